"""The exact system that an arm is: one uniform link in closed form, or a chain of elements; above, nothing else is known.

Both have `damping`, `is_undamped`, `is_locked`, `at_rest`, `singular`, `length`, `EI`, `input_unit` and `with_damping`, and the
functions of this room take either.
"""

from __future__ import annotations

from tfarm.arm import Arm, Theory

from .chain import Chain, chain_of
from .coefficients import Coefficients, coefficients

System = Coefficients | Chain


def system_of(arm: Arm, theory: Theory | None = None) -> System:
    """The system of an arm under its own theory, or another.  Raises ParameterError for an unknown theory."""
    theory = theory or arm.theory
    return coefficients(arm, theory) if arm.is_uniform else chain_of(arm, theory)
