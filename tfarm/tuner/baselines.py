"""Baselines of a time-varying gain: the best constant gain, input shaping, and the linear-quadratic bound.

The *bound* is the finite-horizon linear-quadratic optimum, with the full state and preview of the slew:

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (reference of the moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, for any network, gain or law.

*Input shaping* is on the exact sampled poles of the loop.  The reference is passed through a few impulses whose sum
vanishes at the poles z of the modes that are not to be excited (Singer and Seering, 1990).  On the sample grid a
zero-vibration shaper (ZV) has three impulses: now, n and n + 1 samples later, with n the whole samples of half
a period:

    c_0 + c_n z^-n + c_{n+1} z^-(n+1) = 0,   c_0 + c_n + c_{n+1} = 1

exactly zero for that mode of the linear loop, for any period.  The extra-insensitive one (EI; Singhose, Seering and
Singer, 1994) leaves a share V of the vibration at the mode itself, and is zero at two frequencies next to it,
w (1 +- d) with cos(pi d) = (1 - V)/(1 + V): two ZV shapers in a row.

The tuner is compared with no moment feedback, the best constant gain, input shaping, and the linear-quadratic optimum;
with converters and delay, on the arm of the training and on others.

Feedforward, references, shapers, gains and weights of every controller are those of the arm of the training, for any
moving arm.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.arm.chain import TIME_ROUNDING
from tfarm.arrays import Real
from tfarm.dsp import Chain, Converters, Scenario, Simulation
from tfarm.dsp.scenarios import torque_unit
from tfarm.errors import ConvergenceError
from tfarm.loop.sampled import Sampled
from tfarm.schema import Quantity
from tfarm.spectrum.table import first_frequency
from tfarm.tuner.guard import Guard, MovingGain, constant_windows
from tfarm.tuner.trial import Record, Trial, TunedGain, judged, residual_rms, tip_off

CONSTANT_GAINS = 200  # constant gains of a stability interval that are tried, before the best are refined
LEAST_GAINS = 20  # of them where trials are long
GAIN_SAMPLES = 2_000_000  # that the trials of an interval's gains may have together
BEST_REFINED = 3  # of them
GAIN_XTOL = 1e-9  # tolerance of the refined gains: the cost is flat there
Shaper = Literal["ZV", "EI"]
SHAPERS: tuple[Shaper, ...] = ("ZV", "EI")
SHAPED_MODES = 2  # which a slew excites most
TOLERATED = 0.05  # V: the share of the vibration that EI leaves at the mode itself, that of its authors
NEARLY_PI = 0.999  # of pi rad a sample: the highest frequency of a shaper


class BestConstant(NamedTuple):
    """A constant gain, and the cost of a trial with it."""

    gain: float
    cost: float


def best_constant(trial: Trial) -> BestConstant:
    """Return the best constant gain K >= 0 of a stable loop: a grid, its three lowest costs refined; 0 without one."""
    windows = constant_windows(trial.loop)
    number = min(CONSTANT_GAINS, max(LEAST_GAINS, GAIN_SAMPLES // trial.n))
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, number + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (number + 1)
        for i in np.argsort(costs)[:BEST_REFINED]:
            done = minimize_scalar(
                lambda K: trial.with_constant(float(K)).cost,
                bounds=(max(float(gains[i]) - step, low), min(float(gains[i]) + step, high)),
                method="bounded",
                options={"xatol": GAIN_XTOL},
            )
            found.append(BestConstant(float(done.x), float(done.fun)))
    return min(found, key=lambda each: each.cost)


def lq_bound(trial: Trial) -> Record:
    """Return the optimal trial; its K is zero, as it has no moment feedback, and its u is e."""
    A, B, c = trial.model.A, trial.model.B, trial.model.moment
    r, m = trial.reference.rest, trial.reference.rigid
    a, b = trial.numbers.T * trial.cost.a, trial.numbers.T * trial.cost.b
    P, q = np.zeros_like(A), np.zeros_like(B)
    gains, offsets = np.zeros((trial.n, B.size)), np.zeros(trial.n)
    for k in reversed(range(trial.n)):  # e_k = -gains_k s - offsets_k, the last sample first
        PB = P @ B
        if (weight := b + B @ PB) > 0:
            gains[k], offsets[k] = A.T @ PB / weight, (B @ q + B @ PB * r[k]) / weight
        closed = A - np.outer(B, gains[k])
        q = closed.T @ (q + PB * (r[k] - offsets[k])) + b * offsets[k] * gains[k] - a * m[k] * c
        P = closed.T @ P @ closed + b * np.outer(gains[k], gains[k]) + a * np.outer(c, c)
        P = (P + P.T) / 2
    states, e = np.zeros_like(gains), np.zeros(trial.n)
    for k in range(trial.n):
        e[k] = -gains[k] @ states[k] - offsets[k]
        states[k + 1 : k + 2] = A @ states[k] + B * (e[k] + r[k])
    x = states @ c - m
    cost = float((a * x @ x + b * e @ e) / 2)
    return Record(trial.task.t, x, e, e, np.zeros(trial.n), states @ trial.model.own, cost, None)


def zero_vibration(z: complex) -> Real:
    """Impulses (n + 2,) of the shaper with zeros at z and its conjugate, 0 < arg z < pi."""
    n = max(1, math.floor(math.pi / abs(np.angle(z)) * (1 + TIME_ROUNDING)))
    at = np.array([0, n, n + 1])
    powers = z ** (-at.astype(float))
    shares = np.linalg.solve(np.array([powers.real, powers.imag, np.ones(3)]), [0.0, 0.0, 1.0])
    impulses = np.zeros(n + 2)
    impulses[at] = shares
    return impulses


def extra_insensitive(z: complex) -> Real:
    """Impulses of two such shapers in a row, next to the frequency of z."""
    d = math.acos((1 - TOLERATED) / (1 + TOLERATED)) / math.pi
    turns = (min(float(np.angle(z)) * factor, NEARLY_PI * math.pi) for factor in (1 - d, 1 + d))
    first, second = (zero_vibration(complex(abs(z) * np.exp(1j * turn))) for turn in turns)
    return np.convolve(first, second)


def shaper(loop: Sampled, kind: Shaper, modes: int = SHAPED_MODES) -> Real:
    """Impulses for the first modes below half the sample rate, at the poles of the loop without moment feedback."""
    impulses, build = np.ones(1), zero_vibration if kind == "ZV" else extra_insensitive
    poles: Any = loop.having(MOMENT_GAIN, 0.0).poles
    for mode in range(1, modes + 1):
        own = loop.plant.poles[(loop.plant.mode == mode) & (loop.plant.poles.imag > 0)]
        upper = poles.z[(poles.mode == mode) & (poles.z.imag > 0)]
        if own.size and upper.size and own[0].imag * loop.chain.sampling.period < math.pi:
            impulses = np.convolve(impulses, build(complex(upper[0])))
    return impulses


def shaped(task: Scenario, impulses: Real) -> Scenario:
    """The scenario with every reference passed through the impulses; its slew ends later by their length."""
    names = ("feedforward", "hub_angle", "hub_rate", "rigid_moment")
    through: dict[str, Any] = {name: np.convolve(getattr(task, name), impulses)[: task.t.size] for name in names}
    return replace(task, busy_until=task.busy_until + (impulses.size - 1) * task.period, **through)


def shaped_trial(trial: Trial, kind: Shaper) -> Trial:
    """Return the trial with its slew shaped.

    x is then the moment less the rigid arm's under the shaped slew, which arrives later.  The linear-quadratic bound of
    the unshaped slew is no bound of it.
    """
    return replace(trial, task=shaped(trial.task, shaper(trial.loop, kind)))


ADDED_MASSES = (0.06, 0.15, 0.3)  # of the arm's mass, for one without payload: 0.1, 0.25 and 0.5 kg on the paper's
PAYLOAD_SHARES = (0.5, 1.5, 2.0)  # of the payload, for one that has one
HUB_SHARES = (0.8, 1.2)  # times the hub's inertia
DAMPING_SHARES = (0.1, 10.0)  # times the arm's own C
GIVEN_RATIOS = (3.575e-4, 3.575e-2)  # of critical in mode 1, for an arm without C: 1e-5 and 1e-3 s on the paper's
ENCODER_COUNTS = 8192  # a turn, of the encoder
CONVERTER_BITS = 12  # of the other converters
MOMENT_RANGE = 20.0  # N m, of the paper's arm: times the arm's unit of torque
TORQUE_RANGE = 10.0  # N m, likewise
COMPUTER_DELAY = 1.0  # samples of computation, beyond the chain's own


class Outcome(NamedTuple):
    """`cost` of the trial, inf of an unstable loop, and `residual` root moment after the slew [N m], then None.

    `tip_error` [m] is the distance of the tip from its target at the end; None of an unstable loop, and of the bound.
    """

    cost: Annotated[float, Quantity("cost", help="T sum of (a x^2 + b e^2)/2 over the slew; infinite if unstable")]
    residual: Annotated[
        float | None, Quantity("residual root moment", "N m rms", help="after the slew, less that of a rigid arm")
    ]
    tip_error: Annotated[float | None, Quantity(help="tip error at the end [m]")]

    def as_text(self, digits: int) -> str:
        """The cost."""
        return f"{self.cost:.{digits}g}"


@dataclass(frozen=True)
class Outcomes:
    """Outcomes of all controllers in one condition.

    `best_constant` has the best constant gain of the trained condition; `own_constant` the best one of this condition,
    `own_gain`.  `ZV` and `EI` are compared with their own, later slew, and may pass `bound`, which is that of the
    unshaped one.  `proven`: whether the tuner's guard is certified for this loop too.
    """

    condition: Annotated[str, Quantity("condition", help="arm, converters and delay of the comparison")]
    without: Annotated[Outcome, Quantity("no moment feedback", digits=4, help="servo alone")]
    best_constant: Annotated[
        Outcome, Quantity("constant", digits=4, help="best constant gain of the training condition")
    ]
    own_constant: Annotated[Outcome, Quantity("own constant", digits=4, help="best constant gain of this condition")]
    own_gain: Annotated[float, Quantity(help="best constant moment gain of this condition")]
    ZV: Annotated[Outcome, Quantity("ZV", digits=4, help="zero-vibration input shaper, without moment feedback")]
    EI: Annotated[Outcome, Quantity("EI", digits=4, help="extra-insensitive input shaper, without moment feedback")]
    tuner: Annotated[Outcome, Quantity("tuner", digits=4, help="trained network")]
    bound: Annotated[
        Outcome,
        Quantity("LQ bound", digits=4, help="linear-quadratic optimum with full state and preview: a lower bound"),
    ]
    proven: Annotated[bool, Quantity("guard certified", help="whether the guard of the training is certified here too")]


class NamedLoop(NamedTuple):
    """An arm and a chain under their name."""

    name: str
    arm: Arm
    chain: Chain


def quantised_chain(arm: Arm, chain: Chain) -> Chain:
    """The chain with its own converters; ideal ones are replaced by 12 bits over ranges for the arm's slew."""
    if not chain.is_linear:
        return chain
    unit = torque_unit(arm, chain)
    converters = Converters(
        encoder_counts=ENCODER_COUNTS, hub_rate="difference",
        moment_bits=CONVERTER_BITS, moment_range=MOMENT_RANGE * unit,
        torque_bits=CONVERTER_BITS, torque_range=TORQUE_RANGE * unit,
    )  # fmt: skip
    return replace(chain, converters=converters)


