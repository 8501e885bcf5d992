"""The sampled loop of any linear law in time, exact between the samples.

A signal among the law's references enters as signal - reference: those of the hub's angle and rate are the slew's, that
of the root moment is the rigid arm's.  A column "reference:hub_angle" takes the reference alone.  The encoder's counts
and the strain amplifier's range act on hub angle and root moment; other signals are read as they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.law import REFERENCE, Law
from tfarm.arrays import Real
from tfarm.dsp import kernel
from tfarm.dsp.chain import Chain
from tfarm.dsp.law_loop import acting_law
from tfarm.dsp.law_plant import sensed_plant
from tfarm.dsp.plant import USUAL_MODES, Plant
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.errors import must_be_known

SIGNAL_KINDS = {"hub_angle": 1, "root_moment": 2, "hub_rate": 3}  # through what one goes, as in `kernel.run_law`


class LawSimulator(Simulator):
    """An arm with `count` modes under a law, a chain and a scenario, prepared once.

    Raises ParameterError as `acting_law` does, for an unknown signal, and for one whose reference no scenario has.
    """

    def __init__(
        self,
        arm: Arm,
        law: Law,
        chain: Chain,
        scenario: Scenario,
        *,
        count: int = USUAL_MODES,
        between: int = 0,
        outputs: Sequence[str] = (),
    ) -> None:
        self.law, late = acting_law(arm, law, chain)
        self._references = references_of(self.law, scenario)
        super().__init__(arm, late, scenario, count=count, between=between, outputs=outputs)

    def plant_of(self, arm: Arm, count: int) -> Plant:
        """What gains at the hub measure, what is recorded, and then the signals of the law through their filters."""
        read = sensed_plant(arm, self.chain, self.law.signals, count).together
        return super().plant_of(arm, count).beside(read)

    def run(self) -> Simulation:
        """The law from rest over the scenario."""
        state, law = self._start(), self.law
        matrices = tuple(np.ascontiguousarray(each) for each in law.matrices((*law.signals, *law.wanted)))
        kinds = np.array([SIGNAL_KINDS.get(name, 0) for name in law.signals])
        if self._electronics.is_single:
            matrices = tuple(each.astype(np.float32).astype(float) for each in matrices)
        done = kernel.run_law(self._model, state, self._forcing, self._electronics, matrices, kinds, self._references)
        return self._result(state, int(done), None)


def references_of(law: Law, task: Scenario) -> Real:
    """What is taken off each column of the law at each sample (n, columns): of a column of references, minus it.

    Raises ParameterError for a signal whose reference a scenario does not have.
    """
    known = task.references
    found = np.zeros((task.feedforward.size, len(law.signals) + len(law.wanted)))
    for column, name in enumerate((*law.signals, *law.wanted)):
        plain = name.removeprefix(REFERENCE)
        if name == plain and name not in law.references:
            continue
        must_be_known("references", plain, known)
        found[:, column] = known[plain] if name == plain else -known[plain]
    return found
