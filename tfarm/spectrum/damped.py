"""Damped modes: every eigenvalue in a box, and the undamped mode from which it continues.

With C > 0 there are two families.  Bending modes become overdamped, and their slow real eigenvalues accumulate at -1/C
from the left.  Shear is undamped in this model.  So at any C infinitely many lightly damped modes remain, near
Im s = (n - 1/2) pi c/L for a free tip, c^2 = kappa G/rho, with a damping that vanishes as 1/w^2.  A list of damped
modes is complete in a box only, and no box contains -1/C.
"""

import math
from dataclasses import replace
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import chain
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory
from tfarm.arm.checks import on_the_arm
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import CertificationError, ConvergenceError, ParameterError
from tfarm.exact.characteristic import drive_of
from tfarm.exact.system import System
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.box import TOWARD_SINGULAR, Box, complete_box, filled_box, is_among
from tfarm.spectrum.following import LOST
from tfarm.spectrum.frequencies import LISTS_KEPT
from tfarm.spectrum.naming import function_of, name_eigenvalues
from tfarm.spectrum.proofs import Disc, disjoint, enclose_zero, proven_count
from tfarm.spectrum.shapes import mode_field
from tfarm.spectrum.table import Modes, first_frequency, modes

# of a damped table
MOST_MODES = 300
# the origin of an eigenvalue that no part of the drive determines
NOT_ASSIGNED = "not assigned"


class Unassigned(NamedTuple):
    """An eigenvalue [1/s] of no mode, Im >= 0, a complex one with its conjugate; see `origins_of`."""

    origin: Annotated[str, Quantity("origin", help="part of the drive that determines it")]
    eigenvalue: Annotated[complex, Quantity("eigenvalue", "1/s", 10, "one of the damped arm, Im >= 0")]
    discs: Annotated[tuple[Disc, ...] | None, Quantity(help="its certified enclosure")] = None


