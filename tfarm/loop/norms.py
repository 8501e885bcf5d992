"""H-infinity norms of weighted S, K S and T at the samples, with upper bounds that hold between frequencies too.

    S = 1/(1 + L) = q/F,   K_i S = p_i/F for each signal i,   T = L/(1 + L) = (F - q)/F

with F, q and p_i as in `loop.circle`.  On an arc of the unit circle F and the numerators stay in discs about their
values in the middle: the radii are bounds on their slopes times half the length of the arc.  They contain every mode
of the band, those that decay within a sample by the moments of `loop.left_poles`.  The distance of F's disc from 0
bounds each ratio.  A weight is bounded by the distances of its zeros and poles from the arc.  Arcs whose bound exceeds
the largest value by more than the tolerance are halved.

Of an integrator in a weight, 1/s^m or 1/(z - 1)^m, the numerators have the power x^m of x = 1 - 1/z, or the norm is
infinite: |x/s| <= T sin(qT/2)/(qT/2) at the low end q of the arc, and |x| = |z - 1|.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import Chain
from tfarm.arm.weights import USUAL_WEIGHTS, Weights, weights_of
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.dsp.discretise import root_product
from tfarm.errors import require
from tfarm.exact.rationals import block_factors
from tfarm.loop.circle import Arcs, Circle, Discs, add_discs, power
from tfarm.loop.loop_margins import lowest
from tfarm.loop.sampled import OfLoop, Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.records import frozen
from tfarm.schema import At, Percent, Quantity

# of all weighted functions as one column
STACKED = "stacked"
TITLES = {"S": "W_S S", "KS": "W_KS K S", "T": "W_T T", STACKED: "stacked column"}


class NormBound(NamedTuple):
    """The norm of one weighted function of a loop: a value that it has, and a bound that it does not exceed."""

    function: Annotated[
        str, Quantity("function", help="weighted function of the closed loop, or all as a column")
    ]
    value: Annotated[float, Quantity("norm, at least", key="norm", help="largest value found")]
    omega: Annotated[
        float | None,
        Quantity("frequency", "rad/s", key="norm_at_rad_s", help="of this value; 0 for a limit at rest"),
    ]
    upper: Annotated[
        float | None,
        Quantity(
            "at most", key="upper_bound", help="upper bound at all frequencies; null where there is none"
        ),
    ]


@frozen
class LoopNorm(OfLoop):
    """H-infinity norms of the weighted functions of a sampled loop, by convention infinite unless it is stable.

    `bounds` has a row for each weight, and one for their column.  `arcs` is the number of arcs of the circle examined.
    """

    loop: Sampled
    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    certainty: Annotated[
        str,
        Quantity(
            "certainty", help="certified up to a frequency, or approximate, with the modes of the model"
        ),
    ]
    bounds: Annotated[
        list[NormBound],
        Quantity("weighted norms", first=True, help="norm of each weighted function, and of all"),
    ]
    arcs: Annotated[int, Quantity("arcs of the circle", help="arcs on which the functions were bounded")]

    @property
    def largest(self) -> NormBound:
        """The row of the largest norm, without that of the column."""
        return max((row for row in self.bounds if row.function != TITLES[STACKED]), key=lambda row: row.value)

    @property
    def norm(
        self,
    ) -> Annotated[At, Quantity("largest norm", help="largest value of all functions, at its frequency")]:
        """The largest value of any function."""
        return At(self.largest.value, self.largest.omega)

    @property
    def upper(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "largest norm, at most", key="upper_bound", help="upper bound on all functions at all frequencies"
        ),
    ]:
        """The largest bound on any function; None without one."""
        found = [row.upper for row in self.bounds if row.function != TITLES[STACKED]]
        return None if None in found else max(each for each in found if each is not None)

    @property
    def gap(
        self,
    ) -> Annotated[
        Percent | None,
        Quantity("largest gap", digits=2, help="of the bounds above the values, as a share of these"),
    ]:
        """The largest relative distance of a bound from its value; None without bounds and of an unstable loop."""
        if self.upper is None or math.isinf(self.upper):
            return None
        return Percent(max((row.upper or 0.0) / max(row.value, LEAST_SIZE) - 1 for row in self.bounds))

    @property
    def is_certified(
        self,
    ) -> Annotated[
        bool, Quantity(key="certified", help="whether the upper bounds hold for every mode of the range")
    ]:
        """Whether the bounds hold for every mode of the range."""
        return self.upper is not None


# ------------------------------------------------------------ values


def weighted_sizes(L: Complex, K: Complex | None, sizes: Mapping[str, Real]) -> dict[str, Real]:
    """Return the sizes (laws, m) of each weighted function, and of their column as `STACKED`.

    L (laws, m) are loop functions, K (laws, signals, m) controllers, `sizes` (m,) those of the weights by name
    (`weight_sizes`).  The norms on the grid are their largest values along the last axis.  K may be None without a
    weight on K S.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        S = 1 / (1 + L)
        T = np.where(np.isfinite(L), L * S, 1.0)
    found = {}
    for name, size in sizes.items():
        if name == "S":
            own = abs(S)
        elif name == "T":
            own = abs(T)
        else:
            assert K is not None
            own = np.linalg.norm(K, axis=-2) * abs(S)
        found[name] = own * size
    return found | {STACKED: np.linalg.norm([*found.values()], axis=0)}


