"""The analog plant of a sampled loop: poles and residues of the modal model, with an analog filter.

    G_o(s) = rigid[o,0]/s^2 + rigid[o,1]/s + static[o] + sum over poles of residues[o,i]/(s - poles[i])

A first-order filter wc/(s + wc) on an output adds one pole and changes residues; the form is the same.  Analog damping
of the hub is friction of the arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.dsp.chain import Chain
from tfarm.errors import ParameterError
from tfarm.exact.outputs import Output
from tfarm.records import record
from tfarm.reduced import ModalModel, modal_model
from tfarm.reduced.modal import SLOW_POLES_FROM, slow_remainder
from tfarm.response import transfer
from tfarm.response.signals import Signals
from tfarm.schema import Quantity
from tfarm.spectrum.frequencies import LISTS_KEPT

AMPLIFIED = ("M", "Q", "strain", "current")  # quantities of strain gauges, load cells and shunts
RECORDED = ("hub_angle", "hub_rate", "root_moment", "tip_displacement")  # of a simulation, not filtered
MODES_USED = Quantity("flexible modes", help="number of flexible modes of the arm in the model of the sampled loop")
USUAL_MODES = 20  # flexible, of a sampled loop or a simulation by default


@dataclass(frozen=True)
@record
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
        """G_o(s) of every output at one s."""
        return self.rigid @ np.array([1 / s**2, 1 / s]) + self.static + self.residues @ (1 / (s - self.poles))

    def rows(self, names: Sequence[str]) -> Plant:
        """The plant with these outputs alone, in this order."""
        at = [self.outputs.index(name) for name in names]
        return replace(
            self, outputs=tuple(names), residues=self.residues[at], rigid=self.rigid[at], static=self.static[at]
        )

    def joined(self, more: Plant) -> Plant:
        """The plant with the outputs of another of the same arm after its own; the other may lack the filter's pole."""
        assert np.array_equal(more.poles, self.poles[: more.poles.size])  # those of the arm, for any output
        lacking = self.poles.size - more.poles.size
        return replace(
            self,
            outputs=(*self.outputs, *more.outputs),
            residues=np.r_[self.residues, np.pad(more.residues, ((0, 0), (0, lacking)))],
            rigid=np.r_[self.rigid, more.rigid],
            static=np.r_[self.static, more.static],
        )

    @property
    def at_rest(self) -> Real:
        """G_o(0) of every output that does not turn with the arm (outputs,), and H_o(1) at any period."""
        return np.asarray(self.static - (self.residues / self.poles).sum(axis=1).real)

    def braked(self, slower_than: float) -> int | None:
        """The pole of a hub that friction brings to rest, if |p| is below `slower_than` [1/s]; else None.

        Its residues nearly cancel rigid[:, 1], the more the less friction there is.
        """
        (slow,) = np.nonzero((self.poles.imag == 0) & (abs(self.poles) < slower_than))
        turns = self.rigid[:, 1].any() and not self.rigid[:, 0].any()
        return int(slow[abs(self.poles[slow]).argmin()]) if turns and slow.size else None

    @property
    def count(self) -> int:
        """The last flexible mode in it."""
        return int(self.mode.max(initial=0))


def damped_at_hub(arm: Arm, chain: Chain) -> Arm:
    """The arm with the actuator's analog hub damping, which is friction of its hub."""
    damping = chain.actuator.hub_damping
    if damping > 0 and arm.has_massless_hub:
        remedy = "a hub without inertia has no model of finite order under it; give hub.inertia, or leave it out"
        raise ParameterError(key="actuator.hub_damping", value=damping, remedy=remedy)
    return arm if damping == 0 else replace(arm, hub=replace(arm.hub, friction=arm.hub.friction + damping))


def undelayed_plant(arm: Arm, outputs: Sequence[str], count: int, x: float | None = None) -> Plant:
    """The arm with `count` flexible modes, its outputs not filtered; `x` [m] is the place of outputs along the arm."""
    if arm.is_locked:
        remedy = "a locked hub has no loop; give it a finite inertia"
        raise ParameterError(key="hub.inertia", value=math.inf, remedy=remedy)
    return with_modes(_modelled_once(arm, tuple(outputs), count, x), count)


@lru_cache(maxsize=LISTS_KEPT)  # the simulations of one page need the same model some twenty times
def _modelled_once(arm: Arm, names: tuple[str, ...], count: int, x: float | None) -> ModalModel:
    return modal_model(arm, names, count, x)


