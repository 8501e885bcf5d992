"""A locus compared with that of a reduced model, and the gain that damps the first mode most.

Along a gain the reduced locus is `control.root_locus_map` on the loop of a modal model, opened at that gain and closed
at the others.  A parameter of the arm is nothing that python-control varies: there it is the poles of a reduced closed
loop at a few values.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment, minimize_scalar

from tfarm.arm import FED_BACK, NAMES, Arm, HubFeedback
from tfarm.arm.blocks import Matrices
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.errors import ConvergenceError
from tfarm.loop.branches import ORIGIN, origin_name
from tfarm.loop.locus import Locus, locus
from tfarm.loop.varied import OF_THE_LAW, Title
from tfarm.records import frozen
from tfarm.reduced import modal_model
from tfarm.schema import Quantity
from tfarm.spectrum import modes
from tfarm.spectrum.following import interpolate_roots

if TYPE_CHECKING:
    import control

# values of the gain, and branches
LOCUS_POINTS = 300
# digits of |s| that are drawn and written: poles differ from processor to processor by 1e-14 at most
POLE_DIGITS = 10
GAP_NOTE = (
    "largest distance of a branch from the reduced one, "
    "over |s| or the arm's first flexible frequency, the larger"
)


@frozen
class ReducedLocus:
    """Poles of a reduced closed loop of that `order`, paired with the exact branches, at the values `gain` (m,).

    `branches` (b, m) [1/s] are the reduced poles paired one to one with the exact ones so that the sum of distances is
    least; `gap` (b,) is the largest distance of each branch, as a share of |s| or, if that is more, of the arm's first
    flexible frequency.
    """

    order: Annotated[int, Quantity("order of the reduced model", key="reduced_order", help="states")]
    gain: Real
    branches: Complex
    gap: Real

    @property
    def worst(
        self,
    ) -> Annotated[float, Quantity("largest gap to it", digits=2, help=GAP_NOTE, key="gap_to_reduced")]:
        """The largest gap of all branches."""
        return float(self.gap.max())


def reduced_locus(exact: Locus, order: int | None = None) -> ReducedLocus:
    """Return the locus by python-control on a modal model of that even order, or two modes beyond the last branch.

    Raises ConvergenceError if the model is beyond python-control.
    """
    arm = exact.arm
    rigid = arm.has_rigid_mode
    # by default ten modes at least, and two modes above the last branch
    order = order or max(20, 2 * (int(exact.mode.max()) + rigid + 2))
    count = order // 2 - rigid
    if exact.vary in OF_THE_LAW:
        import control

        which = np.arange(exact.gain.size)
        system = open_loop(exact.case, exact.vary, count)
        try:
            poles = np.asarray(control.root_locus_map(system, exact.gain).loci)
        except np.linalg.LinAlgError as error:
            # it works with coefficients of s^n, which overflow at high frequencies
            text = f"python-control cannot follow a model of this arm: {error}"
            raise ConvergenceError(text, arm.name, count) from None
    else:
        # 9 values at which an arm is reduced anew, where a parameter of it varies
        which = np.unique(np.linspace(0, exact.gain.size - 1, 9).round().astype(int))
        arms = [exact.varied.at(value).arm for value in exact.gain[which].tolist()]
        models = [_closed_model(each, exact.gains, count, HubFeedback())[0] for each in arms]
        poles = np.array([np.linalg.eigvals(A) for A, *_ in models])
    branches = exact.branches[:, which]
    paired = np.full(branches.shape, np.nan, complex)
    for n, (zeros, found) in enumerate(zip(branches.T, poles, strict=True)):
        _, chosen = linear_sum_assignment(np.nan_to_num(abs(zeros[:, None] - found)))
        paired[:, n] = np.where(np.isnan(zeros), np.nan, found[chosen])
    size = np.maximum(abs(branches), modes(arm, 1).natural_frequency[-1])
    gap = np.fmax.reduce(abs(paired - branches) / size, axis=1)
    return ReducedLocus(order, exact.gain[which], paired, gap)


def reduced_of(exact: Locus) -> ReducedLocus | None:
    """Return the reduced locus of gains at the hub; None of another law or number."""
    return None if exact.in_box else reduced_locus(exact)


def open_loop(case: Case, vary: str, count: int) -> control.StateSpace:
    """Return the loop function that the varied gain multiplies, all other gains closed, of a modal model."""
    import control

    law = case.gains
    assert law is not None
    if vary == "all":
        moving = law
        fixed = HubFeedback()
    else:
        moving = HubFeedback().with_number(vary, 1.0)
        fixed = law.with_number(vary, 0.0)
    (A, B, C, D), row = _closed_model(case.arm, fixed, count, moving)
    return control.StateSpace(A, B, row @ C, row @ D)


def _closed_model(arm: Arm, fixed: HubFeedback, count: int, moving: HubFeedback) -> tuple[Matrices, Real]:
    """Return the model of the outputs of either law, closed by the fixed one, and the other's row on its outputs."""
    rows = np.array([fixed.row, moving.row])
    used = np.asarray(rows.any(axis=0))
    used[FED_BACK.index("hub_rate")] |= not used.any()
    # or its pole at 0 is not a state
    used[FED_BACK.index("hub_angle")] |= bool(arm.rate_loss) and arm.has_rigid_mode
    model = modal_model(arm, np.array(FED_BACK)[used].tolist(), count)
    return model.closed(rows[0, used]), rows[1:, used]


@frozen
class MostDamped:
    """The `gain` at which mode 1 has its largest `damping_ratio`; from there on it oscillates (`swings_on`) or not."""

    gain: Annotated[float, Quantity("value", help="value of the gain at which mode 1 is damped most")]
    damping_ratio: Annotated[float, Quantity("damping ratio", help="-Re s/|s| of mode 1 there")]
    swings_on: bool
    title: Title

    @property
    def titles(self) -> dict[str, Title]:
        """That of the gain."""
        return {"gain": self.title}


