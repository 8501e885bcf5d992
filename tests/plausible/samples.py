"""Judges of the verbs of the sampled loop: sampled, simulate; and of tune, by what it compares with."""

from dataclasses import dataclass, replace

import numpy as np

from tests.plausible.held import held, simulated
from tests.plausible.judging import Judged
from tests.plausible.loops import trusted
from tests.plausible.spectra import SAFETY

BESIDE = 1e-3  # share of a printed edge, of the delay margin and of the damping, on either side of which it is looked
STATIC = 1e-6  # of ln radius: what slow poles above the band may add to it
SHARP = 25  # modes whose eigenvalues are polished


def modes_of(case, models, answer):
    """How many modes the model takes: at C = 0 those that the answer holds for, else all, sharp up to this one."""
    return answer["modes_used"] if case.beam.link.damping == 0 else SHARP


class Clock:
    """The sampled models of a case, and what they make of gains."""

    def __init__(self, case, models, count, top=np.inf):
        self.rough, self.fine = (held(m, count, case.period, case.delay, top=top) for m in (models.rough, models.fine))

    def log_radius(self, law):
        """ln of the spectral radius, and its tolerance."""
        (fine, rounding), (rough, _) = self.fine.log_radius(law), self.rough.log_radius(law)
        return fine, SAFETY * abs(fine - rough) + rounding

    def check(self, judged, law, stable, what):
        """Whether a loop is as it is called."""
        radius, slack = self.log_radius(law)
        if abs(radius) <= slack:
            judged.blind += 1
        else:
            judged.truth(f"{what}: ln radius {radius:.3g} ({law})", (radius < 0) == stable)


@dataclass(frozen=True)
class Sampled:
    """`tfarm sampled`: radius, edges of both gains, random gains, delay margin, the damping that makes it safe."""

    oracle = "ZOH of the Galerkin model: spectral radius, beside edges, at random gains, delays and dampings"

    def arguments(self, case):
        return [*case.law.options, "--period", repr(case.period), "--delay-samples", repr(case.delay)]

    def judge(self, case, models, ran):
        judged, answer = Judged(), ran.answer
        count = modes_of(case, models, answer)
        if models.fine.modes[0][count] > trusted(models):
            judged.blind += 1
            return judged
        clock = Clock(case, models, count)
        band = Clock(case, models, count, answer["band_rad_s"] or np.inf)  # which is what the radius is said of
        radius, slack = band.log_radius(case.law)
        all_of_it, _ = clock.log_radius(case.law)
        if abs(all_of_it - radius) < STATIC:  # the same pole: what is above the band is static here, and not at once
            slack += abs(all_of_it - radius)
        size = max(1.0, abs(radius))
        printed = answer["log_spectral_radius"]
        if case.beam.link.damping and not answer["settled"]:  # all is said of some modes only
            judged.blind += 1
            return judged
        if slack < 0.1 * size:
            judged.number("ln radius", printed / size, radius / size, (slack + 1e-11) / size, 0.1)
        if abs(radius) > slack:
            judged.truth(f"{answer['verdict']} at ln radius {radius:.3g}", answer["stable"] == (radius < 0))
        for name in ("K1", "K2"):
            self._windows(judged, case, clock, name, answer[f"{name}_intervals"], answer["shown"][f"{name}_intervals"])
        if answer["stable"]:
            self._delay(judged, case, models, count, answer)
        self._damping(judged, case, models, answer["required_damping_s"])
        return judged

    def _windows(self, judged, case, clock, name, windows, shown):
        windows = [tuple(float(end) for end in pair) for pair in windows]
        figures = [
            (float(end), of)
            for pair, both in zip(windows, shown, strict=True)
            for end, of in zip(pair, both, strict=True)
        ]
        ends = [end for end, _ in figures if np.isfinite(end)]
        unit = max([abs(end) for end in ends] + [abs(getattr(case.law, name)), 1e-6])
        for end, figure in [each for each in figures if np.isfinite(each[0])][:3]:
            if case.beam.link.damping and not figure["settled"]:  # it is said to hold for some modes only
                judged.blind += 1
                continue
            beside = max(BESIDE, 10.0 ** (1 - figure["digits"])) * abs(end)
            for value in (end - beside, end + beside):
                self._at(judged, case, clock, name, value, windows)
        for value in case.rng.uniform(-2, 2, 2) * unit:
            if min((abs(value - end) for end in ends), default=np.inf) > 1e-3 * unit:
                self._at(judged, case, clock, name, float(value), windows)

    def _at(self, judged, case, clock, name, value, windows):
        inside = any(a < value < b for a, b in windows)
        clock.check(judged, replace(case.law, **{name: value}), inside, f"{name} = {value!r}")

    def _delay(self, judged, case, models, count, answer):
        margin, bound = answer["delay_margin_samples"], answer["delay_margin_is_lower_bound"]
        for share in (0.5, 1 - BESIDE) if bound else (0.5, 1 - BESIDE, 1 + BESIDE):
            later = Clock(replace(case, delay=case.delay + share * margin), models, count)
            later.check(judged, case.law, share < 1, f"delay {share} of the margin {margin!r}")

    def _damping(self, judged, case, models, needed):
        if needed in ("inf", 0, 0.0):
            return
        for share in (1 - 2 * BESIDE, 1 + 2 * BESIDE):
            pair = [held(m, SHARP, case.period, case.delay, C=needed * share) for m in (models.rough, models.fine)]
            (rough, _), (fine, rounding) = (each.log_radius(case.law) for each in pair)
            if abs(fine) > SAFETY * abs(fine - rough) + rounding:
                judged.truth(f"C = {share} of {needed!r}: ln radius {fine:.3g}", (fine < 0) == (share > 1))
            else:
                judged.blind += 1


