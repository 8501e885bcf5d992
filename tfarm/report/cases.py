"""The case that a page is about: an arm, its chain and its controllers, and what is measured of them."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from tfarm.arm import AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law, load, presets
from tfarm.dsp import Chain, discretise, load_chain, verdict
from tfarm.errors import ConvergenceError, one_line
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.fitting.recording import MeasuredRun
from tfarm.loop.loop import Loop
from tfarm.loop.margins import Margins, margins
from tfarm.plots.style import gains_words
from tfarm.records import record
from tfarm.report.sections import prose
from tfarm.response.signals import Signals, sign_of
from tfarm.spectrum.table import default_gains
from tfarm.synthesis.design import Design, design

DESIGNED_MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it


@dataclass(frozen=True)
@record
class GivenLaw:
    """A law, the name of its `file` where it has one, and a run that was `measured` under it on the rig."""

    law: AnyLaw
    file: str = ""
    measured: MeasuredRun | None = None

    @property
    def name(self) -> str:
        """Its own name, or its gains with their values."""
        law = as_law(self.law)
        return one_line(law.name, 60) if law.gains is None else gains_words(law)


@dataclass(frozen=True)
@record
class Controller:
    """A law on an arm: `arm` has the input that `law` drives, `given` is its source.

    `name` is for reading, `key` for the columns and names of files, "law" or of several "law_1", "law_2" ...
    """

    arm: Arm
    law: Law
    given: GivenLaw
    name: str
    key: str

    @property
    def gains(self) -> str:
        """Its gains with their values, or the signals that it reads."""
        law = self.law
        return f"order {law.order}, of {', '.join(law.signals)}" if law.gains is None else gains_words(law)

    @property
    def title(self) -> str:
        """Its name and gains."""
        return f"{self.name}: {self.gains}"

    def stem(self, suffix: str) -> str:
        """The name of a file of it."""
        return f"{self.key.replace('_', '-')}-{suffix}"


class Case(NamedTuple):
    """An arm, its chain, and the laws that the page is about; without any it is about the default gains.

    `fit` is the source of the arm's numbers, if they were fitted to measurements; `measured` are responses that are
    drawn over its own.
    """

    arm: Arm
    chain: Chain
    laws: tuple[GivenLaw, ...] = ()
    fit: Fit | None = None
    measured: tuple[Measured, ...] = ()

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """The laws, each under a name that no other has; else the default gains."""
        if not self.laws:
            return (on_hub(self.arm, default_gains(self.arm), "default gains", "default"),)
        found: list[Controller] = []
        for number, given in enumerate(self.laws, 1):
            law = as_law(given.law)
            name = given.name if law.gains is None else "the gains given"
            name += f" ({number})" * (name in {each.name for each in found})
            key = f"law_{number}" if len(self.laws) > 1 else "law"
            found.append(Controller(arm_and_law(self.arm, law)[0], law, given, name, key))
        return tuple(found)

    @property
    def in_s(self) -> tuple[Controller, ...]:
        """The continuous-time controllers: those given, else the default gains and the best ones."""
        found = None if self.laws else best(self.arm, self.chain)
        more = () if found is None else (on_hub(self.arm, found.law, "best damping", "best"),)
        return tuple(each for each in (*self.controllers, *more) if not each.law.is_discrete)

    @property
    def has_loop(self) -> bool:
        """Whether the page has sections on loops: of laws wherever the hub can turn, of gains where both are felt."""
        return not self.arm.is_locked if self.laws else has_loop(self.arm)


def on_hub(arm: Arm, gains: HubFeedback, name: str, key: str) -> Controller:
    """Gains at the hub under a name of their own."""
    return Controller(arm, as_law(gains), GivenLaw(gains), name, key)


def check_laws(case: Case) -> None:
    """Raise ParameterError for a law that does not suit this arm or the sampling period of its chain."""
    for each in case.controllers if case.laws and not case.arm.is_locked else ():
        law = discretise.with_all_gains(*arm_and_law(each.arm, each.law))
        Signals(each.arm, law.signals)
        if not law.is_discrete:
            Loop(each.arm, law)
        discretise.discretised(law, case.chain.sampling.period)


def has_loop(arm: Arm) -> bool:
    """Whether both gains can be closed: the hub can turn, and has inertia."""
    return not (arm.is_locked or arm.has_massless_hub)


def sign_words(arm: Arm) -> str:
    """The law, and the sign of its moment gain."""
    return prose("signs", law=sign_of(arm))


@lru_cache(maxsize=16)
def best(arm: Arm, chain: Chain) -> Design | None:
    """The optimum of `tfarm design ARM`; None where no gains within its bounds hold, or the moment has no place."""
    try:
        found = design(arm, modes=DESIGNED_MODES, chain=chain) if has_loop(arm) else None
    except ConvergenceError:
        return None
    return None if found is None or found.at_limit else found  # where the hub does not move there is no law to draw


brief_on = lru_cache(maxsize=64)(verdict.sampled_brief)  # each computed once for all sections of a page
_margins = lru_cache(maxsize=64)(margins)


def margins_of(arm: Arm, law: AnyLaw) -> Margins:
    """Verdict and margins, computed once for all sections."""
    return _margins(arm, as_law(law))


def is_preset(arm: Arm, chain: Chain) -> bool:
    """Whether the arm comes with tfarm, and its chain is the one that comes with it."""
    return arm.name in presets() and (load(arm.name), load_chain(arm.name)) == (arm, chain)


def argument(name: str, preset: bool) -> str:
    """The name of an arm in a command."""
    return shlex.quote(name if preset else f"{name}.toml")