def with_modes(model: ModalModel, count: int) -> Plant:
    """The plant with the first `count` modes of a model, and slow real poles for all others where C is large."""
    some, C = model.first(count), model.arm.damping
    poles, mode = some.eigenvalues.ravel(), np.repeat(some.index, 2)
    residues = some.residues.reshape(len(some.outputs), poles.size)
    poles, residues = np.r_[poles, some.single], np.c_[residues, some.single_residues]
    mode = np.r_[mode, np.zeros(some.single.size, np.int64)]
    plant = Plant(some.arm, some.outputs, poles, residues, some.rigid, some.static, mode, model)
    if C * some.natural_frequency.max(initial=0.0) < SLOW_POLES_FROM:
        return plant
    exact = transfer(model.arm, model.outputs, x=model.x)
    corners, shares = slow_remainder(C, lambda s: exact(s) - np.array([plant(each) for each in s]).T)
    return replace(
        plant,
        poles=np.r_[plant.poles, -corners],
        residues=np.c_[plant.residues, shares * corners],
        static=plant.static - shares.sum(axis=1),
        mode=np.r_[plant.mode, np.zeros(corners.size, np.int64)],
    )


def is_analog(wanted: Output, chain: Chain) -> bool:
    """Whether an output passes the analog anti-alias filter of a chain.

    Strain, moment and shear, current, accelerations and rates do, as they leave analog amplifiers.  Angles and
    displacements do not, nor does the hub's rate where it is the difference of an encoder.
    """
    if wanted.quantity == "theta" and wanted.power and chain.converters.hub_rate == "difference":
        return False
    return wanted.quantity in AMPLIFIED or wanted.power > 0


def with_filter(plant: Plant, rows: Sequence[int], corner: float) -> Plant:
    """The plant with wc/(s + wc) after some outputs: a pole at -wc, with the residue wc G(-wc).

    Raises ParameterError for an output with the double integral of the torque, an angle or a displacement: encoders
    are digital and have no analog filter.
    """
    for row in rows:
        if plant.rigid[row, 0] != 0.0:
            remedy = "it turns with the hub; an analog filter is for the gauge and the tachometer"
            raise ParameterError(key="filtered output", value=plant.outputs[row], remedy=remedy)
    residues = np.c_[plant.residues, np.zeros(len(plant.outputs), complex)]
    static = plant.static.copy()
    at_corner = plant(-corner)
    for row in rows:
        residues[row, :-1] *= corner / (plant.poles + corner)
        residues[row, -1] = corner * at_corner[row].real
        static[row] = 0.0
    return replace(
        plant,
        poles=np.r_[plant.poles, -corner],
        residues=residues,
        static=static,
        mode=np.r_[plant.mode, 0],
    )


@dataclass(frozen=True)
@record
class SensedPlant:
    """An arm's signals with `count` modes: a plant for each place of signals, and one of all together.

    `read` is of the arm with the actuator's damping; `plants` are not filtered, one for each of `places` [share of the
    length].  Raises ParameterError as `Signals` does, for a locked hub, and for an output that grows with s without
    bound.
    """

    arm: Arm
    read: Signals
    chain: Chain
    plants: tuple[Plant, ...]

    @property
    def together(self) -> Plant:
        """All signals in the order of their names, through their analog filters."""
        whole, corner = self.unfiltered, self.chain.sampling.antialias_corner
        analog = [n for n, each in enumerate(self.read.outputs) if is_analog(each, self.chain)]
        return whole if math.isinf(corner) or not analog else with_filter(whole, analog, corner)

    @property
    def unfiltered(self) -> Plant:
        """All signals in the order of their names, without filters."""
        places = list(dict.fromkeys(self.read.places))
        first, rows = self.plants[0], []
        for wanted, place in zip(self.read.outputs, self.read.places, strict=True):
            plant = self.plants[places.index(place)]
            assert np.array_equal(plant.poles, first.poles)  # those of the arm, at every place
            rows.append((plant, plant.outputs.index(wanted.name)))
        return replace(
            first,
            arm=self.arm,
            outputs=self.read.names,
            residues=np.array([plant.residues[n] for plant, n in rows]),
            rigid=np.array([plant.rigid[n] for plant, n in rows]),
            static=np.array([plant.static[n] for plant, n in rows]),
        )

    def with_modes(self, count: int) -> SensedPlant:
        """The same with another number of modes; cheap where the models have as many."""
        if count > self.plants[0].model.index.max(initial=0):
            return sensed_plant(self.arm, self.chain, self.read.names, count)
        return replace(self, plants=tuple(with_modes(each.model, count) for each in self.plants))


def sensed_plant(arm: Arm, chain: Chain, names: Sequence[str], count: int) -> SensedPlant:
    """Return the signals of these names with `count` flexible modes, of an arm whose hub a chain may damp."""
    read, plants = Signals(damped_at_hub(arm, chain), tuple(names)), []
    for share in dict.fromkeys(read.places):
        here = zip(read.outputs, read.places, strict=True)
        wanted = list(dict.fromkeys(each.name for each, place in here if place == share))
        along = any(each.place == "x" for each in read.outputs if each.name in wanted)
        plants.append(undelayed_plant(read.arm, wanted, count, share * arm.length if along else None))
    return SensedPlant(arm, read, chain, tuple(plants))
