"""The poles of a sampled loop, from the eigenvalues of its matrix, with all digits.

Matrix eigenvalues have an error of about 1e-14, and a mode may grow by 1e-10 a sample; n poles next to each other, as a
law of high order has them next to z = 1, have the nth root of that error.  So all are polished together, each as an
offset o from the nearest open-loop pole, of the plant (e^{pT}) or of the law, by the Ehrlich-Aberth method on the monic
polynomial P(z) = F(z) prod(z - poles of F), in Boersch-Supan's form without derivatives,

    step = W/(1 + sum over the other roots of their W/(z - root)),   W = P(z)/prod over the other roots of (z - root)

where o F(e^{pT} + o) is computed without loss; then ln|z| = Re(pT) + ln|1 + o e^{-pT}|.  q and p_i are polynomials,
kept as factors (`discretise`), so that F has no other poles than the plant.  (Aberth, Mathematics of Computation 27,
1973; Boersch-Supan, Numerische Mathematik 5, 1963.)

Within n |W| of each value, n the number of poles, there is a root (Smith, Journal of the ACM 17, 1970).  With the
rounding error of F in W that bounds the error of the root: where |ln|z|| is less it is not known from 0, and is 0.
"""

from __future__ import annotations

import numpy as np

from tfarm.arrays import MACHINE_EPS, Complex, Real, Whole
from tfarm.loop.sampled_rig import SampledRig
from tfarm.records import frozen

# a pole nearer to z = 0 is stable and not polished
FADED_RADIUS = 0.2


@frozen
class SampledPoles:
    """Closed-loop poles `z` and `log_radius` ln|z| of each, without z = 1 of a free hub angle.

    `error` bounds the error of each z outside FADED_RADIUS; where ln|z| may be no more than that, it is 0.  Inside are
    eigenvalues: where C is large, of modes fitted by `slow_remainder`, whose shares have few digits.
    `mode` is the flexible mode of the open-loop pole that is nearest (0: none).
    """

    z: Complex
    log_radius: Real
    mode: Whole
    error: Real

    @property
    def log_spectral_radius(self) -> float:
        """The largest ln|z|."""
        return float(self.log_radius.max())

    @property
    def unstable(self) -> int:
        """Number of poles outside the unit circle."""
        return int((self.log_radius > 0).sum())

    @property
    def is_determined(self) -> bool:
        """Whether none but poles that are exactly 1 may lie on the circle by rounding alone."""
        return bool((self.z[self.log_radius == 0] == 1).all())

    @property
    def is_stable(self) -> bool:
        """Whether all lie inside the unit circle."""
        return self.log_spectral_radius < 0.0


def polish_poles(rig: SampledRig, weights: Real, eigenvalues: Complex, poles_at_one: int) -> SampledPoles:
    """Return the closed-loop poles, each polished as an offset from its nearest open-loop pole; `poles_at_one` are 1.

    Those next to z = 0 are stable, and not polished.  `weights` are those of the rows of `SampledRig.terms`.
    """
    # for |z|^2 - 1 of a pole at z = 0, the base of no root
    least_square = -1.0 + 1e-15
    z = eigenvalues.copy()
    shifts = rig.open_loop
    pulse = rig.pulse
    z[np.argsort(abs(z - 1), kind="stable")[:poles_at_one]] = 1.0
    # the smallest double, for the logarithm of 0
    log_radius = np.log(np.maximum(abs(z), 5e-324))
    rows = np.flatnonzero((abs(z) > FADED_RADIUS) & (z != 1))
    base = _nearest(rig, z - 1)
    offset: Complex = (z - 1) - shifts[base]
    for _ in range(2):
        offset, error = _polish(rig, weights, base, offset, rows)
        nearest = _nearest(rig, shifts[base] + offset)
        if (nearest[rows] == base[rows]).all():
            break
        # all digits are kept from there
        offset = offset + (shifts[base] - shifts[nearest])
        base = nearest
    own = _square_less_1(rig.in_z.poles)
    start = np.r_[pulse.poles.real * pulse.sampling.period, np.log1p(np.maximum(own, least_square)) / 2]
    at = base[rows]
    o = offset[rows]
    nearest_pole = 1 + shifts[at]
    log_radius[rows] = start[at] + np.log1p(_square_less_1(o / nearest_pole)) / 2
    z[rows] = nearest_pole + o
    log_radius[abs(log_radius) * abs(z) < error] = 0.0
    mode = pulse.mode[abs(z[:, None] - pulse.multipliers).argmin(axis=1)]
    return SampledPoles(z, log_radius, mode, error)