def tried_loops(arm: Arm, chain: Chain, quantised: Chain | None = None) -> list[NamedLoop]:
    """Return the trained condition, that with converters, with delay, and with both; then other arms.

    `quantised` is the chain with converters, by default that of `quantised_chain`.
    """
    quantised = quantised_chain(arm, chain) if quantised is None else quantised
    sampling = replace(chain.sampling, delay_samples=chain.sampling.delay_samples + COMPUTER_DELAY)
    late = f"one {'more ' * bool(chain.sampling.delay_samples)}sample of delay"
    chains = {
        "as trained": chain, "quantised": quantised,
        late: replace(chain, sampling=sampling), f"quantised, {late}": replace(quantised, sampling=sampling),
    }  # fmt: skip
    mass, own = arm.payload_mass, arm.damping
    masses = [share * mass for share in PAYLOAD_SHARES] if mass else [share * arm.own_mass for share in ADDED_MASSES]
    payloads = [float(f"{each:.2g}") for each in masses]
    dampings = [0.0, *(float(f"{share * own:.3g}") for share in DAMPING_SHARES)]
    if not own:
        dampings = [float(f"{2 * zeta / first_frequency(arm):.1g}") for zeta in GIVEN_RATIOS]
    others = {f"payload {each:g} kg": arm.having(payload_mass=each) for each in payloads}
    others |= {f"hub {share - 1:+.0%}": arm.having(hub_inertia=share * arm.hub_inertia) for share in HUB_SHARES}
    others |= {f"C = {C:g} s": arm.having(damping=C) for C in dampings}
    listed = [NamedLoop(name, arm, each) for name, each in chains.items()]
    return listed + [NamedLoop(name, other, chain) for name, other in others.items()]


