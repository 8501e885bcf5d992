"""The record of a simulated loop: signals at the samples and between them, and their figures."""

from dataclasses import dataclass, field, replace
from typing import Annotated, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm.chain import TIME_ROUNDING, Chain
from tfarm.arrays import Real
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.scenarios import Scenario
from tfarm.errors import must_be_known
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import frozen
from tfarm.schema import Quantity

RESIDUAL = "residual root moment after the slew"


# of the travel, within which a signal has settled: as in python-control and MATLAB
SETTLING_BAND = 0.02


# a tenth of a record has to follow a settling time
LEFT_OF_RECORD = 10


def final_value(t: Real, y: Real) -> float:
    """Return the mean of a signal (n,) over the last tenth of its record."""
    return float(y[LEFT_OF_RECORD * t >= (LEFT_OF_RECORD - 1) * t[-1]].mean())


def settling_time(
    t: Real, away: Real, scale: float = 0.0, moves_until: float = 0.0, band: float = SETTLING_BAND
) -> float | None:
    """Return the time [s] after the motion from which deviations (n,) from the final value stay within a band.

    The band is a share of a scale, of the largest deviation where that is 0.  None where the deviation leaves it in the
    last tenth of the record.
    """
    scale = scale or float(away.max(initial=0.0))
    first = 1 + int(np.flatnonzero(away > band * scale).max(initial=-1))
    if first > 0 and (first >= t.size or LEFT_OF_RECORD * (t[-1] - t[first]) < t[-1] * (1 - TIME_ROUNDING)):
        return None
    return max(0.0, float(t[first]) - moves_until)


@frozen
class Trace:
    """Signals, not filtered, at `t` [s]: hub angle [rad], hub rate [rad/s], root moment [N m], tip displacement [m].

    `others` are further outputs, by name and in SI units.
    """

    t: Real
    hub_angle: Real
    hub_rate: Real
    root_moment: Real
    tip_displacement: Real
    others: dict[str, Real] = field(default_factory=dict)

    def signal(self, name: str) -> Real:
        """Return a signal by its name.  Raises ParameterError for one that was not recorded."""
        must_be_known("output", name, self.names)
        if name in self.others:
            return self.others[name]
        return cast("Real", getattr(self, name))

    @property
    def by_name(self) -> dict[str, Real]:
        """Time and signals by name."""
        return {"t": self.t} | {name: self.signal(name) for name in self.names}

    @property
    def units(
        self,
    ) -> Annotated[dict[str, str], Quantity(key="outputs", help="SI unit of each further output")]:
        """The SI units of the further outputs."""
        return {name: OUTPUTS[name.partition("@")[0]].unit for name in self.others}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all signals."""
        return (*RECORDED, *self.others)


@dataclass(frozen=True)
class Stop:
    """Early end of a simulation: at `time` [s] the root moment passed its bound, mostly by `mode` (0: the hub)."""

    time: float
    mode: int


@frozen
class Simulation:
    """A simulated loop: `at_samples` just before each update, `between` the records between the samples, if any.

    `torque` [N m] is the output of the DAC at each sample, `gain` that on the root moment there (None of a controller
    without one), `measured` (n, 3) hub angle, hub rate and root moment behind the analog filters.  `saturated_at`
    (n, 3): whether the encoder, the strain amplifier and the torque were clipped at each sample.  `rings` are frequency
    (m,) [rad/s] and largest amplitude in `RECORDED` (4, m) of the modes that ring, with Im p > -Re p.
    `energy_error` is |energy gained - work done| over initial energy and total work, for an arm without damping; None
    with damping.  Moments of the figures are those before the anti-alias filter.
    """

    scenario: Annotated[Scenario, Quantity(flat=True, help="scenario of the run")]
    chain: Chain
    at_samples: Annotated[Trace, Quantity(flat=True, help="signals at the samples")]
    between: Trace | None
    measured: Real
    torque: Real
    gain: Real | None
    saturated_at: NDArray[np.bool_]
    rings: tuple[Real, Real]
    energy_error: Annotated[
        float | None,
        Quantity(help="energy gained less work done, over initial energy and work, without damping"),
    ]
    stopped: Stop | None

    @property
    def residual_moment(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            f"{RESIDUAL} less the rigid arm's",
            "N m rms",
            key="residual_moment_rms",
            help="rms of the vibration from the end of the slew to the end of the record",
        ),
    ]:
        """The residual; None where the run stopped, or its record ends before the slew."""
        return self.scenario.residual_rms(self.at_samples.root_moment)

    @property
    def residual_raw(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            RESIDUAL,
            "N m rms",
            key="residual_raw_moment_rms",
            help="rms of the root moment from the end of the slew to the end of the record",
        ),
    ]:
        """The same of the root moment itself; its first sample is one of the slew's last torque."""
        rigid = replace(self.scenario, rigid_moment=0 * self.scenario.rigid_moment)
        return rigid.residual_rms(self.at_samples.root_moment)

    @property
    def settling_time(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "settling time (2 %)",
            "s",
            4,
            help="time from the end of the motion after which the root moment stays within 2 % of its largest "
            "deviation from its final value",
        ),
    ]:
        """None where the simulation stopped, or less than a tenth of the record is left to show it."""
        moment = self.at_samples.root_moment
        if self.stopped or not moment.size:
            return None
        return settling_time(
            self.t, abs(moment - final_value(self.t, moment)), moves_until=self.scenario.busy_until
        )

    @property
    def saturated(
        self,
    ) -> Annotated[
        dict[str, int],
        Quantity(
            "saturated samples",
            key="saturated_samples",
            help="samples at which encoder, strain amplifier and torque were clipped",
        ),
    ]:
        """Numbers of samples at which encoder, strain amplifier and torque were clipped."""
        return dict(zip(("encoder", "moment", "torque"), self.saturated_at.sum(axis=0).tolist(), strict=True))

    @property
    def finding(self) -> str:
        """End of the run, largest root moment, and clipped signals."""
        end = float(self.t.max(initial=0.0))
        moment = float(abs(self.at_samples.root_moment).max(initial=0.0))
        clipped = [f"{name} clipped at {n} samples" for name, n in self.saturated.items() if n]
        if self.stopped is None:
            ran = f"ran to {end:.6g} s"
        else:
            ran = f"unstable, stopped at {self.stopped.time:.6g} s"
        return ", ".join([ran, f"root moment up to {moment:.4g} N m", *clipped])

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return self.at_samples.t

    @property
    def volts(self) -> Real | None:
        """The motor's voltage, where the actuator has a motor constant."""
        constant = self.chain.actuator.motor_constant
        return None if constant is None else self.torque / constant
