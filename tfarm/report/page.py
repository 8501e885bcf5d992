"""The subject of a page: an arm with a case for each controller, and every record that its pages ask for.

A page asks here for
  each controller: margins, loop function, Nyquist plot, spillover, poles, result card, verdict on its sampled loop also
    with further delay, slew, time response, film, and a measured run with the computed one;
  the arm: default and best gains, the map and the regions of both, root loci in s and z, modes by four theories,
    responses, measured ones, candidates of what the paper leaves open, the tuner, and the arms of a fit.
The rooms below compute these records.  Sections and pictures read them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, AnyLaw, Arm, HubFeedback, Theory, load, presets
from tfarm.arm.chain import MOST_DELAY
from tfarm.assessment.card import ResultCard, margins_of, result_card, sampled_of
from tfarm.assessment.card import loop_function as loop_curve
from tfarm.assessment.step import Step, step
from tfarm.audit import AuditRow, kept_audit
from tfarm.audit.arm_proofs import ArmProof, prove, proven_damped_modes, proven_modes
from tfarm.audit.published import PublishedRow, validate
from tfarm.case import Case, OfCase
from tfarm.dsp import Chain, Simulation, load_chain, results, traces
from tfarm.dsp.discretise import acting_law
from tfarm.dsp.scenarios import TRIAL_SLEWS
from tfarm.errors import ConvergenceError, one_line
from tfarm.exported.live_loop import LiveNumbers, live_data
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import ARMS, Fit, ResponseBand, ShareOfArms, arms_drawn, response_band, stable_share
from tfarm.fitting.overlay import Overlay, overlay
from tfarm.fitting.prediction import Prediction, departures, predict
from tfarm.fitting.run_files import MeasuredRun
from tfarm.loop.continuous import ContinuousLoop, frequency_above_mode
from tfarm.loop.curve import LoopCurve
from tfarm.loop.loci import Loci, loci
from tfarm.loop.margins import Margins, margins
from tfarm.loop.nyquist import Nyquist, nyquist_of
from tfarm.loop.plane import deepest_moment_gain
from tfarm.loop.plane_axes import ranges_of
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.sampled_analysis import Analysis
from tfarm.loop.sampled_brief import SampledBrief, sampled_brief
from tfarm.loop.sampled_modes import STRONGER, SampledLoci, sampled_loci
from tfarm.loop.sampled_verdict import Verdict, sampled_verdict
from tfarm.loop.spillover import Spill, spill
from tfarm.plots.labels import gains_words
from tfarm.records import frozen
from tfarm.report.blocks import argument, prose
from tfarm.response.frequency import Bode, bode
from tfarm.response.signals import Signals, sign_of
from tfarm.spectrum import DampedModes, Modes, modes
from tfarm.spectrum.gains import default_gains, rate_unit
from tfarm.spectrum.listing import ModeList, listed_modes
from tfarm.spectrum.proofs import Certificate
from tfarm.studies.candidates import (
    Candidates,
    TunerNumbers,
    has_hub_inertia,
    hub_study,
    section_study,
    tuner_numbers,
)
from tfarm.synthesis.design import recommended_gains
from tfarm.synthesis.limits import LoopLimits, loop_limits
from tfarm.synthesis.result import Design
from tfarm.synthesis.stability_map import (
    DESIGNED_MODES,
    StabilityMap,
    StableRegions,
    stability_map,
    stable_regions,
)
from tfarm.synthesis.structures import TYPED_DIGITS

# at most: a second of computing
FILM_FRAMES = 80


# ------------------------------------------------------------ a controller


@frozen
class GivenLaw:
    """A law, the name of its `file` where it has one, and a run that was `measured` under it on the rig."""

    law: AnyLaw
    file: str = ""
    measured: MeasuredRun | None = None


@frozen
class PageCase(OfCase):
    """A case of a page with its records.

    `name` is for reading, `key` for the columns and names of files, "law" or of several "law_1", "law_2" ...
    `given` is the source of the controller.
    """

    case: Case
    name: str
    key: str
    given: GivenLaw

    @property
    def chain(self) -> Chain:
        """The sampling."""
        return self.case.chain

    @property
    def measured(self) -> MeasuredRun | None:
        """The run that was measured on the rig."""
        return self.given.measured

    @property
    def own_name(self) -> str:
        """The name of the controller itself, or its gains with their values."""
        if self.case.gains is None:
            return one_line(self.law.name, 60)
        return gains_words(self.law, TYPED_DIGITS)

    @property
    def gains(self) -> str:
        """Its gains with their values, or the signals that it reads."""
        law = self.law
        if self.case.gains is None:
            return f"order {law.order}, of {', '.join(law.signals)}"
        return gains_words(law, TYPED_DIGITS)

    @property
    def title(self) -> str:
        """Its name and gains."""
        return f"{self.name}: {self.gains}"

    def stem(self, suffix: str) -> str:
        """Return the name of a file of it."""
        return f"{self.key.replace('_', '-')}-{suffix}"

    # the continuous-time loop, and both

    @property
    def margins(self) -> Margins:
        """Verdict, stability intervals and margins of the continuous-time loop."""
        return margins_of(self.arm, self.law)

    @property
    def loop_function(self) -> LoopCurve:
        """Loop functions of both loops; of the continuous-time one alone where the other is not determined."""
        try:
            return loop_curve(self.arm, self.law, self.chain)
        except ConvergenceError:
            return self.margins.curve

    @property
    def nyquist(self) -> Nyquist:
        """The loop function on Nyquist's contour, with its encirclements."""
        return nyquist_of(self.margins.stability)

    @property
    def spillover(self) -> Spill:
        """Verdicts by models of up to twelve modes."""
        return spill(self.arm, self.law, 12)

    @property
    def poles(self) -> Poles:
        """The closed-loop poles."""
        return closed_loop_poles(self.arm, self.law)

    @property
    def card(self) -> ResultCard:
        """The result card of both loops."""
        return result_card(self.arm, self.law, self.chain)

    # the sampled loop, and time

    @property
    def sampled(self) -> Analysis:
        """Verdict, stability intervals and modes of the sampled loop."""
        return sampled_of(self.arm, self.law, self.chain)

    @property
    def brief(self) -> SampledBrief:
        """The verdict on the sampled loop in short."""
        return sampled_brief(self.case)

    @property
    def delays(self) -> Iterator[tuple[float, Verdict]]:
        """Further delays [ms] of none, half a sample and one, with the verdict on the sampled loop."""
        yield 0.0, self.sampled.verdict
        sampling = self.chain.sampling
        for more in (0.5, 1.0):
            delay = sampling.delay_samples + more
            if delay + self.law.delay / sampling.period <= MOST_DELAY:
                late = replace(self.chain, sampling=replace(sampling, delay_samples=delay))
                yield 1e3 * sampling.period * more, sampled_verdict(self.case.through(late))

    @property
    def slew(self) -> Simulation:
        """The slew of the sampled loop, with the records that a picture needs."""
        duration = TRIAL_SLEWS * self.chain.slew.rise_time
        return results.simulate_for_picture(self.case, "slew", duration)

    def film(self, run: Simulation) -> traces.Motion:
        """Return the motion of a slew, and of what follows for half as long."""
        return traces.motion_of(self.arm, run, 1.5 * self.chain.slew.rise_time, FILM_FRAMES)

    @property
    def time_responses(self) -> Step:
        """The slew of both loops with its figures."""
        return step(self.arm, self.law, self.chain, "slew")

    @property
    def prediction(self) -> Prediction | None:
        """The measured run with its prediction, if one was measured."""
        found = self.measured
        if found is None:
            return None
        return predict(
            self.arm, found.run, self.chain, law=self.law, before=found.before, posterior=found.posterior
        )

    @property
    def growth(self) -> float:
        """Time constant [s] of the growth of an unstable sampled loop."""
        return self.chain.sampling.period / self.sampled.verdict.log_radius

    @property
    def departures(self) -> list[float]:
        """Times [s] after the measured run at which the growth of the hub angle shows."""
        if self.measured is None:
            return []
        # as much longer as an unstable loop may seem settled
        longer = 20 * self.growth
        count = self.sampled.verdict.modes_used
        return departures(self.case, self.measured.run, count, longer)

    @property
    def live(self) -> LiveNumbers:
        """The numbers of the live page that begins with this controller."""
        return live_data(self.case)

    def check(self) -> None:
        """Raise ParameterError for a law that does not suit the arm or the sampling period of the chain."""
        Signals(self.arm, self.law.signals)
        if not self.law.is_discrete:
            ContinuousLoop(self.case)
        acting_law(self.case)


