"""float64 against ball arithmetic at random (arm, s, x):  python -m tests.exact.accuracy SIZE SEED

Arms of one link and rigs.  The error of an output G is counted in the change of G
that a relative change of its argument brings about: what is left of |G_64/G - 1| after division by 1 + |s dG/ds / G|,
along the arm by 1 + |s dG/ds / G| + |x dG/dx / G|.  All of it comes from ball evaluations at (s, x) and next to it.
Points that the kernel flags are not its own to answer: balls do.
"""

import cmath
import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tests import survey
from tests.chain_elements import reached
from tests.rigs import some_point, some_rig
from tests.strategies import some_arm, some_s
from tests.survey import Finding
from tfarm.exact import balls
from tfarm.exact.balls import Sweep, rational
from tfarm.exact.layout import readings
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.system import system_of
from tfarm.exact.values import free_outputs
from tfarm.spectrum.frequencies import natural_frequencies

BOUND = 1e-14
UNKNOWN = ("strain", "current")  # a random section has no depth, a random rig no motor
WANTED = {name: each for name, each in OUTPUTS.items() if each.quantity not in UNKNOWN}
AT_ENDS = {name: WANTED[name] for name in ("hub_angle", "hub_rate", "tip_displacement", "tip_deflection")}
AT_ENDS |= {name: WANTED[name] for name in ("tip_acceleration", "root_moment", "root_shear")}
STEP = 2.0**-60
TINY, HUGE = np.finfo(float).tiny, np.finfo(float).max
RIGHT = 120  # bits of a value that its slopes, over `STEP`, leave some sixty of
MOST_BITS = 1 << 14  # an output that has no digit by then is zero


@dataclass(frozen=True)
class Point:
    """One output of one arm at one s: its error, and whether the code itself requests balls there."""

    name: str
    error: float
    flagged: bool
    where: tuple


def measure(arm, s, x, wanted=WANTED):
    """The outputs of one arm at one s and share x of the length: the representable ones as Points."""
    k = system_of(arm)
    exact = exact_values(k, s, x, wanted)
    values, flagged = float_values(k, s, x, wanted)
    points = []
    for name, (size, condition) in exact.items():
        error = float(abs(balls.point(values[name]) / size - 1).mid()) if np.isfinite(values[name]) else np.inf
        points.append(Point(name, error / (1 + condition), flagged, (arm, s, x)))
    return points


def float_values(k, s, x, wanted):
    """Outputs in float64, SI, and whether the kernel flags s."""
    with np.errstate(all="ignore"):
        free = free_outputs(k, tuple(wanted.values()), np.array([s]), x)
        values = free.outputs[:, 0] / free.drive[0]
    return dict(zip(wanted, values.tolist(), strict=True)), bool(free.lost[0])


def exact_values(k, s, x, wanted=WANTED):
    """Each output that is not zero and fits into a float, as a ball with its |s G'/G| (+ |x G'/G|)."""
    here, found, left, bits = Fraction(x), {}, dict(wanted), 256
    while left and bits <= MOST_BITS:
        with balls.precision(bits):
            at, step = balls.point(s), rational(Fraction(STEP))
            values, later = outputs_at(k, at, here, left), outputs_at(k, at * (1 + step), here, left)
            moved = outputs_at(k, at, here * (1 + Fraction(STEP)), left) if 0 < x < 1 else None
            for name, each in list(left.items()):
                neighbours = [later[name]] + ([moved[name]] if moved and each.place == "x" else [])
                if min(map(right_bits, (values[name], *neighbours))) >= RIGHT:
                    size = float(abs(values[name]).mid())
                    condition = sum(float((abs(one / values[name] - 1) / step).mid()) for one in neighbours)
                    if TINY < size < HUGE:
                        found[name] = (values[name], condition)
                    del left[name]
        bits *= 2
    return found


def right_bits(value):
    """How many bits of a ball are right; none of one that may be anything."""
    return value.rel_accuracy_bits() if value.is_finite() else -1


def outputs_at(k, s, x, wanted):
    """Outputs at the ball s from one sweep."""
    those = readings(k, tuple(wanted.values()), x)
    sweep = Sweep(those, s)
    return {name: sweep.output(one) / sweep.input for name, one in zip(wanted, those.each, strict=True)}


def some_share(rng):
    """A point along the arm as a share of its length, often close to an end or on it."""
    return float(rng.choice([rng.uniform(), 10 ** rng.uniform(-4, 0), 1 - 10 ** rng.uniform(-4, 0), 0.0, 1.0]))


def some_place(rng, arm):
    """A share of the length: anywhere, at an end, next to one, or at a joint to the last bit but one."""
    joints = np.cumsum([link.length for link in arm.links])[:-1] / arm.length
    return float(rng.choice(joints)) if joints.size and rng.random() < 0.1 else some_share(rng)


def near(rng, centre, closest=1e-14, farthest=0.1):
    """A frequency next to `centre`, at a distance that is anything between the two shares of it."""
    distance = 10 ** rng.uniform(math.log10(closest), math.log10(farthest))
    return centre * (1 + rng.choice([-1, 1]) * distance)


