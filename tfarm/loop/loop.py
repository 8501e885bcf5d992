"""A loop over a curve: a rig under a linear law, on the imaginary axis or, sampled, on the unit circle.

    D = weights @ rows,    L = numerator/denominator

D is the characteristic function, whose zeros are the closed-loop poles, and is affine in the numbers of the law.  L is
the loop function: poles are where it is -1.  A point of either curve is given as s = i w [1/s]; that of the circle is
z = e^{i w T}, up to half the sampling rate.  The imaginary axis is in `continuous`, the unit circle in `sampled`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback, Law, warn_of_cancellations
from tfarm.arrays import Complex
from tfarm.moved import FormerName
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Quantity


class Loop(ABC):
    """A rig under a law."""

    @property
    @abstractmethod
    def arm(self) -> Arm:
        """The arm, with the input of the law."""

    @property
    @abstractmethod
    def law(self) -> Law:
        """The law with its present numbers."""

    @property
    def period(self) -> float | None:
        """The sampling period [s]; None in continuous time."""
        return None

    @property
    def controller(
        self,
    ) -> Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]:
        """Names of the arm and the controller."""
        return controller(self.law, self.arm)

    @cached_property
    def warnings(
        self,
    ) -> Annotated[
        tuple[str, ...], Quantity("warnings", help="unstable controller poles that its zeros cancel")
    ]:
        """Unstable poles of the law that its own zeros cancel."""
        return warn_of_cancellations(self.law)

    @property
    @abstractmethod
    def gains(self) -> HubFeedback | None:
        """The law as gains at the hub, where it has no more than those."""

    @property
    def is_of_gains(self) -> bool:
        """Whether the law is one of gains at the hub."""
        return self.gains is not None

    @property
    @abstractmethod
    def numbers(self) -> dict[str, float]:
        """The numbers of the law in which D is linear, by name; of gains at the hub these."""

    @abstractmethod
    def under(self, law: Law) -> Self:
        """Return the loop of the same rig under another law."""

    def with_number(self, name: str, value: float) -> Self:
        """Return the same loop with another value of one number of its law."""
        return self.under(self.law.with_number(name, value))

    having = FormerName("with_number")

    @property
    @abstractmethod
    def feeds_back(self) -> bool:
        """Whether the law feeds anything back: L is other than 0."""

    @abstractmethod
    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Return denominator and numerator of L at s = i w, up to one factor: finite at poles too."""

    def loop_function(self, s: NDArray[Any]) -> Complex:
        """Return L at s = i w; infinite at poles of the rig or of the law."""
        drive, fed_back = self.parts(s)
        return np.asarray(np.divide(fed_back, drive, out=np.full(drive.shape, np.inf + 0j), where=drive != 0))
