"""Number of poles of a sampled loop outside the unit circle, certified between the points of the circle too.

With x = 1 - 1/z, a_j = e^{p_j (1-f) T} and b_j = e^{p_j T} the pulse transfer function of the plant is

    H(z) = z^-d [ g0/z + sum over poles of (r_j/p_j) (a_j - 1 + (b_j - a_j)/z)/(z - b_j) + rigid terms in 1/x ]

g0 is the finite part of G at s = 0 of what is not in the sum.  A pole is its share -r_j/p_j of g0 and
x (r_j/p_j) a_j/(z - b_j), which is nothing of a pole that has settled before the sample.  The slow pole p of a braked
hub and the integral of its rate, R/s - R/(s - p) of the angle with R = 1/b large, nearly cancel, and are taken as one:

    x H(z) = -R p (c0 + c1/z + c2/z^2)/(z - e^{pT}),  c0 = t^2 phi(p t), t = (1 - f) T,
    c2 = (f T)^2 e^{pT} phi(-p f T),  c0 + c1 + c2 = T (e^{pT} - 1)/p,  phi(u) = (e^u - 1 - u)/u^2

With n the order of the law, q and p_i its polynomials in z, and H_i x^{n_i} as above,

    x^k F z^-n = q z^-n x^k + sum over signals of p_i z^-n x^{k - n_i} (H_i x^{n_i})

is analytic on the circle and outside, and no pole of the law is one of it: its zeros outside are the unstable poles.
Of a root r the factor (z - r)/z is r x + 1 - r.  Factors that are x, as of an integrator or a difference, are taken
together, and so are those that all terms have in common.

On an arc it stays in a disc about its value in the middle, for 1/(z - b) changes by h/(|z - b| (|z - b| - h)) at most
over h.  Where no disc contains 0, the phase between neighbouring middles is certain, and half the circle gives the
count (the argument principle).  Arcs whose disc contains 0 are cut.

In a band of the arm a modal model has every pole that does not decay within a sample: to the right of a line Re s = -c
and below Im s = top, the argument principle for the exact arm counts as many poles as the model has there.  All others
of the band lie left of the line, also the real ones that accumulate at -1/C: by Cauchy they add

    x sum of (r/p) a/(z - b) = x/(2 pi i) times the integral over the edge of  G(s)/s e^{s (1-f) T}/(z - e^{sT}) ds

to a pulse transfer function (letters as above), the edge being that line and the two that lead from its ends to
Re s = -inf.  So its absolute values bound them on the whole unit circle.  Beyond the band stability is not determined:
there the undamped shear of this model has poles arbitrarily near to the imaginary axis.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.dsp.pulse import phi
from tfarm.errors import ConvergenceError
from tfarm.loop.left_poles import LeftResponse, bound_left_of, filter_bound, left_response
from tfarm.loop.sampled import Sampled, with_more_modes
from tfarm.records import frozen
from tfarm.spectrum import modes
from tfarm.spectrum.box import TOWARD_SINGULAR, Box, winding_number
from tfarm.spectrum.naming import function_of


@frozen
class Discs:
    """Discs in the complex plane, `middle` and `radius` arrays of one shape: results contain those of every point."""

    middle: Complex
    radius: Real

    def __add__(self, other: Discs) -> Discs:
        return Discs(self.middle + other.middle, self.radius + other.radius)

    def __mul__(self, other: Discs) -> Discs:
        mine = abs(self.middle) + self.radius
        theirs = abs(other.middle)
        return Discs(self.middle * other.middle, mine * other.radius + theirs * self.radius)

    def times(self, factor: complex) -> Discs:
        """Return every disc times a number."""
        return Discs(self.middle * factor, self.radius * abs(factor))

    def __getitem__(self, row: int) -> Discs:
        """Return the discs of one row."""
        return Discs(self.middle[row], self.radius[row])


class Arcs(NamedTuple):
    """Arcs of the circle: their `middle` angles and `half` lengths [rad]."""

    middle: Real
    half: Real

    @property
    def x(self) -> Discs:
        """1 - 1/z."""
        return Discs(-np.expm1(-1j * self.middle), self.half + MACHINE_EPS)

    def inverse_power(self, n: int) -> Discs:
        """Return z^-n."""
        return Discs(np.exp(-1j * n * self.middle), n * (self.half + 4 * MACHINE_EPS))

    def polynomial(self, *coefficients: float) -> Discs:
        """Return the sum of coefficients times z^-n, from n = 0 on."""
        return add_discs(self.inverse_power(n).times(each) for n, each in enumerate(coefficients))


class UsedTerm(NamedTuple):
    """A term of a loop's F under some weights: its row among `Circle.parts`, signal (-1 of q), factor, power of x."""

    part: int
    signal: int
    factor: float
    order: int


