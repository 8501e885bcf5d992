"""Natural frequencies and mode shapes: counted, so that none is missing, then found to the last digit."""

from tfarm.spectrum.table import PARAMETERS, Modes, compare_theories, modes, modes_below

__all__ = ["PARAMETERS", "Modes", "compare_theories", "modes", "modes_below"]
