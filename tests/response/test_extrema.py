"""Peaks and dips of |G|: closed forms, a pole without a peak, true infinities, and random rigs against dense grids:

    python -m tests.response.test_extrema SIZE SEED

Random rigs, outputs and places.  A peak is false unless the slope of ln |G|, by dG/ds, changes its sign there; it is
missed where a grid of some ten times as many points has a local maximum of `PROMINENCE` (scipy.signal.find_peaks)
and no peak is listed.  On the imaginary axis peaks are to be infinite exactly where the undamped rig has a pole.
"""

import math

import numpy as np
import pytest
from scipy.signal import find_peaks

import tfarm
from tests import survey
from tests.rigs import some_rig
from tests.survey import Finding, numbered
from tfarm.errors import TfarmError
from tfarm.exact.outputs import OUTPUTS
from tfarm.report.blocks import prose
from tfarm.report.response_sections import bode_facts
from tfarm.response.extrema import extrema
from tfarm.response.frequency import resonant_band

FLEX, BARE = tfarm.load("quanser-flexlink"), tfarm.load("sasaki2012")
NONE = np.empty(0)


def found(G, omega, roots=()):
    """Peaks and dips of a function of s on a grid."""
    return extrema(G, omega, G(1j * omega), np.array(roots, complex), NONE, NONE)


@pytest.mark.parametrize("damping", [0.01, 0.3, 0.7])
def test_of_an_oscillator_the_peak_is_below_its_natural_frequency(damping):
    """omega sqrt(1 - 2 d^2) and 1/(2 d sqrt(1 - d^2)) in every textbook; none for d > 1/sqrt 2."""
    pole = 5 * complex(-damping, math.sqrt(1 - damping**2))
    ((omega, size),), dips = found(lambda s: 25 / (s**2 + 10 * damping * s + 25), np.geomspace(0.1, 100, 200), [pole])
    assert omega == pytest.approx(5 * math.sqrt(1 - 2 * damping**2), rel=1e-6)  # |G| itself then to 1e-12
    assert size == pytest.approx(1 / (2 * damping * math.sqrt(1 - damping**2)), rel=1e-12)
    assert not dips


def test_a_peak_and_a_dip_between_two_points_of_the_grid_are_found():
    """|G|^2 = 1 + e (x^3/3 - h^2 x) in x = omega - 2 has a maximum at -h and a minimum at h."""
    h, e = 0.01, 0.5

    def G(s):
        x = s.imag - 2
        return np.sqrt(1 + e * (x**3 / 3 - h**2 * x)).astype(complex)

    (peak,), (dip,) = found(G, np.array([1.0, 1.5, 1.9, 2.05, 2.4, 3.0]))
    assert (peak.omega, dip.omega) == (pytest.approx(2 - h, abs=1e-5), pytest.approx(2 + h, abs=1e-5))
    assert (peak.magnitude, dip.magnitude) == pytest.approx((1 + e * h**3 / 3, 1 - e * h**3 / 3), abs=1e-12)


def test_what_rounding_makes_of_a_constant_is_no_peak():
    rng = np.random.default_rng(4)
    assert found(lambda s: 1 + 1e-13 * rng.standard_normal(s.size) + 0j, np.geomspace(1, 10, 500)) == ((), ())


def test_a_damped_pole_past_which_the_magnitude_falls_is_no_peak():
    """The first flexible pole of this rig, seen at the tip behind hub friction and motor."""
    data = tfarm.bode(FLEX, "tip_displacement", (1.0, 60.0))
    assert data.resonances.imag == pytest.approx([29.14], rel=1e-3)
    assert (np.diff(abs(data.value)) < 0).all()
    assert (data.peaks, data.dips) == ((), ())
    assert prose("extrema", data=data) == "No peak: no local maximum of |G|; no dip: no local minimum of |G|."
    assert prose("extrema", data=data) in prose("bode", **bode_facts(data))
    assert "no peaks" in prose("bode_alt", data=data)


def test_without_damping_the_dips_between_infinite_peaks_are_finite_where_there_is_no_zero():
    data = tfarm.bode(BARE, "tip_displacement")
    assert judged(data) == ([], [])
    assert [each.omega for each in data.peaks] == tfarm.modes(BARE, 10).natural_frequency[1:].tolist()
    assert all(math.isinf(each.magnitude) for each in data.peaks)
    assert all(each.magnitude > 0 for each in data.dips)
    assert len(data.dips) == 10
    moment = tfarm.bode(BARE, "root_moment")
    assert moment.peaks == tuple((omega, math.inf) for omega in moment.infinite)
    assert moment.dips == tuple((omega, 0.0) for omega in moment.vanishing)
    assert np.isinf(moment.at_poles).all()
    assert not moment.at_zeros.any()


