"""The record of a design: its law, both verdicts, the width of the optimum, and what it has of requirements."""

from typing import Annotated, Any, Literal, NamedTuple

from tfarm.dsp import Chain
from tfarm.loop.norms import NormBound
from tfarm.loop.sampled_brief import SampledBrief
from tfarm.loop.stability import Stability
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.synthesis.drawn import Verification
from tfarm.synthesis.goals import Checked
from tfarm.synthesis.required import RequirementSlope, is_active, names_of
from tfarm.synthesis.requirements import MEASURES, NAMES, requirements_of
from tfarm.synthesis.slew_measures import SlewMeasures
from tfarm.synthesis.slew_models import slew_and_after, trial_slew
from tfarm.synthesis.structures import Bounds
from tfarm.synthesis.worst_case import WorstCase

LoopKind = Literal["sampled", "continuous"]


@frozen
class OnArm:
    """Value of the objective and both verdicts on one of the arms of a design; `numbers` are those of the box."""

    name: Annotated[
        str,
        Quantity(
            "arm", key="name", help="the designed arm, a further one, or one with numbers of the ranges"
        ),
    ]
    numbers: Annotated[
        dict[str, float], Quantity("numbers of the arm", help="values of the numbers in the ranges, by key")
    ]
    value: Annotated[
        float, Quantity("objective", key="value", help="the objective with this law on this arm")
    ]
    verdict: Stability
    sampled: SampledBrief

    @property
    def stability(
        self,
    ) -> Annotated[str, Quantity("continuous-time loop", key="verdict", help="stability without sampling")]:
        """The verdict on the continuous-time loop."""
        return self.verdict.word

    @property
    def known_beyond(
        self,
    ) -> Annotated[bool, Quantity(help="whether the verdict holds for all higher modes too")]:
        """Whether that holds beyond its frequency range."""
        return self.verdict.is_known_beyond

    @property
    def band(
        self,
    ) -> Annotated[
        float, Quantity(key="up_to_rad_s", help="upper end of the frequency range of the verdict [rad/s]")
    ]:
        """The frequency range of that verdict [rad/s]."""
        return self.verdict.band

    @property
    def sampled_loop(
        self,
    ) -> Annotated[str, Quantity("sampled loop", key="sampled", help="stability at the samples")]:
        """The verdict on the sampled loop."""
        return self.sampled.short


class OptimalCoefficient(NamedTuple):
    """A coefficient of a design, the width of the optimum along it, and its bounds."""

    name: Annotated[str, Quantity("coefficient", key="name", help="a number of the law")]
    value: Annotated[float, Quantity("value", digits=7, help="its value in the best law found")]
    flat: Annotated[
        Bounds | None,
        Quantity(
            "within one per cent",
            key="within_one_per_cent",
            help="range within 1 % of the best objective, others fixed; of a slew by the time constant alone",
        ),
    ]
    bounds: Annotated[
        Bounds | None, Quantity("searched", help="bounds of the search; none of a fixed coefficient")
    ]
    optimum: Annotated[
        str, Quantity("optimum", help="place of the value in its bounds; at a bound it is no optimum")
    ]


