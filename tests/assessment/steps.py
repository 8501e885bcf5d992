"""Figures of `tfarm step` against inverse Laplace transforms by two inversions:

    python -m tests.assessment.steps SIZE SEED

Steps of a reference, slews and pulses; arms of `tests.plausible` and the paper's, mode 1 damped 0 to 20 %, a few with a
spring to ground or a motor; laws of hub angle, hub rate and root moment with a delay of 0 to 10 ms and filters of order
0 to 3.  True signals are those of `tests.assessment.step_truth`; where its two inversions differ by more than `AGREES`
of the peak there, or `ENOUGH` elsewhere, there is no truth.

A figure is wrong where it differs by more than 1 %, whatever its bound, or by 1e-6 under the word "converged"; a
settling or a rise time where no signal so near has it, a peak time where the signal is not the peak.  A bound that a
peak exceeds is counted.  A figure that the record has and the answer has not is "not determined"; it has to have a
reason in words, and they are 2 % of all at most.
"""

import math
from collections import Counter
from dataclasses import dataclass, fields, is_dataclass, replace
from unittest import mock

import numpy as np

import tfarm
from tests import survey
from tests.assessment.step_truth import Case, Truth, loop_function
from tests.plausible.arms import draw, log
from tests.survey import Finding
from tfarm.arm import Motor
from tfarm.arm.chain import Sampling, Slew
from tfarm.assessment import step
from tfarm.assessment.signal_figures import PARTS, LoopResponse
from tfarm.dsp import Chain

AGREES, ENOUGH = 1e-6, 1e-4  # of the peak of a signal, there and elsewhere: two inversions differ by no more
RIGHT, CONVERGED, BAND = 0.01, 1e-6, 0.02  # of the peak, and under that word; of the final value: settled
MOST_UNDETERMINED, MOST_WITHOUT_TRUTH = 0.02, 0.05  # of the figures
SLOW, FAST = 1e-3, 1e3  # of the first frequency: growth, and the end of the line along which it is looked for
CHECKS = 40  # times at which both inversions are compared, and the deciding ones
SCENARIOS = ("reference", "slew", "pulse")
FIGURES = ("peak", "peak_time", "final_value", "rise_time", "overshoot", "settling_time", "steady_state_error",
           "residual_rms")  # fmt: skip


# ---------------------------------------------------------------- judgement


@dataclass(frozen=True)
class Judged:
    """What came of one figure: right, wrong, not determined, undefined or no truth."""

    name: str
    outcome: str
    words: str = ""


