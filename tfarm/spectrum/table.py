"""The modal table of an arm: frequencies, shapes, hub participation, nodes and exact sensitivities."""

import math
from dataclasses import field
from fractions import Fraction
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import THEORIES, Arm, Theory, must_be_arm
from tfarm.arm.checks import on_the_arm, whole
from tfarm.arrays import Real, Whole
from tfarm.digits import DOUBLE_DIGITS, general, singly
from tfarm.errors import ConvergenceError, require
from tfarm.exact.system import System, shear_flexibility, system_of
from tfarm.exact.values import (
    APPENDIX_DIGITS,
    ByMethod,
    Method,
    by_method,
    known_method,
    must_be_of_appendix,
    why_no_appendix,
)
from tfarm.records import frozen
from tfarm.schema import Column, Table, Tabled
from tfarm.spectrum.frequencies import ARMS_KEPT, count_below, natural_frequencies, refine
from tfarm.spectrum.proofs import Certificate, certify
from tfarm.spectrum.sensitivities import sensitivities
from tfarm.spectrum.shapes import Shapes


@frozen
class Modes(Tabled):
    """The undamped modes of an arm, in ascending order, complete up to the last one.

    A rigid-body mode has the index 0, flexible modes those from 1.  Every mode has unit modal mass (1 kg m^2 of hub
    inertia counts as 1) and a positive tip displacement.  `natural_frequency` [rad/s] and `index` have one entry for
    each mode, without the effect of C.
    """

    arm: Arm
    theory: Theory
    index: NDArray[np.int64]
    natural_frequency: Real
    _k: System = field(repr=False)

    @property
    def finding(self) -> str:
        """The number of flexible modes and their range of frequencies, in words."""
        if not self.flexible.size:
            return "no flexible mode"
        return f"{self.flexible.size} flexible, {self.flexible[0]:.6g} to {self.flexible[-1]:.6g} rad/s"

    @property
    def table(self) -> Table:
        """A row a mode."""
        columns = (
            Column("index", "mode", of=self.index),
            Column(
                "omega", "natural frequency", "rad/s", of=self.natural_frequency, digits=singly(general, 12)
            ),
            Column("hertz", "frequency", "Hz", of=self.natural_frequency_hz, digits=singly(general, 9)),
        )
        return Table(columns=columns, title=f"modes of {self.arm.name}")

    @property
    def system(self) -> System:
        """The arm's system under this theory, with its damping."""
        return system_of(self.arm, self.theory)

    @property
    def flexible(self) -> Real:
        """Natural frequencies [rad/s] of the flexible modes."""
        return self.natural_frequency[self._rigid :]

    @property
    def natural_frequency_hz(self) -> Real:
        """Natural frequencies [Hz]."""
        return self.natural_frequency / (2 * math.pi)

    def digits(self, digits: int) -> list[str]:
        """Return the frequencies [rad/s] as strings with that many right digits, at least 12.

        Under the Timoshenko theory each is also confirmed as a root of the paper's Delta(s), by mpmath.
        Raises ConvergenceError where a digit is not determined (a double frequency) or Delta has no root there.
        """
        # here: mpmath takes a while to load
        from tfarm.exact.appendix import roots_near

        digits = max(digits, 12)
        flexible = [refine(self._k, omega, digits) for omega in self.flexible.tolist()]
        is_of_appendix = self.theory == "timoshenko" and self.arm.is_uniform
        for text in flexible:
            if is_of_appendix and not roots_near(self.arm, text, digits - 1):
                raise ConvergenceError(f"Delta(s) of the appendix has no root at {text}i rad/s", text, digits)
        return ["0.0"] * self._rigid + flexible

    def frequencies(self, method: Method = "closed-form") -> Real:
        """Return the frequencies [rad/s] by a method (see `tfarm.exact.values`), float64, one for each mode.

        "balls": the middle of each certified bracket of 20 digits; "appendix": the roots of the paper's Delta.
        Raises ParameterError for the appendix of another theory.  At a double frequency raises CertificationError for
        balls and ConvergenceError for the appendix.
        """
        if known_method(method) == "closed-form":
            return self.natural_frequency
        if method == "balls":
            # 1e-4 of a float64's rounding
            brackets = self.certify(20).brackets
            flexible = [float((Fraction(lower) + Fraction(upper)) / 2) for lower, upper in brackets]
        else:
            # here: mpmath takes a while to load
            from tfarm.exact.appendix import natural_frequency

            must_be_of_appendix(self.arm, self.theory)
            starts = self.flexible.tolist()
            flexible = [float(natural_frequency(self.arm, omega, APPENDIX_DIGITS)) for omega in starts]
        return self._with_rigid(flexible)

    def by_methods(self) -> ByMethod:
        """Return the frequencies [rad/s] by every method that has them, with their differences.

        Raises CertificationError or ConvergenceError as `frequencies` does.
        """
        return by_method(self.frequencies, why_no_appendix(self.arm, self.theory))

    def certify(self, digits: int = DOUBLE_DIGITS) -> Certificate:
        """Return certified brackets of the flexible frequencies to that many digits, none missing.

        Raises CertificationError where that fails, as at a double frequency.
        """
        beyond = len(self) + 1
        above = float(natural_frequencies(self._k, beyond, beyond)[0])
        return certify(self._k, self.flexible, above, digits, int(self._rigid))

    def __len__(self) -> int:
        return self.index.size

    # ------------------------------------------------------------ shapes

    def shape(self, x: NDArray[np.float64] | float) -> Real:
        """Return the displacement w(x) [m/sqrt(kg m^2)] at x [m]: (modes, *x.shape)."""
        return self._field(0, x) * float(self._k.length)

    def rotation(self, x: NDArray[np.float64] | float) -> Real:
        """Return the rotation psi(x) [rad/sqrt(kg m^2)] of the cross-section at x [m]: (modes, *x.shape)."""
        return self._field(1, x)

    def moment(self, x: NDArray[np.float64] | float) -> Real:
        """Return the bending moment E I psi'(x) [N m/sqrt(kg m^2)] at x [m]: (modes, *x.shape)."""
        return self._field(2, x) * float(self._k.EI / self._k.length)

    def shear(self, x: NDArray[np.float64] | float) -> Real:
        """Return the shear force kappa G A (w' - psi) [N/sqrt(kg m^2)] at x [m]: (modes, *x.shape)."""
        return self._field(3, x) * float(self._k.EI / self._k.length**2)

    @cached_property
    def hub_participation(self) -> Real:
        """b = psi(0) [rad/sqrt(kg m^2)] of each mode; b^2 is the residue of hub angle/torque in s^2.  0 if locked."""
        found = self._with_rigid(self._shapes.theta() * self._unit)
        if self._rigid:
            found[0] = 1.0 / math.sqrt(self.arm.total_inertia)
        return found

    @cached_property
    def modal_moment(self) -> Real:
        """Root moment E I psi'(0) [N m/sqrt(kg m^2)] of each mode: (k - I_h w^2) b of a free hub clamped on its axis.

        For a hub lighter than the link it is computed so, as the field at the root cancels: 0 for a free pin.
        """
        arm = self.arm
        inertia = arm.hub_side_inertia
        is_light = inertia < arm.link.rhoA * arm.link.length**3 / 3
        if is_light and arm.reads_hub_moment and not arm.is_locked:
            per_angle = arm.hub.stiffness - inertia * self.natural_frequency**2
            return per_angle * self.hub_participation + 0.0
        return self.moment(0.0)

    @cached_property
    def nodes(self) -> tuple[Real, ...]:
        """Points x [m] strictly inside the arm where the displacement of each mode vanishes."""
        found = [np.empty(0)] * self._rigid
        first = 0
        for block in self._shapes.blocks():
            first += block.omega.size
            mode, x = self._nodes(block, first)
            found += np.split(x * float(self._k.length), np.searchsorted(mode, range(1, block.omega.size)))
        return tuple(found)

    # ------------------------------------------------------------ sensitivities

    @cached_property
    def sensitivity(self) -> dict[str, Real]:
        """d ln w / d ln p of each frequency for each parameter p, exact (`sensitivities`); 0 for a rigid mode.

        Each parameter varies alone: Young's modulus at constant G, the area at constant I.  An infinite or zero inertia
        has 0.  A rig has entries for its parts and each of its segments.
        """
        found = sensitivities(self.arm, self._shapes)
        return {name: self._with_rigid(values) for name, values in found.items()}

    # ------------------------------------------------------------ inside

    @property
    def _rigid(self) -> bool:
        """Whether the first mode is the rigid body."""
        return bool(self.index.size and self.index[0] == 0)

    def _with_rigid(self, flexible: Real | list[float]) -> Real:
        """Return values of the flexible modes behind the 0 of a rigid-body mode."""
        return np.r_[[0.0] * self._rigid, flexible]

    @property
    def _unit(self) -> float:
        """The factor from modes of unit dimensionless mass to modes of unit modal mass."""
        return math.sqrt(float(self._k.length / self._k.EI))

    @cached_property
    def _shapes(self) -> Shapes:
        return Shapes(self._k, self.flexible)

    def _field(self, which: int, x: NDArray[np.float64] | float) -> Real:
        share = on_the_arm("x", x, float(self._k.length)) / float(self._k.length)
        values = self._shapes(share.ravel())[which] * self._unit
        if self._rigid:
            turn = 1.0 / math.sqrt(self.arm.total_inertia)
            reach = share.ravel() + self.arm.hub.radius / float(self._k.length)
            rigid = (turn * reach, np.full(share.size, turn), *np.zeros((2, share.size)))[which]
            values = np.vstack([rigid, values])
        return values.reshape(len(values), *share.shape)

    def _nodes(self, shapes: Shapes, last: int) -> tuple[Whole, Real]:
        """Return modes (n,) up to number `last` and the interior zeros x (n,) of their W.

        They are bracketed on a fine grid and refined by Newton's method, W' = Psi + sigma Q.
        """
        # 24 points for each half wave, of two more half waves than the mode has
        even = 24 * (last + 2)
        # a heavy hub has a node close to it
        ends = np.geomspace(1e-9, 0.9 / even, 40)
        grid = np.r_[ends, np.linspace(0.0, 1.0, even)[1:-1], 1.0 - ends[::-1]]
        W, Psi, *_ = shapes(grid)
        # a cut-off mode has W = 0 throughout, to rounding
        size = abs(np.hstack([W, Psi])).max(axis=1, keepdims=True)
        W[abs(W) < 1e-13 * size] = 0.0
        mode, start = np.nonzero(W[:, :-1] * W[:, 1:] < 0)
        low = grid[start]
        high = grid[start + 1]
        before = low
        here = W[mode, start]
        x = low + (high - low) * here / (here - W[mode, start + 1])
        # from two digits to more than 64 bits
        for _ in range(6):
            if (abs(x - before) <= np.spacing(1.0)).all():
                break
            at, slope, _, Q = shapes.at(mode, x)
            before = x
            x = np.clip(x - at / (slope + shear_flexibility(self._k, x) * Q), low, high)
        return mode, x


