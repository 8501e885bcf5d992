"""Damped modes: each undamped mode followed to the arm's own C, in a list complete in a printed box.

With C > 0 there are two families.  Bending modes become overdamped, and their slow real eigenvalues accumulate at -1/C,
from the left only.  Shear is undamped in this model, so at any C infinitely many lightly damped modes remain, near
Im s = (n - 1/2) pi c/L for a free tip, c^2 = kappa G/rho, their damping vanishing as 1/w^2.  No list of damped modes
can be complete but in a box, and no box can hold -1/C.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import CertificationError, ConvergenceError, ParameterError
from tfarm.exact.characteristic import (
    NO_GAINS,
    Gains,
    as_column,
    loop_parts,
    quick_characteristics,
    zeros_at_origin,
)
from tfarm.exact.coefficients import Coefficients
from tfarm.exact.system import System
from tfarm.records import record

from .box import Box
from .complete_box import TOWARD_SINGULAR, complete_box
from .complex_shapes import mode_field
from .continuation import Node, follow
from .correction import Member, improved
from .enclose import Disc, disjoint, enclosed, proven_count
from .scales import first_frequency
from .search import LISTS_KEPT
from .table import Modes, modes

COMPANY = (6, 11, 17, 29)  # modes followed beyond those wanted, lest the last be led astray: the next if that fails
FEWER_MODES = (300, 150, 60, 20, 5, 1)  # that are tried where more are asked for, or not all can be followed
LITTLE = (2, *COMPANY)  # where many C are met and more modes than matter are followed anyway
MANY_MODES = 30  # of more one number in company is tried, as each step takes long
BESIDE_DISC = 1e-12  # how far a listed eigenvalue may be from its disc, of its size (more beside its own partner)
FIRST_STEP_IN_C = 0.01  # the first step in C, over 1/w of the highest mode
FIRST_SHARE = 1e-3  # of all damping; of the lowest frequency, what a zero that friction makes may be: it is known there
SLOWEST, REAL_POINTS = 1e-6, 300  # of the lowest frequency, and how many: signs read on the negative real axis
LAST_STEPS = 3  # of Newton's method from zeros right to SETTLED_CORRECTION: all digits, and once more


@dataclass(frozen=True)
@record
class DampedModes:
    """The modes of an arm with its damping, in the order of the undamped modes they continue from.

    `eigenvalues` (n, 2) [1/s] are both zeros of each mode: a conjugate pair with Im > 0 first, or two real ones, the
    slower first (overdamped); 0 and 0 for the rigid body.  (An overdamped mode whose fast zero has met the third one of
    its wave rings again, in shear: that pair is listed, not its slow zero near -1/C.)  `box` [1/s] holds `count`
    eigenvalues, all of them listed.  `left_out` modes that were asked for are not in the record: from the next one on
    branches could not be told apart.  `others` are real eigenvalues of the motor's circuit, which belong to no mode.
    Where friction at the hub resists the turning rig, the second eigenvalue of mode 0 is not 0 but about -b/J.
    """

    undamped: Modes
    eigenvalues: Complex
    box: Box
    count: int
    left_out: int = 0
    others: tuple[float, ...] = ()

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
        return (self.eigenvalues[:, 0].imag == 0) & (self.index > 0)

    @cached_property
    def damping_ratio(self) -> Real:
        """-(p + q)/(2 sqrt(p q)) of both eigenvalues: -Re/|s| of a pair, above 1 if overdamped, 0 for a rigid body."""
        p, q = self.eigenvalues.T
        size = np.sqrt((p * q).real)
        return np.divide(-(p + q).real / 2, size, out=np.zeros_like(size), where=size > 0)

    def certify(self, digits: int = DOUBLE_DIGITS) -> tuple[tuple[Disc, ...], ...]:
        """A disc around each eigenvalue of the flexible modes (one for a pair), and a proof that the box has no other.

        Raises CertificationError where something cannot be proven.
        """
        k, discs = self.undamped.system, []
        for pair in self._listed:
            wanted = pair[:1] if pair[0].imag > 0 else pair[np.isfinite(pair)]
            discs.append(tuple(enclosed(k, complex(zero), digits) for zero in wanted))
            for zero, disc in zip(wanted.tolist(), discs[-1], strict=True):
                apart = max(abs(pair[0] - pair[-1]) if np.isfinite(pair[-1]) else abs(zero), LEAST_SIZE)
                away = abs(complex(float(disc.re), float(disc.im)) - zero)
                if away > float(disc.radius) + BESIDE_DISC * abs(zero) * max(1.0, abs(zero) / apart):
                    text = f"next to {zero:.12g} 1/s lies {disc.re} + {disc.im}i, not the eigenvalue listed"
                    raise CertificationError(text)
        if not disjoint([disc for pair in discs for disc in pair]):
            raise CertificationError("the discs of two eigenvalues touch: ask for more digits")
        proven = proven_count(k, self.box)
        listed = int(self.box.holds(self._listed.ravel()).sum()) + zeros_at_origin(k)
        if not listed == self.count == proven:
            text = f"{listed} eigenvalues in the box are listed and {self.count} claimed, but {proven} are there"
            raise CertificationError(text)
        return tuple(discs)

    @property
    def single(self) -> Real:
        """Real eigenvalues [1/s] of no flexible mode: what friction makes of the second 0 at rest, then `others`."""
        turning = self.eigenvalues[self.index == 0][:, 1].real
        return np.r_[turning[turning != 0], np.array(self.others)]

    @property
    def _listed(self) -> Complex:
        """Every eigenvalue of the record but those at 0, (n, 2): the flexible modes', then single ones beside NaN."""
        turning = self.eigenvalues[(self.index == 0)][:, 1]
        alone = [*turning[turning != 0], *self.others]
        return np.concatenate(
            [self.eigenvalues[self.index > 0], [[each, np.nan] for each in alone]]
            if alone
            else [self.eigenvalues[self.index > 0]]
        )

    # ------------------------------------------------------------ shapes

    def shape(self, x: NDArray[np.float64] | float) -> Complex:
        """Total displacement w(x) [m] of both eigenvalues of each flexible mode at x [m]: shape (n, 2, *x.shape).

        Scaled so that the residue of w(x) over torque is w(x) psi(0)/(2 s), as for undamped modes of unit modal mass.
        """
        return self._field("W", x) * float(self.undamped.system.length)

    def rotation(self, x: NDArray[np.float64] | float) -> Complex:
        """Total rotation psi(x) [rad], as `shape`."""
        return self._field("Psi", x)

    def moment(self, x: NDArray[np.float64] | float) -> Complex:
        """Elastic bending moment E I psi'(x) [N m], without its damping part, as `shape`."""
        k = self.undamped.system
        return self._field("M", x) * float(k.EI / k.length)

    def _field(self, quantity: str, x: NDArray[np.float64] | float) -> Complex:
        k = self.undamped.system
        share = np.asarray(x, dtype=float) / float(k.length)
        if not np.all((share >= 0) & (share <= 1)):
            raise ParameterError(key="x", value=x, remedy=f"a point of the arm lies between 0 and {float(k.length)} m")
        zeros = self.eigenvalues[self.index > 0]
        values = [[mode_field(k, complex(zero), quantity, share.ravel()) for zero in pair] for pair in zeros]
        return np.array(values, dtype=complex).reshape(*zeros.shape, *share.shape)