class Signal:
    """One signal of an answer, and what it should be."""

    def __init__(self, part, figures, found, truth):
        self.part, self.figures, self.found, self.truth = part, figures, found, truth
        self.row = PARTS.index(part)
        self.t, self.y = truth.curve[0], truth.curve[1][self.row]
        self.space = 2 * float(found.t[1])
        self.peak_time, self.peak = truth.peak(self.row)
        self.stated = getattr(figures, "remainder_bound", None)
        self.is_converged = found.continuous.certainty.startswith("converged")
        late = self.t >= 0.9 * self.t[-1]
        self.final = float(np.trapezoid(self.y[late], self.t[late]) / np.ptp(self.t[late]))
        self.swing = float(np.ptp(self.y[late]))
        reference = {
            "reference": 1.0,
            "slew": truth.case.chain.slew.travel_of(truth.case.arm.reach) / truth.case.arm.reach,
        }
        angle = reference.get(truth.case.scenario)
        self.reference = {"hub": angle, "tip": angle and angle * truth.case.arm.reach}.get(part)
        near = self.t[max(0, int(np.searchsorted(self.t, self.peak_time)) - 2) :][:4]
        self.peak_error = self.disagreement([self.peak_time, figures.peak_time, *np.linspace(near[0], near[-1], 9)])
        rng = np.random.default_rng(1)
        spread = np.r_[rng.uniform(0, 1, CHECKS // 2), rng.uniform(0, 1, CHECKS // 2) ** 6] * found.t[-1]
        self.rms = []
        self.error = max(self.peak_error, self.disagreement([*spread, figures.settling_time]))

    def disagreement(self, times):
        """Largest difference of both inversions at those times that there are."""
        known = [each for each in times if each is not None and 0 <= each <= self.truth.duration]
        return float(self.truth.disagreement(known)[self.row].max())

    @property
    def slack(self):
        """By how much figures of the final value may differ."""
        return RIGHT * abs(self.final) + 1e-3 * self.swing + self.error + CONVERGED * abs(self.peak)

    def judged(self):
        """Every figure."""
        for name in FIGURES:
            value = getattr(self.figures, name)
            error, most = (self.peak_error, AGREES) if name.startswith("peak") else (self.error, ENOUGH)
            if max(error / most, self.error / ENOUGH) > abs(self.peak):
                yield Judged(name, "no truth", f"inversions differ by {error / abs(self.peak):.2g} of the peak")
                continue
            is_here = value is not None
            outcome = getattr(self, f"_{name}")(value)
            if isinstance(outcome, str):
                yield Judged(name, outcome)
            elif not is_here:
                has_reason = self.reasons()
                yield Judged(name, "not determined" if has_reason else "wrong", "" if has_reason else "no reason given")
            else:
                yield Judged(name, "right" if outcome else "wrong", "" if outcome else f"{value!r}, {self.true()}")

        if self.stated is not None and self.figures.peak is not None:
            apart = abs(self.figures.peak - self.peak)
            is_outside = apart > self.stated + self.peak_error + 1e-9 * abs(self.peak)
            yield Judged("bound", "bound exceeded" if is_outside else "right", f"by {apart:.3g}, {self.true()}")

    def true(self):
        """The true signal in words."""
        final = f"final {self.final:.6g}, swing {self.swing:.3g}"
        peak = f"peak {self.peak:.8g} at {self.peak_time:.8g} s"
        last = f"last outside of 2 % at {self.last(1.0):.6g} s"
        rise = "" if self.reference is None else f", rise {self.rise(1.0, 0)[0]:.6g} s"
        true = f"true: {peak}, {final}, {last}{rise}, rms {self.rms}, right to {self.error:.2g}"
        return f"stated bound {self.stated}, {true}"

    def reasons(self):
        """Texts of the answer that could say why a figure is missing."""
        texts = list(strings(self.figures, ("signal", "unit")))
        return texts + list(strings(self.found.continuous, ("stability", "certainty")))

    # figures: True or False, or a word where there is none

    def _peak(self, value):
        if value is None:
            return None
        apart = abs(value - self.peak)
        if self.is_converged:
            return apart <= CONVERGED * abs(self.peak) + self.peak_error
        return apart <= RIGHT * abs(self.peak) + self.peak_error

    def _peak_time(self, value):
        if value is None or not 0 <= value <= self.truth.duration:
            return None if value is None else False
        here = [self.truth.at([value], side)[self.row, 0] for side in (-1.0, 0.0, 1.0)]
        return max(abs(each) for each in here) >= (1 - RIGHT) * abs(self.peak) - self.error

    def _final_value(self, value):
        if value is None:
            is_zero = self.part == "root_moment" and self.truth.case.arm.has_rigid_mode
            return "undefined" if is_zero or self.may_be_unsettled else None
        return abs(value - self.final) <= self.slack

    def _steady_state_error(self, value):
        if value is None:
            return "undefined" if self.reference is None or self.may_be_unsettled else None
        return self.reference is not None and abs(self.reference - self.final - value) <= self.slack

    def _overshoot(self, value):
        if value is None:
            return "undefined" if self.reference is None or self.may_be_unsettled else None
        share = float((self.y / self.final).max())
        slack = RIGHT * share + self.error / abs(self.final) + share * self.slack / abs(self.final)
        return abs(max(0.0, share - 1) - float(value)) <= slack

    def _residual_rms(self, value):
        after = self.t >= self.truth.input.end * (1 - 1e-12)
        if value is None:
            return "undefined" if not self.truth.input.end or after.sum() < 3 else None
        t, away = self.t[after], [self.y[after] - final for final in self.finals]
        self.rms = [math.sqrt(np.trapezoid(each**2, t) / np.ptp(t)) for each in away]
        slack = self.error + CONVERGED * abs(self.peak)
        return any(abs(value - each) <= 2 * RIGHT * each + slack for each in self.rms)

    def _rise_time(self, value):
        if value is None:
            return "undefined" if self.reference is None or self.may_be_unsettled else None
        low, high = self.rise(1.0, self.slack / abs(self.final))
        return low - self.space <= value <= high + self.space

    def rise(self, scale, slack):
        """Least and largest time from 10 to 90 % of the final value."""
        share = self.y / self.final * scale

        def reached(level):
            return float(self.t[int((share >= level).argmax())]) if (share >= level).any() else math.inf

        first, last = ((reached(level - slack), reached(level + slack)) for level in (0.1, 0.9))
        return last[0] - first[1], last[1] - first[0]

    @property
    def finals(self):
        """Values about which a signal may settle: a root moment also about 0, of an arm that turns freely."""
        is_free = self.part == "root_moment" and self.truth.case.arm.has_rigid_mode
        return (self.final, 0.0) if is_free else (self.final,)

    def outside(self, share, final):
        """Times at which the signal is outside a share of the band."""
        away = abs(self.y - final)
        band = BAND * (float(away.max()) if self.reference is None else abs(final))
        return self.t[away > band * share]

    def last(self, share):
        """The last of them."""
        return float(self.outside(share, self.final).max(initial=0.0))

    def shares(self, final):
        """Shares of the band that decide for sure."""
        scale = float(abs(self.y - final).max()) if self.reference is None else abs(final)
        slack = (self.slack - RIGHT * abs(self.final) + 1e-3 * scale) / max(BAND * scale, 1e-300)
        return max(0.0, 1 - slack), 1 + slack

    @property
    def may_be_unsettled(self):
        """Whether too little of the record may be left after the settling time, or none of it is about an end."""
        end = 0.9 * self.t[-1] - self.space
        return any((self.outside(self.shares(final)[0], final) >= end).any() for final in self.finals)

    def _settling_time(self, value):
        if value is None:
            return "undefined" if self.may_be_unsettled else None
        return any(self.settles(value, final) for final in self.finals)

    def settles(self, value, final):
        """Whether a signal settles at that time after the end of the motion."""
        near, far = self.shares(final)
        inner, outer = self.outside(near, final), self.outside(far, final)
        at = value + self.truth.input.end
        is_late = (outer > at + self.space).any()
        return not is_late and (value <= self.space or bool((abs(inner - at) <= self.space).any()))


def strings(of, without):
    """Non-empty texts in the fields of a record."""
    for each in fields(of) if is_dataclass(of) else ():
        value = getattr(of, each.name)
        if each.name in without or value is None:
            continue
        values = value.values() if isinstance(value, dict) else value if isinstance(value, tuple | list) else [value]
        yield from (text for text in values if isinstance(text, str) and text)


def identities(found, truth):
    """y = 0 before the delay of a reference's step, u(tau+), and the curves that CSV and pictures show."""
    case, loop = truth.case, found.continuous
    t = np.minimum(found.t, truth.duration)
    true = np.array([truth.at(t, side) for side in (-1.0, 0.0, 1.0)])
    scale = abs(truth.curve[1]).max(axis=1)
    signals = np.array([loop.signals[name] for name in (*found.names[:3], "torque")])
    bound = getattr(found.response, "remainder", None)
    allowed = bound(found.t)[[*range(3), -1]] if bound else np.zeros(signals.shape)
    allowed[-1] += truth.rounding(t)
    before = found.t < case.delay * (1 - 1e-9)
    if case.scenario == "reference" and before.any():
        early = (abs(signals[:, before]).max(axis=1) / scale).max()
        yield Judged("y before the delay", "wrong" if early > 1e-12 else "right", f"{early:.3g} of the peak")
    if truth.has_impulse:
        return
    at = (case.delay if case.scenario == "reference" else 0.0) + 1e-9 * truth.duration
    expected = truth.at(np.array([at]), 1.0)[-1, 0]
    value = found.response.at(np.array([at]))[-1, 0]
    limit = max(RIGHT * scale[-1], bound(np.array([at]))[-1, 0] if bound else 0.0)
    is_right = abs(value - expected) <= limit
    yield Judged("u(tau+)", "right" if is_right else "wrong", "" if is_right else f"{value:.8g}, true {expected:.8g}")
    apart = abs(signals - true).min(axis=0)
    for part, row, most, size in zip(PARTS, apart, allowed, scale, strict=True):
        n = int((row - np.maximum(most, RIGHT * size)).argmax())
        is_right = row[n] <= max(most[n], RIGHT * size)
        words = f"{signals[PARTS.index(part), n]:.8g} at {t[n]:.8g} s, true {true[1, PARTS.index(part), n]:.8g}"
        yield Judged(f"{part} over time", "right" if is_right else "wrong", "" if is_right else words)


def answered(case):
    """The answer of `step`, its sampled loop left out."""
    nothing = LoopResponse(stability="", certainty="", signals={})
    with mock.patch.object(step, "sampled_response", return_value=nothing):
        return step.step(case.arm, case.law, case.chain, case.scenario, case.duration)


def judge(case):
    """Every figure of one case; None of a loop that is called unstable."""
    try:
        found = answered(case)
    except (tfarm.ConvergenceError, tfarm.ParameterError) as refused:
        return [Judged(f"{part}.{name}", "not determined", str(refused)) for part in PARTS for name in FIGURES]
    if found.continuous.stability == "unstable":
        return None
    truth = Truth(case, float(found.t[-1]))
    signals = [Signal(part, getattr(found.continuous, part), found, truth) for part in PARTS]
    judged = []
    if case.duration is None:
        is_long = found.duration > case.chain.slew.rise_time * (1 + RIGHT)
        judged.append(Judged("usual duration", "right" if is_long else "wrong", f"{found.duration:.4g} s"))
    for own in signals:
        if own.part == "torque" and truth.has_impulse:
            is_said = own.figures.peak is None and any("impulse" in text for text in own.reasons())
            judged.append(Judged("torque.peak", "right" if is_said else "wrong", "an impulse"))
            continue
        judged += [replace(each, name=f"{own.part}.{each.name}") for each in own.judged()]
    return judged + list(identities(found, truth))


# ---------------------------------------------------------------- random cases


def some_arm(rng):
    """An arm and its first frequency [rad/s], 3 to 1000, mode 1 damped 0 to 20 %."""
    while True:
        own = draw(int(rng.integers(2**31)), int(rng.integers(2**31)))
        arm, first = own.arm, own.first
        if rng.random() < 0.2:
            arm, first = tfarm.load("sasaki2012-lab"), 71.5
            if rng.random() < 0.3:
                return arm, first
        if 3 <= first <= 1000:
            break
    ratio = 0.0 if rng.random() < 0.15 else log(rng, 1e-4, 0.2)
    arm = arm.with_numbers(damping=2 * ratio / first)
    if rng.random() < 0.07:
        arm = replace(arm, hub=replace(arm.hub, stiffness=arm.total_inertia * first**2 * log(rng, 1e-3, 1.0)))
    if rng.random() < 0.07:
        arm = replace(arm, motor=some_motor(rng, arm), input=str(rng.choice(["motor_voltage", "motor_current"])))
    return arm, first


def some_motor(rng, arm):
    """A motor whose rotor is a share of the hub."""
    ratio = log(rng, 1.0, 50.0)
    return Motor(
        resistance=log(rng, 0.5, 10.0), torque_constant=log(rng, 1e-2, 0.3), gear_ratio=ratio,
        rotor_inertia=arm.hub.inertia * log(rng, 1e-2, 1.0) / ratio**2, gear_efficiency=float(rng.uniform(0.6, 1.0)),
        inductance=0.0 if rng.random() < 0.5 else log(rng, 1e-5, 1e-3),
    )  # fmt: skip


def some_case(rng):
    """A case whose loop does not grow fast, without delay in a third of them, half of them steps of a reference."""
    delay = 0.0 if rng.random() < 1 / 3 else float(rng.uniform(0, 0.01))
    name = str(rng.choice(SCENARIOS, p=[0.5, 0.25, 0.25]))
    while True:
        arm, first = some_arm(rng)
        if (name == "slew" and not arm.has_rigid_mode) or (arm.is_undamped and delay):  # unstable at any gain
            continue
        for attempt in range(6):
            case = some_loop(rng, arm, first, delay, name, 0.6**attempt)
            if not grows(case, first):
                return case


def grows(case, first):
    """Whether 1 + L has a zero right of `SLOW` by its turns along that line: so have most loops that are not stable."""
    s = SLOW * first + 1j * np.r_[0.0, np.geomspace(1e-4, FAST, 2**15)] * first
    F = 1 + loop_function(case, s)
    return round(float(np.angle(F[1:] / F[:-1]).sum()) / math.pi) != 0


def some_loop(rng, arm, first, delay, name, share):
    """A law about a bandwidth below the delay and the filters, and a share of it, and a record."""
    corners = tuple(float(f"{log(rng, 50.0, 3000.0):.3g}") for _ in range(rng.integers(0, 4)))
    if len(corners) > 1 and rng.random() < 0.4:
        corners = (corners[0],) * len(corners)
    limits = [first, *([0.3 / delay] if delay else []), *([0.5 * min(corners) / len(corners)] if corners else [])]
    band = min(limits) * log(rng, 0.03, 1.0) * share
    J = arm.turned_inertia
    kp, kd = J * band**2, 2 * J * band * float(rng.uniform(0.3, 1.5))
    kind = rng.choice(["PD", "angle and rate", "rate"], p=[0.5, 0.3, 0.2])
    is_differentiated = not corners and kind == "PD" and rng.random() < 0.9  # of a step: an impulse, in a few
    kind = "angle and rate" if is_differentiated else kind
    entries = {
        "PD": {"hub_angle": ((kd, kp), corners)},
        "angle and rate": {"hub_angle": ((kp,), corners), "hub_rate": ((kd,), corners)},
        "rate": {"hub_rate": ((kd,), corners)},
    }[str(kind)]
    if rng.random() < 0.3:
        per_torque = arm.input_per_torque
        entries["root_moment"] = ((per_torque * float(rng.uniform(-1.0, 0.7)),), corners if rng.random() < 0.6 else ())
    hub = "hub_rate" if kind == "rate" else "hub_angle"
    references = (hub,) if name == "reference" or rng.random() < 0.8 else ()
    if references and name == "slew" and rng.random() < 0.5:
        references = tuple(entries)
    rise = log(rng, 1.0, 6.0) * 2 * math.pi / first
    chain = Chain(sampling=Sampling(period=float(f"{rise / 40:.3g}")), slew=Slew(rise_time=float(f"{rise:.3g}")))
    length = None if rng.random() < 0.2 else float(f"{chain.slew.rise_time * 1.1 + log(rng, 5.0, 60.0) / band:.4g}")
    return Case(arm, entries, delay, references, name, chain, length)


def steps(size, seed):
    """The survey: a finding a case, and one of the whole."""
    total, cases = Counter(), 0
    for number in range(size):
        case, judged = None, None
        rng = np.random.default_rng([seed, number])
        while judged is None:
            case = some_case(rng)
            judged = judge(case)
        cases += 1
        total.update(each.outcome for each in judged)
        wrong = [each for each in judged if each.outcome == "wrong"]
        kinds = sorted({each.outcome for each in judged} - {"right", "undefined"})
        details = "".join(f"\n  {each.name}: {each.words}" for each in judged if each.outcome in kinds and each.words)
        words = f"{seed} {number}{details}\n{case.words}" if wrong else f"{seed} {number}{details}" if kinds else ""
        yield Finding(", ".join(kinds) or "right", words, bool(wrong))
    count = sum(total[each] for each in ("right", "wrong", "not determined", "no truth"))
    shares = {each: total[each] / max(count, 1) for each in ("not determined", "no truth")}
    is_bad = shares["not determined"] > MOST_UNDETERMINED or shares["no truth"] > MOST_WITHOUT_TRUTH
    words = f"{cases} cases, {count} figures, {total['wrong']} wrong, " + ", ".join(
        f"{each} {100 * share:.2f} %" for each, share in shares.items()
    )
    yield Finding("all", words, is_bad)


if __name__ == "__main__":
    survey.main(steps, size=400)