def test_none_is_false_and_none_missed_on_random_rigs():
    """`python -m tests.response.test_extrema 200` for more."""
    found = [plots(np.random.default_rng([12, number]), modes=3) for number in range(10)]
    assert {each.outcome for each in found} <= {"right", "refused"}
    assert sum(each.figures.get("peaks and dips", 0) for each in found) > 40


EVEN, AROUND = 8_000, 60  # points of the dense grid: of all, and on each side of a root
PROMINENCE = 1e-7  # of |G|: some of the rounding of a deflection
NOISE = 1e-12  # the same next to a root, over |s/(s - p)|
STEPS = (1e-2, 1e-3, 1e-4, 1e-5)  # of the distance to the nearest root, to both sides of an extremum
WANTED = [each for each in OUTPUTS.values() if each.quantity not in ("strain", "current")]


def some_bode(rng, modes=6):
    """A Bode plot of a random rig.  Raises TfarmError where there is none."""
    arm, wanted = some_rig(rng), WANTED[rng.integers(len(WANTED))]
    x = float(rng.uniform(0, arm.length)) if wanted.place == "x" else None
    return tfarm.bode(arm, wanted, resonant_band(arm, modes), x=x)


def judged(data):
    """The peaks and dips [rad/s] of a Bode plot that are none, and those that it lacks."""
    G = tfarm.transfer(data.arm, data.row, x=data.x)
    roots = np.r_[data.poles, data.zeros]
    false, missed = [], []
    for sign, listed, on_axis, limit in ((1, data.peaks, data.infinite, np.inf), (-1, data.dips, data.vanishing, 0.0)):
        false += [each.omega for each in listed if not is_extremum(G, each, sign, roots, on_axis, limit)]
        inside = on_axis[(on_axis > data.band[0]) & (on_axis < data.band[1])]
        missed += sorted(set(inside) - {each.omega for each in listed if each.magnitude == limit})
        missed += missing(G, data, sign, listed, roots)
        missed += [each.omega for each in listed if each.magnitude != limit and not is_drawn(data, each)]
    return false, missed


def is_drawn(data, each):
    """Whether a point of the grid is so near that the curve has the extremum to 1 %."""
    return abs(abs(data.value[abs(data.omega - each.omega).argmin()]) / each.magnitude - 1) < 0.01


def is_extremum(G, each, sign, roots, on_axis, limit):
    """Whether |G| turns there, from rising to falling for sign 1; it is infinite or 0 where a root is, nowhere else."""
    if each.magnitude == limit:
        return each.omega in on_axis
    near = min(each.omega, *abs(1j * each.omega - roots)) if roots.size else each.omega
    for step in STEPS:
        s = 1j * (each.omega + np.array([-step, step]) * near)
        before, after = sign * -(G.derivative(s) / G(s)).imag  # d ln |G|/d omega
        if before > 0 > after:
            return abs(abs(G(1j * each.omega)) / each.magnitude - 1) < 1e-9
    return False


def missing(G, data, sign, listed, roots):
    """The local maxima of sign |G| on a dense grid next to which none is listed."""
    low, high = data.band
    omega = np.geomspace(low, high, EVEN)
    steps = np.geomspace(1e-8, 0.1, AROUND)
    for root in roots[roots.imag > 0]:
        near = np.geomspace(max(abs(root.real) / 50, 1e-7 * root.imag), 0.1 * root.imag, AROUND)
        omega = np.r_[omega, root.imag + near, root.imag - near, root.imag * (1 + steps), root.imag * (1 - steps)]
    omega = np.unique(omega[(omega >= low) & (omega <= high)])
    axis = np.r_[data.infinite, data.vanishing]
    if axis.size:  # there values are large or small by rounding's leave
        omega = omega[abs(omega[:, None] / axis - 1).min(axis=1) > 1e-7]
    with np.errstate(divide="ignore"):
        height = sign * np.log(abs(G(1j * omega)))
    found, about = find_peaks(height, prominence=PROMINENCE)
    places, result = np.array([each.omega for each in listed]), []
    for place, prominence in zip(found, about["prominences"], strict=True):
        left, right = omega[place - 1], omega[place + 1]
        noise = NOISE * omega[place] / abs(1j * omega[place] - roots).min(initial=np.inf)
        if prominence > noise and not ((left <= places) & (places <= right)).any():
            result.append(float(omega[place]))
    return result


def plots(rng, modes=6):
    """The finding on one Bode plot."""
    try:
        data = some_bode(rng, modes)
    except TfarmError as error:
        return Finding("refused", str(error))
    false, missed = judged(data)
    is_wrong = bool(false or missed)
    words = f"{data.row.name} at {data.x}: false {false}, missed {missed}\n    {data.arm}" if is_wrong else ""
    return Finding("wrong" if is_wrong else "right", words, is_wrong, {"peaks and dips": len(data.peaks + data.dips)})


if __name__ == "__main__":
    survey.main(numbered(plots), seed=0)
