"""Natural frequencies, mode shapes and damped modes, complete by counts.

table          Modes: frequencies, shapes, nodes and sensitivities of the undamped arm
frequencies    natural frequencies from the count of Wittrick and Williams
shapes         mode shapes of unit modal mass
sensitivities  exact sensitivities of the frequencies to each parameter
damped         DampedModes: every eigenvalue in a box, with its mode
naming         the mode of each eigenvalue, followed as the damping grows
following      roots of a family of functions, followed as a number varies
box            all zeros of an analytic function in a box
proofs         proofs in ball arithmetic: brackets, discs and counts
gains          natural units of gains, their limits, and default gains
listing        ModeList: the list of modes of commands and pages
"""

from tfarm.spectrum.damped import DampedModes, damped_modes
from tfarm.spectrum.sensitivities import PARAMETERS
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
