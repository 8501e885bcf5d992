"""True signals of `tfarm step`: the loop closed by hand, and inverted twice (`tests.assessment.inversion`).

From the arm's transfer functions G and the coefficients C of the law

    U = E/(1 + L),   y = G U,   L = e^{-s tau} sum C_k G_k,   E = X_u + e^{-s tau} sum C_k X_k

E, of which alone u jumps, and what returns of it by the hub's own inertia, with its kinks, are inverted in closed form,
the rest by Durbin's method with two periods.
"""

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

import tfarm
from tests.assessment.inversion import durbin, inverse
from tfarm.arm import to_toml
from tfarm.arm.writing import law_toml
from tfarm.assessment.signal_figures import PARTS
from tfarm.dsp import Chain
from tfarm.dsp.scenarios import scenario

WINDOWS, POINTS = (1, 16, 256), 2**18  # the duration over each is a grid of its own


@dataclass(frozen=True)
class Case:
    """A loop and its input: the law's `entries` are (numerator, corners of its filter [1/s]) by signal."""

    arm: tfarm.Arm
    entries: dict
    delay: float
    references: tuple
    scenario: str
    chain: Chain
    duration: float | None

    @property
    def law(self):
        """The law as tfarm takes it."""
        entries = {name: (list(num), list(filter_of(corners))) for name, (num, corners) in self.entries.items()}
        return tfarm.Law(entries, delay=self.delay, references=self.references)

    @property
    def words(self):
        """All that the case needs to be run again."""
        length = "" if self.duration is None else f" --duration {self.duration!r}"
        sampling, slew = self.chain.sampling, self.chain.slew
        chain = f"[sampling]\nperiod = {sampling.period!r}\n[slew]\nrise_time = {slew.rise_time!r}"
        files = "".join(f"\n--- {each}" for each in (to_toml(self.arm), law_toml(self.law), chain))
        return f"step arm.toml --law law.toml --dsp chain.toml --scenario {self.scenario}{length}{files}"

    @property
    def tracked(self):
        """The signal of the hub that is followed, as `step` says it."""
        known = {*self.references, *self.entries}
        return "hub_angle" if self.scenario != "reference" or "hub_angle" in known else "hub_rate"


def filter_of(corners):
    """Coefficients of prod (s/c + 1)."""
    den = np.ones(1)
    for c in corners:
        den = np.polymul(den, [1 / c, 1.0])
    return den


def loop_function(case, s):
    """L(s), from the transfer functions and the coefficients of the law."""
    angle, moment = tfarm.transfer(case.arm, ["hub_angle", "root_moment"])(s)
    plant = {"hub_angle": angle, "hub_rate": s * angle, "root_moment": moment}
    return np.exp(-s * case.delay) * sum(
        np.polyval(num, s) / np.polyval(filter_of(corners), s) * plant[name]
        for name, (num, corners) in case.entries.items()
    )


# ---------------------------------------------------------------- inputs


@dataclass(frozen=True)
class Input:
    """X_u and X_k by signal, each pairs (coefficient, power of 1/s), at `edges` (t, weight); the end of the input [s].

    A `disturbance` is no torque of the motor.
    """

    actuator: tuple
    references: dict
    edges: tuple
    end: float
    disturbance: bool = False


def input_of(case, duration):
    """The input of a case, in the words of `tfarm.dsp.scenarios`."""
    arm, rise = case.arm, case.chain.slew.rise_time
    if case.scenario == "reference":
        return Input((), {case.tracked: (1.0, 1)}, ((0.0, 1.0),), 0.0)
    if case.scenario == "pulse":
        task = scenario("pulse", arm, case.chain, duration)
        return Input(((task.disturbance[0], 1),), {}, ((0.0, 1.0), (task.busy_until, -1.0)), task.busy_until, True)
    a = 4 * case.chain.slew.travel_of(arm.reach) / arm.reach / rise**2
    known = {"hub_angle": (a, 3), "hub_rate": (a, 2), "root_moment": (-a * arm.gauged_inertia, 1)}
    references = {name: X for name, X in known.items() if name in case.references}
    feedforward = ((a * arm.turned_inertia, 1), (a * arm.rate_loss, 2))
    return Input(feedforward, references, ((0.0, 1.0), (rise / 2, -2.0), (rise, 1.0)), rise)


# ---------------------------------------------------------------- truth


