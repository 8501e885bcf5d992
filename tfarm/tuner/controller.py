"""The trained network as a controller: a gain schedule of `tfarm.dsp.Simulator`, with converters, delay, on any arm.

Its file is JSON: strict, finite, of shapes that fit; never pickle.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError

from tfarm.arm import FED_BACK, HubFeedback
from tfarm.arm.schema import StrictTable
from tfarm.dsp import Measurement, Simulation, Simulator
from tfarm.dsp.chain import Reading
from tfarm.errors import MISSING, ParameterError, TfarmError
from tfarm.files import read_file, write_file
from tfarm.records import record
from tfarm.tuner.guard import GuardKind
from tfarm.tuner.kernel import MOST_HIDDEN, Limits, Network
from tfarm.tuner.trial import Cost, Record, Trial

FORMAT = "tfarm tuner 1"
MOST_TUNER_BYTES = 4_000_000  # bytes of a tuner's file: more than a network of MOST_HIDDEN neurons takes
Finite = Annotated[float, Field(allow_inf_nan=False)]


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


@dataclass(frozen=True)
@record
class SavedTuner:
    """What a tuner needs to run: network, guard, K1, Kp and the reading of the signals; and where it was trained.

    `cost` counts moments and torques in the unit by which the network divides them, the first of its scales [N m].
    """

    network: Network
    guard_kind: GuardKind
    lo: float
    hi: float
    K1: float
    signals: Reading
    cost: Cost
    arm: str
    period: float
    Kp: float = 0.0

    def gain(self) -> TunedGain:
        """The controller."""
        servo = HubFeedback(K1=self.K1, Kp=self.Kp)
        return TunedGain(self.network, Limits(self.lo, self.hi), servo, self.signals)


class TunerFile(StrictTable):
    """The file."""

    format: Literal["tfarm tuner 1"]
    arm: Annotated[str, Field(max_length=80)]
    period: Annotated[Finite, Field(gt=0)]
    K1: Finite
    Kp: Annotated[Finite, Field(ge=0)] = 0.0  # absent in files of tuners without a servo
    signals: Reading
    a: Annotated[Finite, Field(ge=0)]
    b: Annotated[Finite, Field(ge=0)]
    guard_kind: GuardKind
    guard: Annotated[list[Annotated[Finite, Field(ge=0)]], Field(min_length=2, max_length=2)] | None
    scales: Annotated[list[Finite], Field(min_length=6, max_length=7)]
    W1: Annotated[
        list[Annotated[list[Finite], Field(min_length=6, max_length=7)]], Field(min_length=1, max_length=MOST_HIDDEN)
    ]
    w2: Annotated[list[Finite], Field(min_length=1, max_length=MOST_HIDDEN)]

    def build(self) -> SavedTuner:
        """The tuner; ParameterError where its parts do not fit together."""
        if (self.guard is None) != (self.guard_kind == "none"):
            raise ParameterError(key="guard", value=self.guard, remedy="two ends, or null with guard_kind none")
        lo, hi = (0.0, math.inf) if self.guard is None else self.guard
        if not lo < hi:
            raise ParameterError(key="guard", value=self.guard, remedy="its lower end comes first")
        widths = {len(row) for row in self.W1}
        if widths != {len(self.scales)}:
            raise ParameterError(
                key="W1", value=sorted(widths), remedy=f"rows of {len(self.scales)}, one weight an input"
            )
        network = Network(np.array(self.W1), np.array(self.w2), np.array(self.scales))
        cost = Cost(a=self.a, b=self.b)
        return SavedTuner(network, self.guard_kind, lo, hi, self.K1, self.signals, cost, self.arm, self.period, self.Kp)


def to_text(tuner: SavedTuner) -> str:
    """The file's text; equal tuners give equal text, and it loads to the same bits."""
    content = {
        "format": FORMAT,
        "arm": tuner.arm,
        "period": tuner.period,
        "K1": tuner.K1,
        **({"Kp": tuner.Kp} if tuner.Kp else {}),
        "signals": tuner.signals,
        "a": tuner.cost.a,
        "b": tuner.cost.b,
        "guard_kind": tuner.guard_kind,
        "guard": None if tuner.guard_kind == "none" else [tuner.lo, tuner.hi],
        **weights_answer(tuner.network),
    }
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def weights_answer(network: Network) -> dict[str, list[float] | list[list[float]]]:
    """scales, W1 and w2 as lists."""
    return {name: getattr(network, name).tolist() for name in ("scales", "W1", "w2")}


def save_tuner(tuner: SavedTuner, path: Path) -> None:
    """Write it beside, then rename."""
    write_file(path, to_text(tuner).encode(), key="--save")


def load_tuner(path: str | os.PathLike[str]) -> SavedTuner:
    """The tuner of a file.  Raises ParameterError, in one line, for whatever is wrong with it."""
    text = read_file(path, MOST_TUNER_BYTES, key="controller", what="a tuner's file")
    try:
        return TunerFile.model_validate_json(text).build()
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = ".".join(map(str, problem["loc"])) or "file"
        special = {"json_invalid": os.fspath(path), "missing": MISSING}
        what = special.get(problem["type"], problem["input"])
        message = f"{problem['msg'][:1].lower()}{problem['msg'][1:]}"
        remedy = f"{message}; save it again with tfarm tune ARM --save FILE.json"
        raise ParameterError(key=key, value=what, remedy=remedy, file=path) from None
    except TfarmError as error:
        raise error.in_file(path) if isinstance(error, ParameterError) else error from None
