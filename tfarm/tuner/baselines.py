"""Baselines of a time-varying gain: the best constant gain, input shaping, and the linear-quadratic bound.

The *bound* is the finite-horizon linear-quadratic optimum, with the full state and preview of the slew:

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (reference of the moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, for any network, gain or law.

*Input shaping* is that of `tfarm.dsp.shaping`, ZV and EI, at the exact sampled poles of the loop without moment
feedback.

The tuner is compared with no moment feedback, the best constant gain, input shaping, and the linear-quadratic optimum;
with converters and delay, on the arm of the training and on others.

Feedforward, references, shapers, gains and weights of every controller are those of the arm of the training, for any
moving arm.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Simulation
from tfarm.dsp.scenarios import slew_scenario, torque_unit
from tfarm.dsp.shaping import impulses_at, loop_modes
from tfarm.errors import ConvergenceError
from tfarm.loop.sampled import Sampled
from tfarm.schema import Quantity
from tfarm.spectrum.table import first_frequency
from tfarm.tuner.guard import Guard, MovingGain, constant_windows
from tfarm.tuner.trial import Record, Trial, TunedGain, record_of_simulation, residual_rms, tip_off

Shaper = Literal["ZV", "EI"]
SHAPERS: tuple[Shaper, ...] = ("ZV", "EI")


class BestConstant(NamedTuple):
    """A constant gain, and the cost of a trial with it."""

    gain: float
    cost: float


def best_constant(trial: Trial) -> BestConstant:
    """Return the best constant gain K >= 0 of a stable loop: a grid, its three lowest costs refined; 0 without one."""

    def cost(K: float) -> float:
        return trial.with_constant(float(K)).cost

    windows = constant_windows(trial.loop)
    # fewer gains of an interval where trials are long: 2 million samples together
    number = min(200, max(20, 2_000_000 // trial.n))
    found = [BestConstant(0.0, cost(0.0))] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, number + 2).tolist()
        for i in np.argsort([cost(K) for K in gains[1:-1]])[:3]:
            # the cost is flat at its minimum
            done = minimize_scalar(
                cost, bounds=(gains[i], gains[i + 2]), method="bounded", options={"xatol": 1e-9}
            )
            found.append(BestConstant(float(done.x), float(done.fun)))
    return min(found, key=lambda each: each.cost)


def lq_bound(trial: Trial) -> Record:
    """Return the optimal trial; its K is zero, as it has no moment feedback, and its u is e."""
    model = trial.model
    n = trial.n
    m = trial.reference.rigid
    rest = trial.reference.rest
    numbers = trial.numbers
    a = numbers.T * numbers.a
    b = numbers.T * numbers.b
    # of the states and 1: the last column of A is B r, the last entry of c is -m
    A = np.pad(model.A, (0, 1))
    B = np.r_[model.B, 0.0]
    c = np.r_[model.moment, 0.0]
    A[-1, -1] = 1.0
    P = np.zeros_like(A)
    gains = np.zeros((n, B.size))
    # e_k = -gains_k s, the last sample first
    for k in reversed(range(n)):
        A[:-1, -1] = model.B * rest[k]
        c[-1] = -m[k]
        PB = P @ B
        gain = gains[k]
        weight = b + B @ PB
        if weight > 0:
            gain[:] = A.T @ PB / weight
        closed = A - np.outer(B, gain)
        P = closed.T @ P @ closed + b * np.outer(gain, gain) + a * np.outer(c, c)
        P = (P + P.T) / 2
    states = np.zeros((n + 1, B.size - 1))
    e = np.zeros(n)
    for k, gain in enumerate(gains):
        e[k] = -gain[:-1] @ states[k] - gain[-1]
        states[k + 1] = model.A @ states[k] + model.B * (e[k] + rest[k])
    at_samples = states[:-1]
    x = at_samples @ model.moment - m
    cost = float((a * x @ x + b * e @ e) / 2)
    return Record(trial.task.t, x, e, e, np.zeros(n), at_samples @ model.own, cost, None)


def shaper(loop: Sampled, kind: Shaper, modes: int = 2) -> Real:
    """Return the impulses for the first modes below half the sample rate, at poles without moment feedback.

    By default for those two that a slew excites most.
    """
    servo = Case(loop.arm, loop.gains.with_number(MOMENT_GAIN, 0.0), loop.chain)
    return impulses_at(loop_modes(servo, loop.plant.count), kind, modes)


def shaped_trial(trial: Trial, kind: Shaper) -> Trial:
    """Return the trial with its slew shaped.

    x is then the moment less the rigid arm's under the shaped slew, which arrives later.  The linear-quadratic bound of
    the unshaped slew is no bound of it.  The shaper of a chain is replaced.
    """
    task = trial.task
    if trial.loop.chain.reference.shaper != "none":
        task = slew_scenario(trial.arm, trial.loop.chain, float(task.t[-1]))
    return replace(trial, task=task.through(shaper(trial.loop, kind)))


class Outcome(NamedTuple):
    """`cost` of the trial, inf of an unstable loop, and `residual` root moment after the slew [N m], then None.

    `tip_error` [m] is the distance of the tip from its target at the end; None of an unstable loop, and of the bound.
    """

    cost: Annotated[
        float, Quantity("cost", help="T sum of (a x^2 + b e^2)/2 over the slew; infinite if unstable")
    ]
    residual: Annotated[
        float | None,
        Quantity("residual root moment", "N m rms", help="after the slew, less that of a rigid arm"),
    ]
    tip_error: Annotated[float | None, Quantity(help="tip error at the end [m]")]

    def as_text(self, digits: int) -> str:
        """Return the cost."""
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
    own_constant: Annotated[
        Outcome, Quantity("own constant", digits=4, help="best constant gain of this condition")
    ]
    own_gain: Annotated[float, Quantity(help="best constant moment gain of this condition")]
    ZV: Annotated[
        Outcome, Quantity("ZV", digits=4, help="zero-vibration input shaper, without moment feedback")
    ]
    EI: Annotated[
        Outcome, Quantity("EI", digits=4, help="extra-insensitive input shaper, without moment feedback")
    ]
    tuner: Annotated[Outcome, Quantity("tuner", digits=4, help="trained network")]
    bound: Annotated[
        Outcome,
        Quantity(
            "LQ bound", digits=4, help="linear-quadratic optimum with full state and preview: a lower bound"
        ),
    ]
    proven: Annotated[
        bool, Quantity("guard certified", help="whether the guard of the training is certified here too")
    ]


class NamedLoop(NamedTuple):
    """A case under its name."""

    name: str
    case: Case


def quantised_chain(arm: Arm, chain: Chain) -> Chain:
    """Return the chain with its own converters; ideal ones are replaced by 12 bits over ranges for the arm's slew.

    These are 20 N m of moment and 10 N m of torque on the paper's arm, in the unit of torque of any other.
    """
    if not chain.is_linear:
        return chain
    unit = torque_unit(arm, chain)
    converters = Converters(
        encoder_counts=8192,
        hub_rate="difference",
        moment_bits=12,
        moment_range=20.0 * unit,
        torque_bits=12,
        torque_range=10.0 * unit,
    )
    return replace(chain, converters=converters)


def tried_loops(case: Case, quantised: Chain | None = None) -> list[NamedLoop]:
    """Return the trained condition, that with converters, with delay, and with both; then other arms.

    `quantised` is the chain with converters, by default that of `quantised_chain`.
    """
    arm = case.arm
    coarse = case.through(quantised or quantised_chain(arm, case.chain))
    delay = case.chain.sampling.delay_samples
    sampling = replace(case.chain.sampling, delay_samples=delay + 1)
    late = f"one {'more ' * bool(delay)}sample of delay"
    # shares of the payload, or of the arm's mass: 0.1, 0.25 and 0.5 kg on the paper's
    mass = arm.own_mass
    masses = (0.06, 0.15, 0.3)
    if arm.payload_mass:
        mass = arm.payload_mass
        masses = (0.5, 1.5, 2.0)
    payloads = [float(f"{share * mass:.2g}") for share in masses]
    # by damping ratios of mode 1: 1e-5 and 1e-3 s on the paper's
    dampings = [float(f"{2 * zeta / first_frequency(arm):.1g}") for zeta in (3.575e-4, 3.575e-2)]
    if arm.damping:
        dampings = [0.0, *(float(f"{share * arm.damping:.3g}") for share in (0.1, 10.0))]
    others = {
        **{f"payload {each:g} kg": arm.with_numbers(payload_mass=each) for each in payloads},
        **{
            f"hub {share - 1:+.0%}": arm.with_numbers(hub_inertia=share * arm.hub_inertia)
            for share in (0.8, 1.2)
        },
        **{f"C = {C:g} s": arm.with_numbers(damping=C) for C in dampings},
    }
    cases = {
        "as trained": case,
        "quantised": coarse,
        late: case.through(replace(case.chain, sampling=sampling)),
        f"quantised, {late}": coarse.through(replace(coarse.chain, sampling=sampling)),
        **{name: case.on(each) for name, each in others.items()},
    }
    return [NamedLoop(name, each) for name, each in cases.items()]


def compare_controllers(
    trial: Trial,
    gain: TunedGain,
    guard: Guard,
    listed: list[NamedLoop] | None = None,
    nominal: float | None = None,
) -> list[Outcomes]:
    """Return the outcomes in each condition; `trial` is that of the training, `nominal` its best constant gain."""
    nominal = best_constant(trial).gain if nominal is None else nominal
    slews = {kind: shaped_trial(trial, kind).task for kind in SHAPERS}
    found = []
    for condition in tried_loops(trial.case) if listed is None else listed:
        here = trial.on(condition.case)
        own = best_constant(here)
        bound = lq_bound(here)
        found.append(
            Outcomes(
                condition=condition.name,
                without=_constant(here, 0.0),
                best_constant=_constant(here, nominal),
                own_constant=_constant(here, own.gain),
                own_gain=own.gain,
                ZV=_constant(replace(here, task=slews["ZV"]), 0.0),
                EI=_constant(replace(here, task=slews["EI"]), 0.0),
                tuner=_outcome(gain.run(here.simulator()), here),
                bound=Outcome(bound.cost, residual_rms(bound, here.task), None),
                proven=guard.is_proven and _proven(here, guard),
            )
        )
    return found


def _proven(here: Trial, guard: Guard) -> bool:
    """Return whether the sector is certified for this loop, with the trial's modes."""
    with suppress(ConvergenceError):
        return not here.arm.is_undamped and MovingGain(here.loop).proof(guard.lo, guard.hi) is not None
    return False


def _constant(trial: Trial, K: float) -> Outcome:
    """Return the outcome of a constant gain."""
    return _outcome(trial.simulator().linear(trial.loop.gains.with_number(MOMENT_GAIN, K)), trial)


def _outcome(run: Simulation, trial: Trial) -> Outcome:
    """Return the outcome of a simulation, by the cost of a trial."""
    return Outcome(
        record_of_simulation(run, trial.cost, trial.signals).cost, run.residual_moment, tip_off(run, trial)
    )
