"""One call for both: gains K1 and K2, and laws of any other structure."""

from __future__ import annotations

from typing import cast

from tfarm.arm import Arm
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.synthesis.design import Design, Objective
from tfarm.synthesis.design import design as best_gains
from tfarm.synthesis.law_design import LawDesign, Progress, law_design
from tfarm.synthesis.search import Bounds

GAINS = "K1-K2"


def design(
    arm: Arm, objective: str = "damping", *, structure: str = GAINS, K1: Bounds | None = None,
    K2: Bounds | None = None, Kp: float = 0.0, modes: int = 2, chain: Chain | None = None, continuous: bool = False,
    progress: Progress | None = None,
) -> Design | LawDesign:  # fmt: skip
    """The law of a structure that serves an objective best in the sampled loop of a chain (10 ms unless given).

    "K1-K2": gains of rate and moment within bounds, "damping", "margin" or "residual", of the sampled loop or the
    `continuous` one (see `design.design`).  "PD", "PD+notch", "lead", "PPF" of the first `modes` modes and
    "strain-rate": a `tfarm.Law`, "damping", "margin", "sensitivity" or "delay" (see `structures`); `Kp` is chosen where
    it is 0, and `progress` is told how the search goes on.  What is recommended holds when sampled, with all gains a
    quarter larger or smaller, and without a clock.
    Raises ParameterError for what does not go together, ConvergenceError where nothing found holds.
    """
    if structure == GAINS:
        return best_gains(
            arm, cast("Objective", objective), K1=K1, K2=K2, Kp=Kp, modes=modes, chain=chain, continuous=continuous
        )
    for name, given in (("K1", K1), ("K2", K2), ("continuous", continuous or None)):
        if given is not None:
            remedy = f"goes with the structure {GAINS} alone"
            raise ParameterError(key=name, value=given, remedy=remedy)
    return law_design(arm, objective, structure, Kp=Kp, modes=modes, chain=chain, progress=progress)
