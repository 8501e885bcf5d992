"""Reduced models of an order or within an error, each with its frequency range, worst error and first missing mode.

The norm of an error is |dG| / (|G| + |w G'|).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices
from tfarm.arm.checks import positive, whole
from tfarm.arrays import Complex, Real
from tfarm.errors import MISSING, ConvergenceError, require
from tfarm.exact.outputs import Output
from tfarm.records import frozen
from tfarm.reduced.modal import SLOW_PAIRS, SLOW_POLES_FROM, modal_model, relaxed_model, slow_model
from tfarm.reduced.partial_fractions import EXACT_ROUNDING, PartialFractions, Ruler
from tfarm.reduced.rational import has_rational, modes_in, rational_model
from tfarm.response import Wanted, transfer
from tfarm.response.frequency import known_band
from tfarm.schema import Quantity
from tfarm.spectrum import modes

if TYPE_CHECKING:
    import control

Reduction = Literal["modal", "aaa"]

# rad/s, by default
BAND = (0.1, 1000.0)
# of the printed errors
NORM = "|dG| / (|G| + |w dG/dw|)"
# of a model within an error
MOST_STATES = 400


class Channel(NamedTuple):
    """An output of a reduced model: its largest error over the range, and the frequency of that."""

    output: Annotated[str, Quantity("output", help="output of the model")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the output")]
    error: Annotated[float, Quantity("worst error", digits=3, help="largest relative error in the range")]
    worst_at: Annotated[float, Quantity("at", "rad/s", help="frequency of the worst error")]


@frozen
class ReducedModel:
    """A reduced model and its error.

    `worst_error` is the largest |dG| / (|G| + |w dG/dw|) over `band` [rad/s], with a margin of 2 %: the maximum of
    `errors` (outputs,), which are at `worst_at` [rad/s].  `first_mode_lacking` is the first flexible mode of the arm
    without a pole of the model within 1e-6, `lacking_frequency` [rad/s] its undamped frequency.  `note` has the
    deviation from the requested order or method, or is empty.
    """

    model: PartialFractions
    method: Annotated[
        Reduction, Quantity("method", help="truncated modal series, or rational approximation (AAA)")
    ]
    band: Annotated[
        tuple[float, float],
        Quantity("frequency range", "rad/s", help="in which the error is known", key="range_rad_s"),
    ]
    errors: Real
    worst_at: Real
    first_mode_lacking: Annotated[
        int, Quantity("first mode missing", help="first flexible mode of the arm without a pole of the model")
    ]
    lacking_frequency: Annotated[
        float,
        Quantity(
            "its frequency",
            "rad/s",
            10,
            "natural frequency of that mode, undamped",
            key="first_mode_lacking_rad_s",
        ),
    ]
    note: Annotated[str, Quantity("note", help="deviation from the requested order or method")] = ""

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm", help="name of the arm", key="arm")]:
        """The name of the arm."""
        return self.arm.name

    @property
    def error_norm(
        self,
    ) -> Annotated[str, Quantity("error norm", help="norm of the error at each frequency")]:
        """The norm of `errors`."""
        return NORM

    @property
    def channels(
        self,
    ) -> Annotated[list[Channel], Quantity("outputs", help="each with its error", key="channels")]:
        """A row an output."""
        G = transfer(self.arm, self.model.rows, x=self.model.x)
        rows = zip(self.model.outputs, G.units, self.errors.tolist(), self.worst_at.tolist(), strict=True)
        return [Channel(*row) for row in rows]

    @property
    def poles(self) -> Annotated[Complex, Quantity("s", "1/s", 10, "poles of the model", key="poles")]:
        """The poles of the model with Im s >= 0 and their mirror images."""
        return np.r_[self.model.eigenvalues.ravel(), self.model.single].astype(complex)

    @property
    def x(self) -> Annotated[float | None, Quantity(help="place of outputs along the arm [m]")]:
        """The place of outputs along the arm."""
        return self.model.x

    @property
    def input(self) -> Annotated[str, Quantity("input", help="input of the model")]:
        """The input."""
        return self.model.input

    @property
    def states(self) -> Annotated[tuple[str, ...], Quantity(help="names of the states")]:
        """Names of the states."""
        return self.model.states

    @property
    def named_matrices(
        self,
    ) -> Annotated[dict[str, Real], Quantity(help="matrix of the state space", flat=True)]:
        """A, B, C and D by their names."""
        return dict(zip("ABCD", self.matrices(), strict=True))

    @property
    def worst_error(
        self,
    ) -> Annotated[float, Quantity("worst error", digits=3, help="largest of all outputs")]:
        """The largest of `errors`."""
        return float(self.errors.max())

    @property
    def arm(self) -> Arm:
        """The exact arm."""
        return self.model.arm

    @property
    def order(self) -> Annotated[int, Quantity("order", help="number of states")]:
        """The number of states."""
        return self.model.order

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.model.outputs

    @property
    def name(self) -> str:
        """Arm, method and order in words."""
        return f"{self.arm.name}, {self.method}, order {self.order}"

    def __call__(self, s: ArrayLike) -> Complex:
        """Return values (outputs, *s.shape) at complex s [1/s]."""
        return self.model(s)

    def matrices(self) -> Matrices:
        """Return A, B, C, D as NumPy arrays (see `PartialFractions.matrices`)."""
        return self.model.matrices()

    def state_space(self) -> control.StateSpace:
        """Return the model as a `control.StateSpace` with named inputs, outputs and states."""
        return self.model.state_space(self.name)


def reduce(
    arm: Arm,
    outputs: Wanted,
    *,
    order: int | None = None,
    error: float | None = None,
    method: Reduction | None = None,
    band: tuple[float, float] = BAND,
    x: float | None = None,
) -> ReducedModel:
    """Return the reduced model of an `order`, or the smallest one whose worst error over the range is within `error`.

    Orders are even.  At C > 0 an odd order has a state for the relaxation of the omitted modes (see `relaxed_model`).
    Where these are overdamped, 14 states of an even order may be slow poles next to -1/C (`slow_model`).
    `band` [rad/s] is the frequency range; `method` is "modal" or "aaa" (C = 0 only), by default that with the smaller
    error; `x` [m] is the place of outputs along the arm.
    Raises ParameterError for illegal arguments, ConvergenceError where no model of up to 400 states is within the
    error.
    """
    rows = transfer(arm, outputs, x=x).rows
    names = tuple(each.name for each in rows)
    band = known_band(band, 1e12)
    require(len(set(names)) == len(names), "outputs", names, "name each output once")
    is_known = method is None or method in get_args(Reduction)
    require(is_known, "method", method, "modal or aaa, or leave it out for the better one")
    remedy = "AAA in s^2 is for C = 0, no friction and no inductance; take modal, which has them"
    require(method != "aaa" or has_rational(arm), "method", "aaa", remedy)
    remedy = "give either an order (a number of states) or an error"
    require((order is None) != (error is None), "order", MISSING if order is None else order, remedy)
    if order is not None:
        return _Bench(arm, rows, band, x, method).of_order(order)
    error = positive("error", error, "a positive number, such as 1e-6")
    remedy = f"below the rounding of the exact values; give {EXACT_ROUNDING:g} or more"
    require(error >= EXACT_ROUNDING, "error", error, remedy)
    return _Bench(arm, rows, band, x, method).smallest_within(error)


class _Bench:
    """Models of one arm over one frequency range, with their errors."""

    def __init__(
        self,
        arm: Arm,
        rows: tuple[Output, ...],
        band: tuple[float, float],
        x: float | None,
        method: Reduction | None,
    ) -> None:
        self.arm = arm
        self.rows = rows
        self.band = band
        self.x = x
        self.fixed = modal_model(arm, rows, 0, x).order
        self.inside = modes_in(arm, band[1])
        # pairs of poles
        self.most = (MOST_STATES - self.fixed) // 2
        # 12 above the range: more would fit rounding
        self.most_by_aaa = min(self.inside + 12, self.most)
        self.by_modes = method != "aaa"
        self.by_aaa = method != "modal" and has_rational(arm)
        self.ruler = Ruler(arm, rows, band, x)

    def of_order(self, order: int) -> ReducedModel:
        """Return the better model of that many states."""
        pairs = self._pairs(order)
        of = (self.arm, self.rows)
        if (order - self.fixed) % 2 and self.arm.damping:
            return self._measure(relaxed_model(*of, pairs, self.x), "modal")
        found: list[ReducedModel] = []
        if self.by_aaa and pairs > self.inside:
            model = rational_model(*of, pairs, self.band[1], self.x)
            note = ""
            if model.order != order:
                note = f"order below {order}: no more poles passed the checks of AAA"
            found.append(self._measure(model, "aaa", note))
        if self.by_modes or not found:
            note = ""
            if not self.by_modes:
                note = f"method modal: AAA needs more than the {self.inside} modes in the range"
            found.append(self._measure(modal_model(*of, pairs, self.x), "modal", note))
            # modes: slow poles replace omitted ones that are overdamped
            less = pairs - SLOW_PAIRS
            if less >= 1:
                last = modes(self.arm, less).natural_frequency[-1]
                if self.arm.damping * last >= SLOW_POLES_FROM:
                    found.append(self._measure(slow_model(*of, less, self.x), "modal"))
        return min(found, key=lambda each: each.worst_error)

    def smallest_within(self, error: float) -> ReducedModel:
        """Return the smallest model whose error is at most that one."""
        found = self._few_poles(error)
        most = self.most
        if self.arm.damping:
            found += self._few_modes(error, relaxed_model, most)
            if found:
                most = found[-1].model.index.size
        if self.by_modes:
            found += self._few_modes(error, modal_model, most)
        if not found and self.arm.damping:
            found += self._few_modes(error, slow_model, self.most - SLOW_PAIRS)
        if not found:
            best = self.of_order(2 * self.most_by_aaa + self.fixed)
            message = (
                f"no model of up to {MOST_STATES} states is within {error:g} from {self.band[0]:g} to {self.band[1]:g} "
                f"rad/s; order {best.order} has {best.worst_error:.2g}: allow more, or narrow the range"
            )
            raise ConvergenceError(message, best, best.worst_error)
        return min(found, key=lambda each: (each.order, each.worst_error))

    def _few_poles(self, error: float) -> list[ReducedModel]:
        """Return the smallest model by AAA within an error, if there is one."""
        if not self.by_aaa:
            return []
        sizes = range(self.inside + 1, self.most_by_aaa + 1)
        models = (rational_model(self.arm, self.rows, pairs, self.band[1], self.x) for pairs in sizes)
        return self._first_within(error, models, "aaa")

    def _first_within(
        self, error: float, models: Iterable[PartialFractions], method: Reduction
    ) -> list[ReducedModel]:
        """Return the first of the models whose error is within that one, if any."""
        for model in models:
            if self.ruler.rough(model) <= error:
                found = self._measure(model, method)
                if found.worst_error <= error:
                    return [found]
        return []

    def _few_modes(
        self, error: float, make: Callable[..., PartialFractions], most: int
    ) -> list[ReducedModel]:
        """Return the smallest model of up to `most` modes within an error, if any.  By bisection, as errors fall."""

        def model(count: int) -> PartialFractions:
            return make(self.arm, self.rows, count, self.x)

        def rough(count: int) -> float:
            return self.ruler.rough(model(count))

        good = 0
        bad = -1
        # of the errors with more and more modes beyond those of the range
        sizes: list[float] = []
        try:
            while (size := rough(good)) > error:
                if good > self.inside:
                    sizes.append(size)
                # 0.5: decrease of the error with 2.25 times the modes, at least, even for 1/n; less is its floor
                is_floor = len(sizes) > 2 and sizes[-1] > 0.5 * sizes[-3]
                if good == most or is_floor:
                    return []
                bad = good
                good = min(good + max(good // 2, 2), most)
        except ConvergenceError:
            # at C > 0 no more damped modes can be separated
            return []
        while good - bad > 1:
            middle = (good + bad) // 2
            if rough(middle) <= error:
                good = middle
            else:
                bad = middle
        # 3: numbers of modes, from that of the rough error on, whose error is computed in full
        counts = range(good, min(good + 3, most + 1))
        return self._first_within(error, map(model, counts), "modal")

    def _measure(self, model: PartialFractions, method: Reduction, note: str = "") -> ReducedModel:
        """Return a model with its error."""
        errors, worst_at = self.ruler.measure(model)
        return ReducedModel(model, method, self.band, errors, worst_at, *first_mode_lacking(model), note)

    def _pairs(self, order: object) -> int:
        """Return the number of flexible pairs of poles in a model of that order."""
        rigid = {0: "", 2: "two for the rigid body, "}.get(self.fixed, f"{self.fixed} other than the modes, ")
        remedy = f"states come in pairs, {rigid}two a mode: an even number from 2 to {MOST_STATES}"
        if not self.arm.is_undamped:
            remedy = (
                f"two states a mode, {rigid}and one for relaxation where it is odd: from 2 to {MOST_STATES}"
            )
        order = whole("order", order, 2, MOST_STATES, remedy)
        require(order % 2 == 0 or self.arm.damping or not self.arm.is_uniform, "order", order, remedy)
        return (order - self.fixed) // 2


def first_mode_lacking(model: PartialFractions) -> tuple[int, float]:
    """Return the number and undamped frequency [rad/s] of the arm's first flexible mode that the model lacks."""
    omega = modes(model.arm, model.index.size + 1).flexible
    # 1e-6: relative gap within which a pole of the model is a mode of the arm
    has = (abs(model.natural_frequency[:, None] - omega) <= 1e-6 * omega).any(axis=0)
    first = int(np.argmin(has))
    return first + 1, float(omega[first])
