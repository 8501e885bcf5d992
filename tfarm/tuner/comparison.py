"""The tuner beside what it has to beat, in one run: no moment feedback, the best constant gain, input shaping, and the
linear-quadratic optimum that nothing beats; with converters and delay, on the arm it was trained on and on others.

Every controller knows the arm by its name plate only: feedforward, references, shapers, gains and weights are those of
the arm that it was trained on, whatever arm moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.dsp import Chain, Converters, Scenario, Simulation
from tfarm.dsp.scenarios import torque_unit
from tfarm.errors import ConvergenceError
from tfarm.spectrum.scales import first_frequency
from tfarm.tuner.baselines import SHAPERS, Shaper, best_constant, lq_bound, shaped_trial
from tfarm.tuner.controller import TunedGain, judged, tip_off
from tfarm.tuner.guard import Guard
from tfarm.tuner.sector import MovingGain
from tfarm.tuner.trial import Trial, residual_rms

ADDED_MASSES = (0.06, 0.15, 0.3)  # of the arm's mass, for one without payload: 0.1, 0.25 and 0.5 kg on the paper's
PAYLOAD_SHARES = (0.5, 1.5, 2.0)  # of the payload, for one that has one
HUB_SHARES = (0.8, 1.2)  # times the hub's inertia
DAMPING_SHARES = (0.1, 10.0)  # times the arm's own C
GIVEN_RATIOS = (3.575e-4, 3.575e-2)  # of critical in mode 1, for an arm without C: 1e-5 and 1e-3 s on the paper's
ENCODER_COUNTS = 8192  # a turn, of the encoder
CONVERTER_BITS = 12  # of the other converters
MOMENT_RANGE = 20.0  # N m, of the paper's arm: times the arm's unit of torque
TORQUE_RANGE = 10.0  # N m, likewise
COMPUTER_DELAY = 1.0  # samples that the computer takes, beyond the chain's own


class Outcome(NamedTuple):
    """`cost` of the trial, inf where the loop ran away, and `residual` root moment after the slew [N m], None there.

    `tip_error` [m] is how far the tip is off its target when the trial ends; None where it ran away, and of the bound.
    """

    cost: float
    residual: float | None
    tip_error: float | None


@dataclass(frozen=True)
class Outcomes:
    """One condition: what each controller makes of it.

    `best_constant` is the best constant gain of the trained condition, used here; `own_constant` the best for this
    condition, at `own_gain`.  `ZV` and `EI` are judged by their own, later slew, and so may pass `bound`, which is that
    of the unshaped one.  `proven`: whether the tuner's guard is proven for this loop too.
    """

    condition: str
    without: Outcome
    best_constant: Outcome
    own_constant: Outcome
    own_gain: float
    ZV: Outcome
    EI: Outcome
    tuner: Outcome
    bound: Outcome
    proven: bool


@dataclass(frozen=True)
class NamedLoop:
    """An arm and a chain under their name."""

    name: str
    arm: Arm
    chain: Chain


def quantised_chain(arm: Arm, chain: Chain) -> Chain:
    """The chain with its own converters, or where they are ideal with 12 bits over ranges that suit the arm's slew."""
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
    """The trained condition, converters, delay, and both; then the arms that it was not trained on.

    `quantised` is the chain with converters, that of `quantised_chain` if it is not given.
    """
    quantised = quantised_chain(arm, chain) if quantised is None else quantised
    sampling = replace(chain.sampling, delay_samples=chain.sampling.delay_samples + COMPUTER_DELAY)
    late = f"one {'more ' * bool(chain.sampling.delay_samples)}sample of delay"
    listed = [
        NamedLoop("as trained", arm, chain),
        NamedLoop("quantised", arm, quantised),
        NamedLoop(late, arm, replace(chain, sampling=sampling)),
        NamedLoop(f"quantised, {late}", arm, replace(quantised, sampling=sampling)),
    ]
    mass, own = arm.payload_mass, arm.damping
    masses = [share * mass for share in PAYLOAD_SHARES] if mass else [share * arm.own_mass for share in ADDED_MASSES]
    payloads = [float(f"{each:.2g}") for each in masses]
    if own:
        dampings = [0.0, *(float(f"{share * own:.3g}") for share in DAMPING_SHARES)]
    else:
        dampings = [float(f"{2 * zeta / first_frequency(arm):.1g}") for zeta in GIVEN_RATIOS]
    others = {f"payload {each:g} kg": arm.having(payload_mass=each) for each in payloads}
    others |= {f"hub {share - 1:+.0%}": arm.having(hub_inertia=share * arm.hub_inertia) for share in HUB_SHARES}
    others |= {f"C = {C:g} s": arm.having(damping=C) for C in dampings}
    return listed + [NamedLoop(name, other, chain) for name, other in others.items()]


def compare_controllers(
    trial: Trial,
    gain: TunedGain,
    guard: Guard,
    listed: list[NamedLoop] | None = None,
    nominal: float | None = None,
) -> list[Outcomes]:
    """A row a condition; `trial` is the one that the tuner was trained on, `nominal` its best constant gain."""
    nominal = best_constant(trial).gain if nominal is None else nominal
    wanted = tried_loops(trial.arm, trial.loop.chain) if listed is None else listed
    late = {kind: shaped_trial(trial, kind).task for kind in SHAPERS}
    return [_row(trial, gain, guard, nominal, late, each) for each in wanted]


def _row(
    trial: Trial, gain: TunedGain, guard: Guard, nominal: float, late: Mapping[Shaper, Scenario], condition: NamedLoop
) -> Outcomes:
    """What each controller makes of a condition; `late` are the slews through the shapers."""
    here = trial.asked_of(condition.arm, condition.chain, gain.servo)
    own, bound = best_constant(here), lq_bound(here)
    return Outcomes(
        condition=condition.name,
        without=_constant(here, here.task, 0.0),
        best_constant=_constant(here, here.task, nominal),
        own_constant=_constant(here, here.task, own.gain),
        own_gain=own.gain,
        ZV=_constant(here, late["ZV"], 0.0),
        EI=_constant(here, late["EI"], 0.0),
        tuner=_played(gain.run(here.simulator()), here),
        bound=Outcome(bound.cost, residual_rms(bound, here.task), None),
        proven=guard.is_proven and _proven(here, guard),
    )


def _proven(here: Trial, guard: Guard) -> bool:
    """Whether the sector is proven for this loop, with the trial's modes."""
    if here.arm.is_undamped:
        return False
    try:
        return MovingGain(here.loop).proof(guard.lo, guard.hi) is not None
    except ConvergenceError:
        return False


def _constant(trial: Trial, task: Scenario, K: float) -> Outcome:
    return _played(trial.simulator(task=task).linear(trial.loop.gains.having(MOMENT_GAIN, K)), trial)


def _played(run: Simulation, trial: Trial) -> Outcome:
    record = judged(run, trial.cost, trial.signals)
    return Outcome(record.cost, residual_rms(record, run.scenario), tip_off(run, trial))