def modes(
    arm: Arm, count: int | None = None, *, up_to: float | None = None, theory: Theory | None = None
) -> Modes:
    """Return all undamped modes of the arm: the first `count` flexible ones, or those below `up_to` [rad/s].

    Complete by their count (Wittrick and Williams 1971), for any hub and payload, also above the shear cut-off, double
    frequencies twice.  `theory` is one of timoshenko, shear, rayleigh, euler-bernoulli.
    Raises ParameterError for a count outside 1..10000 or a frequency that is not positive.
    """
    # of one table
    most_table_modes = 10_000
    must_be_arm(arm)
    if theory is None:
        theory = arm.theory
    k = system_of(arm, theory).undamped
    rigid = arm.has_rigid_mode
    require(
        (count is None) != (up_to is None),
        "count",
        count,
        "give either a count of modes or a frequency up_to",
    )
    if up_to is None:
        count = whole("count", count, 1, math.inf, f"a whole number of modes from 1 to {most_table_modes}")
    else:
        require(0 < up_to < math.inf, "up_to", up_to, "a positive, finite frequency in rad/s")
        count = modes_below(arm, up_to, theory=theory)
        require(count, "up_to", up_to, "no flexible mode lies below it; choose a higher one")
    require(count <= most_table_modes, "count", count, f"at most {most_table_modes} modes")
    flexible = natural_frequencies(k, rigid + 1, rigid + count)
    index = np.arange(1 - rigid, count + 1)
    return Modes(arm, theory, index, np.r_[[0.0] * rigid, flexible], k)