class Truth:
    """Signals of hub, tip, root moment and torque (rows) of a case up to a duration, by two inversions."""

    def __init__(self, case, duration):
        self.case, self.input, self.duration = case, input_of(case, duration), duration
        of_rate, (J, b) = case.tracked == "hub_rate", self.hub
        G = tfarm.transfer(case.arm, ["hub_angle", "tip_displacement", "root_moment"])

        def transform(s):
            """Signals (rows, m), what the law's references do being late by its delay."""
            angle, tip, moment = G(s)
            plant = {"hub_angle": angle, "hub_rate": s * angle, "root_moment": moment}
            C = {name: np.polyval(num, s) / np.polyval(filter_of(own), s) for name, (num, own) in case.entries.items()}
            late = np.exp(-s * case.delay)
            L = late * sum(C[name] * plant[name] for name in C)
            rows = np.array([angle * s, tip * s, moment, -L] if of_rate else [angle, tip, moment, -L]) / (1 + L)
            rows[-1] += late * sum(C[name] / (J * (s + b) ** n) for name, n in self.inertial.items())
            X_u = sum(c / s**n for c, n in self.input.actuator)
            X_k = sum(C[name] * c / s**n for name, (c, n) in self.input.references.items())
            return rows * (X_u + late * X_k) * sum(w * np.exp(-s * at) for at, w in self.input.edges)

        lengths = [duration / each for each in WINDOWS]
        self.smooth = [durbin(transform, each, POINTS) for each in lengths]
        self.second = [durbin(transform, each, POINTS, 3.0, 28.0) for each in lengths]

    @property
    def hub(self):
        """Inertia of the hub alone in units of the input, and a rate [1/s] far from no other of the loop."""
        return self.case.arm.input_per_torque * self.case.arm.hub_side_inertia, 1.2345 / self.case.chain.slew.rise_time

    @property
    def inertial(self):
        """Powers of 1/s of the hub's response by its inertia alone; none behind an inductance."""
        powers = {"hub_angle": 2, "hub_rate": 1} if not self.case.arm.input_lags else {}
        return {name: n for name, n in powers.items() if name in self.case.entries}

    @cached_property
    def direct(self):
        """E as rational functions: numerator, poles, and delay."""
        found = [([c], Counter({0: n}), 0.0) for c, n in self.input.actuator]
        for name, (c, n) in self.input.references.items():
            num, poles = self.entry(name)
            found.append((c * num, Counter({0: n}) + poles, self.case.delay))
        return found

    @cached_property
    def returning(self):
        """What the hub's inertia alone makes of it: -e^{-s tau} sum C_k/(J (s + b)^n) E, the same to leading order."""
        J, b = self.hub
        return [
            (-np.polymul(num, entry[0]) / J, poles + entry[1] + Counter({-b: n}), delay + self.case.delay)
            for num, poles, delay in self.direct
            for entry, n in ((self.entry(name), n) for name, n in self.inertial.items())
        ]

    def entry(self, name):
        """Numerator and poles of an entry of the law."""
        num, corners = self.case.entries[name]
        return np.multiply(num, math.prod(corners)), Counter(-each for each in corners)

    @cached_property
    def closed(self):
        """Closed forms of both, with their times and weights."""
        direct = () if self.input.disturbance else self.direct
        forms = [(inverse(num, poles), delay) for num, poles, delay in (*direct, *self.returning)]
        return [(form, at + delay, w) for form, delay in forms for at, w in self.input.edges]

    @property
    def has_impulse(self):
        """Whether the torque is infinite somewhere."""
        return any(form.impulse for form, *_ in self.closed)

    @cached_property
    def jumps(self):
        """Times at which the torque may jump."""
        return np.unique([at for _, at, _ in self.closed if at <= self.duration])

    def windows(self, t):
        """The finest window of each time (n,)."""
        last = len(WINDOWS) - 1
        return np.maximum(last - np.searchsorted(self.duration / np.array(WINDOWS[::-1]), t * (1 - 1e-12)), 0)

    def inverted(self, own, t):
        """Signals (rows, n) at times t by one of both inversions, each time in its finest window."""
        y, place = np.zeros((len(PARTS), t.size)), self.windows(t)
        for n in set(place.tolist()):
            y[:, place == n] = interpolated(*own[n], t[place == n])
        return y

    def at(self, t, side=0.0):
        """Signals (rows, n) at times t, or just before or after them (`side` -1 or 1)."""
        t = np.asarray(t, float)
        y = self.inverted(self.smooth, t)
        near = t + side * 1e-15 * self.duration
        y[-1] += sum((w * each.at(near - at) for each, at, w in self.closed), np.zeros(t.size))
        return y

    @cached_property
    def curve(self):
        """Times, finer early, with both sides of each jump, and the signals there."""
        parts, start = [], 0.0
        for own, _ in self.smooth[::-1]:
            parts.append(own[own >= start])
            start = own[-1] * (1 + 1e-12)
        t = np.setdiff1d(np.concatenate(parts), self.jumps)
        sides = [(t, self.at(t)), *((self.jumps, self.at(self.jumps, side)) for side in (-1.0, 1.0))]
        every, y = np.concatenate([each for each, _ in sides]), np.hstack([each for _, each in sides])
        order = np.argsort(every, kind="stable")
        return every[order], y[:, order]

    def peak(self, row):
        """Time and value of the largest size, found between the grid's points."""
        t, y = self.curve
        n = int(abs(y[row]).argmax())
        best = t[n], y[row, n]
        if not np.isin(t[n], self.jumps):
            near = np.linspace(t[max(n - 1, 0)], t[min(n + 1, t.size - 1)], 201)
            fine = self.at(near)[row]
            k = int(abs(fine).argmax())
            best = max(best, (near[k], fine[k]), key=lambda pair: abs(pair[1]))
        return best

    def disagreement(self, t):
        """Differences of both inversions (rows, n) at times t, and the rounding of what is in closed form."""
        t = np.asarray(t, float)
        found = abs(self.inverted(self.second, t) - self.inverted(self.smooth, t))
        found[-1] += self.rounding(t)
        return found

    def rounding(self, t):
        """Error of the torque (n,) at times t by rounding of its closed forms."""
        return sum((abs(w) * each.rounding(t - at) for each, at, w in self.closed), np.zeros(t.size))


def interpolated(t, y, at):
    """Signals (rows, n) on an even grid, at other times, by six neighbours."""
    step = t[1]
    first = np.clip(np.floor(at / step).astype(int) - 2, 0, t.size - 6)
    x = at / step - first
    total = np.zeros((len(y), at.size))
    for j in range(6):
        weight = math.prod((x - i) / (j - i) for i in range(6) if i != j)
        total += weight * y[:, first + j]
    return total
