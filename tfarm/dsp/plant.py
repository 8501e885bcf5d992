"""The plant of a sampled loop: poles and residues of the modal model with an analog filter.

    G_o(s) = rigid[o,0]/s^2 + rigid[o,1]/s + static[o] + sum over poles of residues[o,i]/(s - poles[i])

A first-order filter wc/(s + wc) on an output adds one pole and changes residues; the form is the same.  Analog damping
of the hub is friction of the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, must_have_free_hub
from tfarm.arm.chain import Chain
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.exact.outputs import Output
from tfarm.records import frozen
from tfarm.reduced import ModalModel, modal_model
from tfarm.reduced.modal import SLOW_POLES_FROM, slow_remainder
from tfarm.response import transfer
from tfarm.schema import Quantity
from tfarm.spectrum.frequencies import LISTS_KEPT

# of a simulation, not filtered
RECORDED = ("hub_angle", "hub_rate", "root_moment", "tip_displacement")
MODES_USED = Quantity(
    "flexible modes", help="number of flexible modes of the arm in the model of the sampled loop"
)
# flexible, of a sampled loop or a simulation by default
USUAL_MODES = 20
# C w from which on a mode surely is: following it further costs a hundred times as much
OVERDAMPED = 2.5
# e^-40 = 4e-18: such a pole has settled before the next sample
FORGOTTEN = 40.0


@frozen
class Plant:
    """Poles (m,) [1/s] other than s = 0, conjugates listed too; residues (outputs, m), rigid (outputs, 2), static
    (outputs,).

    `mode` (m,) is the flexible mode of a pole; 0 for those of a filter, the hub, or no certain mode.
    `model` is its modal model, which may have more modes.
    """

    arm: Arm
    outputs: tuple[str, ...]
    poles: Complex
    residues: Complex
    rigid: Real
    static: Real
    mode: NDArray[np.int64]
    model: ModalModel

    def __call__(self, s: complex) -> Complex:
        """Return G_o(s) of every output at one s."""
        return self.rigid @ np.array([1 / s**2, 1 / s]) + self.static + self.residues @ (1 / (s - self.poles))

    def rows(self, at: Sequence[int], names: tuple[str, ...]) -> Plant:
        """Return the plant with these of its outputs, in this order, under these names."""
        return replace(
            self, outputs=names, residues=self.residues[at], rigid=self.rigid[at], static=self.static[at]
        )

    def times(self, factors: Real) -> Plant:
        """Return the plant with each output times a factor (outputs,)."""
        by_row = factors[:, None]
        return replace(
            self, residues=self.residues * by_row, rigid=self.rigid * by_row, static=self.static * factors
        )

    def join(self, more: Plant) -> Plant:
        """Return the plant with the outputs of another of the same arm, which may lack the filter's pole."""
        # those of the arm, for any output
        assert np.array_equal(more.poles, self.poles[: more.poles.size])
        lacking = self.poles.size - more.poles.size
        return replace(
            self,
            outputs=(*self.outputs, *more.outputs),
            residues=np.r_[self.residues, np.pad(more.residues, ((0, 0), (0, lacking)))],
            rigid=np.r_[self.rigid, more.rigid],
            static=np.r_[self.static, more.static],
        )

    def with_poles(self, poles: Any, residues: Any) -> Plant:
        """Return the plant with further poles, which are of no mode."""
        return replace(
            self,
            poles=np.r_[self.poles, poles],
            residues=np.c_[self.residues, residues],
            mode=np.r_[self.mode, np.zeros(np.size(poles), np.int64)],
        )

    @property
    def at_rest(self) -> Real:
        """G_o(0) of every output that does not turn with the arm (outputs,), and H_o(1) at any period."""
        return self.static - (self.residues / self.poles).sum(axis=1).real

    def slow_hub_pole(self, period: float) -> int | None:
        """Return the pole of a hub that friction brings to rest, if it is slow at a sampling period [s]; else None.

        Its residues nearly cancel rigid[:, 1], the more the less friction there is: where |p| T is below 0.1, its two
        parts are more than ten times their sum.
        """
        (slow,) = np.nonzero((self.poles.imag == 0) & (abs(self.poles) < 0.1 / period))
        turns = self.rigid[:, 1].any() and not self.rigid[:, 0].any()
        if turns and slow.size:
            return int(slow[abs(self.poles[slow]).argmin()])
        return None

    @property
    def count(self) -> int:
        """The last flexible mode in it."""
        return int(self.mode.max(initial=0))


