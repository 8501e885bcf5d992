"""The pieces of a report: each a section of an arm's page, its card, its proof or the evidence, made by itself.

None needs another, so two processes can share them.  What a piece returns are words and file names; its pictures and
tables are on disk already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from tfarm.errors import TfarmError
from tfarm.processes import may_start_processes, shared
from tfarm.report.card import save_card
from tfarm.report.given_laws import Subject
from tfarm.report.live import is_live, save_live, write_assets
from tfarm.report.pieces import LAW_PIECES, PIECES, Piece
from tfarm.report.sections import SavedSection, Section, save_section
from tfarm.report.trust import Evidence, gather
from tfarm.report.trust_proofs import save_proof
from tfarm.report.words import typeset

Progress = Callable[[int, int, str], object]

WORKERS = 2
ENOUGH = 8  # pieces of work of one arm for which a second process, which takes a second or two to start, is worth it
CARD, CARD_ALONE = "card", "card alone"  # with the proofs of the arm, and without
LIVE = "live loop"
FIRST = ("tune", "sampled", "locus", "modes", CARD)  # what takes longest, modes beside the proofs that they share
Task = tuple[int, int | str]  # which arm, which piece (or its card and proof)
Result = SavedSection | Evidence | None

EVIDENCE: Task = (-1, "why trust this")  # of no arm
SCRIPTS: Task = (-1, "scripts of the live pages")


def make_all(
    subjects: Sequence[Subject],
    folders: Sequence[Path],
    only: tuple[str, ...],
    with_evidence: bool,
    scripts: tuple[Path, Path] | None,
    progress: Progress | None,
) -> tuple[list[list[SavedSection]], Evidence | None]:
    """The sections of each arm's page, in the order of PIECES, and the evidence if that is asked for.

    `scripts`: the folder that the live pages' scripts are made in, and that which they are for (see `write_assets`).
    """
    of_none = [EVIDENCE] * with_evidence + [SCRIPTS] * (scripts is not None)
    tasks = [*of_none, *_tasks(subjects, only)]
    done: dict[Task, Result] = {}
    if progress is not None:
        progress(0, len(tasks), _name_of(subjects, tasks[0]) if tasks else "nothing to make")

    def work(task: Task) -> Callable[[], Result]:
        if task == EVIDENCE:
            return gather
        if task == SCRIPTS and scripts is not None:
            return partial(write_assets, *scripts)
        return partial(make, subjects[task[0]], task[1], folders[task[0]])

    for task, section in _results(subjects, tasks, work):
        done[task] = section
        if progress is not None:
            progress(len(done), len(tasks), _name_of(subjects, task))
    places = range(len(subjects))
    sections = [[s for t in tasks if t[0] == i and isinstance(s := done[t], SavedSection)] for i in places]
    evidence = done.get(EVIDENCE)
    return sections, evidence if isinstance(evidence, Evidence) else None


def _tasks(subjects: Sequence[Subject], only: tuple[str, ...]) -> Iterator[Task]:
    """What is to be made of each arm."""
    for i, subject in enumerate(subjects):
        for j, piece in enumerate(pieces_of(subject)):
            if piece.is_for(subject) and (not only or set(only) & set(piece.questions)):
                yield i, j
        if not only and is_live(subject):
            yield i, LIVE
        yield i, CARD_ALONE if subject.laws and only else CARD


def _results(
    subjects: Sequence[Subject], tasks: Sequence[Task], work: Callable[[Task], Callable[[], Result]]
) -> Iterator[tuple[Task, Result]]:
    """Each task with its result as it comes: here, or by two processes where there is work for them."""
    if not tasks or (len(subjects) == 1 and len(tasks) < ENOUGH) or WORKERS == 1 or not may_start_processes():
        for task in tasks:
            yield task, work(task)()
        return

    def submit(pool: Executor, task: Task) -> Future[Result]:
        return pool.submit(work(task))

    yield from shared(_by_arm(subjects, tasks), submit, WORKERS, [__name__])


def _by_arm(subjects: Sequence[Subject], tasks: Sequence[Task]) -> list[list[Task]]:
    """The tasks of each arm, and before them those of none; what takes longest first, so that no end is long."""

    def place(task: Task) -> int:
        i, piece = task
        what = piece if isinstance(piece, str) else pieces_of(subjects[i])[piece].anchor
        return FIRST.index(what) if what in FIRST else len(FIRST)

    return [sorted(each, key=place) for _, each in groupby(sorted(tasks, key=itemgetter(0)), itemgetter(0))]


def make(subject: Subject, piece: int | str, folder: Path) -> Result:
    if piece == LIVE:
        save_live(subject, folder)
        return None
    if isinstance(piece, str):
        save_card(subject.arm, folder, [each.given_name for each in subject.laws], subject.chain)
        if piece == CARD:
            save_proof(subject.arm, folder, subject.chain)
        return None
    return save_section(_section(pieces_of(subject)[piece], subject), folder)


def pieces_of(subject: Subject) -> Sequence[Piece]:
    """The sections of a page on this subject, in their order."""
    return LAW_PIECES if subject.laws else PIECES


def _section(piece: Piece, subject: Subject) -> Section:
    """The section, or in its place why tfarm could not make it of this arm; a bug of ours stays loud."""
    try:
        return piece.made(subject)
    except TfarmError as error:
        title = f"{piece.name[0].upper()}{piece.name[1:]}"
        words = (f"This section could not be made for this arm: {typeset(str(error))}.",)
        return Section(anchor=piece.anchor, title=title, words=words, failure=str(error))


def _name_of(subjects: Sequence[Subject], task: Task) -> str:
    piece = task[1]
    if task in (EVIDENCE, SCRIPTS):
        return str(piece)
    subject = subjects[task[0]]
    return f"{subject.arm.name}: {piece if isinstance(piece, str) else pieces_of(subject)[piece].name}"