@dataclass
class Circle:
    """The upper half of the unit circle in arcs, and on each the terms of a loop's F; its weights do not matter.

    `missing` (signals,) bounds |x sum over poles left out|.  `low` and `high` [rad] are the ends of the arcs, `parts`
    the discs (1 + terms, arcs) of x and of the terms of F z^-n without their `powers` of x; `first_arcs` are cut as
    counts need it.  With the response of the poles `left` of the line `missing` bounds the others.
    """

    loop: Sampled
    kept: NDArray[np.bool_]
    missing: Real
    first_arcs: int = 64
    left: LeftResponse | None = None
    low: Real = field(init=False)
    high: Real = field(init=False)
    parts: Discs = field(init=False)

    def __post_init__(self) -> None:
        ends = np.linspace(0.0, np.pi, self.first_arcs + 1)
        self.low = ends[:-1]
        self.high = ends[1:]
        self.parts = self.parts_on(self.low, self.high)

    def count(self, weights: Sequence[float]) -> int | None:
        """Return the number of poles outside the circle under these weights, without z = 1 of a free angle.

        None if it is not certified.
        """
        # rad: no arc is cut further, as its ends are known to a few last bits
        shortest_arc = 1e-13
        # a loop that takes more is not shown
        most_arcs = 60_000
        # into which an arc is cut that is too long
        pieces = 4
        while True:
            F = self.characteristic(weights)
            rough = ~(abs(F.middle) > F.radius)
            if not rough.any():
                steps = np.angle(F.middle[1:] / F.middle[:-1])
                start, end = map(_angle_to_axis, np.angle(F.middle[[0, -1]]))
                return -round(float(steps.sum() + start - end) / np.pi)
            width = self.high[rough] - self.low[rough]
            if width.min() < shortest_arc or (pieces - 1) * rough.sum() + rough.size > most_arcs:
                return None
            self._cut(rough, pieces)

    # ------------------------------------------------------------ the characteristic function

    @cached_property
    def terms(self) -> list[tuple[int, int, float, Complex]]:
        """Part, row of the signal, gain and roots less 1 of q (part and row -1) and of each p_i."""
        return [(-1, -1, 1.0, self.loop.in_z.poles), *self.loop.in_z.terms]

    @cached_property
    def orders(self) -> list[int]:
        """The order at z = 1 of each signal's pulse transfer function, and 0 of q."""
        return [*(2 if twice else int(once != 0.0) for twice, once in self.loop.plant.rigid), 0]

    def characteristic(self, weights: Sequence[float]) -> Discs:
        """Return x^k F z^-n on every arc, k the least that leaves no pole at z = 1."""
        x = self.parts[0]
        used = self.used_terms(weights)
        return add_discs((power(x, each.order) * self.parts[each.part]).times(each.factor) for each in used)

    def used_terms(self, weights: Sequence[float]) -> list[UsedTerm]:
        """Return the terms of x^k F z^-n under these weights, that of q first."""
        row = (*weights, 1.0)
        found = []
        for n, (part, signal, gain, roots) in enumerate(self.terms, start=1):
            factor = row[part] * gain
            if factor:
                order = int((roots == 0).sum()) - self.orders[signal]
                found.append(UsedTerm(n, signal, factor, order))
        least = min(each.order for each in found)
        return [each._replace(order=each.order - least) for each in found]

    def law_term(self, arcs: Arcs, roots: Complex) -> Discs:
        """Return prod(z - r) z^-n of a term's roots, less 1 given, without its powers of x."""
        late = self.loop.in_z.poles.size - roots.size
        return root_ratio(arcs.x, roots[roots != 0]) * arcs.inverse_power(late)

    def parts_on(self, low: Real, high: Real) -> Discs:
        """Return x, and the terms of F z^-n without powers of x, on arcs."""
        arcs = Arcs((low + high) / 2, (high - low) / 2)
        late = arcs.inverse_power(1)
        sums = self.pole_sums(arcs, self.weights)
        n = len(self.orders) - 1
        signals = [self._output(row, arcs, sums[row] + sums[n + row] * late, sums[-1]) for row in range(n)]
        found = [arcs.x]
        for _, row, _, roots in self.terms:
            term = self.law_term(arcs, roots)
            found.append(term if row < 0 else term * signals[row])
        return Discs(np.array([each.middle for each in found]), np.array([each.radius for each in found]))

    def _output(self, row: int, arcs: Arcs, of_poles: Discs, pair: Discs) -> Discs:
        """Return x^n times an output's pulse transfer function, n its order at z = 1, from the sums over the poles."""
        plant = self.loop.plant
        pulse = self.loop.pulse
        sampling = pulse.sampling
        order = self.orders[row]
        twice, once = plant.rigid[row]
        x = arcs.x
        late = arcs.inverse_power(1)
        at_rest = float(plant.static[row] - (plant.residues[row] / plant.poles)[~self.kept].real.sum())
        finite = of_poles + late.times(at_rest) + Discs(0 * x.middle, self.missing[row])
        if self.left is not None:
            finite = finite + x * late * arcs.polynomial(*self.left.moments[row])
        total = power(x, order) * finite
        push = arcs.polynomial(sampling.remaining, sampling.late) * late
        # then there is no 1/s: an arm that turns freely has no friction at the hub
        if order == 2:
            ramps = x * arcs.polynomial(*pulse.ramps)
            total = total + (push.times(sampling.period) + ramps).times(twice) * late
        elif order == 1:
            rate = push if self.slow_hub_pole is None else pair * self._slow_hub_pair(arcs)
            total = total + rate.times(once)
        return total * arcs.inverse_power(sampling.whole_delay)

    # ------------------------------------------------------------ arcs

    def _cut(self, rough: NDArray[np.bool_], pieces: int) -> None:
        """Cut some arcs into pieces."""
        ends = np.linspace(self.low[rough], self.high[rough], pieces + 1)
        low = ends[:-1].ravel()
        high = ends[1:].ravel()
        new = self.parts_on(low, high)
        order = np.argsort(np.r_[self.low[~rough], low])

        def merge(old: Any, new: Any) -> Any:
            return np.concatenate([old[..., ~rough], new], axis=-1)[..., order]

        self.low = merge(self.low, low)
        self.high = merge(self.high, high)
        self.parts = Discs(merge(self.parts.middle, new.middle), merge(self.parts.radius, new.radius))

    @cached_property
    def weights(self) -> Complex:
        """Numerators of sums over the poles of weight/(z - b), (2 signals + 1, poles); 0 of those left out.

        (r/p) (a - 1), and (r/p) (b - a) that is to be multiplied by 1/z; and -p of a braked hub.
        """
        plant = self.loop.plant
        sampling = self.loop.chain.sampling
        p = plant.poles
        late = sampling.late
        early = p * (sampling.period - late)
        is_braked = np.arange(p.size) == (-1 if self.slow_hub_pole is None else self.slow_hub_pole)
        # the rest is in `_slow_hub_pair`
        share = (plant.residues + np.outer(plant.rigid[:, 1], is_braked)) / p
        now = np.expm1(early)
        before = np.exp(early) * np.expm1(p * late)
        of_kept = np.where(self.kept, [share * now, share * before], 0.0)
        return np.vstack([*of_kept, np.where(is_braked, -p, 0.0)])

    @cached_property
    def slow_hub_pole(self) -> int | None:
        """The pole of a hub that friction brings to rest, if it is slow and kept; else None."""
        found = self.loop.plant.slow_hub_pole(self.loop.chain.sampling.period)
        return found if found is not None and self.kept[found] else None

    def _slow_hub_pair(self, arcs: Arcs) -> Discs:
        """Return c0 + c1/z + c2/z^2: x times the pulse transfer function of 1/s - 1/(s - p), over -p/(z - e^{pT})."""
        T = self.loop.chain.sampling.period
        late = self.loop.chain.sampling.late
        early = T - late
        p = float(self.loop.plant.poles[self.slow_hub_pole].real)
        first = early**2 * phi(p * early)
        last = late**2 * np.exp(p * T) * phi(-p * late)
        middle = T * np.expm1(p * T) / p - first - last
        return arcs.polynomial(first, middle, last)

    def pole_sums(self, arcs: Arcs, weights: Complex) -> Discs:
        """Return the sums over the poles p of the plant of weight/(z - b) on arcs: discs (weights, arcs)."""
        # distance from the circle of a pole on it: its disc is wide, and contains 0
        on_it = 1e-100
        p = self.loop.plant.poles
        T = self.loop.chain.sampling.period
        b = np.exp(p * T)
        room = np.maximum(-np.expm1(p.real * T), on_it)
        blur = MACHINE_EPS * (4 + abs(p * T))
        middles = []
        radii = []
        # terms 1/(z - b) at a time, lest they leave the cache
        for some in np.array_split(np.arange(arcs.half.size), 1 + arcs.half.size * p.size // 2**19):
            away = np.exp(1j * arcs.middle[some])[:, None] - b
            h = arcs.half[some][:, None]
            away = np.where(away == 0, on_it, away)
            near = 1 / abs(away)
            least = 1 / np.maximum(1 / near - h, room)
            change = np.minimum(h * near * least, near + least) + blur * near**2
            middles.append(weights @ (1 / away).T)
            radii.append(abs(weights) @ change.T)
        return Discs(np.concatenate(middles, axis=1), np.concatenate(radii, axis=1))


def add_discs(terms: Iterable[Discs]) -> Discs:
    """Return the sum of some discs."""
    return reduce(Discs.__add__, terms)


def power(x: Discs, n: int) -> Discs:
    """Return x^n."""
    one = Discs(np.ones_like(x.middle), np.zeros_like(x.radius))
    return reduce(Discs.__mul__, [x] * n, one)


def root_ratio(x: Discs, roots: Complex) -> Discs:
    """Return prod((z - r)/z) for x = 1 - 1/z in discs, each root r given as r - 1."""
    # of a factor of the law: of its root, of its middle, and of the products
    rounding = 8 * MACHINE_EPS
    middle = x.middle[:, None]
    slopes = abs(1 + roots)
    factors = middle * (1 + roots) - roots
    sizes = abs(factors)
    blur = rounding * (abs(middle) * slopes + abs(roots))
    most = (sizes + x.radius[:, None] * slopes + blur).prod(axis=1)
    radius = most - sizes.prod(axis=1) + rounding * (1 + roots.size) * most
    return Discs(factors.prod(axis=1), radius)


def _angle_to_axis(angle: float) -> float:
    """Return the angle of a value from the nearer half of the real axis."""
    return angle - np.pi * round(angle / np.pi)


@frozen
class Band:
    """The poles `kept` (poles,) of a loop's plant in a band up to `top` [rad/s].

    `missing` (outputs,) bounds the share of all other poles of that band in the pulse transfer functions, on the whole
    unit circle; they are left of Re s = -`line`.
    """

    loop: Sampled
    top: float
    kept: NDArray[np.bool_]
    missing: Real
    line: float

    @property
    def modes(self) -> int:
        """The last flexible mode in it, which need not be the fastest, as damping slows modes down unequally."""
        return int(self.loop.plant.mode[abs(self.loop.plant.poles.imag) < self.top].max(initial=0))

    @cached_property
    def full(self) -> Sampled:
        """The loop with all modes of the band, and at least one."""
        return with_more_modes(self.loop, max(1, self.modes))

    @cached_property
    def circle(self) -> Circle:
        """The unit circle, for counts of the poles outside."""
        return Circle(self.loop, self.kept, self.missing)

    @cached_property
    def fine_circle(self) -> Circle:
        """The unit circle with the response of the poles left of the line, for bounds that need more than a count."""
        left = left_response(self.loop, self.line, self.top)
        missing = left.error + filter_bound(self.loop, self.line)
        return Circle(self.loop, self.kept, missing, left=left)


def complete_band(loop: Sampled) -> Band | None:
    """Return the highest band in which the loop's plant is certified to be complete; None without one, as at C = 0."""
    plant = loop.plant
    sampling = loop.chain.sampling
    C = plant.arm.damping
    remaining = sampling.remaining
    if C == 0.0:
        return None
    # e^-30 = 1e-13 is left over a sample of the poles on the line
    line = min(TOWARD_SINGULAR / C, 30.0 / remaining)
    top = _highest_complete(loop, line)
    missing = None if top is None else bound_left_of(loop, line, top)
    if top is None or missing is None:
        return None
    kept = (plant.poles.real > -line) & (abs(plant.poles.imag) < top)
    return Band(loop, top, kept, missing + filter_bound(loop, line), line)


def _highest_complete(loop: Sampled, line: float) -> float | None:
    """Return the top of the highest box right of the line in which the exact arm has the plant's poles alone."""
    plant = loop.plant
    function = function_of(modes(plant.model.arm, 1).system)
    poles = np.r_[plant.poles[(plant.mode > 0) | (plant.poles.imag != 0)], plant.model.single]
    poles = poles[poles.real > -line]

    def is_complete(top: float) -> bool:
        box = Box(-line, line, -top, top)
        try:
            return winding_number(function, box) == int(box.holds(poles).sum())
        except ConvergenceError:
            return False

    heights = np.r_[0.0, np.sort(poles.imag[poles.imag > 0])]
    # 1.02 times the last pole of the model: all of them are in that box
    tops = [*((heights[1:] + heights[:-1]) / 2).tolist(), float(1.02 * heights[-1] or line)]
    if is_complete(tops[-1]):
        # times the last pole of the model: heights up to which there may be no other
        higher = (2.0, 8.0, 32.0, 128.0, 512.0)
        return tops[-1] * max([1.0, *takewhile(lambda factor: is_complete(factor * tops[-1]), higher)])
    number = bisect_left(tops[:-1], True, key=lambda top: not is_complete(top))
    return tops[number - 1] if number else None
