"""The pieces of a report: each a section of an arm's page, its card, its proof or the evidence, made by itself.

None needs another, so two processes share them.  What a piece returns are words and file names; its pictures and
tables are on disk already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tfarm.errors import TfarmError
from tfarm.processes import may_start_processes, shared
from tfarm.report.card import save_card
from tfarm.report.given_laws import Subject
from tfarm.report.live import is_live, save_live, write_assets
from tfarm.report.pieces import ARM_PIECES, LAW_PIECES, Piece
from tfarm.report.sections import PageSection, SavedSection, save_section
from tfarm.report.trust import Evidence, gather
from tfarm.report.trust_proofs import save_proof
from tfarm.report.words import typeset, upper

ReportProgress = Callable[[int, int, str], object]

MOST_WORKERS = 2  # processes that share the pieces of a report: as many cores as a small machine has
WORTH_A_PROCESS = 8  # pieces for which a second process, which takes a second or two to start, is worth it
CARD_WORK, CARD_ALONE_WORK = "card", "card alone"  # with the proofs of the arm, and without
LIVE_WORK = "live loop"
CARD_SECONDS = 0.9  # less than the modes, which share their proofs and are begun before
PieceWork = tuple[int, int | str]  # which arm, which piece (or its card and proof)
Made = SavedSection | Evidence | None

EVIDENCE_WORK: PieceWork = (-1, "why trust this")  # of no arm
SCRIPTS_WORK: PieceWork = (-1, "scripts of the live pages")


def make_all(
    subjects: Sequence[Subject],
    folders: Sequence[Path],
    only: tuple[str, ...],
    scripts: Path | None,
    progress: ReportProgress | None,
) -> tuple[list[list[SavedSection]], Evidence | None]:
    """The sections of each arm's page, in the order of PIECES, and the evidence of a full report.

    `scripts` is the folder that the live pages' scripts are made in.
    """
    tasks = [EVIDENCE_WORK] * (not only) + [SCRIPTS_WORK] * (scripts is not None)
    for i, subject in enumerate(subjects):
        suited = [(j, piece) for j, piece in enumerate(pieces_of(subject)) if piece.is_for(subject)]
        tasks += [(i, j) for j, piece in suited if not only or any(map(piece.is_on, only))]
        tasks += [(i, LIVE_WORK)] * (not only and is_live(subject))
        tasks.append((i, CARD_ALONE_WORK if subject.laws and only else CARD_WORK))
    done: dict[PieceWork, Made] = {}

    def tell(running: Sequence[PieceWork]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(_name_of(subjects, task) for task in running))

    def work(task: PieceWork) -> Callable[[], Made]:
        if task == EVIDENCE_WORK:
            return gather
        if task == SCRIPTS_WORK and scripts is not None:
            return partial(write_assets, scripts)
        return partial(make, subjects[task[0]], task[1], folders[task[0]])

    def turn(task: PieceWork) -> tuple[int, float]:  # an arm after the other, and of each the longest work first
        i, piece = task
        if isinstance(piece, str):
            return i, -CARD_SECONDS * (piece == CARD_WORK)
        return i, -pieces_of(subjects[i])[piece].seconds

    tell(())
    if len(tasks) < WORTH_A_PROCESS or MOST_WORKERS == 1 or not may_start_processes():
        for task in tasks:
            tell([task])
            done[task] = work(task)()
    else:
        ordered = {task: work(task) for task in sorted(tasks, key=turn)}
        for task, result in shared(ordered, MOST_WORKERS, [__name__], tell):
            done[task] = result  # noqa: PERF403  `tell` counts them meanwhile
    tell(())
    places = range(len(subjects))
    sections = [[s for t in tasks if t[0] == i and isinstance(s := done[t], SavedSection)] for i in places]
    evidence = done.get(EVIDENCE_WORK)
    return sections, evidence if isinstance(evidence, Evidence) else None


def make(subject: Subject, piece: int | str, folder: Path) -> Made:
    """A section of an arm's page, or its card, proof or live page, saved in the arm's folder."""
    if piece == LIVE_WORK:
        save_live(subject, folder)
        return None
    if isinstance(piece, str):
        save_card(subject.arm, folder, subject.laws, subject.chain)
        if piece == CARD_WORK:
            save_proof(subject.arm, folder, subject.chain)
        return None
    return save_section(section_or_why_not(pieces_of(subject)[piece], subject), folder)


def pieces_of(subject: Subject) -> Sequence[Piece]:
    """The sections of a page on this subject, in their order."""
    return LAW_PIECES if subject.laws else ARM_PIECES


def section_or_why_not(piece: Piece, subject: Subject) -> PageSection:
    """The section, or in its place why tfarm could not make it of this arm; a bug of ours stays loud."""
    try:
        return piece.made(subject)
    except TfarmError as error:
        words = (f"This section could not be made for this arm: {typeset(str(error))}.",)
        return PageSection(anchor=piece.anchor, title=upper(piece.name), words=words, failure=str(error))


def _name_of(subjects: Sequence[Subject], task: PieceWork) -> str:
    piece = task[1]
    if task in (EVIDENCE_WORK, SCRIPTS_WORK):
        return str(piece)
    subject = subjects[task[0]]
    return f"{subject.arm.name}: {piece if isinstance(piece, str) else pieces_of(subject)[piece].name}"
