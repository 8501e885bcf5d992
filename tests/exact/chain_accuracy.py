"""float64 against ball arithmetic at random (rig, s, x):  python -m tests.exact.chain_accuracy SIZE SEED

The error of an output G is counted as in `accuracy`: |G_64/G - 1| over 1 + |s dG/ds / G|, along the link over
1 + |s dG/ds / G| + |x dG/dx / G|.  Points that the kernel flags are not its own to answer: balls do.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tests import survey
from tests.chain_elements import reached
from tests.exact.accuracy import HUGE, STEP, TINY, findings, some_share
from tests.rigs import some_point, some_rig
from tfarm.exact import balls
from tfarm.exact.balls import rational
from tfarm.exact.chain_balls import Sweep
from tfarm.exact.chain_values import free_outputs, readings
from tfarm.exact.chaining import chain_of
from tfarm.exact.outputs import OUTPUTS
from tfarm.spectrum.search import natural_frequencies

BOUND = 1e-14
UNKNOWN = ("strain", "current")  # a random section has no depth, a random rig no motor
WANTED = tuple(each for each in OUTPUTS.values() if each.quantity not in UNKNOWN)
RIGHT = 120  # bits of a value that its slopes, over `STEP`, leave some sixty of
MOST_BITS = 1 << 14  # an output that has no digit by then is zero


@dataclass(frozen=True)
class Point:
    """One output of one rig at one s: its error, and whether the code itself asks for balls there."""

    name: str
    error: float
    flagged: bool
    where: tuple


def measure(arm, s, x):
    """The outputs of one rig at one s and share x of the length: the representable ones as Points."""
    chain = chain_of(arm)
    with np.errstate(all="ignore"):
        free = free_outputs(chain, WANTED, np.array([s]), x)
        found = free.outputs[:, 0] / free.drive[0]
    points = []
    for each, value, exact in zip(WANTED, found, exact_values(chain, s, x), strict=True):
        if exact is None:
            continue
        size, condition = exact
        error = abs(balls.point(complex(value)) / size - 1) if np.isfinite(value) else None
        error = np.inf if error is None else float(error.mid()) / (1 + condition)
        points.append(Point(each.name, error, bool(free.lost[0]), (arm, s, x)))
    return points


def exact_values(chain, s, x):
    """Each output as a ball with its |s G'/G| (+ |x G'/G|); None where it is zero or does not fit into a float."""
    here, found = Fraction(x), [None] * len(WANTED)
    left, bits = set(range(len(WANTED))), 256
    while left and bits <= MOST_BITS:
        with balls.precision(bits):
            at, step = balls.point(s), rational(Fraction(STEP))
            values, later = outputs_at(chain, at, here), outputs_at(chain, at * (1 + step), here)
            moved = outputs_at(chain, at, here * (1 + Fraction(STEP))) if 0 < x < 1 else None
            for i in sorted(left):
                neighbours = [later[i]] + ([moved[i]] if moved and WANTED[i].place == "x" else [])
                if min(map(right_bits, (values[i], *neighbours))) >= RIGHT:
                    size = float(abs(values[i]).mid())
                    condition = sum(float((abs(each / values[i] - 1) / step).mid()) for each in neighbours)
                    found[i] = (values[i], condition) if TINY < size < HUGE else None
                    left.discard(i)
        bits *= 2
    return found


def right_bits(value):
    """How many bits of a ball are right; none of one that may be anything."""
    return value.rel_accuracy_bits() if value.is_finite() else -1


def outputs_at(chain, s, x):
    """Every output at the ball s from one sweep."""
    those = readings(chain, WANTED, x)
    sweep, places = Sweep(those.layout, s), those.layout.places
    values = []
    for one, C in zip(those.each, those.gauges, strict=True):
        value = sweep.theta * rational(one.theta)
        if one.place is not None:
            state = sweep.states[places.index(one.place)]
            value = sum((part for weight, part in zip(one.state, state, strict=True) if weight), value)
        values.append(value * s**one.power / (s * rational(C) + 1) * rational(one.unit) / sweep.input)
    return values


def some_place(rng, arm):
    """A share of the length: anywhere, at an end, next to one, or at a joint to the last bit but one."""
    joints = np.cumsum([link.length for link in arm.links])[:-1] / arm.length
    return float(rng.choice(joints)) if joints.size and rng.random() < 0.1 else some_share(rng)


def by_a_frequency(rng):
    """One of the first twelve natural frequencies, at 1e-12 of it to a tenth."""
    arm = some_rig(rng, damped=False)
    number = int(rng.integers(2, 13))
    (omega,) = natural_frequencies(chain_of(arm), number, number)
    return arm, complex(0.0, omega * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-12, -1)))


def slow(rng):
    """Down to a millionth of the first frequency, where deflections are small differences."""
    arm = some_rig(rng)
    return arm, some_point(rng, arm) * 10 ** rng.uniform(-6, 0)


def fast(rng):
    """Up to the hundredth mode or so, where every segment's waves are fast."""
    arm = some_rig(rng)
    return arm, complex(0.0, reached(arm, 10 ** rng.uniform(1, 2)))


def overdamped(rng):
    """Real s < 0 of a damped rig, up to nearly -1/C of one of its segments."""
    arm = some_rig(rng, damped=True)
    if (singular := chain_of(arm).singular) and rng.random() < 0.5:
        away = 10 ** rng.uniform(-4, -0.3) * rng.choice([-1, 1])
        return arm, complex(rng.choice(singular) * (1 + away))
    return arm, complex(-abs(some_point(rng, arm)))


def anywhere(rng):
    """On the axis and off it."""
    arm = some_rig(rng)
    return arm, some_point(rng, arm)


PLACES = {
    "by a natural frequency": by_a_frequency,
    "down to rest": slow,
    "up to the hundredth mode": fast,
    "at real s < 0": overdamped,
}


def run(count, seed=0, place=anywhere):
    """The Points of so many rigs, `place` drawing a rig and its s."""
    points = []
    for n in range(count):
        rng = np.random.default_rng([seed, n])
        arm, s = place(rng)
        points += measure(arm, s, some_place(rng, arm))
    return points


def everywhere(size, seed):
    return findings(run(size, seed), BOUND)


def in_danger(size, seed):
    """At each of the places."""
    return (found for place in PLACES.values() for found in findings(run(math.ceil(size / 10), seed, place), BOUND))


if __name__ == "__main__":
    survey.main(everywhere, in_danger, size=5_000, seed=0)