# ------------------------------------------------------------ the arm


class PossibleArms(NamedTuple):
    """Arms that the data of a fit leave possible, the margins of each under the default gains, and their responses.

    `band` is None of a fit without responses, `share` of arms without a loop.
    """

    arms: tuple[Arm, ...]
    margins: list[Margins]
    band: ResponseBand | None
    share: ShareOfArms | None


class ArmReport(NamedTuple):
    """An arm, its chain, and the laws that the page is about; without any it is about the default gains.

    `fit` is the source of the arm's numbers, if they were fitted to measurements; `measured` are responses that are
    drawn over its own.  Pictures are saved for a paper too where it `is_paper`.
    """

    arm: Arm
    chain: Chain
    laws: tuple[GivenLaw, ...] = ()
    fit: Fit | None = None
    measured: tuple[Measured, ...] = ()
    is_paper: bool = False

    @property
    def gains(self) -> HubFeedback:
        """The default gains of the arm."""
        return default_gains(self.arm)

    def case_of(self, given: GivenLaw, name: str, key: str) -> PageCase:
        """Return the case of a controller on the arm, under a name of its own."""
        return PageCase(Case(self.arm, given.law, self.chain), name, key, given)

    @property
    def default(self) -> PageCase:
        """The case of the default gains."""
        return self.case_of(GivenLaw(self.gains), "default gains", "default")

    @property
    def cases(self) -> tuple[PageCase, ...]:
        """A case for each law under a name that no other has; else that of the default gains."""
        if not self.laws:
            return (self.default,)
        found: list[PageCase] = []
        for number, given in enumerate(self.laws, 1):
            key = f"law_{number}" if len(self.laws) > 1 else "law"
            each = self.case_of(given, "the gains given", key)
            name = each.own_name if each.case.gains is None else each.name
            name += f" ({number})" * (name in {other.name for other in found})
            found.append(replace(each, name=name))
        return tuple(found)

    @property
    def in_s(self) -> tuple[PageCase, ...]:
        """The cases of continuous-time controllers: those given, else the default gains and those recommended."""
        found = None if self.laws else self.recommended
        shown = list(self.cases)
        if found is not None and found.is_met:
            shown.append(self.case_of(GivenLaw(found.law), "recommended gains", "recommended"))
        return tuple(each for each in shown if not each.law.is_discrete)

    @property
    def bare(self) -> PageCase:
        """The default gains without that of the root moment."""
        return self.case_of(
            GivenLaw(self.gains.with_number(MOMENT_GAIN, 0.0)), f"{MOMENT_GAIN} = 0", "without"
        )

    @property
    def has_loop(self) -> bool:
        """Whether the page has sections on loops: of laws wherever the hub can turn, of gains where both are felt."""
        return not self.arm.is_locked if self.laws else has_loop(self.arm)

    @property
    def recommended(self) -> Design | None:
        """The gains that `tfarm design` returns by default; None where there are none, with `why_none`."""
        return recommended_gains(self.arm, self.chain)[0] if has_loop(self.arm) else None

    @property
    def command_name(self) -> str:
        """The arm in a command."""
        return argument(self.arm.name, is_preset(self.arm, self.chain))

    @property
    def why_none(self) -> str:
        """The reason why no gains are recommended."""
        return recommended_gains(self.arm, self.chain)[1]

    def limits(self, each: PageCase) -> LoopLimits:
        """Return the limits of a case; of the page's own gains with those recommended in their place."""
        # a margin beyond them has no mode named
        known = modes(self.arm, 12)
        found = None if self.laws else self.recommended
        if found is None or not found.is_met:
            return loop_limits(each.card, known, found)
        return loop_limits(each.card, known, found, result_card(self.arm, found.law, self.chain))

    @property
    def map(self) -> StabilityMap:
        """The map of both gains."""
        return stability_map(self.arm, self.chain)

    @property
    def band(self) -> float:
        """The frequency range [rad/s] in which damping is designed for."""
        return frequency_above_mode(self.arm, DESIGNED_MODES)

    @property
    def rate_unit(self) -> float:
        """The unit of the rate gain, J w1."""
        return rate_unit(self.arm)

    @property
    def deepest_moment_gain(self) -> float:
        """The lowest moment gain at which unstable gains are searched."""
        return deepest_moment_gain(self.arm)

    @property
    def regions(self) -> StableRegions:
        """The stability regions around the gains of the page, continuous and sampled."""
        return stable_regions(self.cases[0].case)

    def locus(self, name: str) -> Loci:
        """Return the root locus along one of the default gains, exact and of a reduced model."""
        # what balances a torque, both sides of 0 and beyond 1
        torque = self.arm.input_per_torque
        ends = {RATE_GAIN: (0.0, 2.0 * self.rate_unit), MOMENT_GAIN: (-1.0 * torque, 1.6 * torque)}
        return loci(self.default.case, name, *ends[name])

    @property
    def sampled_loci(self) -> SampledLoci:
        """The root loci of the sampled loop along both gains."""
        loop = self.cases[0].sampled.loop
        arm = loop.plant.arm
        # past the rate gain at which sampling alone makes the hub unstable; K2 over the stable interval of most arms
        turning = arm.hub_side_inertia * arm.input_per_torque
        top = max(1.25 * 2 * turning / self.chain.sampling.period, STRONGER * loop.gains[RATE_GAIN])
        return sampled_loci(loop, top, (-0.5, 1.5))

    def modes(self, count: int, theory: Theory | None = None) -> Modes:
        """Return the first modes of the arm, by another theory where one is named."""
        return modes(self.arm, count, theory=theory)

    def mode_list(self, count: int) -> ModeList:
        """Return a row for each of the first modes, damped too."""
        return listed_modes(self.modes(count))

    def proven_modes(self, count: int) -> Certificate:
        """Return the certified brackets of the first modes.  Raises CertificationError where there are none."""
        return proven_modes(self.arm, count)

    def proven_damped_modes(self, count: int) -> DampedModes:
        """Return the certified damped modes.  Raises CertificationError or ConvergenceError where there are none."""
        return proven_damped_modes(self.arm, count)

    def bode(self, output: str) -> Bode:
        """Return the response of an output to the input."""
        return bode(self.arm, output)

    @property
    def proof(self) -> ArmProof:
        """The counts and certified digits of the arm."""
        return prove(self.arm, self.chain)

    @property
    def overlays(self) -> list[Overlay]:
        """Each measured response over that of the arm."""
        return [overlay(self.arm, one) for one in self.measured]

    @property
    def candidates(self) -> Mapping[str, Candidates]:
        """The arm with other sections and with other hubs, as far as the paper leaves them open."""
        found = {}
        if self.arm.is_uniform:
            found["assumptions_section"] = section_study(self.arm)
        if self.has_candidate_hubs:
            found["assumptions_hub"] = hub_study(self.arm)
        return found

    @property
    def has_candidate_hubs(self) -> bool:
        """Whether other hubs are candidates."""
        return self.arm.is_uniform and has_hub_inertia(self.arm)

    @property
    def tuner(self) -> TunerNumbers:
        """The gain tuner against baselines."""
        return tuner_numbers(self.arm, self.chain)

    def tuned_regions(self, found: TunerNumbers) -> StableRegions:
        """Return the stability regions around the gains of the tuner."""
        return stable_regions(Case(found.arm, found.tuning.constant, found.tuning.trial.loop.chain))

    def possible_arms(self, count: int = ARMS) -> PossibleArms:
        """Return arms that the data of the fit leave possible.  Raises ConvergenceError where there are none."""
        fit = self.fit
        assert fit is not None
        arms = arms_drawn(fit, count)
        found = [margins(each, default_gains(fit.arm)) for each in arms if has_loop(fit.arm)]
        band = response_band(fit, arms, "root_moment") if fit.responses else None
        return PossibleArms(arms, found, band, stable_share(arms, ranges_of(fit.arm)) if found else None)


def gather() -> tuple[Sequence[AuditRow], Sequence[PublishedRow]]:
    """Return the evidence for the whole package: the audit of the paper, kept or new, and the tables of others.

    Raises CertificationError where one of them fails.
    """
    return kept_audit(), validate()


def has_loop(arm: Arm) -> bool:
    """Whether both gains can be closed: the hub can turn, and has inertia."""
    return not (arm.is_locked or arm.has_massless_hub)


def sign_words(arm: Arm) -> str:
    """Return the law, and the sign of its moment gain."""
    return prose("signs", law=sign_of(arm))


def is_preset(arm: Arm, chain: Chain) -> bool:
    """Whether the arm comes with tfarm, and its chain is the one that comes with it."""
    return arm.name in presets() and (load(arm.name), load_chain(arm.name)) == (arm, chain)