@dataclass(frozen=True)
class Simulate:
    """`tfarm simulate`: hub angle, root moment, tip and torque at every sample."""

    oracle = "the ZOH model stepped under the same law and references; error over the largest value"

    def arguments(self, case):
        rng = case.rng
        scenario = str(rng.choice(["slew", "slew", "step", "decay", "impulse"]))
        duration = case.period * int(min(1500, 3.0 / case.period, 20 + 60 / (case.first * case.period)))
        clock = ["--period", repr(case.period), "--delay-samples", repr(case.delay)]
        return ["--scenario", scenario, "--duration", repr(duration), *clock, *tame(case).options]

    def judge(self, case, models, ran):
        judged, answer = Judged(), ran.answer
        if answer["stopped_at_s"] is not None or not answer["t"]:
            radius, slack = Clock(case, models, SHARP).log_radius(tame(case))
            judged.truth(f"ran away at ln radius {radius:.3g}", radius > -slack)
            return judged
        n, size = len(answer["t"]), stated_size(answer)
        pairs = ((models.fine, 40), (models.rough, 28))
        fine, rough = (step_through(case, m, count, n, answer["scenario"], size) for m, count in pairs)
        names = ("hub_angle", "hub_rate", "root_moment", "tip_displacement", "torque")
        allowed = ROUNDED + LEFT * (answer["modes_change"] or 0.0)
        for name, own, other in zip(names, fine.T, rough.T, strict=True):
            largest = abs(own).max() or 1.0
            slack = 3 * abs(own - other).max() / largest + allowed
            judged.error(name, abs(np.array(answer[name]) - own).max() / largest, slack, 0.05)
        return judged


def tame(case):
    """Gains at which the rigid arm holds at this period: a simulation of what runs away tells little."""
    most = 0.3 * case.beam.total_inertia / case.period / (1 + case.delay)
    K1 = min(abs(case.law.K1), most)
    return replace(
        case.law, K1=K1, K2=float(np.clip(case.law.K2, -0.2, 0.6)), Kp=min(case.law.Kp, 0.2 * K1 / case.period)
    )


LEFT = 3  # times the change that is printed, which is no bound: without damping up to twice of it was left
ROUNDED = 1e-3  # of the largest value: what a simulation may leave without saying so
OFFSET = 0.01  # of the length, at the tip of an arm that is released


def stated_size(answer):
    """The torque of a step [N m] or the impulse [N m s], which the answer states: one digit, so that none is lost."""
    words = answer["scenario_in_words"].split(" of ")
    return float(words[1].split()[0]) if answer["scenario"] in ("step", "impulse") else 0.0


def step_through(case, model, count, n, scenario, size):
    """Angle, rate, moment, tip and torque at each sample: (n, 5)."""
    sampled = held(model, count, case.period, case.delay)
    A, _, C = sampled.matrices
    poles = sampled.poles
    tip = np.zeros(len(A), complex)
    tip[: poles.size], tip[poles.size + 1] = sampled.tip, case.beam.link.length / sampled.inertia
    start, struck = np.zeros((2, len(A)), complex)
    if scenario == "impulse":
        struck[: poles.size + 1] = size
    if scenario == "decay":
        own = np.nonzero(poles.imag > 0)[0]
        i = own[np.argmin(abs(poles[own]))]
        j = int(np.argmin(abs(poles - poles[i].conj())))
        p, r = poles[i], tip[i]
        start[i] = 1j * OFFSET * case.beam.link.length * abs(p) ** 2 / (2 * p.imag) / (p * r)
        start[j] = start[i].conj()
    records, torques = simulated(
        sampled, np.vstack([C, tip]), tame(case), references(case, n, scenario, size), n, start, struck
    )
    return np.column_stack([records, torques])


def references(case, n, scenario, size):
    """Feedforward, hub angle, hub rate and the rigid arm's moment at each sample."""
    zero, J, T = np.zeros(n), case.beam.total_inertia, case.period
    if scenario == "step":
        return np.full(n, size), zero, zero, zero
    if scenario != "slew":
        return zero, zero, zero, zero
    rise, t = case.slew.rise_time, T * np.arange(n + 1)
    peak = 4 * case.slew.travel / (case.beam.link.length * rise**2)
    rate = peak * np.clip(np.minimum(t, rise - t), 0, None)
    acceleration = np.diff(rate) / T
    angle = np.r_[0, np.cumsum((rate[1:] + rate[:-1]) / 2 * T)][:-1]
    rigid = -(J - case.beam.hub.inertia) * np.r_[0, acceleration[:-1]]
    return J * acceleration, angle, rate[:-1], rigid


@dataclass(frozen=True)
class Tune:
    """`tfarm tune`, two trials: it ends, and the costs keep their order."""

    oracle = "order alone: the bound is below every cost, the best constant gain not above none"

    def arguments(self, case):
        return ["--trials", "2", "--period", repr(case.period), "--K1", repr(tame(case).K1)]

    def judge(self, case, models, ran):
        judged, answer = Judged(), ran.answer
        least = answer["cost_lq_bound"] * (1 - 1e-6)
        for name in ("cost_without", "cost_best_constant", "cost_tuned"):
            judged.truth(f"{name} {answer[name]} below the bound {least}", answer[name] >= least)
        judged.truth("constant worse than none", answer["cost_best_constant"] <= answer["cost_without"] * (1 + 1e-6))
        return judged
