"""One call for all: gains K1 and K2 and laws of any other structure, for one arm or for the worst of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

from tfarm.arm import TWO_GAINS, Arm
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.synthesis import law_design as laws
from tfarm.synthesis.design import Design, Objective, best_gains, gains_score_on
from tfarm.synthesis.law_design import LawDesign, law_design
from tfarm.synthesis.search import Bounds
from tfarm.synthesis.worst_case import ArmBox, NamedArm, Tell, arms_of, for_the_worst, same_input


def design(
    arm: Arm, objective: str = "damping", *, structure: str = TWO_GAINS, K1: Bounds | None = None,
    K2: Bounds | None = None, Kp: float = 0.0, modes: int = 2, chain: Chain | None = None, continuous: bool = False,
    progress: Tell | None = None, also: Sequence[Arm] = (), ranges: Mapping[str, Bounds] | None = None,
) -> Design | LawDesign:  # fmt: skip
    """The law of a structure that serves an objective best in the sampled loop of a chain (10 ms unless given).

    "K1-K2": gains of rate and moment within bounds, "damping", "margin", "residual" or "cost", of the sampled loop or
    the `continuous` one (see `best_gains`).  "PD", "PD+notch", "lead", "PPF" of the first `modes` modes and
    "strain-rate": a `tfarm.Law`, "damping", "margin", "sensitivity", "delay", "residual" or "cost" (see `law_judge`);
    `Kp` is chosen where it is 0, and `progress` is told how the search goes on.  What is recommended holds when
    sampled, with all gains a quarter larger or smaller, and without a clock.

    `also` are further arms that the law has to serve, `ranges` the ends of numbers of the arm, such as
    {"payload.mass": (0.1, 0.5)}: the objective is then the worst of the arm, of those, of the corners of the box, and
    of arms inside it that a search finds to be worse, which is no proof over the box.  The law holds on each arm that
    is named in `.arms`.  Raises ParameterError for what does not go together, ConvergenceError where nothing found
    holds.
    """
    ends = {key: (float(low), float(high)) for key, (low, high) in (ranges or {}).items()}
    box = ArmBox(arm, ends) if ends else None
    arms, tell = arms_of(arm, also, box), progress or (lambda text: None)
    same_input(arms)
    if structure == TWO_GAINS:

        def find(named: Sequence[NamedArm]) -> Design:
            return best_gains(
                arm, cast("Objective", objective), K1=K1, K2=K2, Kp=Kp, modes=modes, chain=chain,
                continuous=continuous, others=named[1:],
            )  # fmt: skip

        gains, case = for_the_worst(arms, box, find, gains_score_on, tell)
        return replace(gains, worst_case=case)
    for name, given in (("K1", K1), ("K2", K2), ("continuous", continuous or None)):
        if given is not None:
            remedy = f"goes with the structure {TWO_GAINS} alone"
            raise ParameterError(key=name, value=given, remedy=remedy)

    def find_law(named: Sequence[NamedArm]) -> LawDesign:
        return law_design(
            arm, objective, structure, on_angle=Kp, modes=modes, chain=chain, progress=progress, others=named[1:]
        )

    found, case = for_the_worst(arms, box, find_law, laws.law_score_on, tell)
    return replace(found, worst_case=case)
