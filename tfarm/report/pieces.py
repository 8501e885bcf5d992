"""What pages are made of: the sections of an arm's page, and of one that is about laws that were given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from tfarm.arm import Arm
from tfarm.report.arm_section import arm_section
from tfarm.report.assumptions_section import assumptions_section
from tfarm.report.bode_section import bode_section
from tfarm.report.fit_section import fit_section, measured_section
from tfarm.report.given_laws import Subject, continuous_laws, on_arm
from tfarm.report.law_section import law_section
from tfarm.report.locus_section import locus_section
from tfarm.report.loop_laws import has_loop, has_rate_loop
from tfarm.report.loop_section import map_section, margins_section, no_loop_section, nyquist_section, poles_section
from tfarm.report.modes_section import modes_section
from tfarm.report.paper import is_from_paper, paper_section
from tfarm.report.sampled_section import sampled_section
from tfarm.report.sections import PageSection
from tfarm.report.tuner_section import tuner_section


@dataclass(frozen=True, slots=True)
class Piece:
    """One section of one arm's page: a name for the progress bar, the section's anchor, and how to make it.

    The page that `report --only` asks for is called by the first word of its sections' anchors; its `title` stands with
    one of them, and `is_also_on` says which other pages of that kind have a section.  The full page has all, and at
    its top the first words of those that are an answer (`is_answer`).  `seconds` is about how long a section takes to
    make, where that is long: the longest are begun first.

    `make` takes these parts of the page's subject (`of`), and a page where one is missing has no such section; `in_s`:
    only where one of the laws acts without a clock.
    """

    name: str
    anchor: str
    make: Callable[..., PageSection]
    suits: Callable[[Arm], bool] = lambda arm: True
    title: str = ""
    is_also_on: Callable[[str], bool] = lambda page: False
    is_answer: bool = False
    seconds: float = 0.0
    of: tuple[str, ...] = ("arm",)
    in_s: bool = False

    @property
    def page(self) -> str:
        """The page that has it when it is asked for alone."""
        return self.anchor.partition("-")[0]

    def is_on(self, page: str) -> bool:
        """Whether that page, asked for alone, has the section."""
        return page == self.page or self.is_also_on(page)

    def is_for(self, subject: Subject) -> bool:
        """Whether a page on this subject has the section."""
        if not self.suits(subject.arm) or not all(getattr(subject, part) for part in self.of):
            return False
        return not self.in_s or bool(continuous_laws(on_arm(subject.arm, subject.laws)))

    def made(self, subject: Subject) -> PageSection:
        """The section."""
        return self.make(*(getattr(subject, part) for part in self.of))


Answer = partial(Piece, is_answer=True)
SAMPLED, LAWS = ("arm", "chain"), ("arm", "chain", "laws")  # of what sections are that say what a clock does, or laws


def is_of_the_loop(page: str) -> bool:
    """Whether the page is one that an arm without a loop has nothing on, but that it has none."""
    return any(piece.page == page and piece.suits in (has_loop, has_rate_loop) for piece in ARM_PIECES)


ARM_PIECES = (
    Answer("the fit", "fit", fit_section, of=("fit",)),
    Answer("map of the gains", "margins-map", map_section, has_loop, of=SAMPLED),
    Piece("the arm", "arm", arm_section, is_also_on=lambda page: True),
    Piece("the paper's values", "paper", paper_section, is_from_paper),
    Piece("root moment", "bode-root-moment", partial(bode_section, output="root_moment"), title="Bode plots"),
    Piece("tip displacement", "bode-tip-displacement", partial(bode_section, output="tip_displacement")),
    Piece("measured responses", "bode-measured", measured_section, of=("arm", "measured")),
    Piece("modes", "modes", modes_section, title="Modes", seconds=1.0),
    Answer("no loop", "no-loop", no_loop_section, lambda arm: not has_loop(arm), is_also_on=is_of_the_loop),
    Answer("margins", "margins", margins_section, has_rate_loop, "Gains and margins", of=SAMPLED),
    Answer("root loci", "locus", locus_section, has_rate_loop, "Root loci", seconds=2.0, of=SAMPLED),
    Piece("Nyquist", "margins-nyquist", nyquist_section, has_rate_loop, of=SAMPLED),
    Answer("sampled loop", "sampled", sampled_section, has_loop, "The sampled loop", seconds=8.0, of=SAMPLED),
    Answer("gain tuner", "tune", tuner_section, has_loop, "The gain tuner", seconds=10.0, of=SAMPLED),
    Piece("assumptions", "assumptions", assumptions_section, title="What the assumptions do"),
)
QUESTIONS = {piece.page: piece.title for piece in ARM_PIECES if piece.title}  # pages that may be asked for alone
LAW_PIECES = (
    Answer("margins", "margins", margins_section, has_rate_loop, of=LAWS, in_s=True),
    Answer("sampled loop", "sampled", sampled_section, has_rate_loop, seconds=8.0, of=LAWS),
    Answer("the law", "law", law_section, has_rate_loop, is_also_on=is_of_the_loop, of=LAWS),
    Piece("Nyquist", "margins-nyquist", nyquist_section, has_rate_loop, of=LAWS, in_s=True),
    Answer("poles", "locus", poles_section, has_rate_loop, seconds=2.0, of=LAWS, in_s=True),
    Answer("no loop", "no-loop", no_loop_section, lambda arm: not has_rate_loop(arm), is_also_on=is_of_the_loop),
    *(
        piece
        for piece in ARM_PIECES
        if not is_of_the_loop(piece.page) and piece.is_also_on is not is_of_the_loop  # which laws have their own of
    ),
)