def _square_less_1(delta: Complex) -> Real:
    """Return |1 + delta|^2 - 1 without cancellation."""
    return np.asarray(2 * delta.real + abs(delta) ** 2)


def _nearest(rig: SampledRig, delta: Complex) -> Whole:
    """Return the number of the open-loop pole nearest to each z = 1 + delta, of those that are not near z = 0.

    The integrals of a hub that cannot drift are not among them, as F has no digits next to them.
    """
    away = abs(delta[:, None] - rig.open_loop)
    away[:, abs(1 + rig.open_loop) <= FADED_RADIUS] = np.inf
    if not rig.plant.rigid.any():
        away[:, rig.pulse.poles.size - 1] = np.inf
    return away.argmin(axis=1)


def _polish(
    rig: SampledRig, weights: Real, base: Whole, offset: Complex, rows: Whole
) -> tuple[Complex, Real]:
    """Return the offsets, some iterated until they converge or F is 0 but for rounding, and bounds on all errors.

    These are the radii of Smith's discs, and the rounding of a pole of the law; 0 of the others.
    """
    # of all roots together: a cluster of nine takes 24
    most_steps = 200
    # an offset this small is a pole that the loop does not move
    unmoved = 1e-50
    error = np.zeros(offset.size)
    offset = offset.copy()
    # for an offset of 0: next to 1 that is none
    offset[rows] = np.where(offset[rows] == 0, 1e-17, offset[rows])
    # a root on an open-loop pole, and one that diverges
    with np.errstate(all="ignore"):
        for _ in range(most_steps):
            o = offset[rows]
            f, slope, apart = _weierstrass(rig, weights, base, offset, rows)
            W = np.nan_to_num(f / slope, posinf=0.0, neginf=0.0)
            others = W / apart[:, rows]
            np.fill_diagonal(others, 0.0)
            step = np.nan_to_num(W / (1 + others.sum(axis=1)), posinf=0.0, neginf=0.0)
            # of the offset: a smaller step is below its rounding
            moving = abs(step) > 1e-12 * abs(o)
            o_next = o - step
            offset[rows] = np.where(abs(o_next) < unmoved, unmoved, o_next)
            if (abs(f[moving]) <= rig.rounding(weights, base[rows[moving]], o[moving])).all():
                break
        offset[abs(offset) <= unmoved] = 0.0
        f, slope, _ = _weierstrass(rig, weights, base, offset, rows)
        radius = offset.size * (abs(f) + rig.rounding(weights, base[rows], offset[rows])) / abs(slope)
    at = base[rows]
    own = np.where(at < rig.pulse.poles.size, 0.0, MACHINE_EPS * abs(rig.open_loop[at]))
    # of a pole that the loop does not move 0/0
    error[rows] = np.nan_to_num(radius, posinf=0.0) + own
    return offset, error


def _weierstrass(
    rig: SampledRig, weights: Real, base: Whole, offset: Complex, rows: Whole
) -> tuple[Complex, Complex, Complex]:
    """Return at some roots o F and o F/W, and their distances from all roots, 1 from themselves."""
    pulse = rig.pulse
    b = base[rows]
    o = offset[rows]
    one = rig.open_loop[b]
    # the other poles are at z = 1
    known = np.r_[pulse.shifts[:-1], np.full(pulse.sampling.whole_delay + 1, -1.0)]
    poles = np.r_[known, np.zeros(max(0, offset.size - known.size - rig.in_z.poles.size))]
    apart = (one[:, None] - rig.open_loop[base]) + (o[:, None] - offset)
    apart[np.arange(rows.size), rows] = 1.0
    away = (one[:, None] - poles) + o[:, None]
    of_plant = b < pulse.poles.size
    own = np.where(b == pulse.poles.size - 1, known.size, b)
    # but where a free hub angle has the pole at z = 1
    listed = of_plant & (own < poles.size)
    # F is times the distance from that pole
    away[listed, own[listed]] = 1.0
    of_poles = (apart[:, : poles.size] / away).prod(axis=1)
    others = apart[:, poles.size :].prod(axis=1)
    slope = np.where(of_plant & ~listed, o, 1.0) * of_poles * others
    return weights @ rig.terms(1 + (one + o), b, o), slope, apart
