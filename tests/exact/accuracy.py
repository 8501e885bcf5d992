"""float64 against ball arithmetic at random (arm, s, x):  python -m tests.exact.accuracy SIZE SEED

The error of an output G is counted in the change of G that a relative change of its argument brings about: what is
left of |G_64/G - 1| after division by 1 + |s dG/ds / G|, along the arm by 1 + |s dG/ds / G| + |x dG/dx / G|.  All of
it comes from two ball evaluations, at (s, x) and next to it.
"""

import cmath
import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tests import survey
from tests.outputs import OF_ONE_LINK
from tests.strategies import some_arm, some_s
from tests.survey import Finding
from tfarm.exact import balls
from tfarm.exact.coefficients import coefficients
from tfarm.exact.fields import fields
from tfarm.exact.outputs import unit_scale
from tfarm.exact.waves import evaluate
from tfarm.spectrum.search import natural_frequencies

BOUND = 2e-14
ENDS = {"theta": 0, "M": 1, "Q": 2, "W": 3, "Y": 4}
FIELDS = {"Y": 0, "Phi": 1, "M": 2, "Q": 3}
STEP = 2.0**-60
TINY, HUGE = np.finfo(float).tiny, np.finfo(float).max


@dataclass(frozen=True)
class Point:
    """One output of one arm at one s: its error, and whether the code itself asks for balls there."""

    name: str
    error: float
    flagged: bool
    where: tuple


def some_share(rng):
    """A point along the arm as a share of its length, often close to an end or on it."""
    return float(rng.choice([rng.uniform(), 10 ** rng.uniform(-4, 0), 1 - 10 ** rng.uniform(-4, 0), 0.0, 1.0]))


def measure(arm, s, x, outputs=OF_ONE_LINK):
    """Those outputs of one arm at one s (and share x of the length): the representable ones as Points."""
    k, L = coefficients(arm), arm.link.length
    values, flagged = float_values(k, s, x)
    points = []
    for name, (value, condition) in exact_values(k, s, x, outputs).items():
        error = abs(balls.point(complex(values[name])) / value - 1)
        error = float(error.mid()) if np.isfinite(values[name]) else np.inf
        points.append(Point(name, error / (1 + condition), flagged, (arm, s, x * L)))
    return points


def float_values(k, s, x):
    """Every output in float64, SI, and whether the kernel flags s."""
    at_ends = {name: each for name, each in OF_ONE_LINK.items() if each.place != "x"}
    table = [[ENDS[o.quantity], o.power, o.gauge, float(unit_scale(o, k))] for o in at_ends.values()]
    values, flagged = np.empty((len(table), 1), complex), np.empty(1, bool)
    with np.errstate(all="raise", under="ignore"):
        evaluate(np.array([s]), k.kernel, np.array(table), values, flagged)
        along = fields(k, np.array([s]), x)[0][:, 0]
    found = dict(zip(at_ends, values[:, 0], strict=True))
    for name, each in OF_ONE_LINK.items():
        if each.place == "x":
            found[name] = along[FIELDS[each.quantity]] * float(unit_scale(each, k)) / (1 + k.damping * s * each.gauge)
    return found, bool(flagged[0])


def exact_values(k, s, x, outputs=OF_ONE_LINK):
    """Each of those outputs that is not zero and fits into a float, as a ball, with its |s G'/G|."""
    bits = 320 + lost_bits(k, s)
    while True:
        with balls.precision(bits):
            here, there = (balls.State(k, balls.point(s) * (1 + balls.rational(step))) for step in (0.0, STEP))
            found = {name: _value(here, there, each, x) for name, each in outputs.items()}
            if None not in found.values():
                return {name: pair for name, pair in found.items() if pair[1] is not None}
        bits *= 2


def lost_bits(k, s):
    """About so many bits cancel at s: the square of the faster wave's growth along the arm, e^(2 |Re t|)."""
    with balls.precision(128):
        state = balls.State(k, balls.point(s))
        half = state.z_sum / 2
        spread = balls.root(half * half - state.z_product)
        rates = (abs(balls.root(z).real.mid()) for z in (half + spread, half - spread))
        return int(2 * float(max(rates)) / math.log(2))


def _value(here, there, output, x):
    """(ball, condition); condition None where G is zero or does not fit; None where the precision does not do."""
    if _vanishes(here.k, output, x):
        return 0, None
    if here.input.contains(0) or there.input.contains(0):
        return None
    value = here.value(output, x)
    if value.rel_accuracy_bits() < 150:
        return None
    neighbours = [there.value(output, x)]
    if output.place == "x":
        neighbours.append(here.value(output, Fraction(x) * (1 + Fraction(STEP))))
    slopes = [abs(neighbour / value - 1) / balls.rational(STEP) for neighbour in neighbours]
    if any(slope.rad() > 0.01 * (1 + slope.mid()) for slope in slopes):
        return None
    size = float(abs(value).mid())
    return value, sum(float(slope.mid()) for slope in slopes) if TINY < size < HUGE else None


