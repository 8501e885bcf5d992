"""Structures of a law: its entries as functions of free coefficients, each with a scale and bounds of its own.

A structure is one function under `@structure(name, formula)`: the table of the documentation, the refusal of another
name and the tests follow from `STRUCTURES`.  In the formulas N(s) = (s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2), and M
is the root moment; g and K2 are of either sign.  Kp is fixed: it gives the speed of the angle, sqrt(Kp/J), and all
objectives are best at small Kp.  Signals enter less their references.
Most objectives are best without an integral, so Ki has a lower limit, Kp sqrt(Kp/J)/10.  PI alone stabilises no rigid
hub without friction: the roots of J s^3 + Kp s + Ki have the sum 0.
A pole faster than 2/T rings when discretised by Tustin's rule: there the search ends.

A coefficient is c = unit sinh(x), x the coordinate of the search: linear below its unit and logarithmic above.  So a
positive one, far above its unit, is searched by decades, and one of either sign through 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import ANGLE_GAIN, PLANE, TWO_GAINS, AnyLaw, Arm, HubFeedback, Law, must_not_be_algebraic
from tfarm.arrays import Real
from tfarm.errors import must_be_known, require
from tfarm.loop.continuous import frequency_above_mode
from tfarm.records import frozen
from tfarm.spectrum import modes as natural_modes
from tfarm.spectrum.gains import check_gains, rate_unit, turning_inertia
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.anti_windup import with_anti_windup
from tfarm.synthesis.observer import filter_gain, held_model, integral_feedback, observer_law

Bounds = tuple[float, float]

# of bounds: the place of a coefficient, and its lower (0) or upper end (1)
Ends = list[tuple[int, int]]

# of the usual size: the unit of a positive coefficient
LOGARITHMIC = 1e-8
# of the gains of a law that was found: as many as a person types
TYPED_DIGITS = 6
# of a coefficient's usual size, up and down: its first bounds
REACH = np.exp(4.0)


class Entry(NamedTuple):
    """Entry of a law for a signal: polynomials in s, descending, (degree + 1, laws); proper, a gain without `den`."""

    signal: str
    num: Real
    den: Real = np.ones((1, 1))

    def of_laws(self, laws: Any) -> Entry:
        """Return the entry of some of the laws; a polynomial that is common to all laws stays."""

        def of(polynomial: Real) -> Real:
            return polynomial if polynomial.shape[1] == 1 else polynomial[:, laws]

        return Entry(self.signal, of(self.num), of(self.den))


class Coefficient(NamedTuple):
    """A free coefficient: its name, `unit` of its scale, first bounds, physical `ends`, and a sensible `start`."""

    name: str
    unit: float
    bounds: Bounds
    ends: Bounds
    start: float


def positive_coefficient(name: str, start: float, most: float = np.inf, reach: float = REACH) -> Coefficient:
    """Return a coefficient above 0, at most `most`, of the usual size `start`."""
    bounds = (start / reach, min(start * reach, most))
    return Coefficient(name, LOGARITHMIC * start, bounds, (0.0, most), start)


def signed_coefficient(name: str, size: float) -> Coefficient:
    """Return a coefficient of either sign and this usual size; 0 is its start."""
    most = REACH * size
    return Coefficient(name, size, (-most, most), (-np.inf, np.inf), 0.0)


@frozen
class Structure:
    """A law with `free` coefficients, and `fixed` ones, which are not searched.

    `entries` maps coefficients (n, laws) to the entries; the bounds of the coefficients named in `given` are not to be
    widened.  Where the input `is_limited` a law with an integrator has anti-windup.
    """

    name: str
    free: tuple[Coefficient, ...]
    fixed: dict[str, float]
    entries: Callable[[Real], tuple[Entry, ...]]
    given: tuple[str, ...] = ()
    is_limited: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the free coefficients."""
        return tuple(each.name for each in self.free)

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return len(self.free)

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals of the law."""
        start = self.coefficients(self.origin[:, None])
        return tuple(each.signal for each in self.entries(start))

    @property
    def units(self) -> Real:
        """The unit (n,) of each scale."""
        return np.array([each.unit for each in self.free])

    @property
    def origin(self) -> Real:
        """x (n,) of the start, within the bounds."""
        return np.clip(self.at([each.start for each in self.free]), *self.box)

    @property
    def box(self) -> tuple[Real, Real]:
        """The least and the largest x (n,); a bound of 0 that is a physical end is replaced by a unit."""
        low = []
        high = []
        for each in self.free:
            least, most = each.bounds
            low.append(each.unit if least == each.ends[0] == 0.0 else least)
            high.append(most)
        return self.at(low), self.at(high)

    def at(self, coefficients: Any) -> Real:
        """Return x of these coefficients (n,)."""
        return np.arcsinh(np.asarray(coefficients) / self.units)

    def coefficients(self, x: Real) -> Real:
        """Return the coefficients at x (n, laws)."""
        return (self.units * np.sinh(x.T)).T

    def by_name(self, free: Sequence[float]) -> dict[str, float]:
        """Return all coefficients by name, the fixed ones first."""
        return self.fixed | dict(zip(self.names, free, strict=True))

    def typed(self, x: Real) -> list[list[float]]:
        """Return the coefficients at x (n,), gains at the hub to `TYPED_DIGITS`: the nearest, then all next to them."""
        found = self.coefficients(x).tolist()
        if self.name != TWO_GAINS:
            return [found]
        return [list(each) for each in product(*map(_typed, found))]

    def record_at(self, x: Real) -> AnyLaw:
        """Return the law at x (n,), as a record."""
        return self.record_of(self.coefficients(x).tolist())

    def record_of(self, c: Sequence[float]) -> AnyLaw:
        """Return the law of coefficients (n,), as a record."""
        if self.name == TWO_GAINS:
            return HubFeedback(**self.by_name(c))
        blocks = {}
        for signal, num, den in self.entries(np.transpose([c])):
            blocks[signal] = tuple(num[:, 0].tolist()), tuple(den[:, 0].tolist())
        law = Law(blocks, name=self.name, references=tuple(blocks))
        return with_anti_windup(law) if self.is_limited else law

    def at_ends(self, x: Real) -> Ends:
        """Return the ends of the bounds at which coefficients are: nearer than a thousandth of the range of x."""
        low, high = self.box
        is_there = abs(np.array(self.box) - x) < 1e-3 * (high - low)
        return [(place, end) for place, end in np.argwhere(is_there.T).tolist()]

    def ends(self, *, physical: bool) -> Ends:
        """Return the ends of the bounds that are not given: the physical ones, or the others."""
        found = []
        for place, each in enumerate(self.free):
            if each.name not in self.given:
                is_physical = np.equal(each.bounds, each.ends)
                found += [(place, end) for end in (0, 1) if is_physical[end] == physical]
        return found

    def wider(self, ends: Ends, by: float) -> Structure:
        """Return the same with these bounds farther out, `by` of x, not beyond physical ends."""
        free = list(self.free)
        for place, end in ends:
            each = free[place]
            way = by if end else -by
            bound = float(np.clip(each.unit * np.sinh(self.box[end][place] + way), *each.ends))
            low, high = each.bounds
            bounds = (low, bound) if end else (bound, high)
            free[place] = each._replace(bounds=bounds)
        return replace(self, free=tuple(free))


def _typed(value: float) -> list[float]:
    """Return the numbers of `TYPED_DIGITS` to either side, the nearer first."""
    last = 10.0 ** (np.floor(np.log10(abs(value) or 1.0)) + 1 - TYPED_DIGITS)
    ends = [float(f"{way(value / last) * last:.{TYPED_DIGITS}g}") for way in (np.floor, np.ceil)]
    return sorted(ends, key=lambda end: abs(end - value))


def structure_of(
    name: str,
    arm: Arm,
    *,
    Kp: float,
    modes: int,
    period: float,
    bounds: Mapping[str, Bounds | None],
    is_angle_free: bool = False,
) -> Structure:
    """Return the structure of that name for an arm at a sampling period [s].

    `Kp` [input/rad] of 0 is chosen but of K1-K2: a speed of the angle of a tenth of the first frequency, or of a radian
    a sample if that is less.  `bounds` of coefficients are those to be searched, where not None.
    Raises ParameterError for an unknown structure, bad bounds or Kp, and for gains too large for the arm.
    """
    must_be_known("structure", name, STRUCTURES)
    is_given = bool(Kp)
    if name != TWO_GAINS:
        require(0.0 <= Kp < np.inf, ANGLE_GAIN, Kp, "the hub angle gain is zero (chosen) or positive")
        speed = 0.1 * min(first_frequency(arm), 1 / period)
        if Kp == 0.0:
            Kp = float(f"{turning_inertia(arm) * speed**2:.3g}")
    free, entries = STRUCTURES[name].of(arm, Kp, modes, period)
    given = {}
    for key, pair in bounds.items():
        if pair is None:
            continue
        require(name == TWO_GAINS, key, pair, f"goes with the structure {TWO_GAINS} alone")
        low, high = pair
        is_range = -np.inf < low < high < np.inf
        require(is_range, key, pair, "bounds are two finite numbers, the lower first")
        given[key] = (float(low), float(high))
    free = tuple(each._replace(bounds=given.get(each.name, each.bounds)) for each in free)
    is_free = is_angle_free and not is_given and name != TWO_GAINS
    if is_free:
        # a slow integral is a slow pole, which a search for speed leaves without a limit of Ki
        free = tuple(
            positive_coefficient("Ki", each.start, reach=REACH**2) if each.name == "Ki" else each
            for each in free
        )
        free = (positive_coefficient(ANGLE_GAIN, Kp), *free)
        form = Structure(name, free, {}, lambda c: entries(c[0], c[1:]), tuple(given))
    else:
        form = Structure(name, free, {ANGLE_GAIN: Kp}, lambda c: entries(Kp, c), tuple(given))
    if "root_moment" in form.signals:
        must_not_be_algebraic(arm, "structure", name)
    return form


def check_bounds(form: Structure, arm: Arm) -> None:
    """Raise ParameterError where the bounds have gains that are too large for the arm."""
    if form.name == TWO_GAINS:
        for corner in zip(*(each.bounds for each in form.free), strict=True):
            check_gains(arm, HubFeedback(**form.by_name(corner)))


def multiply_polynomials(first: Real, second: Real) -> Real:
    """Return the product of polynomials (degree + 1, laws)."""
    size = len(second)
    laws = max(first.shape[1], second.shape[1])
    total = np.zeros((len(first) + size - 1, laws))
    for n, row in enumerate(first):
        total[n : n + size] += row * second
    return total


def polynomial_of(*coefficients: Any) -> Real:
    """Return a polynomial (degree + 1, laws) of coefficients that are numbers or (laws,)."""
    return np.array(np.broadcast_arrays(*(np.atleast_1d(each) for each in coefficients)))


# free coefficients, and their entries
Built = tuple[Sequence[Coefficient], Callable[[Any, Real], tuple[Entry, ...]]]


class Declaration(NamedTuple):
    """A structure: its formula in LaTeX, and its coefficients and entries of arm, Kp, number of modes, and period."""

    formula: str
    of: Callable[[Arm, float, int, float], Built]


STRUCTURES: dict[str, Declaration] = {}


def structure(name: str, formula: str) -> Callable[[Callable[[Arm, float, int, float], Built]], None]:
    """Declare a structure: `tfarm design`, its documentation and its tests have it from here."""

    def declare(of: Callable[[Arm, float, int, float], Built]) -> None:
        STRUCTURES[name] = Declaration(formula, of)

    return declare


def _rate_gain(arm: Arm, Kp: float, name: str = "K1") -> Coefficient:
    """Return K1, usually that of damping ratio 1/sqrt(2) of the rigid arm under Kp, without friction."""
    return positive_coefficient(name, float(np.sqrt(2 * Kp * turning_inertia(arm))))


def _integral_gain(arm: Arm, Kp: float) -> Coefficient:
    """Return Ki, from its lower limit on."""
    least = 0.1 * Kp * float(np.sqrt(Kp / turning_inertia(arm)))
    return Coefficient("Ki", LOGARITHMIC * least, (least, REACH * least), (least, np.inf), 2 * least)


def _pole(period: float) -> Coefficient:
    """Return the pole of a filter, at most the fastest of a sampled signal."""
    return positive_coefficient("pole_rad_s", 2 / period, 2 / period)


def _servo(Kp: Any, K1: Real) -> tuple[Entry, Entry]:
    """Return the entries of Kp on the angle and K1 (laws,) on its rate."""
    return Entry("hub_angle", polynomial_of(Kp)), Entry("hub_rate", polynomial_of(K1))


def _second_order(w: Real, damping: Real) -> Real:
    """Return s^2 + 2 damping w s + w^2."""
    return polynomial_of(1.0, 2 * damping * w, w * w)


@structure(TWO_GAINS, r"$v = -K_p \theta - K_1 \theta_t - K_2 M$")
def _two_gains(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    """Return the gains of the paper's law, to physical ends: no damping at K1 = 0, hub at rest at K2 = 1 (a torque)."""
    unit = arm.input_per_torque
    rate = rate_unit(arm)
    most = 2.0 * turning_inertia(arm) * frequency_above_mode(arm, 1)
    K1 = Coefficient(PLANE[0], LOGARITHMIC * rate, (0.0, most), (0.0, np.inf), 0.1 * rate)
    K2 = Coefficient(PLANE[1], unit, (-3.0 * unit, unit), (-np.inf, unit), 0.0)

    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        angle, rate = _servo(Kp, c[0])
        moment = Entry("root_moment", polynomial_of(c[1]))
        if not np.any(Kp):
            return rate, moment
        return angle, rate, moment

    return (K1, K2), entries