@frozen
class Design:
    """The best law of a `structure` and its `coefficients`, the value of the objective, both verdicts, and its width.

    `value` is a damping ratio, a disk margin, the largest |S|, a delay margin [s], a residual moment [N m] or a cost.
    `loop` is that of the design: the "sampled" one of `chain` or the "continuous" one.  `verdict` is that of the
    continuous-time loop, `sampled` that of the sampled one, both of the arm itself.  `arms` has them for each arm of a
    design, the arm itself first, and `value` is the worst among them.  `bounds` are those of the free coefficients;
    those of `widened` are wider than at first.  `flat` are ranges of each coefficient, the others constant, in which
    the value is within one per cent of the best.  `at_bound` names coefficients at an end of their bounds: there the
    search was cut off, and the value is no optimum.  Those in `at_limit` are at a physical end, K1 = 0, the K2 = 1 that
    stops the hub, or 2/T of a pole, or at the least Ki.  Of `starts` searches `agreed` reached the best score.
    """

    objective: Annotated[str, Quantity("objective", help="criterion of the design")]
    structure: Annotated[str, Quantity("structure", help="form of the law")]
    law: Any
    coefficients: dict[str, float]
    value: Annotated[float, Quantity("value of the objective", key="value", help="the worst over the arms")]
    verdict: Annotated[
        Stability, Quantity(flat=True, help="stability of the continuous-time loop on the designed arm")
    ]
    bounds: dict[str, Bounds]
    flat: dict[str, Bounds]
    modes: Annotated[int, Quantity("flexible modes in the objective", help="modes whose damping counts")]
    at_bound: tuple[str, ...]
    at_limit: tuple[str, ...]
    widened: tuple[str, ...]
    loop: Annotated[
        LoopKind, Quantity("designed for the loop", key="designed_for", help="sampled or continuous")
    ]
    chain: Chain
    sampled: Annotated[
        SampledBrief, Quantity("sampled loop", help="stability at the samples on the designed arm")
    ]
    arms: Annotated[tuple[OnArm, ...], Quantity("arms", help="all arms that the law was designed for")]
    starts: Annotated[int, Quantity("searches", help="minimisations from different starts")]
    agreed: Annotated[
        int,
        Quantity(
            "searches within half a per cent of the best",
            key="starts_agreed",
            help="few: the optimum is hard to find",
        ),
    ]
    worst_case: WorstCase
    requirements: Annotated[
        tuple[Checked, ...], Quantity("requirements", help="requirements with exact values, on each arm")
    ] = ()
    conflicts: Annotated[
        tuple[str, ...],
        Quantity("conflicts", help="requirements without which the others are met, where not all are"),
    ] = ()
    alternatives: Annotated[
        tuple[str, ...], Quantity("alternatives", help="structures whose best law meets all requirements")
    ] = ()
    sensitivities: Annotated[
        tuple[RequirementSlope, ...],
        Quantity("sensitivities", help="changes of the required quantities of the sampled loop, exact"),
    ] = ()

    verification: Annotated[
        Verification | None,
        Quantity("fresh arms", help="requirements on arms drawn from a study or posterior"),
    ] = None
    norm: Annotated[
        NormBound | None,
        Quantity("weighted norm", help="of all weighted functions of the sampled loop as a column"),
    ] = None

    @property
    def is_met(
        self,
    ) -> Annotated[
        bool | None, Quantity("requirements met", help="whether the exact loops meet all; null without any")
    ]:
        """Whether the exact loops meet all requirements on all arms; None without requirements."""
        return all(each.violation <= 0 for each in self.requirements) if self.requirements else None

    @property
    def active(
        self,
    ) -> Annotated[
        list[str], Quantity("active requirements", help="requirements with less than 2 % of their limit left")
    ]:
        """The requirements that limit the law."""
        return names_of(self.requirements, is_active)

    @property
    def rows(
        self,
    ) -> Annotated[
        list[OptimalCoefficient], Quantity("coefficients", key="coefficients", help="numbers of the law")
    ]:
        """One row for each coefficient."""
        optima = dict.fromkeys(self.bounds, "inside")
        optima |= dict.fromkeys(self.widened, "inside bounds that were widened")
        optima |= dict.fromkeys(self.at_bound, "none: search cut off at the bound")
        optima |= dict.fromkeys(self.at_limit, "at the physical limit")
        found = []
        for name, value in self.coefficients.items():
            fixed = "fixed" if value else "fixed at 0"
            flat = self.flat.get(name)
            found.append(
                OptimalCoefficient(name, value, flat, self.bounds.get(name), optima.get(name, fixed))
            )
        return found

    @property
    def objective_in_words(
        self,
    ) -> Annotated[
        str,
        Quantity("objective in words", key="objective_in_words", help="the quantity, and what decides at 0"),
    ]:
        """Title and unit of the quantity that is the objective."""
        # of objectives without requirements
        plain = {
            "damping": "least damping ratio of the first modes",
            "margin": "disk margin",
            "sensitivity": "largest |S|",
            "delay": "delay margin, s",
            "residual": "residual root moment after the slew, N m",
            "cost": "cost of the tuner's trial",
        }
        if not self.requirements and self.objective in plain:
            return plain[self.objective]
        measure = MEASURES[NAMES[self.objective]]
        words = f"{measure.title}, {measure.unit}" if measure.unit else measure.title
        if NAMES[self.objective].endswith("settling_time_s") and self.value == 0:
            words = f"{words}: the tip is within 2 % when the motion ends, and the time constant decides"
        return words

    @property
    def slew_duration(
        self,
    ) -> Annotated[
        float | None, Quantity("record of the slew", "s", 6, "duration over which the objective is taken")
    ]:
        """Length of the record of a quantity of the slew, for `tfarm simulate --duration`; None of others."""
        arm = self.verdict.loop.arm
        if self.requirements:
            measures = [requirements_of(each.requirement)[0].measure for each in self.requirements]
            if any(each.of_slew for each in (MEASURES[NAMES[self.objective]], *measures)):
                return float(SlewMeasures(arm, arm, self.chain).tasks[0].t[-1])
            return None
        if self.loop == "continuous":
            return None
        if self.objective == "residual":
            return float(slew_and_after(arm, arm, self.chain, self.law).t[-1])
        if self.objective == "cost":
            return float(trial_slew(arm, self.chain).t[-1])
        return None

    @property
    def worst_arm(self) -> Annotated[str, Quantity("worst arm", help="the arm that limits the objective")]:
        """The arm with that value."""
        return next(each.name for each in self.arms if each.value == self.value)

    @property
    def tried(
        self,
    ) -> Annotated[
        int, Quantity(key="arms_tried_inside", help="arms inside the ranges on which the law was tried")
    ]:
        """Number of arms inside the box that were tried."""
        return self.worst_case.tried

    @property
    def worst_case_words(
        self,
    ) -> Annotated[
        str,
        Quantity("worst case", key="worst_case_in_words", help="choice of the arms; no proof between them"),
    ]:
        """Choice of the arms."""
        return self.worst_case.sentence(len(self.arms))