def controller_entries(loop: Sampled, omega: Real) -> Complex:
    """Return the entries K_i (signals, m) of the law in z at frequencies [rad/s]."""
    delta = np.expm1(1j * omega * loop.period)
    found = np.zeros((len(loop.in_z.signals), omega.size), complex)
    for part, row, gain, zeros in loop.in_z.terms:
        found[row] += loop.weights[part] * gain * root_product(delta, zeros)
    return found / root_product(delta, loop.in_z.poles)


def weight_sizes(weights: Weights, omega: Real, period: float | None) -> dict[str, Real]:
    """Return each weight's size at frequencies (m,) [rad/s], at the samples of a period [s] or in continuous time.

    Raises ParameterError for an unstable weight, and for one in z of another period.
    """
    return {name: each.size(omega) for name, each in _roots_of(weights, period).items()}


def _largest(loop: Sampled, weights: Mapping[str, WeightRoots]) -> tuple[Real, Real]:
    """Return the largest values of the weighted functions on a grid that resolves the loop, refined, and their places.

    The place of a limit at rest is 0.
    """
    names = [*weights, STACKED]

    def values(omega: Real) -> dict[str, Real]:
        L = loop.loop_function(1j * omega)
        sizes = {name: each.size(omega) for name, each in weights.items()}
        return weighted_sizes(L, controller_entries(loop, omega), sizes)

    def inverse(name: str) -> Callable[[Real], Real]:
        return lambda omega: 1 / np.maximum(values(omega)[name], LEAST_SIZE)

    omega = np.append(loop.rig.grid.q, np.pi) / loop.period
    # a maximum is flat: its place has fewer digits
    places = np.array([float(f"{lowest(inverse(name), omega)[1]:.7g}") for name in names])
    found = values(places)
    largest = np.array([found[name][n] for n, name in enumerate(names)])
    first = values(omega[:1])
    is_at_rest = [first[name][0] >= (1 - 1e-9) * most for name, most in zip(names, largest, strict=True)]
    return largest, np.where(is_at_rest, 0.0, places)


# ------------------------------------------------------------ bounds


class WeightRoots(NamedTuple):
    """|W| = gain prod|s - zeros|/prod|s - poles|, of s = iq/T or z = e^{iq}; `integrators` poles are at rest, apart."""

    gain: float
    zeros: Complex
    poles: Complex
    integrators: int
    period: float
    is_discrete: bool

    def size(self, omega: Real) -> Real:
        """Return |W| at frequencies (n,) [rad/s]."""
        q = omega * self.period
        x = 2 * np.sin(q / 2) if self.is_discrete else omega
        return np.asarray(self._most_ratio(q, q) / x**self.integrators)

    def most(self, low: Real, high: Real) -> Real:
        """Return the largest |W x^m| on arcs (n,) of the circle, m the number of integrators."""
        ratio = self._most_ratio(low, high)
        if self.is_discrete:
            return ratio
        return np.asarray(ratio * (self.period * np.sinc(low / (2 * np.pi))) ** self.integrators)

    def _most_ratio(self, low: Real, high: Real) -> Real:
        """Return the largest gain prod|s - zeros|/prod|s - poles| on arcs, by each root's own distance."""
        _, far = self._distances(self.zeros, low, high)
        near, _ = self._distances(self.poles, low, high)
        return np.asarray(self.gain * far.prod(axis=0) / near.prod(axis=0))

    def _distances(self, roots: Complex, low: Real, high: Real) -> tuple[Real, Real]:
        """Return the least and the largest distance (roots, arcs) of roots from arcs."""
        r = roots[:, None]
        if self.is_discrete:
            # the nearest and the farthest point of the circle, or the end next to it
            angle = np.angle(r)
            inside = [np.clip(each, low, high) for each in (angle, angle + np.pi)]
            points = np.exp(1j * np.array([*np.broadcast_arrays(low, high, *inside)]))
        else:
            inside = [np.clip(r.imag * self.period, low, high)]
            points = 1j * np.array([*np.broadcast_arrays(low, high, *inside)]) / self.period
        away = abs(points - r)
        return away.min(axis=0), away.max(axis=0)


