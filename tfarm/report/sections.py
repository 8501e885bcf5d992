"""The sections of an arm's pages in their order, the page that has each, and the task that makes it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from tfarm.errors import TfarmError
from tfarm.plots.style import drawn_for
from tfarm.report import loop_section, response_sections
from tfarm.report.blocks import PageSection, save_section, upper
from tfarm.report.measured_section import measured_runs_section
from tfarm.report.page import ArmReport, has_loop
from tfarm.report.response_sections import bode_section
from tfarm.report.sampled_section import sampled_section, tuner_section


class Task(StrEnum):
    """Work of one process that several sections share."""

    # whose sections share a design
    LOOP = "continuous loop"
    # whose sections share damped modes
    SAMPLED = "sampled loop"
    # of no arm
    EVIDENCE = "method and proofs"


@dataclass(frozen=True, slots=True)
class SectionSpec:
    """A section of an arm's pages: a name for the progress bar, the section's anchor, and how to make it of a report.

    A report that it does not suit has no such section.  The page that has it is called by the first word of its anchor,
    or `on`; the `title` of the page is that of one of its sections.  The first page shows blocks of some, and begins
    with the one that `is_first`.
    """

    name: str
    anchor: str
    make: Callable[[ArmReport], PageSection]
    suits: Callable[[ArmReport], Any] = bool
    title: str = ""
    on: str = ""
    is_first: bool = False

    @property
    def page(self) -> str:
        """The page that has it."""
        return self.on or self.anchor.partition("-")[0]

    @property
    def task(self) -> str:
        """The work of one process that makes it, after the other sections of it."""
        shared = {"margins": Task.LOOP, "locus": Task.LOOP, "sampled": Task.SAMPLED, "tune": Task.SAMPLED}
        return shared.get(self.page, self.name)


def _in_s(report: ArmReport) -> bool:
    """Whether a controller of the report acts in continuous time."""
    return not report.arm.is_locked and any(not each.law.is_discrete for each in report.cases)


def _of_laws(report: ArmReport) -> bool:
    """Whether the page is about given laws of a hub that turns."""
    return bool(report.laws) and not report.arm.is_locked


def _of_runs(report: ArmReport) -> bool:
    """Whether a run was measured under a law of the report."""
    return report.has_loop and any(each.measured is not None for each in report.cases)


def _of_gains(report: ArmReport) -> bool:
    """Whether the page is about both gains of the arm itself."""
    return not report.laws and has_loop(report.arm)


PIECES = (
    SectionSpec(
        "stability region of both gains", "margins-map", loop_section.map_section, _of_gains, is_first=True
    ),
    SectionSpec("recommended gains", "margins-recommended", loop_section.recommended_section, _of_gains),
    SectionSpec("stability margins", "margins", loop_section.margins_section, _in_s, "Gains and margins"),
    SectionSpec("Nyquist plot", "margins-nyquist", loop_section.nyquist_section, _in_s),
    SectionSpec(
        "response of the root moment",
        "bode-root-moment",
        partial(bode_section, output="root_moment"),
        title="Bode plots",
    ),
    SectionSpec(
        "response of the tip", "bode-tip-displacement", partial(bode_section, output="tip_displacement")
    ),
    SectionSpec(
        "measured responses", "bode-measured", response_sections.measured_section, attrgetter("measured")
    ),
    SectionSpec("the arm", "arm", response_sections.arm_section, on="modes"),
    SectionSpec("modes", "modes", response_sections.modes_section, title="Arm and modes"),
    SectionSpec("root loci", "locus", loop_section.locus_section, _in_s, "Root loci"),
    SectionSpec("sampled loop", "sampled", sampled_section, attrgetter("has_loop"), "The sampled loop"),
    SectionSpec("measured runs", "sampled-measured", measured_runs_section, _of_runs),
    SectionSpec("controllers", "law", loop_section.law_section, _of_laws, "The controller"),
    SectionSpec("gain tuner", "tune", tuner_section, _of_gains, "The gain tuner"),
    SectionSpec(
        "fit to measurements", "fit", response_sections.fit_section, attrgetter("fit"), "Fitted numbers"
    ),
    SectionSpec("assumptions", "assumptions", response_sections.assumptions_section, title="Assumptions"),
)
# titles of pages that may be asked for alone
QUESTIONS = {piece.page: piece.title for piece in PIECES if piece.title}


def pieces_of(report: ArmReport) -> list[SectionSpec]:
    """Return the sections of a report, in their order."""
    return [piece for piece in PIECES if piece.suits(report)]


def make_section(piece: SectionSpec, report: ArmReport, folder: Path) -> PageSection:
    """Return a section saved in the arm's folder, or the reason why tfarm could not make it; a bug of ours is loud."""
    try:
        with drawn_for("page"):
            section = replace(piece.make(report), anchor=piece.anchor)
    except TfarmError as error:
        section = PageSection(
            anchor=piece.anchor,
            title=upper(piece.name),
            answer=f"This section could not be made for this arm: {error}.",
            failure=str(error),
        )
    return save_section(section, folder, report.is_paper)
