"""The certified bound on the residual vibration of a slew, of one arm or of every arm of a box.

The loop is the sampled one under its law; controller, references and impulses stay those of the nominal arm.  A box has
ranges of some numbers of the arm, and is halved until the bound is near to the residual of an arm in it.
"""

import itertools
from collections.abc import Mapping
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.dsp.discretise import acting_law, law_in_z
from tfarm.dsp.plant import USUAL_MODES, undelayed_plant
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.shaping import MOMENT
from tfarm.errors import CertificationError, ConvergenceError, require
from tfarm.references.uncertain import most_residual, uncertain_loop
from tfarm.response.signals import Signals
from tfarm.spectrum.box import TOWARD_SINGULAR
from tfarm.spectrum.enclosed import AFFINE_KEYS, EnclosedArms

Ranges = Mapping[str, tuple[float, float]]


class PoleBand(NamedTuple):
    """A band up to `top` [rad/s] right of -`line` [1/s], with the number of poles of each arm, and its tails."""

    line: float
    top: float
    number: int
    tails: Real


class Bound(NamedTuple):
    """A bound on the residual root moment [N m] over a box of arms, and the residual of the middle one."""

    ranges: Ranges
    band: PoleBand
    most: float
    least: float


class SlewBounds:
    """Bounds on the residual root moment at the samples after a slew of a case.

    Raises CertificationError, with the reason, for a loop that has none.
    """

    def __init__(self, case: Case, task: Scenario) -> None:
        law = case.feedback
        chain = case.chain
        reasons = {
            "without damping nothing bounds the modes left out": not case.arm.least_damping,
            "the loop is not linear": not chain.is_linear,
            "the hub rate is estimated": chain.converters.hub_rate != "ideal",
            "the loop has an anti-alias filter": np.isfinite(chain.sampling.antialias_corner),
            "the controller has columns of references": bool(law.wanted),
        }
        for reason, is_met in reasons.items():
            if is_met:
                raise CertificationError(reason)
        self.arm = case.arm
        self.task = task
        acting, late = acting_law(case, law)
        self.in_z = law_in_z(law, acting, late)
        self.sampling = late.sampling
        self.names = tuple(dict.fromkeys((*self.in_z.signals, MOMENT)))

    def over(self, ranges: Ranges, tolerance: float = 0.1, most_boxes: int = 64) -> tuple[Bound, int]:
        """Return the box of the largest bound over all arms in these ranges (`check_ranges`), and the number of boxes.

        It is halved until its bound exceeds the largest residual of a middle arm by the tolerance at most.
        Raises CertificationError where a box is not certified, however narrow.
        """
        keyed = KeyedArms(self.arm, tuple(ranges), "range")
        number = itertools.count(1)
        # not certified ones first, then by their bounds
        boxes: list[tuple[float, int, Ranges, Bound | None]] = []
        least = 0.0

        def bound(box: Ranges, band: PoleBand | None) -> None:
            nonlocal least
            n = next(number)
            try:
                found = self.bound(keyed, box, band)
                least = max(least, found.least)
                heappush(boxes, (-found.most, n, box, found))
            except (CertificationError, ConvergenceError, np.linalg.LinAlgError) as error:
                if n >= most_boxes or not box:
                    where = f": {range_words(box)}" if box else ""
                    raise CertificationError(f"{error}{where}") from None
                heappush(boxes, (-np.inf, n, box, None))

        bound(ranges, None)
        while True:
            _, n, box, worst = boxes[0]
            if worst and (not box or worst.most <= (1 + tolerance) * least or n >= most_boxes):
                return worst, len(boxes)
            heappop(boxes)
            # the number with the largest share of its range
            key = max(box, key=lambda name: np.ptp(box[name]) / np.ptp(ranges[name]))
            low, high = box[key]
            for ends in ((low, (low + high) / 2), ((low + high) / 2, high)):
                bound({**box, key: ends}, worst and worst.band)

    def bound(self, keyed: KeyedArms, box: Ranges, band: PoleBand | None) -> Bound:
        """Return the bound over one box, in a band if it is known.  Raises CertificationError."""
        corners = [keyed.at(dict(zip(box, ends, strict=True))) for ends in itertools.product(*box.values())]
        middle = keyed.at({key: (low + high) / 2 for key, (low, high) in box.items()})
        read = Signals(middle, self.names)
        arms = EnclosedArms(middle, tuple(corners), read.outputs, read.places)
        poles = undelayed_plant(middle, ("hub_angle",), USUAL_MODES).poles
        line, top = (band.line, band.top) if band else self.edges(poles, middle.damping)
        poles = poles[(poles.real > -line) & (poles.imag >= 0) & (poles.imag < top)]
        plant = arms.plant(poles, self.sampling.period, self.sampling.remaining)
        loop = uncertain_loop(plant, self.sampling, self.in_z)
        majorant = loop.majorant()
        # last, as it takes longest
        if band is None:
            tails = arms.tail(line, top, self.sampling.period, self.sampling.remaining)
            band = PoleBand(line, top, arms.count(line, top), tails)
        if poles.size + np.count_nonzero(poles.imag) != band.number:
            raise CertificationError("not every pole of the band is known")
        signals = self.in_z.signals
        own = band.tails[: len(signals)], float(band.tails[self.names.index(MOMENT)])
        return Bound(box, band, *most_residual(loop, majorant, self.task, signals, own))

    def edges(self, poles: Complex, C: float) -> tuple[float, float]:
        """Return c and top of a band: a line Re s = -c in the widest gap of the poles, and a frequency above them."""
        # e^-30 = 1e-13 is left over a sample of the poles on the line
        line = min(TOWARD_SINGULAR / C, 30.0 / self.sampling.remaining)
        rates = np.sort(-poles.real)
        ends = np.r_[line / 2, rates[(rates > line / 2) & (rates < line)], line]
        at = int(np.diff(ends).argmax())
        line = float(ends[at : at + 2].mean())
        # above the last pole: a higher one takes longer
        return line, 1.5 * max(line, float(poles.imag[poles.real > -line].max(initial=0.0)))


def check_ranges(ranges: Ranges) -> None:
    """Raise ParameterError for a range of a number in which the arm is not affine, and for ends out of order."""
    for key, ends in ranges.items():
        remedy = "mass or inertia of payload, hub or attachment, or friction or stiffness of the hub"
        require(AFFINE_KEYS.fullmatch(key) is not None, f"range {key}", key, remedy)
        require(0 <= ends[0] < ends[1] < np.inf, f"range {key}", ends, "two finite numbers, the lower first")


def range_words(ranges: Ranges) -> str:
    """Return some ranges in words."""
    return ", ".join(f"{key} {low:.5g} to {high:.5g}" for key, (low, high) in ranges.items())
