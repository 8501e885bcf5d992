"""A simulated loop: its signals at the samples and between them, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.dsp.chain import Chain
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.scenarios import Scenario
from tfarm.errors import must_be_known
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import record


@dataclass(frozen=True)
@record
class Trace:
    """Signals, not filtered, at `t` [s]: hub angle [rad], hub rate [rad/s], root moment [N m], tip displacement [m].

    `others` are those asked for besides, by name and in SI units.
    """

    t: Real
    hub_angle: Real
    hub_rate: Real
    root_moment: Real
    tip_displacement: Real
    others: dict[str, Real] = field(default_factory=dict)

    def signal(self, name: str) -> Real:
        """One of the signals by its name.  Raises ParameterError for one that was not asked for."""
        must_be_known("output", name, self.names)
        return self.others[name] if name in self.others else cast("Real", getattr(self, name))

    @property
    def units(self) -> dict[str, str]:
        """The SI units of what was asked for besides."""
        return {name: OUTPUTS[name.partition("@")[0]].unit for name in self.others}

    @property
    def names(self) -> tuple[str, ...]:
        """The signals that it has."""
        return (*RECORDED, *self.others)


@dataclass(frozen=True)
class Stop:
    """Why a simulation ended early: at `time` [s] the arm was folded up, by `mode` above all (0: the hub)."""

    time: float
    mode: int


@dataclass(frozen=True)
@record
class Simulation:
    """A simulated loop: `at_samples` just before each update, `between` the records asked for between the samples.

    `torque` [N m] is what leaves the DAC at each sample, `gain` that on the root moment there (None where a controller
    does not say), `measured` (n, 3) what the analog filters pass of hub angle, hub rate and root moment.
    `saturated_at` (n, 3) says at which samples the encoder, the strain amplifier and the torque were clipped.
    `energy_error` is |energy gained - work done| over the energy that went to and fro, for an arm without damping; None
    with damping.
    """

    scenario: Scenario
    chain: Chain
    at_samples: Trace
    between: Trace | None
    measured: Real
    torque: Real
    gain: Real | None
    saturated_at: NDArray[np.bool_]
    energy_error: float | None
    stopped: Stop | None

    @property
    def finding(self) -> str:
        """How far it ran, the largest root moment on the way, and what was clipped, in words."""
        end, moment = float(self.t.max(initial=0.0)), float(abs(self.at_samples.root_moment).max(initial=0.0))
        clipped = [f"{name} clipped at {n} samples" for name, n in self.saturated.items() if n]
        ran = f"ran to {end:.6g} s" if self.stopped is None else f"ran away, stopped at {self.stopped.time:.6g} s"
        return ", ".join([ran, f"root moment up to {moment:.4g} N m", *clipped])

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return self.at_samples.t

    @property
    def saturated(self) -> dict[str, int]:
        """At how many samples encoder, strain amplifier and torque were clipped."""
        counts = self.saturated_at.sum(axis=0)
        return {name: int(n) for name, n in zip(("encoder", "moment", "torque"), counts, strict=True)}

    @property
    def volts(self) -> Real | None:
        """The motor's voltage, where the actuator has a motor constant."""
        constant = self.chain.actuator.motor_constant
        return None if constant is None else self.torque / constant