def _roots_of(weights: Weights, period: float | None) -> dict[str, WeightRoots]:
    """Return each weight by its roots.  Raises ParameterError for an unstable one, and for one of another period."""
    # of a weight in s in continuous time: s = iq
    T = period or 1.0
    is_discrete = weights.period is not None
    if weights.period is not None:
        remedy = f"the period of the loop is {T:g} s; make them equal"
        require(math.isclose(weights.period, T, rel_tol=1e-9), "weights.period", weights.period, remedy)
    found = {}
    for name, block in weights.blocks.items():
        poles, ((gain, zeros),) = block_factors(block, "none" if is_discrete else "s", T, 0.0)
        # in z they are given less 1
        shift = int(is_discrete)
        own = poles[poles != 0] + shift
        is_stable = abs(own) < 1 if is_discrete else own.real < 0
        remedy = "poles of a weight are stable, or integrators"
        require(is_stable.all(), f"weights.{name}", [f"{each:.6g}" for each in own[~is_stable]], remedy)
        integrators = poles.size - own.size
        found[name] = WeightRoots(abs(gain), zeros + shift, own, integrators, T, is_discrete)
    return found


# power of x, and disc without it, of each term of a sum
TermSum = list[tuple[int, Discs]]


def _add_terms(x: Discs, terms: TermSum, less: int) -> Discs:
    """Return the sum of terms over x^less."""
    return add_discs(power(x, order - less) * disc for order, disc in terms)


def _numerators(circle: Circle, law: Sequence[float], arcs: Arcs, parts: Discs) -> dict[str, list[TermSum]]:
    """Return q of S, the sum of p_i H_i of T, and each signal's p_i of K S."""
    own, *fed_back = circle.used_terms(law)
    by_signal: dict[int, TermSum] = {}
    for each in fed_back:
        zeros = circle.terms[each.part - 1][3]
        order = each.order + circle.orders[each.signal]
        term = circle.law_term(arcs, zeros).times(each.factor)
        by_signal.setdefault(each.signal, []).append((order, term))
    through = [(each.order, parts[each.part].times(each.factor)) for each in fed_back]
    return {
        "S": [[(own.order, parts[own.part].times(own.factor))]],
        "KS": [*by_signal.values()],
        "T": [through] if through else [],
    }


def _bounds(
    circle: Circle,
    law: Sequence[float],
    weights: Mapping[str, WeightRoots],
    low: Real,
    high: Real,
    parts: Discs,
) -> tuple[Real, Real]:
    """Return upper bounds (functions, arcs) on arcs, and values in their middles; the last row is that of the column.

    Raises ParameterError for a weight with which a norm is infinite.
    """
    # of sums and products of discs
    rounding = 1e-12
    middle = (low + high) / 2
    numerators = _numerators(circle, law, Arcs(middle, (high - low) / 2), parts)
    x = parts[0]
    F = add_discs(_add_terms(x, terms, 0) for name in ("S", "T") for terms in numerators[name])
    uppers = []
    values = []
    for name, weight in weights.items():
        order = min((order for terms in numerators[name] for order, _ in terms), default=weight.integrators)
        remedy = "the norm is infinite: the function is not 0 at rest; give a stable pole"
        require(order >= weight.integrators, f"weights.{name}", "integrator", remedy)
        tops = [_add_terms(x, terms, weight.integrators) for terms in numerators[name]]
        most = np.sqrt(sum(((abs(each.middle) + each.radius) ** 2 for each in tops), 0 * low))
        size = np.sqrt(sum((abs(each.middle) ** 2 for each in tops), 0 * low))
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = weight.most(low, high) * most / np.maximum(abs(F.middle) - F.radius, 0.0)
            value = weight.most(middle, middle) * size / abs(F.middle)
        uppers.append(np.where(most == 0, 0.0, bound) * (1 + rounding))
        values.append(np.where(np.isfinite(value), value, 0.0))
    return _with_column(uppers), _with_column(values)


def _with_column(rows: Sequence[Real]) -> Real:
    """Return rows (functions, n), and the root of the sum of their squares as the last one."""
    return np.vstack([*rows, np.linalg.norm(rows, axis=0)])