def compare_controllers(
    trial: Trial,
    gain: TunedGain,
    guard: Guard,
    listed: list[NamedLoop] | None = None,
    nominal: float | None = None,
) -> list[Outcomes]:
    """Return the outcomes in each condition; `trial` is that of the training, `nominal` its best constant gain."""
    nominal = best_constant(trial).gain if nominal is None else nominal
    late = {kind: shaped_trial(trial, kind).task for kind in SHAPERS}
    found = []
    for condition in tried_loops(trial.arm, trial.loop.chain) if listed is None else listed:
        here = trial.on(condition.arm, condition.chain, gain.servo)
        own, bound = best_constant(here), lq_bound(here)
        found.append(
            Outcomes(
                condition=condition.name,
                without=_constant(here, here.task, 0.0),
                best_constant=_constant(here, here.task, nominal),
                own_constant=_constant(here, here.task, own.gain),
                own_gain=own.gain,
                ZV=_constant(here, late["ZV"], 0.0),
                EI=_constant(here, late["EI"], 0.0),
                tuner=_outcome(gain.run(here.simulator()), here),
                bound=Outcome(bound.cost, residual_rms(bound, here.task), None),
                proven=guard.is_proven and _proven(here, guard),
            )
        )
    return found


def _proven(here: Trial, guard: Guard) -> bool:
    """Whether the sector is certified for this loop, with the trial's modes."""
    with suppress(ConvergenceError):
        return not here.arm.is_undamped and MovingGain(here.loop).proof(guard.lo, guard.hi) is not None
    return False


def _constant(trial: Trial, task: Scenario, K: float) -> Outcome:
    """The outcome of a constant gain."""
    return _outcome(trial.simulator(task=task).linear(trial.loop.gains.having(MOMENT_GAIN, K)), trial)


def _outcome(run: Simulation, trial: Trial) -> Outcome:
    """The outcome of a simulation, by the cost of a trial."""
    record = judged(run, trial.cost, trial.signals)
    return Outcome(record.cost, residual_rms(record, run.scenario), tip_off(run, trial))
