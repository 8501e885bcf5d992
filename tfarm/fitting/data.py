"""A measured frequency response: one signal of a rig over another, at frequencies of a swept sine or of an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.records import record


@dataclass(frozen=True, kw_only=True)
@record
class Measured:
    """A measured response `output`/`input`: complex `values` (n,) in SI units at ascending `omega` (n,) [rad/s].

    Both signals are named as in `response.signals` ("tip_acceleration", "strain@0.05"), `input` also as an arm's input
    is ("hub_torque").  `sigma` (n,) is the standard deviation of the real and of the imaginary part, each; `coherence`
    (n,) between 0 and 1 is that of an estimate from so many independent `averages`.  `source` says where they are from,
    `digest` is the SHA-256 of the file.

    Raises ParameterError for what no measurement can be: shapes that differ, frequencies that are not positive or do
    not ascend, values that are no numbers or 0 everywhere, a coherence out of [0, 1] or 0 everywhere, a sigma that is
    not positive.
    """

    output: str
    input: str
    omega: Real
    values: Complex
    sigma: Real | None = None
    coherence: Real | None = None
    averages: int | None = None
    source: str = "array"
    digest: str = ""

    def __post_init__(self) -> None:
        for name, kind in {"omega": float, "values": complex, "sigma": float, "coherence": float}.items():
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, np.atleast_1d(np.asarray(given, dtype=kind)))
        for name in ("values", "sigma", "coherence"):
            held = getattr(self, name)
            if held is not None and held.shape != self.omega.shape:
                remedy = f"one for each of the {self.omega.size} frequencies"
                raise ParameterError(key=f"{self.name} {name}", value=held.shape, remedy=remedy)
        if not (self.omega > 0).all() or not np.isfinite(self.omega).all():
            bad = float(self.omega[~((self.omega > 0) & np.isfinite(self.omega))][0])
            raise ParameterError(key="frequency", value=bad, remedy="positive and finite; leave other rows out")
        steps = np.diff(self.omega)
        if (steps <= 0).any():
            at = float(self.omega[1:][steps <= 0][0])
            remedy = "repeated or not in ascending order; sort the rows, and average those of one frequency"
            raise ParameterError(key="frequency", value=at, remedy=remedy)
        if not np.isfinite(self.values).all():
            at = float(self.omega[~np.isfinite(self.values)][0])
            raise ParameterError(key=f"value at {at:g} rad/s", value="no number", remedy="leave the row out")
        if not self.values.any():
            raise ParameterError(key=f"{self.name} values", value=0.0, remedy="0 everywhere: nothing was measured")
        if self.sigma is not None and not ((self.sigma > 0) & np.isfinite(self.sigma)).all():
            raise ParameterError(key="sigma", value=float(self.sigma.min()), remedy="a standard deviation is positive")
        if self.coherence is not None:
            if not ((self.coherence >= 0) & (self.coherence <= 1)).all():
                raise ParameterError(key="coherence", value=float(self.coherence.max()), remedy="between 0 and 1")
            if not self.coherence.any():
                remedy = "0 everywhere: nothing was measured; leave it out"
                raise ParameterError(key="coherence", value=0.0, remedy=remedy)

    @property
    def name(self) -> str:
        """What is measured, as the command line has it: tip_acceleration/hub_angle."""
        return f"{self.output}/{self.input}"


def in_parts(values: Complex) -> Real:
    """Real parts, then imaginary ones, along the last axis: (..., n) becomes (..., 2 n)."""
    return np.concatenate([values.real, values.imag], axis=-1)


def must_be_measured(measured: object) -> None:
    """Raise ParameterError where a path or anything else stands in the place of a measured response."""
    if not isinstance(measured, Measured):
        remedy = "is no measured response; give what tfarm.read_measured returns, or a tfarm.Measured"
        raise ParameterError(key="measured", value=measured, remedy=remedy)