def _bounded(
    circle: Circle,
    law: Sequence[float],
    weights: Mapping[str, WeightRoots],
    largest: tuple[Real, Real],
    tolerance: float,
) -> tuple[Real, Real, Real, int]:
    """Return the largest values, their places, upper bounds on the whole circle (functions,), and the number of arcs.

    `largest` are values and places [rad/s] to begin with.  Arcs are halved until no bound exceeds the largest value of
    its function by more than the tolerance; the bounds of a search that takes too many hold too.
    """
    # more of them take seconds
    most_arcs = 150_000
    low = circle.low
    high = circle.high
    parts = circle.parts
    least, place = largest
    upper = np.zeros(least.size)
    number = 0
    while low.size:
        number += low.size
        bounds, values = _bounds(circle, law, weights, low, high, parts)
        best = values.argmax(axis=1)
        found = values.max(axis=1)
        # by less it is the same peak, to rounding
        is_higher = found > (1 + 1e-9) * least
        place = np.where(is_higher, (low + high)[best] / (2 * circle.loop.period), place)
        least = np.maximum(least, found)
        excess = (bounds / np.maximum(least, LEAST_SIZE)[:, None]).max(axis=0) - 1
        # a bound is rounded up later
        is_done = (excess <= 0.99 * tolerance) | (number > most_arcs)
        upper = np.maximum(upper, bounds[:, is_done].max(axis=1, initial=0.0))
        low = low[~is_done]
        high = high[~is_done]
        middle = (low + high) / 2
        low, high = np.r_[low, middle], np.r_[middle, high]
        parts = circle.parts_on(low, high)
    return least, place, upper, number


def _round_up(value: float, digits: int = 6) -> float:
    """Return the next larger number of so few digits as are printed."""
    if not value:
        return value
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / unit) * unit:.{digits}g}")


def norm(
    arm: Arm,
    law: AnyLaw,
    chain: Chain | None = None,
    *,
    weights: Mapping[str, Any] | Weights | None = None,
    tolerance: float = 1e-3,
) -> LoopNorm:
    """Return the H-infinity norms of the weighted S, K S and T of the sampled loop, with certified upper bounds.

    S = 1/(1 + L), T = L/(1 + L), and K S has an entry for each signal that the controller reads.

    Parameters
    ----------
    arm
        Of `tfarm.load`.
    law
        A `HubFeedback` or a `Law`.
    chain
        Sampling, converters and actuator, 10 ms and ideal unless given.
    weights
        Of S, KS and T, each an entry as of a `Law`: {"S": ([0.5, 2.0], [1.0, 0.02]), "KS": 0.1}.  By default S and T
        have the weight 1: their norms are Ms and Mt.
    tolerance
        Largest relative distance of the upper bound from the largest value, 1e-5 or more.

    Returns
    -------
    LoopNorm
        Norm and upper bound of each weighted function, and of all as one column.

    Raises
    ------
    ParameterError
        For unstable weights, weights with which a norm is infinite, and as `tfarm.sampled` does.

    References
    ----------
    S. Skogestad and I. Postlethwaite, Multivariable Feedback Control, 2nd edition, Wiley, 2005, section 2.8.
    P. Apkarian and D. Noll, "Structured H-infinity control of infinite-dimensional systems", Int. J. Robust and
    Nonlinear Control 28 (2018).
    """
    # of upper bounds, which are printed with 6 digits
    require(1e-5 <= tolerance < 1, "tolerance", tolerance, "a number from 1e-5 to below 1")
    wanted = weights_of(USUAL_WEIGHTS if weights is None else weights)
    verdict = sampled_verdict(Case(arm, law, chain))
    loop = verdict.full
    roots = _roots_of(wanted, loop.period)
    names = [TITLES[each] for each in (*roots, STACKED)]
    if not verdict.is_stable:
        bound = None if verdict.band is None else math.inf
        rows = [NormBound(name, math.inf, None, bound) for name in names]
        return LoopNorm(loop, verdict.word, verdict.holds_for, rows, 0)
    values, places = _largest(loop, roots)
    uppers = np.full(len(names), np.inf)
    number = 0
    if verdict.band is not None:
        start = values, places
        values, places, uppers, number = _bounded(
            verdict.band.fine_circle, loop.weights, roots, start, tolerance
        )
    certainty = verdict.holds_for
    if not np.isfinite(uppers).all():
        certainty = f"approximate, the largest values of a grid; {certainty}"
    rows = [
        NormBound(name, value, place, _round_up(upper) if math.isfinite(upper) else None)
        for name, value, place, upper in zip(
            names, values.tolist(), places.tolist(), uppers.tolist(), strict=True
        )
    ]
    return LoopNorm(loop, verdict.word, certainty, rows, number)