def _vanishes(k, output, x):
    if output.place == "root":
        return False
    if output.place == "x" and x == 0:
        return output.quantity in ("Y", "Phi")
    held = {"W": np.isinf(float(k.tip_mass)), "M": k.tip_inertia == 0, "Q": k.tip_mass == 0}
    return (output.place == "tip" or x == 1) and held.get(output.quantity, False)


def run(count, seed=0):
    """The Points of `count` random arms."""
    rng = np.random.default_rng(seed)
    return [point for _ in range(count) for point in measure(some_arm(rng), some_s(rng), some_share(rng))]


def run_near_singularity(count, seed=0):
    """The Points of so many damped arms at real s next to -1/C, at 1e-4 of it to nearly all the way to 0."""
    rng, points = np.random.default_rng([seed, 1]), []
    for _ in range(count):
        arm = some_arm(rng, damping=10 ** rng.uniform(-4.5, -2))
        away = rng.choice([-1, 1]) * 10 ** rng.uniform(-4, -0.05)
        points += measure(arm, complex(-(1 + away) / arm.link.damping), some_share(rng))
    return points


def near(rng, centre, closest=1e-14, farthest=0.1):
    """A frequency next to `centre`, at a distance that is anything between the two shares of it."""
    distance = 10 ** rng.uniform(math.log10(closest), math.log10(farthest))
    return centre * (1 + rng.choice([-1, 1]) * distance)


def by_the_cut_off(rng):
    """Two of the four waves become constant there.

    Left out: a pinned-pinned arm has a mode of constant Psi at the cut-off, and Phi = Psi - Theta cancels it.
    """
    while True:
        arm = some_arm(rng, damping=0.0)
        if (arm.hub.inertia, arm.payload.mass, arm.payload.inertia) != (0.0, math.inf, 0.0):
            return arm, complex(0.0, near(rng, arm.shear_cutoff))


def by_a_frequency(rng):
    """One of the natural frequencies 2 to 39, at 1e-12 of it to a tenth."""
    arm, number = some_arm(rng, damping=0.0), int(rng.integers(2, 40))
    (omega,) = natural_frequencies(coefficients(arm), number, number)
    return arm, complex(0.0, near(rng, omega, 1e-12))


def by_the_change_of_form(rng):
    """Where |z| = 6, series give way to waves: s^2 = 36/g for a slender arm, on the imaginary axis and elsewhere."""
    arm = some_arm(rng)
    s = near(rng, 6 / math.sqrt(coefficients(arm).g), 1e-3, 0.3)
    return arm, s * cmath.exp(1j * rng.choice([math.pi / 2, 0.3]))


def overdamped(rng):
    """Real s < 0 of a damped arm."""
    return some_arm(rng, damping=10 ** rng.uniform(-7, -2)), -abs(some_s(rng)) + 0j


PLACES = {
    "by the shear cut-off": by_the_cut_off,
    "by a natural frequency": by_a_frequency,
    "between series and waves": by_the_change_of_form,
    "at real s < 0": overdamped,
}


def run_at(place, count, seed=0):
    """The Points of `count` arms where the last digits are in danger: `place` draws an arm and its s."""
    rng = np.random.default_rng(seed)
    return [point for _ in range(count) for point in measure(*place(rng), some_share(rng))]


def findings(points, bound=BOUND):
    """Of each value: flagged, where the kernel asks for balls, or its error."""
    for point in points:
        is_wrong = not (point.flagged or point.error <= bound)
        arm, s, x = point.where
        words = f"{point.error:.3g} {point.name} s={s!r} x={x!r}\n    {arm}" if is_wrong else ""
        figures = {} if point.flagged else {"error": point.error, point.name: point.error}
        outcome = "flagged" if point.flagged else f"above {bound:g}" if is_wrong else f"within {bound:g}"
        yield Finding(outcome, words, is_wrong, figures)


def anywhere(size, seed):
    return findings(run(size, seed))


def next_to_the_singularity(size, seed):
    """At real s next to -1/C."""
    return findings(run_near_singularity(size // 4, seed))


def in_danger(size, seed):
    """At each of the places."""
    return (found for place in PLACES.values() for found in findings(run_at(place, size // 4, seed)))


if __name__ == "__main__":
    survey.main(anywhere, next_to_the_singularity, in_danger, size=10_000, seed=0)