@frozen
class DampedModes:
    """The modes of an arm with its damping, in the order of the undamped modes from which they continue.

    `eigenvalues` (n, 2) [1/s] are both zeros of each mode: a conjugate pair with Im > 0 first, or two real ones, the
    slower first (overdamped); 0 and 0 for the rigid body.  The fast zero of an overdamped mode may meet the third zero
    of its wave and oscillate again, in shear: then that pair is listed, not the slow zero near -1/C.  `box` [1/s] has
    `count` eigenvalues, all of them listed.  `left_out` is the number of requested modes that the record lacks, as
    their branches are not separable.  `others` are real eigenvalues of the motor's circuit, of no mode.  With friction
    at the hub the second eigenvalue of mode 0 is about -b/J instead of 0.  `unassigned` are eigenvalues without a
    certain mode; a mode without an eigenvalue has NaN.
    """

    undamped: Modes
    eigenvalues: Complex
    box: Box
    count: int
    left_out: int = 0
    others: tuple[float, ...] = ()
    unassigned: tuple[Unassigned, ...] = ()

    @property
    def index(self) -> NDArray[np.int64]:
        """Numbers of the modes: 0 for the rigid body, flexible ones from 1."""
        return self.undamped.index

    @property
    def natural_frequency(self) -> Real:
        """Natural frequencies of the undamped arm [rad/s]."""
        return self.undamped.natural_frequency

    @property
    def is_overdamped(self) -> NDArray[np.bool_]:
        """Which modes do not oscillate."""
        return (self.eigenvalues[:, 0].imag == 0) & (self.index > 0) & self.is_assigned

    @property
    def is_assigned(self) -> NDArray[np.bool_]:
        """Which modes have an eigenvalue; that of mode 0 may be 0."""
        return np.isfinite(self.eigenvalues[:, 0])

    @cached_property
    def damping_ratio(self) -> Real:
        """-(p + q)/(2 sqrt(p q)) of both eigenvalues: -Re/|s| of a pair, above 1 if overdamped, 0 for a rigid body."""
        p, q = self.eigenvalues.T
        size = np.sqrt((p * q).real)
        unknown = np.where(self.is_assigned, 0.0, np.nan)
        return np.divide(-(p + q).real / 2, size, out=unknown, where=size > 0)

    def certify(self, digits: int = DOUBLE_DIGITS) -> tuple[tuple[Disc, ...], ...]:
        """Return a disc around each eigenvalue, one for a pair, and certify that the box has no other.

        Raises CertificationError where that fails.
        """
        k = self.undamped.system
        discs = []
        for pair in self._every_pair:
            wanted = pair[:1] if pair[0].imag > 0 else pair[np.isfinite(pair)]
            discs.append(tuple(enclose_zero(k, zero, digits) for zero in wanted.tolist()))
            for zero, disc in zip(wanted.tolist(), discs[-1], strict=True):
                size = abs(zero)
                apart = abs(pair[0] - pair[-1]) if np.isfinite(pair[-1]) else size
                away = abs(complex(float(disc.re), float(disc.im)) - zero)
                # 1e-12: largest distance of a listed eigenvalue from its disc, of its size (more near its partner)
                most = 1e-12 * size * max(1.0, size / max(apart, LEAST_SIZE))
                if away > float(disc.radius) + most:
                    raise CertificationError(
                        f"next to {zero:.12g} 1/s lies {disc.re} + {disc.im}i, not the eigenvalue listed"
                    )
        if not disjoint(list(chain.from_iterable(discs))):
            raise CertificationError("the discs of two eigenvalues touch: more digits are needed")
        proven = proven_count(k, self.box)
        listed = int(self.box.holds(self._every_pair.ravel()).sum()) + k.at_rest
        if not listed == self.count == proven:
            raise CertificationError(
                f"the box has {proven} eigenvalues, but the list {listed} and the record {self.count}"
            )
        return tuple(discs)

    @property
    def single(self) -> Real:
        """Real eigenvalues [1/s] of no flexible mode: that of friction in mode 0, then `others`."""
        turning = self.eigenvalues[self.index == 0][:, 1].real
        return np.r_[turning[abs(turning) > 0], np.array(self.others)]

    @property
    def unassigned_pairs(self) -> Complex:
        """The unassigned eigenvalues (n, 2) [1/s]: a conjugate pair, or a real one and NaN."""
        zeros = np.array([each.eigenvalue for each in self.unassigned], dtype=complex)
        return np.stack([zeros, np.where(zeros.imag > 0, zeros.conj(), np.nan)], axis=-1)

    @property
    def _every_pair(self) -> Complex:
        """Every eigenvalue of the record other than 0, (n, 2): of the flexible modes, single ones, unassigned ones.

        Rows with one eigenvalue or none have NaN.
        """
        return np.concatenate(
            [self.eigenvalues[self.index > 0], _in_rows(self.single), self.unassigned_pairs]
        )

    # ------------------------------------------------------------ shapes

    def shape(self, x: NDArray[np.float64] | float) -> Complex:
        """Return the displacement w(x) [m/sqrt(kg m^2)] of each flexible mode at x [m]: (n, 2, *x.shape).

        Both eigenvalues of a mode have one; NaN for a mode without an eigenvalue.  Scaled so that the residue of
        w(x) over torque is w(x) psi(0)/(2 s), as for undamped modes of unit modal mass.
        """
        return self._field("W", x) * float(self.undamped.system.length)

    def rotation(self, x: NDArray[np.float64] | float) -> Complex:
        """Return the rotation psi(x) [rad/sqrt(kg m^2)], as `shape`."""
        return self._field("Psi", x)

    def moment(self, x: NDArray[np.float64] | float) -> Complex:
        """Return the elastic bending moment E I psi'(x) [N m/sqrt(kg m^2)], without its damping part, as `shape`."""
        k = self.undamped.system
        return self._field("M", x) * float(k.EI / k.length)

    def _field(self, quantity: str, x: NDArray[np.float64] | float) -> Complex:
        k = self.undamped.system
        share = on_the_arm("x", x, float(k.length)) / float(k.length)
        zeros = self.eigenvalues[self.index > 0]
        values = np.full((zeros.size, share.size), complex(np.nan, np.nan))
        for row, zero in zip(values, zeros.ravel().tolist(), strict=True):
            if np.isfinite(zero):
                row[:] = mode_field(k, zero, quantity, share.ravel())
        return values.reshape(*zeros.shape, *share.shape)


def damped_modes(undamped: Modes, *, steps: float = math.inf, reach: float = math.inf) -> DampedModes:
    """Return the modes of the arm with its damping, and every eigenvalue of a box up to half-way to the next mode.

    Eigenvalues in the box without a certain mode are `unassigned`.  The record has at most 300 modes of a damped arm,
    fewer where a box cannot be searched; `left_out` is the number of others.  After `steps` of following modes the
    eigenvalues of those not plain are listed as unassigned, or left out beyond the box.  Modes beyond the list are
    followed up to C w = `reach`: overdamped ones take long, and no box ends at them.
    Raises ConvergenceError where not even the box of the first mode can be searched.
    """
    if not isinstance(undamped, Modes):
        raise ParameterError(key="modes", value=undamped, remedy="give what tfarm.modes returns")
    count = int(undamped.index.max())
    most = count if undamped.arm.is_undamped else min(count, MOST_MODES)
    found = _first_modes(undamped.arm, undamped.theory, most, steps, reach)
    return replace(found, left_out=count - int(found.index.max()))


