"""Records of a rig in motion: what was commanded, held from a sample to the next, and what was measured.

A record in open loop has the commanded input of the plant.  One in closed loop has the references of the controller
that was running, and that controller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tfarm.arm import AT_HUB, Arm, Law, Motor
from tfarm.arm.law import REFERENCE, as_law
from tfarm.arrays import Real
from tfarm.errors import MISSING, must_be_known, require
from tfarm.exact.outputs import OUTPUTS
from tfarm.fitting.data import check_signal
from tfarm.records import frozen

if TYPE_CHECKING:
    from tfarm.fitting.recording import Recording

# free number of a fit: torque at the hub over what was commanded, in whatever unit that is
DRIVE_GAIN = "drive.gain"
# the number of the arm that it is
GAIN_KEY = "motor.torque_constant"


@frozen(kw_only=True)
class RigRun:
    """A record of a rig in motion at samples every `period` [s], all arrays (n,) in SI units.

    `outputs` are measured signals by name ("hub_angle", "root_moment", "strain@0.05"), `input` is the commanded input
    of the plant, held from each sample to the next.  Under a `law` it may be left out, and `references` of the
    hub's angle, rate or moment take its place; a `law` that is None is an open loop.
    `sigma` has the standard deviations of outputs that are known; others follow from the residuals.  `initial` is
    "rest" or "free" at the first sample, by default free.  One that `is_disturbed` has its input, and a torque besides
    that is not known: of friction, or where a controller that is not known answers it.
    Raises ParameterError for arrays of other lengths, values that are no numbers, and a record without outputs, without
    input and references, or of an open loop without an input.
    """

    period: float
    outputs: Mapping[str, Real]
    input: Real | None = None
    references: Mapping[str, Real] = field(default_factory=dict)
    law: Law | None = None
    sigma: Mapping[str, float] = field(default_factory=dict)
    initial: Literal["rest", "free"] = "free"
    is_disturbed: bool = False
    source: str = "array"
    digest: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        require(self.outputs, "outputs", MISSING, "name at least one measured signal of the record")
        columns: dict[str, Any] = {**self.outputs}
        columns |= {f"{REFERENCE}{name}": value for name, value in self.references.items()}
        if self.input is not None:
            columns["input"] = self.input
        for name, values in columns.items():
            remedy = f"one number for each of the {self.count} samples"
            require(np.shape(values) == (self.count,), name, np.shape(values), remedy)
            require(np.isfinite(values).all(), name, "nan or inf", "finite numbers; cut the record there")
        for name in self.outputs:
            check_signal(name, "output")
        must_be_known("initial", self.initial, ("rest", "free"))
        for name in self.references:
            require(name in AT_HUB, "reference", name, f"of one of {', '.join(AT_HUB)}")
        for name, value in self.sigma.items():
            require(name in self.outputs and value > 0, f"sigma of {name}", value, "positive, of an output")
        if self.law is None:
            remedy = (
                "an open loop has its commanded input; of a closed one give the controller that was running"
            )
            require(self.input is not None, "input", MISSING, remedy)
        else:
            object.__setattr__(self, "law", as_law(self.law))
            remedy = "is of a record with its input and without the controller that was running"
            require(not self.is_disturbed, "disturbed", True, remedy)
            remedy = "a closed loop has a reference: a column reference:hub_angle, for instance"
            require(self.references or self.input is not None, "references", MISSING, remedy)

    @property
    def count(self) -> int:
        """Samples of each signal."""
        return int(np.size(next(iter(self.outputs.values()))))

    @property
    def t(self) -> Real:
        """The times of the samples [s], from 0 on."""
        return np.asarray(self.period * np.arange(self.count))

    @property
    def names(self) -> tuple[str, ...]:
        """The measured signals."""
        return tuple(self.outputs)

    @property
    def is_led(self) -> bool:
        """Whether a controller leads the hub's angle, which was measured, to a reference."""
        return self.law is not None and "hub_angle" in self.references and "hub_angle" in self.outputs

    @property
    def driving(self) -> Real:
        """What moves the arm (columns, n): the input of an open loop, or the references of a closed one."""
        if self.law is None or not self.references:
            return np.array([self.input])
        return np.array([*self.references.values()])

    @property
    def driving_changes(self) -> Real:
        """The same, of references the change from sample to sample: of a step nearly white."""
        found = self.driving
        if self.law is None or not self.references:
            return found
        return np.diff(found, axis=1, prepend=0.0)

    @property
    def busy_until(self) -> float:
        """The time [s] of the last change of that."""
        changes = (np.diff(self.driving, axis=1) != 0).any(axis=0)
        return float(self.period * (1 + np.flatnonzero(changes).max(initial=-1)))


def run_of(recording: Recording, arm: Arm, law: Law | None = None) -> RigRun:
    """Return the run that a record has of an arm: its columns by their names.

    The column of the arm's input ("hub_torque", "motor_current") is the commanded input, "reference:hub_angle" a
    reference, and every other column with the name of a signal is an output; the rest is left out.
    Raises ParameterError as `RigRun` does.
    """
    columns = recording.signals
    driven = arm.input if law is None or law.input is None else law.input
    outputs = {}
    for name, values in columns.items():
        plain = name.partition("@")[0]
        if name != driven and not name.startswith(REFERENCE) and plain in OUTPUTS:
            outputs[name] = values
    remedy = f"a column of a signal, such as hub_angle, besides {driven}"
    require(outputs, "record", recording.source, remedy, recording.source)
    references = {
        name.removeprefix(REFERENCE): values for name, values in columns.items() if name.startswith(REFERENCE)
    }
    return RigRun(
        period=recording.period,
        outputs=outputs,
        input=columns.get(driven),
        references=references if law is not None else {},
        law=law,
        sigma=recording.sigma,
        source=recording.source,
        digest=recording.digest,
        note=recording.note,
    )


def from_rest(run: RigRun) -> tuple[RigRun, float]:
    """Return a run in closed loop about its first hub angle, and that angle [rad], where it has a reference of it.

    So the arm is at rest at 0 there, and so is the controller; a constant angle changes nothing else in a linear loop.
    """
    if not run.is_led:
        return run, 0.0
    start = float(run.outputs["hub_angle"][0])
    outputs = {**run.outputs, "hub_angle": run.outputs["hub_angle"] - start}
    references = {**run.references, "hub_angle": run.references["hub_angle"] - start}
    return replace(run, outputs=outputs, references=references), start


def commanded(arm: Arm, runs: Sequence[RigRun]) -> tuple[Arm, tuple[RigRun, ...]]:
    """Return the arm with a drive whose gain is its motor's torque constant, and the runs under its command.

    An arm without a motor gets one without gear, inertia and back-EMF: the command is its current.
    """
    if arm.motor is None:
        arm = replace(arm, motor=Motor(resistance=1.0, torque_constant=1.0, back_emf_constant=0.0))
    remedy = "the gain of its drive is its motor's torque constant: free motor.torque_constant, not both"
    require(arm.input in ("hub_torque", "motor_current"), "input", arm.input, remedy)
    driven = []
    for each in runs:
        law = each.law
        driven.append(each if law is None else replace(each, law=replace(law, input=None)))
    return replace(arm, input="motor_current"), tuple(driven)