def compare_theories(table: Modes) -> dict[Theory, Real]:
    """Return the frequencies [rad/s] of the modes by each of the four theories, in the order of `THEORIES`.

    Modes are matched by their number.  Above the shear cut-off, where the Timoshenko beam has a second spectrum, equal
    numbers may have different shapes.
    """
    count = int(table.index.max())
    by_theory = {
        theory: modes(table.arm, count, theory=theory) for theory in THEORIES if theory != table.theory
    }
    return {theory: by_theory.get(theory, table).natural_frequency for theory in THEORIES}


def hub_locked(table: Modes) -> Modes:
    """Return as many modes of the same arm with a locked hub; the table itself where the hub is locked already.

    The joint behind the hub stays flexible.
    """
    if table.arm.is_locked:
        return table
    return modes(table.arm.with_numbers(hub_inertia=math.inf), int(table.index.max()), theory=table.theory)


def modes_below(arm: Arm, up_to: float, *, theory: Theory | None = None) -> int:
    """Return the number of flexible modes of the undamped arm below up_to [rad/s], by the count."""
    return count_below(system_of(arm, theory).undamped, up_to) - arm.has_rigid_mode


def flexible_frequencies(arm: Arm, up_to: float) -> Real:
    """Return the flexible natural frequencies [rad/s] of the undamped arm below `up_to`."""
    if modes_below(arm, up_to) == 0:
        return np.empty(0)
    return modes(arm, up_to=up_to).flexible


@lru_cache(maxsize=ARMS_KEPT)
def first_frequency(arm: Arm) -> float:
    """Return w1 [rad/s], the lowest flexible frequency of the undamped arm."""
    return float(modes(arm.elastic, 1).natural_frequency[-1])