# one page needs the same modes some ninety times
@lru_cache(maxsize=LISTS_KEPT)
def _first_modes(arm: Arm, theory: Theory, count: int, steps: float, reach: float) -> DampedModes:
    """Return the first `count` modes of an arm, or half of them where their box cannot be searched."""
    try:
        return _search(modes(arm, count, theory=theory), steps, reach)
    except ConvergenceError:
        if count == 1:
            raise
        return _first_modes(arm, theory, count // 2, steps, reach)


def _search(undamped: Modes, steps: float, reach: float) -> DampedModes:
    """Return all eigenvalues in a box, assigned to their modes where that is certain."""
    k = undamped.system
    arm = undamped.arm
    theory = undamped.theory
    count = int(undamped.index.max())
    # 6 modes named beyond the list: a box may end below them
    omega = modes(arm, count + 6, theory=theory).flexible
    beyond = int((k.damping * omega[count:] < reach).sum())
    single, every = name_eigenvalues(undamped, count + beyond, steps)
    pairs = every[:count]
    company = every[count:]
    omega = omega[: count + 1]
    lost = np.flatnonzero(np.isnan(pairs[:, 0]))
    box, found = _box_of(undamped, omega, np.concatenate([_in_rows(single), pairs]), company)
    for zeros in (single, pairs):
        zeros[box.holds(zeros) & ~is_among(zeros, found)] = LOST
    unnamed = found[(found.imag >= 0) & ~is_among(found, np.r_[single, pairs.ravel()])]
    free = np.r_[single[single.imag != 0], unnamed]
    # zeros of the drive may be in the place of modes
    if free.size:
        origins = np.reshape(origins_of(k, pairs.ravel()), pairs.shape)
        of_drive = (origins != NOT_ASSIGNED).any(axis=1)
        free = np.r_[free, pairs[of_drive].ravel()]
        pairs[of_drive] = LOST
    for row in lost.tolist():
        near = _plain_zero(omega, row, found, free)
        if near is not None:
            pairs[row] = near, near.conjugate()
            free = free[free != near]
    real = single[single.imag == 0].real
    rigid = np.zeros((undamped.index.size - count, 2), complex)
    if single.size and k.at_rest == 1:
        turning = single[0]
        rigid[:, 1] = np.nan
        if turning.imag == 0:
            rigid[:, 1] = turning.real
            real = real[1:]
    upper = sorted(free[free.imag >= 0].tolist(), key=abs)
    return DampedModes(
        undamped,
        np.concatenate([rigid, pairs]),
        box,
        found.size + k.at_rest,
        others=tuple(real.tolist()),
        unassigned=tuple(map(Unassigned, origins_of(k, np.array(upper, complex)), upper)),
    )


def _box_of(undamped: Modes, omega: Real, listed: Complex, company: Complex) -> tuple[Box, Complex]:
    """Return the highest box in which the listed pairs (n, 2) are all eigenvalues, or one that is searched, with all.

    `company` are pairs that are not listed, `omega` the undamped frequencies of the list and the next one.
    """
    k = undamped.system
    f = function_of(k)
    is_whole = bool(np.isfinite(listed[:, 0]).all())
    below = listed
    if is_whole:
        box = complete_box(f, listed, company, k.damping)
        if box is not None:
            return box, listed[box.holds(listed)]
    else:
        # unknown ones may be above known ones
        below = listed[:0]
    starts = np.r_[listed.ravel(), company.ravel(), damped_starts(undamped.arm, omega)]
    return filled_box(f, below, company, float(omega[-2:].mean()), starts, k.damping)


def _in_rows(single: Complex | Real) -> Complex:
    """Return single eigenvalues (m,) as rows (m, 2), each with NaN as the other."""
    return np.stack([single, np.full(single.size, LOST)], axis=-1)


def _plain_zero(omega: Real, mode: int, found: Complex, free: Complex) -> complex | None:
    """Return the free zero of a frequency whose distance is small compared with those to all others, else None."""
    start = 1j * omega[mode]
    near = min(free[free.imag > 0].tolist(), key=lambda zero: abs(zero - start), default=None)
    if near is None:
        return None
    rest = found[found != near]
    apart = np.r_[abs(np.delete(omega, mode) - omega[mode]), abs(rest - near), abs(rest - start)]
    return near if abs(near - start) < 0.2 * apart.min() else None


def origins_of(k: System, s: Complex) -> list[str]:
    """Return the parts p of the drive with |d ln s/d ln p| > 0.3 of each eigenvalue (n,); else "not assigned".

    By differences: ds = -dD/D'(s).  It is 1 for b in -b/J and -k/b and for the lag in -R/L_a, and 1/2 for both parts of
    a pair s^2 = -K^2/(J L_a).  For a mode it is as small as the effect of the dissipation on its frequency.
    """
    # parts that may determine a zero
    drive_parts = {
        "friction": "hub friction",
        "back_emf": "back-EMF",
        "lag": "electrical pole",
    }
    # of a part, for differences: float64 has D to 1e-15 of its terms
    share = Fraction(1, 10_000)
    parts = [part for part in drive_parts if getattr(k.drive, part)]
    if not parts:
        return [NOT_ASSIGNED] * s.size
    found: list[list[str]] = [[] for _ in s]
    # of zeros that are not known
    with np.errstate(invalid="ignore"):
        here = function_of(k)(s)
        for part in parts:
            larger = k.drive._replace(**{part: getattr(k.drive, part) * (1 + share)})
            there = function_of(replace(k, drive=larger))(s)
            change = there.value * np.exp(there.scale - here.scale) - here.value
            # 0.3: |d ln s/d ln p| of the part p of an eigenvalue's origin: 1/2 for two parts
            is_large = abs(change / (here.slope * s)) > 0.3 * share
            for n in np.flatnonzero(is_large).tolist():
                found[n].append(drive_parts[part])
    return [" and ".join(names) or NOT_ASSIGNED for names in found]


def missing_real_eigenvalues(damped: DampedModes) -> Real:
    """Return real eigenvalues (n,) [1/s] right of -1/C, or nearer than the last mode, that the record lacks.

    Friction at a hub without inertia, and a dashpot at clamp or joint, add one from -inf: it continues from no mode.
    Others may be of modes beyond the record.
    """
    # of the lowest frequency, and number: points of the negative real axis
    slowest = 1e-6
    real_points = 300
    # half a second to import, and not needed for an undamped arm
    from scipy.optimize import brentq

    k = damped.undamped.system
    lowest = first_frequency(damped.undamped.arm)
    last = float(damped.natural_frequency.max())
    reach = TOWARD_SINGULAR / k.damping if k.damping else last
    at = -np.geomspace(min(slowest * lowest, reach / 2), reach, real_points)

    def signed(s: Real) -> Real:
        drive, scale = drive_of(k, s + 0j)
        return np.asarray((drive * np.exp(1j * scale.imag)).real)

    alone = damped.unassigned_pairs[:, 0]
    unassigned = alone[alone.imag == 0].real
    overdamped = damped.eigenvalues[damped.is_overdamped].real.ravel()
    known = np.sort(-np.r_[overdamped, damped.single, unassigned])
    sides = np.sign(signed(at))
    passed = np.searchsorted(known, -at)
    changes = sides[1:] * sides[:-1] < 0
    new = np.flatnonzero(changes & (np.diff(passed) == 0))

    def value(s: float) -> float:
        return float(signed(np.array([s]))[0])

    return np.array([brentq(value, at[n + 1], at[n], xtol=1e-300) for n in new])


def damped_starts(arm: Arm, omega: Real) -> Complex:
    """Return estimates [1/s] of damped eigenvalues from undamped frequencies (n,) [rad/s], both of each pair.

    In each segment both waves of such a frequency have numbers k, and with damping each of these has the four s of

        (rhoI s^2 + kGA + EI (1 + C s) k^2) (rhoA s^2 + kGA k^2) - kGA^2 k^2 = 0,

    which are the eigenvalues of its companion matrix.  The frequencies themselves are for segments without damping.
    """
    starts: list[Complex] = [1j * omega, -1j * omega]
    for link in dict.fromkeys(each for each in arm.links if each.damping):
        EI, kGA, rhoA, rhoI, C = map(float, (link.EI, link.kGA, link.rhoA, link.rhoI, link.damping))
        half_sum = omega**2 * (rhoI / EI + rhoA / kGA) / 2
        product = omega**2 * rhoA / EI * (omega**2 * rhoI / kGA - 1)
        spread = np.sqrt(half_sum**2 - product)
        k2 = np.concatenate([half_sum + spread, half_sum - spread])
        # below the shear cut-off the second wave does not travel
        k2 = k2[k2 > 0]
        c0 = EI / rhoI * kGA / rhoA * k2**2
        c1 = EI * C / rhoI * kGA / rhoA * k2**2
        c2 = kGA / rhoA * k2 + kGA / rhoI + EI / rhoI * k2
        c3 = EI * C / rhoI * k2
        unit = c0**0.25
        companion = np.zeros((k2.size, 4, 4))
        companion[:, 0] = -np.stack([c3 / unit, c2 / unit**2, c1 / unit**3, np.ones(k2.size)], axis=1)
        companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
        starts.append(np.linalg.eigvals(companion).astype(complex).ravel() * np.repeat(unit, 4))
    return np.concatenate(starts)
