"""The trained network as a gain schedule of `tfarm.dsp.Simulator`: with converters, delay, on any arm."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tfarm.arm import FED_BACK, HubFeedback
from tfarm.dsp import Measurement, Simulation, Simulator
from tfarm.dsp.chain import Reading
from tfarm.tuner.kernel import Limits
from tfarm.tuner.network import Network
from tfarm.tuner.trial import Cost, Record, Trial


@dataclass
class TunedGain:
    """K for each measurement; it remembers u, e, x and K of the two samples before, and forgets them at sample 0.

    `servo` is the law beside the moment.
    """

    network: Network
    guard: Limits
    servo: HubFeedback
    signals: Reading
    _past: list[tuple[float, float, float, float]] = field(default_factory=list, init=False)

    def run(self, simulator: Simulator) -> Simulation:
        """The loop of a simulator under the servo and this gain."""
        return simulator.gain_schedule(self.servo.K1, self, Kp=self.servo.Kp)

    def __call__(self, m: Measurement) -> float:
        """The gain at this sample."""
        if m.k == 0:
            self._past = [(0.0, 0.0, 0.0, 0.0)] * 2
        (u1, e1, x1, K_before), (_, e2, _, _) = self._past
        u = m.servo(self.servo) + (m.feedforward if self.signals == "total" else 0.0)
        row = [u, u1, e1, e2, m.vibration, x1, K_before][: self.network.scales.size]
        K = self.network.gain(np.array(row), self.guard)
        self._past = [(u, u - K * m.vibration, m.vibration, K), self._past[0]]
        return K


def judged(simulation: Simulation, cost: Cost, signals: Reading) -> Record:
    """A simulation as a record: x before the converters, as a trial has it, e from the torque after them.

    So x has passed the anti-alias filter where there is one, but none of the ADC's steps.
    """
    task, done = simulation.scenario, simulation.torque.size
    rest = 0.0 if signals == "total" else task.feedforward[:done]
    x = simulation.measured[:, FED_BACK.index("root_moment")] - task.moment_reference[:done]
    e = simulation.torque - rest
    K = np.zeros(done) if simulation.gain is None else simulation.gain
    stopped = done if simulation.stopped is not None else None
    total = np.inf if stopped is not None else float(task.period * np.sum(cost.a * x**2 + cost.b * e**2) / 2)
    return Record(simulation.t, x, e + K * x, e, K, simulation.at_samples.root_moment, total, stopped)


def simulated(simulator: Simulator, gain: TunedGain, cost: Cost) -> Record:
    """The trained network in a simulator whose chain has the same reading of the signals."""
    return judged(gain.run(simulator), cost, gain.signals)


def tip_off(simulation: Simulation, trial: Trial) -> float | None:
    """How far the tip is off its target [m] when a simulation of a slew ends; None where the loop ran away."""
    if simulation.stopped is not None:
        return None
    chain, arm = trial.loop.chain, trial.arm
    return float(simulation.at_samples.tip_displacement[-1] - chain.slew.travel_of(arm.reach))