def damped_modes(undamped: Modes) -> DampedModes:
    """The modes of the arm with its own C, continued from the undamped ones: all, or the first that can be followed.

    Where branches cannot be told apart the record holds fewer modes than are asked for, and `left_out` says how many
    are missing.  Raises ConvergenceError where not even the first can be followed.
    """
    if not isinstance(undamped, Modes):
        raise ParameterError(key="modes", value=undamped, remedy="give what tfarm.modes returns")
    asked, lost = int(undamped.index.max()), None
    for count in sorted({asked, *FEWER_MODES}, reverse=True):
        if count > asked or (count > FEWER_MODES[0] and not undamped.arm.is_undamped):
            continue
        some = undamped if count == asked else modes(undamped.arm, count, theory=undamped.theory)
        try:
            found = all_damped_modes(some, COMPANY if count == asked <= MANY_MODES else COMPANY[:1])
        except ConvergenceError as error:
            lost = error
            continue
        return replace(found, left_out=asked - count)
    assert lost is not None
    raise lost


def damped_at_hub(arm: Arm, count: int) -> DampedModes | None:
    """The first `count` flexible modes with what the hub itself loses, and nothing else: neither links nor clamp.

    None where it loses nothing, or they cannot be followed.
    """
    clamp, joint = replace(arm.clamp, damping=0.0), replace(arm.joint, damping=0.0)
    hub_alone = replace(arm.elastic, clamp=clamp, joint=joint)
    if hub_alone.is_undamped:
        return None
    try:
        return damped_modes(modes(hub_alone, count))
    except ConvergenceError:
        return None