def _by_mode(arm: Arm, modes: int) -> dict[str, float]:
    """Return the frequencies [rad/s] of the first flexible modes by the ending of the names of their coefficients."""
    flexible = natural_modes(arm, modes).natural_frequency[-modes:]
    return {f"_{n}": w for n, w in enumerate(flexible.tolist(), 1)}


@structure("PD", r"$v = -K_p \theta - K_1 \theta_t$")
def _pd(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    return (_rate_gain(arm, Kp),), lambda Kp, c: _servo(Kp, c[0])


def _notched(arm: Arm, Kp: float, period: float, names: Mapping[str, float]) -> Built:
    """Return PD with a notch for each ending of its coefficients' names, which has the notch's frequency [rad/s]."""

    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        K1, pole = c[:2]
        num = polynomial_of(K1 + Kp / pole, Kp)
        den = polynomial_of(1 / pole, 1.0)
        for w, a, b in c[2:].reshape(len(names), 3, -1):
            num = multiply_polynomials(num, _second_order(w, a))
            den = multiply_polynomials(den, _second_order(w, b))
        return (Entry("hub_angle", num, den),)

    free = [_rate_gain(arm, Kp), _pole(period)]
    for name, w in names.items():
        free += [
            positive_coefficient(f"notch_rad_s{name}", min(w, 1 / period), 2 / period),
            positive_coefficient(f"notch_zero_damping{name}", 0.1),
            positive_coefficient(f"notch_pole_damping{name}", 0.7),
        ]
    return free, entries


@structure("PD+notch", r"$v = -(K_p + K_1 s/(1 + s/p)) \, N(s) \, \theta$")
def _pd_notch(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    return _notched(arm, Kp, period, {"": first_frequency(arm)})


@structure("PD+notches", r"$v = -(K_p + K_1 s/(1 + s/p)) \, \prod_i N_i(s) \, \theta$, a notch a mode")
def _pd_notches(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    return _notched(arm, Kp, period, _by_mode(arm, modes))


@structure("lead", r"$v = -K_p (1 + s/z)/(1 + s/p) \, \theta$")
def _lead(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        zero, pole = c
        return (Entry("hub_angle", polynomial_of(Kp / zero, Kp), polynomial_of(1 / pole, 1.0)),)

    zero = positive_coefficient("zero_rad_s", Kp / _rate_gain(arm, Kp).start)
    return (zero, _pole(period)), entries


@structure("PI", r"$v = -(K_p + K_i/s) \, \theta$, for a hub with friction or back-EMF")
def _pi(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        return (Entry("hub_angle", polynomial_of(Kp, c[0]), polynomial_of(1.0, 0.0)),)

    return (_integral_gain(arm, Kp),), entries


@structure("PID", r"$v = -(K_p + K_i/s + K_d s/(1 + s/p)) \, \theta$")
def _pid(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        Ki, Kd, pole = c
        num = polynomial_of(Kd + Kp / pole, Kp + Ki / pole, Ki)
        return (Entry("hub_angle", num, polynomial_of(1 / pole, 1.0, 0.0)),)

    return (_integral_gain(arm, Kp), _rate_gain(arm, Kp, "Kd"), _pole(period)), entries


def _mode_filters(
    arm: Arm, Kp: float, modes: int, period: float, passed: Callable[[Any, Any, Any], Real]
) -> Built:
    """Return PD, and on the root moment a second-order filter for each mode, of a numerator of its g, w and zeta."""

    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        num = np.zeros((1, c.shape[1]))
        den = np.ones((1, 1))
        for g, w, zeta in c[1:].reshape(modes, 3, -1):
            own = _second_order(w, zeta)
            through = multiply_polynomials(passed(g, w, zeta), den)
            num = multiply_polynomials(num, own)
            num[-len(through) :] += through
            den = multiply_polynomials(den, own)
        return (*_servo(Kp, c[0]), Entry("root_moment", num, den))

    # of frequency and damping of a filter
    reach = np.exp(2.0)
    free = [_rate_gain(arm, Kp)]
    for name, w in _by_mode(arm, modes).items():
        free += [
            signed_coefficient(f"gain{name}", 0.1 * arm.input_per_torque),
            positive_coefficient(f"filter_rad_s{name}", min(w, 1 / period), 2 / period, reach),
            positive_coefficient(f"filter_damping{name}", 0.3, reach=reach),
        ]
    return free, entries


@structure(
    "PPF",
    r"PD, and $-\sum_i g_i \omega_i^2/(s^2 + 2 \zeta_i \omega_i s + \omega_i^2) \, M$ (positive position feedback)",
)
def _ppf(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    return _mode_filters(arm, Kp, modes, period, lambda g, w, zeta: polynomial_of(g * w * w))


@structure(
    "rate+resonant",
    r"PD, and $-\sum_i g_i \, 2 \zeta_i \omega_i s/(s^2 + 2 \zeta_i \omega_i s + \omega_i^2) \, M$ (resonant feedback)",
)
def _rate_resonant(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    return _mode_filters(arm, Kp, modes, period, lambda g, w, zeta: polynomial_of(2 * g * zeta * w, 0.0))


@structure("strain-rate", r"PD, and $-g s/(1 + s/p) \, M$")
def _strain_rate(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        K1, g, pole = c
        filtered = Entry("root_moment", polynomial_of(g, 0.0), polynomial_of(1 / pole, 1.0))
        return (*_servo(Kp, K1), filtered)

    gain = signed_coefficient("gain_s", 0.1 * arm.input_per_torque / first_frequency(arm))
    return (_rate_gain(arm, Kp), gain, _pole(period)), entries


@structure(
    "LQG",
    r"$v = -K \hat x - k \int \theta \, dt$: observer with state feedback of least "
    r"$\int (K_p \theta)^2 + (w M)^2 + (K_i \int \theta)^2 + v^2 \, dt$",
)
def _lqg(arm: Arm, Kp: float, modes: int, period: float) -> Built:
    """Return LQG of few modes; a rigid arm's observer of the angle alone would have the speed `observer_rad_s`."""
    signals = ("hub_angle", "root_moment")
    plant = held_model(arm, signals, modes, period)
    J = turning_inertia(arm)

    def entries(Kp: Any, c: Real) -> tuple[Entry, ...]:
        Ki, weight, speed, noise = c
        K, k = integral_feedback(plant, np.array([Kp + 0 * weight, weight]), Ki)
        L = filter_gain(plant, np.array([1 / (J * speed**2), noise]))
        laws = observer_law(plant, K, k, L)
        return tuple(Entry(name, *law) for name, law in zip(signals, laws, strict=True))

    unit = arm.input_per_torque
    free = (
        _integral_gain(arm, Kp),
        positive_coefficient("moment_weight", 0.3 * unit),
        positive_coefficient("observer_rad_s", min(first_frequency(arm), 1 / period)),
        positive_coefficient("moment_noise", 1 / unit),
    )
    return free, entries
