"""Natural frequencies and mode shapes: counted, so that none is missing, then found to the last digit."""

from tfarm.spectrum.modes import PARAMETERS, Modes, modes, modes_below

__all__ = ["PARAMETERS", "Modes", "modes", "modes_below"]
