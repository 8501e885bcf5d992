"""Time responses of the exact loop in continuous time: sums of exponentials from its poles, and an inversion before.

An input is sum_i w_i e^{-s t_i} X(s), with X rational: at the actuator, X_u, or the reference X_k of a signal.  So

    y(t) = sum_i w_i (h_u(t - t_i) + h_k(t - t_i - tau)),    h(t) = 0 for t < 0,
    H_u(s) = N_y q X_u/D,    H_k(s) = N_y sum_k p_k X_k/D,    D = drive q + e^{-s tau} sum_k p_k N_k

with numerators N, law p_k/q and delay tau of `loop`: the reference acts through the law, tau later.

Late, h is the sum over the poles: h(t) = sum_m A_m e^{z_m t}.  The z_m are those of D, complete in a box, and those of
X.  Residues are trapezoidal sums on circles, which converge geometrically (Trefethen and Weideman, SIAM Review 56,
2014).  Poles that are closer than 1/T, T the duration, cancel in a sum of residues, as do those at s = 0: there the
terms are the nodes s_j of one circle around all of them, with H(s_j) (s_j - c)/n.

Early, poles left of the box have not decayed: those of a law, of its delay, and of overdamped bending.  There h has two
parts.  The direct one is the law's own response, of u to X_u or sum_k p_k X_k/q, and the share of u in a signal that
follows it at once: a rational function, with the jumps.  The rest is smoother, and inverted by `inversion`.

Bounds.  Early, the error of the inversion as measured.  At the end of that time the sum over the poles is compared with
it; from there on the difference decays at least as fast as the slowest pole outside the box, left of it or above.  Two
identities are checked at each run: h = 0 before its start (by `inversion`), and h(0+) = lim s H for s -> inf.  The
bounds are measured and no proofs.  Shear modes above the shear cut-off of a damped arm are not in them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from tfarm.arm.law import of_common_blocks
from tfarm.arrays import LEAST_SIZE, MACHINE_EPS, Complex, Real, Whole
from tfarm.errors import require
from tfarm.loop.continuous import FAR_RIGHT, ContinuousLoop, frequency_above_mode
from tfarm.loop.inversion import POINTS, Inversion, invert_transform
from tfarm.loop.poles import Poles, poles_below
from tfarm.records import frozen
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

# the input of the arm as a place of excitation, and as a signal
ACTUATOR = "actuator"
TORQUE = "torque"

Transform = Callable[[Complex], Complex]


@dataclass(frozen=True)
class Excitation:
    """Inputs sum_i w_i e^{-s t_i} X(s) of a loop: `inputs` are X by place, `poles` those of all X [1/s] but 0.

    A place is `ACTUATOR`, a signal whose reference it is, or a column of references of the law (with the minus of its
    sign).  `free` is a motion that is added to signals, and which the law feeds back.
    """

    inputs: Mapping[str, Transform]
    times: tuple[float, ...] = (0.0,)
    weights: tuple[float, ...] = (1.0,)
    poles: tuple[complex, ...] = ()
    free: Mapping[str, Transform] = field(default_factory=dict)


class Peak(NamedTuple):
    """Time [s] and value of a signal where it is largest in size, and bounds there and on the largest size of all."""

    time: float
    value: float
    bound: float
    most: float


@dataclass(frozen=True)
class DelayedResponse:
    """Response to an excitation with one delay [s]: h of each signal, (signals, n) at t >= 0.

    `late` are exponents and amplitudes (signals, m) of the poles, `direct` those of the direct response, `rests`
    inversions of what is left, the first to an early end.  `difference` (signals,) is the bound on the error of `late`
    at the end of the inversions, which decays with `slowest` [1/s]; `off` (signals,) that of h(0+), infinite where its
    limit is.
    """

    delay: float
    late: tuple[Complex, Complex]
    direct: tuple[Complex, Complex]
    rests: tuple[Inversion, ...]
    difference: Real
    slowest: float
    off: Real

    @property
    def end(self) -> float:
        """The end of the inversions [s]."""
        return self.rests[-1].end

    def late_sum(self, t: Real, starts: Real, weights: Real) -> Real:
        """Return the sum of w_i h(t - t_i) (signals, n) over ascending starts, of those with late terms alone.

        Between two starts all terms before are one sum, so that many starts take no longer than one.
        """
        z, amplitudes = self.late
        found = np.zeros((self.off.size, t.size))
        shares = 0.0 * z
        since = np.diff(starts, prepend=starts[0])
        later = np.append(starts[1:], math.inf)
        for start, step, weight, following in zip(starts, since, weights, later, strict=True):
            shares = shares * np.exp(z * step) + weight
            (here,) = np.nonzero((t >= start + self.end) & (t < following + self.end))
            for block in in_blocks(here):
                found[:, block] = _sum_terms((z, amplitudes * shares), t[block] - start)
        return found

    def early(self, t: Real) -> Real:
        """Return h by the inversions."""
        first, last = self.rests
        rest = np.where(t < first.end, first.values_at(t), last.values_at(t))
        return np.asarray(_sum_terms(self.direct, t) + rest)

    def errors(self, t: Real) -> Real:
        """Return the bound on the error of h."""
        first, last = self.rests
        early = np.where(t < first.end, first.errors_at(t), last.errors_at(t))
        early += np.where(np.isfinite(self.off), self.off, 0.0)[:, None]
        late = self.difference[:, None] * np.exp(self.slowest * np.maximum(t - self.end, 0))
        return np.where(t < self.end, early, late)


@frozen
class TimeResponse:
    """Signals over time by name, "torque" being the input; `parts` are the responses to the excitation by delay."""

    names: tuple[str, ...]
    excitation: Excitation
    poles: Poles
    parts: tuple[DelayedResponse, ...]

    @cached_property
    def starts(self) -> Real:
        """The times [s] at which signals may jump."""
        return np.unique([start + part.delay for start in self.excitation.times for part in self.parts])

    def at(self, t: Real, *, before: bool = False) -> Real:
        """Return the signals (signals, n) at times t [s], after a jump, or before it."""
        found = self._sum_parts(t, DelayedResponse.early, before=before)
        order = np.argsort(self.excitation.times, kind="stable")
        starts = np.array(self.excitation.times)[order]
        weights = np.array(self.excitation.weights)[order]
        for part in self.parts:
            found += part.late_sum(t - part.delay, starts, weights)
        return found

    def remainder(self, t: Real) -> Real:
        """Return the bound (signals, n) on the error of the signals at times t [s]."""
        return self._sum_parts(t, DelayedResponse.errors, np.abs, is_late=True)

    def _sum_parts(
        self,
        t: Real,
        h: Callable[[DelayedResponse, Real], Real],
        size: Callable[[float], float] = float,
        *,
        before: bool = False,
        is_late: bool = False,
    ) -> Real:
        """Return the sum of w_i h(t - t_i), the weights or their sizes, in blocks of times: `is_late` times too."""
        found = np.zeros((len(self.names), t.size))
        for part in self.parts:
            for time, weight in zip(self.excitation.times, self.excitation.weights, strict=True):
                start = time + part.delay
                last = math.inf if is_late else time + part.end
                later = np.flatnonzero((t > start if before else t >= start) & (t - part.delay < last))
                for block in in_blocks(later):
                    found[:, block] += size(weight) * h(part, t[block] - start)
        return found

    def peaks(self, t: Real) -> dict[str, Peak]:
        """Return the peak of each signal over a record of times `t`, and on both sides of its jumps.

        Intervals in which a signal may exceed the largest value found, as it bends there, are cut until none is left.
        The bound of a peak includes what they may hold, and the rounding of its value, 2.2e-16 of its size.  `most` is
        infinite of an impulse.
        """
        # of an interval
        cuts = 8
        # of a peak: less is rounding
        seen = 1e-13
        jumps = self.starts[self.starts <= t[-1]]
        t = _with_jumps(t, jumps)
        after = self.at(t)
        before = after.copy()
        at_jump = np.isin(t, jumps)
        before[:, at_jump] = self.at(t[at_jump], before=True)
        ends = np.array([t[:-1], t[1:]])
        y = np.array([after[:, :-1], before[:, 1:]])
        steps = np.diff(t)
        bends = abs(np.diff((y[1] - y[0]) / steps)) * 2 / (t[2:] - t[:-2])
        bends[:, at_jump[1:-1]] = 0.0
        more = _of_both(bends) * steps**2 / 4
        errors = self.remainder(t)
        errors = np.maximum(errors[:, :-1], errors[:, 1:])
        most = np.zeros(len(self.names))
        times = [ends.ravel()]
        values = [np.hstack([*y])]
        for most_open in (*[3000] * 8, 0):
            largest = abs(np.hstack(values)).max(axis=1, keepdims=True) + LEAST_SIZE
            is_seen = more > seen * largest
            could = abs(y).max(axis=0) + np.where(is_seen, more, 0.0)
            excess = np.where((could > largest) & is_seen, could / largest, 0.0).max(axis=0)
            is_open = np.argsort(-excess)[: min(most_open, np.count_nonzero(excess))]
            most = np.maximum(most, np.delete(could + errors, is_open, axis=1).max(axis=1, initial=0.0))
            every = np.linspace(ends[0, is_open], ends[1, is_open], cuts + 1)
            between = every[1:-1].ravel()
            inner = self.at(between)
            times.append(between)
            values.append(inner)
            whole = np.stack([y[0][:, is_open], *np.split(inner, cuts - 1, axis=1), y[1][:, is_open]], axis=1)
            more = np.hstack([*_of_both(abs(np.diff(whole, 2, axis=1))).swapaxes(0, 1)]) / 4
            y = np.array([np.hstack([*part.swapaxes(0, 1)]) for part in (whole[:, :-1], whole[:, 1:])])
            ends = np.array([every[:-1].ravel(), every[1:].ravel()])
            errors = np.tile(errors[:, is_open], cuts)
        return self._peaks_of(np.concatenate(times), np.hstack(values), most)

    def _peaks_of(self, t: Real, y: Real, most: Real) -> dict[str, Peak]:
        """Return the peak of each signal from its values (signals, n) at times t and a bound on its size between."""
        largest = (1 - 1e-14) * abs(y).max(axis=1, keepdims=True)
        # the first time of a constant
        places = np.where(abs(y) >= largest, t, math.inf).argmin(axis=1)
        time = t[places]
        value = y[:, places].diagonal()
        size = abs(value)
        bound = np.max([self.remainder(time).diagonal(), most - size, MACHINE_EPS * size], axis=0)
        most = size + bound
        for part in self.parts:
            most = np.where(np.isinf(part.off), math.inf, most)
        found = np.array([time, value, bound, most])
        return {name: Peak(*each) for name, each in zip(self.names, found.T.tolist(), strict=True)}

    def near_starts(self, end: float) -> Real:
        """Return times [s] up to an end at which the beginnings after each start are resolved."""
        shares = np.r_[np.geomspace(1e-6, 1, 300), np.linspace(0, 1, 700)]
        t = np.unique([start + part.end * shares for part in self.parts for start in self.starts])
        return t[t <= end]


def in_blocks(places: Whole) -> list[Whole]:
    """Return the places of times in blocks that are evaluated together: of 20,000, with 200 terms 64 MB."""
    return np.array_split(places, 1 + places.size // 20_000)


def _with_jumps(t: Real, jumps: Real) -> Real:
    """Return times and those of jumps, ascending, each once: those closer than 1e-10 of the record are one."""
    same_time = 1e-10
    t = np.union1d(t[abs(t[:, None] - jumps).min(axis=1, initial=math.inf) > same_time * t[-1]], jumps)
    return t[np.diff(t, append=math.inf) > same_time * t[-1]]


def _of_both(bends: Real) -> Real:
    """Return the larger value (rows, n, ...) of both ends of each interval (rows, n + 1, ...), 0 at the outer ones."""
    return np.maximum(np.insert(bends, 0, 0.0, axis=1), np.insert(bends, bends.shape[1], 0.0, axis=1))


def usual_poles(loop: ContinuousLoop, count: int = 80) -> Poles:
    """Return the poles of a response: those below a frequency with `count` flexible modes, complete in their box.

    Raises ConvergenceError where they are not complete.
    """
    seen = loop.under(of_common_blocks(loop.law))
    return replace(poles_below(seen, frequency_above_mode(loop.arm, count)), loop=loop)


def time_response(
    poles: Poles, names: tuple[str, ...], excitation: Excitation, duration: float
) -> TimeResponse:
    """Return the signals of these names and "torque" over `duration` [s] from the poles of the loop.

    Raises ParameterError for a loop that grows beyond a double.
    """
    # exponent of the fastest growing pole at the end of a record
    most_growth = 500.0
    growth = float(poles.values.real.max(initial=0.0)) * duration
    longest = most_growth * duration / max(growth, 1)
    remedy = f"the loop is unstable and grows by e^{growth:.0f}; at most {longest:.3g} s"
    require(growth < most_growth, "duration", duration, remedy)
    loop = poles.loop
    delay = loop.law.delay
    kinds = [(0.0, True, False), (delay, False, True)] if delay else [(0.0, True, True)]
    delayed = [(start, Transforms(loop, names, excitation, *which)) for start, *which in kinds]
    acting = [(start, each) for start, each in delayed if each.parts(each.far)[0].any()]
    parts = [_respond(poles, each, start, duration) for start, each in acting or delayed[:1]]
    return TimeResponse((*names, TORQUE), excitation, poles, tuple(parts))


@dataclass(frozen=True)
class Transforms:
    """H of the signals and the torque, its direct part and the rest, each (signals, n) at s (n,).

    `acts`: of inputs at the actuator and free motions.  `refers`: of references and of free motions that are fed back,
    without the factor e^{-s tau} of its delay.
    """

    loop: ContinuousLoop
    names: tuple[str, ...]
    excitation: Excitation
    acts: bool
    refers: bool

    @cached_property
    def far(self) -> Complex:
        """Places far right of all poles [1/s]."""
        fastest = abs(self.loop.law.poles).max(initial=first_frequency(self.loop.arm))
        return np.array(FAR_RIGHT, complex) * fastest

    @cached_property
    def shares(self) -> Real:
        """Limits of N/drive for s -> inf (signals, 1): the share that follows the torque at once, or 0."""
        drive, row = self._rig(self.far)
        ratio = np.array([row[name] for name in self.names]) / drive
        follows = abs(ratio[:, -1] - ratio[:, -2]) <= 1e-3 * abs(ratio[:, -1])
        return np.r_[np.where(follows, ratio[:, -1].real, 0.0), 1.0][:, None]

    def _rig(self, s: Complex) -> tuple[Complex, dict[str, Complex]]:
        """Return drive and numerators by name."""
        read = Signals(self.loop.arm, tuple(dict.fromkeys((*self.loop.law.signals, *self.names))))
        drive, numerators, _ = read.parts(s)
        return drive, dict(zip(read.names, numerators, strict=True))

    def parts(self, s: Complex) -> tuple[Complex, Complex, Complex]:
        """Return H, its direct part, and the rest."""
        law = self.loop.law
        excitation = self.excitation
        drive, row = self._rig(s)
        columns = (*law.signals, *law.wanted)
        parts, den = law.shares(s, columns)
        entries = dict(zip(columns, parts.sum(axis=0), strict=True))
        fed_back = np.exp(-s * law.delay) * sum(entries[name] * row[name] for name in law.signals)
        free = {name: motion(s) for name, motion in excitation.free.items()}
        driven = 0 * s
        for name, X in excitation.inputs.items():
            if name != ACTUATOR and self.refers:
                driven = driven + X(s) * entries[name]
            elif name == ACTUATOR and self.acts:
                driven = driven + X(s) * den
        if self.refers:
            for name in free.keys() & {*law.signals}:
                driven = driven - entries[name] * free[name]
        added = np.array([free.get(name, 0 * s) * self.acts for name in (*self.names, TORQUE)])
        rig = np.array([*(row[name] for name in self.names), drive])
        D = drive * den + fed_back
        whole = rig * driven / D + added
        direct = self.shares * driven / den + added
        rest = whole - direct
        # the same without cancellation
        rest[-1] = -driven * fed_back / (D * den)
        return whole, direct, rest


def _respond(poles: Poles, of: Transforms, start: float, duration: float) -> DelayedResponse:
    """Return the response to a part of the excitation."""
    left, _, _, top = poles.box
    own = np.array(of.excitation.poles, complex)
    known = np.r_[poles.values, own]
    edges = [*poles.loop.k.singular, left, 1j * top]
    most_close = 0.1 * first_frequency(poles.loop.arm)
    late = _terms(known, edges, most_close, lambda s: of.parts(s)[0], duration)
    exponents, _ = late
    slowest = float(exponents.real[exponents.imag > top / 2].max(initial=left))

    # 20 time constants of the poles outside the box; above it as well, or until frequencies up to four times its top
    decayed = 20.0
    resolved = 2 * np.pi * POINTS / (4 * 4 * top)
    end = max(decayed / -left, min(decayed / max(-slowest, LEAST_SIZE), resolved))
    growth = float(known.real.max(initial=0.0))
    # where an unstable pole has grown by e^10
    end = min(end, 10 / max(growth, LEAST_SIZE))
    # a first inversion ends 64 times sooner, for what begins as the root of time
    rests = tuple(invert_transform(lambda s: of.parts(s)[2], each, growth) for each in (end / 64, end))
    direct = _terms(np.r_[own, of.loop.law.poles], [], math.inf, lambda s: of.parts(s)[1], end)
    part = DelayedResponse(start, late, direct, rests, np.zeros(0), slowest, np.zeros(0))

    t = np.linspace(0.8 * end, end, 400)
    ends = _sum_terms(late, t)
    apart = abs(ends - part.early(t)) + rests[-1].errors_at(t)
    # s times the transform of the direct sum, right of its circles and far right, where it is h(0+)
    right = 10 / end + abs(of.loop.law.poles).max(initial=0.0)
    s = np.r_[right * np.array([1.0, 3.0]), of.far]
    _, at_once, after = of.parts(s)
    before, limit = abs((at_once + after) * s)[:, -2:].T
    z, amplitudes = direct
    transform = (amplitudes / (s[:, None, None] - z)).sum(axis=-1).T
    off = abs((at_once - transform).real * s).max(axis=1)
    off[(limit > 2 * before) & (limit > abs(ends).max(axis=1))] = math.inf
    return replace(part, difference=2 * apart.max(axis=1), off=off)


def _sum_terms(terms: tuple[Complex, Complex], t: Real) -> Real:
    """Return Re of the sum of the terms (signals, n) at times t [s]."""
    z, amplitudes = terms
    return np.asarray((amplitudes @ np.exp(np.outer(z, t))).real)


def _terms(
    known: Complex, edges: Sequence[complex], most_close: float, transform: Transform, duration: float
) -> tuple[Complex, Complex]:
    """Return exponents (m,) and amplitudes (signals, m) of poles and circles with Im >= 0, twice with a conjugate.

    Real edges bound circles on the real axis, imaginary ones at any place.
    """
    # poles closer than 3/T are one circle, but no farther apart than 0.1 of the first mode
    close = 3.0
    # of the least distance of two circles: by so little a centre is off the real axis
    on_axis = 1e-9
    every, count = np.unique(np.r_[0, known, known[known.imag != 0].conj()], return_counts=True)
    reach = min(close / duration, most_close)
    beyond = 2 * (abs(every).max() + 1 / duration)
    # a multiple pole that rounding has split
    alike = 0.01 * np.maximum(-np.maximum.outer(every.real, every.real), 0)
    _, label = connected_components(abs(every[:, None] - every) <= np.maximum(reach, alike))
    found = []
    for n in range(label.max() + 1):
        is_inside = label == n
        own = every[is_inside]
        c = complex(own.mean())
        if c.imag < -on_axis * reach:
            continue
        nearest = [complex(edge.real or c.real, edge.imag or c.imag) for edge in map(complex, edges)]
        room = float(abs(np.r_[every[~is_inside], nearest, beyond] - c).min())
        z, amplitudes = _circle(own, int(count[is_inside].sum()), c, room, transform, duration)
        found.append((z, 2.0 * amplitudes if c.imag > on_axis * reach else amplitudes))
    z, amplitudes = zip(*found, strict=True)
    return np.concatenate(z), np.hstack(amplitudes)


def _circle(
    own: Complex, order: int, c: complex, room: float, transform: Transform, duration: float
) -> tuple[Complex, Complex]:
    """Return the nodes of a circle around poles, to a distance of `room` from others; of a simple pole its residue."""
    # over T, of a circle around s = 0, on which e^{s T} is moderate; or times the extent of its poles
    slow_radius = 2.0
    # of the way to the next pole: radius of the circle of one pole
    pole_radius = 0.25
    # of the logarithm of what is left out: e^-40 is below the rounding
    node_log = 40.0
    most_nodes = 512
    is_simple = order == 1 and c != 0
    extent = float(abs(own - c).max())
    radius = pole_radius * room
    fewest_nodes = 32
    if not is_simple:
        fewest_nodes = 128
        # where e^{s t} does not grow
        moderate = max(slow_radius * max(extent, 1 / duration), -c.real / 2)
        radius = min(max(math.sqrt(extent * room), radius), moderate)
    ratio = max(extent / radius, radius / room)
    nodes = int(np.clip(-node_log / math.log(ratio), fewest_nodes, most_nodes))
    arrow = radius * np.exp(2j * np.pi * (np.arange(nodes) + 0.5) / nodes)
    values = transform(c + arrow) * arrow / nodes
    if is_simple:
        return own, values.sum(axis=1)[:, None]
    return c + arrow, values