def all_damped_modes(undamped: Modes, companies: tuple[int, ...] = COMPANY) -> DampedModes:
    """All of the modes with the arm's own C, followed with so many more beside them: the next number if one fails.

    Raises ConvergenceError if a branch is lost, or two arrive at one eigenvalue.
    """
    found = _followed_once(undamped.arm, undamped.theory, int(undamped.index.max()), companies)
    if isinstance(found, ConvergenceError):
        raise found.with_traceback(None)  # else the frames of every search for it stay
    return found if found.undamped == undamped else Branches(companies)(undamped)


@lru_cache(maxsize=LISTS_KEPT)  # loops, plants and simulations of one page ask for the same modes some ninety times
def _followed_once(arm: Arm, theory: Theory, count: int, companies: tuple[int, ...]) -> DampedModes | ConvergenceError:
    """All damped modes of an arm's own table of `count`, or why they cannot be followed: that takes longest."""
    try:
        return Branches(companies)(modes(arm, count, theory=theory))
    except ConvergenceError as error:
        return error.with_traceback(None)


class Branches:
    """`all_damped_modes` of one arm with this C and that: each is followed on from the nearest smaller C that was met.

    A branch that was lost at one C is not sought again beyond it.  `companies`: how many modes are followed beside
    those wanted, the next number where one fails.
    """

    def __init__(self, companies: tuple[int, ...] = COMPANY) -> None:
        self.companies = companies
        self._met: dict[tuple[int, int], list[Node]] = {}
        self._lost: dict[tuple[int, int], tuple[float, ConvergenceError]] = {}

    def __call__(self, undamped: Modes) -> DampedModes:
        """The modes with the C of this table's arm.  Raises ConvergenceError as `all_damped_modes` does."""
        k = undamped.system
        flexible, alone = int((undamped.index > 0).sum()), len(single_zeros(undamped))
        zeros = self._followed(undamped, flexible + alone)
        listed, company = zeros[: flexible + alone], zeros[flexible + alone :]
        box, count = complete_box(member(k).function, listed, company, k.damping)
        single = listed[:alone]
        if single.size and (np.isfinite(single[:, 1]).any() or single[:, 0].imag.any()):
            raise ConvergenceError("friction at the hub or the motor's circuit rings with a flexible mode", single, 0)
        resisted = int(bool(alone) and k.at_rest == 1)
        rigid = np.zeros((undamped.index.size - flexible, 2), complex)
        rigid[:, 1] = single[:resisted, 0] if resisted else 0.0
        others = tuple(float(each) for each in single[resisted:, 0].real)
        eigenvalues = np.concatenate([rigid, listed[alone:]])
        return DampedModes(undamped, eigenvalues, box, count + zeros_at_origin(k), others=others)

    def _followed(self, undamped: Modes, wanted: int) -> Complex:
        """The zeros that the first modes, and those in their company, arrive at."""
        k = undamped.system
        C = level_of(k)
        lost: ConvergenceError | None = None
        for company in self.companies:
            key = wanted, company
            if key in self._lost and self._lost[key][0] <= C:
                lost = self._lost[key][1]
                continue
            met = self._met.get(key) or [_first_node(undamped, wanted + company, C)]
            start = sorted((node for node in met if node.at <= C), key=lambda node: node.at)[-1]
            first = C - start.at if len(met) > 1 else min(C, FIRST_STEP_IN_C / abs(start.zeros[-1, 0]))
            try:
                nodes = follow(lambda level: member(k.with_damping(level / C if C else 0.0)), start, C, first, wanted)
            except ConvergenceError as error:
                lost = error
                self._lost[key] = C, error
                continue
            self._met[key] = [*met, *nodes[1:]] if isinstance(k, Coefficients) else []  # one C is not all there is
            return nodes[-1].zeros if C == 0 else polished(member(k), nodes[-1].zeros)
        assert lost is not None
        raise lost


