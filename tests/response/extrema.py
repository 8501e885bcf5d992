"""Peaks and dips of Bode plots against dense grids:  python -m tests.response.extrema SIZE SEED

Random rigs, outputs and places.  A peak is false unless the slope of ln |G|, by dG/ds, changes its sign there; it is
missed where a grid of some ten times as many points has a local maximum of `PROMINENCE` (scipy.signal.find_peaks)
and no peak is listed.  On the imaginary axis peaks are to be infinite exactly where the undamped rig has a pole.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

import tfarm
from tests import survey
from tests.rigs import some_rig
from tests.survey import Finding, numbered
from tfarm.exact.outputs import OUTPUTS
from tfarm.response.frequency import resonant_band

EVEN, AROUND = 8_000, 60  # points of the dense grid: of all, and on each side of a root
PROMINENCE = 1e-7  # of |G|: some of the rounding of a deflection
NOISE = 1e-12  # the same next to a root, over |s/(s - p)|
STEPS = (1e-2, 1e-3, 1e-4, 1e-5)  # of the distance to the nearest root, to both sides of an extremum
WANTED = [each for each in OUTPUTS.values() if each.quantity not in ("strain", "current")]


@dataclass(frozen=True)
class Case:
    """A Bode plot with the peaks and dips [rad/s] that are none, and those that it lacks."""

    data: object
    false: tuple
    missed: tuple


def some_bode(rng, modes=6):
    """A Bode plot of a random rig.  Raises TfarmError where there is none."""
    arm, wanted = some_rig(rng), WANTED[rng.integers(len(WANTED))]
    x = float(rng.uniform(0, arm.length)) if wanted.place == "x" else None
    return tfarm.bode(arm, wanted, resonant_band(arm, modes), x=x)


def judged(data):
    """The case of a Bode plot."""
    G = tfarm.transfer(data.arm, data.row, x=data.x)
    roots = np.r_[data.poles, data.zeros]
    false, missed = [], []
    for sign, listed, on_axis, limit in (
        (1, data.peaks, data.infinite, np.inf),
        (-1, data.dips, data.vanishing, 0.0),
    ):
        false += [each.omega for each in listed if not is_extremum(G, each, sign, roots, on_axis, limit)]
        inside = on_axis[(on_axis > data.band[0]) & (on_axis < data.band[1])]
        missed += sorted(set(inside) - {each.omega for each in listed if each.magnitude == limit})
        missed += missing(G, data, sign, listed, roots)
    return Case(data, tuple(false), tuple(missed))


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
    except tfarm.TfarmError as error:
        return Finding("refused", str(error))
    case = judged(data)
    is_wrong = bool(case.false or case.missed)
    words = f"{data.row.name} at {data.x}: false {case.false}, missed {case.missed}\n    {data.arm}" if is_wrong else ""
    figures = {"peaks and dips": len(data.peaks) + len(data.dips), "resonances": data.resonances.size}
    return Finding("wrong" if is_wrong else "right", words, is_wrong, figures)


if __name__ == "__main__":
    survey.main(numbered(plots), seed=0)