def link_anywhere(rng):
    """One link on a hub."""
    return some_arm(rng), some_s(rng)


def link_by_the_cut_off(rng):
    """Two of the four waves become constant there.

    Left out: a pinned-pinned arm has a mode of constant Psi at the cut-off, and Phi = Psi - Theta cancels it.
    """
    while True:
        arm = some_arm(rng, damping=0.0)
        if (arm.hub.inertia, arm.payload.mass, arm.payload.inertia) != (0.0, math.inf, 0.0):
            return arm, complex(0.0, near(rng, arm.shear_cutoff))


def link_by_a_frequency(rng):
    """One of the natural frequencies 2 to 39, at 1e-12 of it to a tenth."""
    arm, number = some_arm(rng, damping=0.0), int(rng.integers(2, 40))
    (omega,) = natural_frequencies(system_of(arm), number, number)
    return arm, complex(0.0, near(rng, omega, 1e-12))


def link_by_the_change_of_form(rng):
    """Where |z| = 6, series give way to waves: s^2 = 36/g for a slender arm, on the imaginary axis and elsewhere."""
    arm = some_arm(rng)
    s = near(rng, 6 / math.sqrt(system_of(arm).segments[0].g), 1e-3, 0.3)
    return arm, s * cmath.exp(1j * rng.choice([math.pi / 2, 0.3]))


def link_overdamped(rng):
    """Real s < 0 of a damped arm."""
    return some_arm(rng, damping=10 ** rng.uniform(-7, -2)), -abs(some_s(rng)) + 0j


def link_next_to_the_singularity(rng):
    """Real s next to -1/C, at 1e-4 of it to nearly all the way to 0."""
    arm = some_arm(rng, damping=10 ** rng.uniform(-4.5, -2))
    return arm, complex(-(1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-4, -0.05)) / arm.link.damping)


def rig_anywhere(rng):
    """On the axis and off it."""
    arm = some_rig(rng)
    return arm, some_point(rng, arm)


def rig_by_a_frequency(rng):
    """One of the first twelve natural frequencies, at 1e-12 of it to a tenth."""
    arm = some_rig(rng, damped=False)
    number = int(rng.integers(2, 13))
    (omega,) = natural_frequencies(system_of(arm), number, number)
    return arm, complex(0.0, omega * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-12, -1)))


def rig_down_to_rest(rng):
    """Down to a millionth of the first frequency, where deflections are small differences."""
    arm = some_rig(rng)
    return arm, some_point(rng, arm) * 10 ** rng.uniform(-6, 0)


def rig_high_up(rng):
    """Up to the hundredth mode or so, where every segment's waves are fast."""
    arm = some_rig(rng)
    return arm, complex(0.0, reached(arm, 10 ** rng.uniform(1, 2)))


def rig_overdamped(rng):
    """Real s < 0 of a damped rig, up to nearly -1/C of one of its segments."""
    arm = some_rig(rng, damped=True)
    if (singular := system_of(arm).singular) and rng.random() < 0.5:
        away = 10 ** rng.uniform(-4, -0.3) * rng.choice([-1, 1])
        return arm, complex(rng.choice(singular) * (1 + away))
    return arm, complex(-abs(some_point(rng, arm)))


PLACES = {
    each.__name__.replace("_", " "): each
    for each in (
        link_anywhere,
        link_by_the_cut_off,
        link_by_a_frequency,
        link_by_the_change_of_form,
        link_overdamped,
        link_next_to_the_singularity,
        rig_anywhere,
        rig_by_a_frequency,
        rig_down_to_rest,
        rig_high_up,
        rig_overdamped,
    )
}


def run(place, count, seed=0):
    """The Points of `count` arms, `place` drawing an arm and its s."""
    points = []
    for n in range(count):
        rng = np.random.default_rng([seed, n])
        arm, s = place(rng)
        points += measure(arm, s, some_place(rng, arm))
    return points


def findings(points):
    """Of each value: flagged, where the kernel requests balls, or its error."""
    for point in points:
        is_wrong = not (point.flagged or point.error <= BOUND)
        arm, s, x = point.where
        words = f"{point.error:.3g} {point.name} s={s!r} x={x!r}\n    {arm}" if is_wrong else ""
        figures = {} if point.flagged else {"error": point.error, point.name: point.error}
        outcome = "flagged" if point.flagged else f"above {BOUND:g}" if is_wrong else f"within {BOUND:g}"
        yield Finding(outcome, words, is_wrong, figures)


def at_every_place(size, seed):
    """Where the last digits are in danger a tenth as often as anywhere."""
    sizes = {name: size if "anywhere" in name else size // 10 for name in PLACES}
    return (found for name, place in PLACES.items() for found in findings(run(place, sizes[name], seed)))


if __name__ == "__main__":
    survey.main(at_every_place, size=10_000, seed=0)