def entered(damped: DampedModes) -> Real:
    """Real eigenvalues (n,) [1/s] right of -1/C, or nearer than the last mode, that the record has not.

    Where nothing weighs at the hub its friction brings one in from -inf, and a dashpot at clamp or joint does: it
    continues from no mode.  Others may be of modes beyond the record.
    """
    from scipy.optimize import brentq  # takes half a second to load, and no undamped arm comes here

    k = damped.undamped.system
    if isinstance(k, Coefficients):
        return np.empty(0)
    lowest, last = first_frequency(damped.undamped.arm), float(damped.natural_frequency.max())
    reach = TOWARD_SINGULAR / k.damping if k.damping else last
    at = -np.geomspace(min(SLOWEST * lowest, reach / 2), reach, REAL_POINTS)

    def signed(s: Real) -> Real:
        drive, _, scale = loop_parts(k, s + 0j)
        return np.asarray((drive * np.exp(1j * scale.imag)).real)

    known = np.sort(-np.r_[damped.eigenvalues[damped.is_overdamped].real.ravel(), damped.single])
    sides, passed = np.sign(signed(at)), np.searchsorted(known, -at)
    new = np.flatnonzero((sides[1:] * sides[:-1] < 0) & (np.diff(passed) == 0))
    return np.array([brentq(lambda s: float(signed(np.array([s]))[0]), at[n + 1], at[n], xtol=1e-300) for n in new])


def level_of(k: System) -> float:
    """How far a system's damping is from none: its C [s], 1 s where it is damped otherwise, 0 where it is not."""
    return 0.0 if k.is_undamped else k.damping or 1.0


def single_zeros(undamped: Modes, share: float = 1.0) -> list[float]:
    """Real eigenvalues [1/s] that no flexible mode goes over into, under a share of the damping: -b/J, and -R/L_a."""
    k = undamped.system
    if isinstance(k, Coefficients):
        return []
    friction = float((k.drive.friction + k.drive.back_emf) * k.EI / k.length)
    turning = [-share * friction / undamped.arm.total_inertia] if k.at_rest == 1 else []
    return turning + ([-1.0 / float(k.drive.lag)] if k.drive.lag else [])


def _first_node(undamped: Modes, count: int, level: float) -> Node:
    """Where the way begins: at no damping, or at so little that what friction makes of the zeros at 0 is apart."""
    alone = single_zeros(undamped)
    more = modes(undamped.arm, count - len(alone), theory=undamped.theory)
    omega = more.natural_frequency[more.index > 0]
    node = Node(0.0, np.stack([1j * omega, -1j * omega], 1))
    if not alone:
        return node
    share = min(FIRST_SHARE, FIRST_SHARE * abs(node.zeros[0, 0] / alone[0]))
    single = np.array([[zero, np.nan] for zero in single_zeros(undamped, share)], dtype=complex)
    start = member(undamped.system.with_damping(share))
    return Node(share * level, polished(start, np.concatenate([single, node.zeros])))


def member(k: System, gains: Gains = NO_GAINS) -> Member:
    """The characteristic function without its zeros at the origin, to be followed."""
    at_zero, rows = zeros_at_origin(k, gains), as_column(gains)
    singular = -1.0 / k.damping if k.damping else -np.inf
    return Member(lambda s: quick_characteristics(k, s, rows, at_zero), singular)


def polished(last: Member, zeros: Complex) -> Complex:
    """Every zero to the last digits that float64 has of it."""
    for _ in range(LAST_STEPS):
        zeros, _ = improved(last, zeros)
    return zeros