def most_damped(found: Locus) -> MostDamped | None:
    """Return the first mode's largest damping ratio along a gain; None where its branch is not followed all the way.

    Between neighbours that oscillate too it is solved for.  At an end of the range it is that of the locus's own value.
    """
    rows = found.branches[(found.mode == 1) & (found.branches.imag > 0).any(axis=1)]
    rows = rows[~np.isnan(rows).any(axis=1)]
    if found.vary not in NAMES or not rows.size:
        return None
    first = rows[0]
    ratios = damping_ratios(first)
    at = int(np.argmax(ratios))
    best = (float(found.gain[at]), float(ratios[at]))
    way = int(np.sign(found.gain[-1] - found.gain[0]))
    near = slice(at - 1, at + 2)
    gain = found.gain[near][::way]
    branch = first[near][::way]
    if 0 < at < ratios.size - 1 and (branch.imag > 0).all():

        def negative_ratio(value: float) -> float:
            pole = interpolate_roots(found.varied, gain, branch[:, None], np.array([value]))
            return -damping_ratios(pole).item()

        # 1e-7 of the gain: a damping ratio, flat there, is known to 1e-14 of its curvature
        low, middle, high = gain.tolist()
        known = 1e-7 * abs(middle)
        least = minimize_scalar(
            negative_ratio, bounds=(low, high), method="bounded", options={"xatol": known}
        )
        best = (float(least.x), -float(least.fun))
    return MostDamped(*best, bool((first[at:].imag > 0).all()), found.varied.title)


def damping_ratios(s: Complex) -> Real:
    """Return -Re s/|s| of oscillating poles; -inf of real ones."""
    return np.where(s.imag > 0, -s.real / np.maximum(abs(s), LEAST_SIZE), -np.inf)


class Branch(NamedTuple):
    """A branch of a locus: its poles at both ends of the range, and its distance from the reduced model's."""

    branch: Annotated[
        int, Quantity("branch", help="its number among the poles of the CSV file and the picture")
    ]
    origin: Annotated[str, ORIGIN]
    mode: Annotated[int, Quantity(help="flexible mode that the branch continues from; 0 of another origin")]
    first: Annotated[
        complex, Quantity("first pole", "1/s", 10, "pole at the first value of the number that varies")
    ]
    last: Annotated[
        complex, Quantity("last pole", "1/s", 10, "pole at the last value of the number that varies")
    ]
    gap: Annotated[float | None, Quantity("gap to reduced", digits=2, help=GAP_NOTE)]
    ends_at: Annotated[
        float | None, Quantity("followed up to", digits=10, help="last value at which it is followed")
    ]
    titles: dict[str, Title]


@frozen
class Loci:
    """The exact locus and the reduced one."""

    exact: Annotated[Locus, Quantity(flat=True)]
    # None of a law that is more than gains at the hub
    reduced: Annotated[ReducedLocus | Any, Quantity(flat=True)]

    @property
    def rows(
        self,
    ) -> Annotated[
        list[Branch],
        Quantity(
            "branches",
            key="branch_list",
            help="poles followed: those at s = 0, then one a mode with Im s > 0; its mirror image only where the two "
            "part on the real axis. A crossing of a branch with omega > 0 is one of its mirror image too. A branch is "
            "null where it is not followed: beyond -1/C, where real poles accumulate; outside the box of a law. "
            "Crossings of poles on no branch are listed too (branch null).",
        ),
    ]:
        """One row for each branch."""
        exact = self.exact
        ends = dict(exact.ends)
        names = map(origin_name, exact.origin.tolist())
        gaps = [None] * len(exact.branches) if self.reduced is None else self.reduced.gap.tolist()
        unit = f" {self.unit}" if self.unit else ""
        titles = {}
        for end, value in zip(("first", "last"), exact.gain[[0, -1]].tolist(), strict=True):
            titles[end] = (f"pole at {exact.vary} = {value:.6g}{unit}", "1/s")
        poles = exact.branches[:, [0, -1]].tolist()
        columns = zip(names, exact.mode.tolist(), poles, gaps, strict=True)
        return [
            Branch(n, name, mode, first, last, gap, ends.get(n), titles)
            for n, (name, mode, (first, last), gap) in enumerate(columns)
        ]

    @property
    def best(
        self,
    ) -> Annotated[
        MostDamped | None,
        Quantity(
            "first mode most damped",
            key="first_mode_most_damped",
            help="largest damping ratio of mode 1 along a gain",
        ),
    ]:
        """The gain at which the first mode has its largest damping ratio."""
        return most_damped(self.exact)

    @property
    def name(self) -> str:
        """The number that varies."""
        return self.exact.vary

    @property
    def unit(self) -> str:
        """The unit of that number; empty of a pure one."""
        return self.exact.varied.title[1]


def round_branches(branches: Complex) -> Complex:
    """Round branches to the digits that are the same on every processor, relative to |s|: a small Re s is kept."""
    size = np.maximum(abs(branches), np.finfo(float).tiny)
    unit = 10.0 ** (np.floor(np.log10(size)) + 1 - POLE_DIGITS)
    return np.round(branches.real / unit) * unit + 1j * (np.round(branches.imag / unit) * unit)


def loci(case: Case, vary: str, start: float, stop: float) -> Loci:
    """Return both loci of one gain.  Raises as `locus` and `reduced_locus` do."""
    locus_branches = 7
    exact = locus(case.arm, case.law, vary, start, stop, LOCUS_POINTS, locus_branches)
    return Loci(exact, reduced_locus(exact))
