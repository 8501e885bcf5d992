"""The exact system that an arm is: one uniform link in closed form, or a chain of elements.  Above, no more is known.

Both have `damping`, `is_undamped`, `is_real_on_axis`, `is_locked`, `at_rest`, `singular`, `transit`, `length`, `EI`,
`input_unit` and `with_damping`, and the functions of this room take either.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory

from .chain import ElementChain
from .chaining import chain_of
from .coefficients import Coefficients, coefficients
from .outputs import Output

System = Coefficients | ElementChain


def system_of(arm: Arm, theory: Theory | None = None, wanted: Sequence[Output] = ()) -> System:
    """The system of an arm under its own theory, or another, for certain outputs.

    Raises ParameterError for an unknown theory.
    """
    theory = theory or arm.theory
    is_simple = arm.is_uniform and not any(each.is_of_a_chain for each in wanted)
    return coefficients(arm, theory) if is_simple else chain_of(arm, theory)


def shear_flexibility(k: System, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """E I/(kappa G A L^2) at the shares x (1-D) of the length, with E I and L of the whole: W' = Psi + that Q."""
    if isinstance(k, Coefficients):
        return np.full(x.shape, float(k.sigma))
    inner = list(reversed(k.segments))
    edges = np.cumsum([float(each.length) for each in inner])[:-1]
    own = np.array([float(each.sigma * each.length**2 / each.stiffness) for each in inner])
    return np.asarray(own[np.searchsorted(edges, x, side="right")])
