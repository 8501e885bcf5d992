"""Natural frequencies, mode shapes and damped modes, complete by counts."""

from tfarm.spectrum.damped import DampedModes, damped_modes
from tfarm.spectrum.shapes import PARAMETERS
from tfarm.spectrum.table import Modes, compare_theories, flexible_frequencies, modes, modes_below

__all__ = [
    "PARAMETERS",
    "DampedModes",
    "Modes",
    "compare_theories",
    "damped_modes",
    "flexible_frequencies",
    "modes",
    "modes_below",
]