def arm_under_chain(arm: Arm, chain: Chain) -> tuple[Arm, Chain]:
    """Return the arm that a chain drives, and that chain without analog damping, which is friction of the arm's hub.

    So the damping is in every loop of that arm once: in the sampled and in the continuous-time one.
    """
    damping = chain.actuator.hub_damping
    remedy = "a hub without inertia has no model of finite order under it; give hub.inertia, or leave it out"
    require(not (damping > 0 and arm.has_massless_hub), "actuator.hub_damping", damping, remedy)
    if damping == 0:
        return arm, chain
    hub = replace(arm.hub, friction=arm.hub.friction + damping)
    return replace(arm, hub=hub), replace(chain, actuator=replace(chain.actuator, hub_damping=0.0))


# the simulations of one page need the same model some twenty times
_modelled_once = lru_cache(maxsize=LISTS_KEPT)(modal_model)


def undelayed_plant(arm: Arm, outputs: Sequence[str], count: int, x: float | None = None) -> Plant:
    """Return the arm with `count` flexible modes, its outputs not filtered; `x` [m] is that of outputs along it."""
    must_have_free_hub(arm)
    return with_modes(_modelled_once(arm, tuple(outputs), count, x, reach=OVERDAMPED), count)


def with_modes(model: ModalModel, count: int) -> Plant:
    """Return the plant with the first `count` modes of a model, and slow real poles for all others where C is large."""
    some = model.first(count)
    C = model.arm.damping
    poles = some.eigenvalues.ravel()
    residues = some.residues.reshape(len(some.outputs), poles.size)
    mode = np.repeat(some.index, 2)
    plant = Plant(some.arm, some.outputs, poles, residues, some.rigid, some.static, mode, model)
    plant = plant.with_poles(some.single, some.single_residues)
    if C * some.natural_frequency.max(initial=0.0) < SLOW_POLES_FROM:
        return plant
    exact = transfer(model.arm, model.outputs, x=model.x)
    corners, shares = slow_remainder(C, lambda s: exact(s) - np.array([plant(each) for each in s]).T)
    return replace(plant, static=plant.static - shares.sum(axis=1)).with_poles(-corners, shares * corners)


def is_analog(wanted: Output, chain: Chain) -> bool:
    """Return whether an output passes the analog anti-alias filter of a chain.

    Strain, moment and shear, current, accelerations and rates do, as they leave analog amplifiers.  Angles and
    displacements do not, nor does the hub's rate where it is the difference of an encoder.
    """
    is_encoder = wanted.quantity == "theta" and chain.converters.hub_rate == "difference"
    # quantities of strain gauges, load cells and shunts
    is_amplified = wanted.quantity in ("M", "Q", "strain", "current")
    return is_amplified or (wanted.power > 0 and not is_encoder)


def with_filter(plant: Plant, rows: Sequence[int], corner: float) -> Plant:
    """Return the plant with wc/(s + wc) after some outputs: a pole at -wc, with the residue wc G(-wc).

    None of these has the double integral of the torque, as angles and displacements do (`is_analog`).
    """
    is_filtered = np.isin(np.arange(len(plant.outputs)), rows)
    lag = np.where(is_filtered[:, None], corner / (plant.poles + corner), 1.0)
    late = replace(plant, residues=plant.residues * lag, static=np.where(is_filtered, 0.0, plant.static))
    return late.with_poles(-corner, np.where(is_filtered, corner * plant(-corner).real, 0.0))


def with_held_filter(plant: Plant, held: Real) -> Plant:
    """Return the plant whose filters, its last pole, start from other values than 0: with the same pole once more.

    An amplitude 1 of it is the excess `held` (outputs,) over the filtered outputs.  The torque drives both poles, and
    the shares of the second cancel.
    """
    residues = plant.residues.copy()
    residues[:, -1] -= held
    return replace(plant, residues=residues).with_poles(plant.poles[-1], held)


# ------------------------------------------------------------ at the samples


Made = TypeVar("Made")


def first_distinct(make: Callable[[Any], Made], candidates: Sequence[Any]) -> Made:
    """Return the result of the first candidate at which no two damped modes are one; raise the error of the last."""
    *others, last = candidates
    for each in others:
        with suppress(ConvergenceError):
            return make(each)
    return make(last)
