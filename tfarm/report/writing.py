"""From arms to a folder of pages: everything is made beside, and moved into place only when all of it is there.

The work is a list of pieces, one a section of an arm's page, each independent of the others, so two processes can
share it.  What a piece returns are words and file names; its pictures and tables are on disk already.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from tfarm.arm import Arm
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, TfarmError, did_you_mean
from tfarm.files import temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.report.card import save_card, written_cards
from tfarm.report.frame import beside
from tfarm.report.given_laws import GivenLaw, Subject, check_laws
from tfarm.report.kept import COMPARISON, kept_comparison
from tfarm.report.live import ASSETS, PAGE, has_assets, is_live, save_live, write_assets
from tfarm.report.page import QUESTIONS, arm_page, file_of, index_page
from tfarm.report.pieces import LAW_PIECES, PIECES, Piece
from tfarm.report.sections import SavedSection, Section, save_section
from tfarm.report.trust import FOLDER, Evidence, gather, kept_evidence, write_trust
from tfarm.report.trust_proofs import save_proof, written_proofs
from tfarm.report.unchanged import is_unchanged, key_of, note_made
from tfarm.report.words import typeset
from tfarm.report.workers import may_start_processes, shared

Progress = Callable[[int, int, str], object]
Notice = Callable[[str], object]

WORKERS = 2
ENOUGH = 8  # pieces of work of one arm for which a second process, which takes a second or two to start, is worth it
OURS = (
    "index.html",
    "README.md",
    "pictures",
    "bench.json",
    "trust",
    "data",
    "compare.html",
    "compare.json",
    ASSETS,
)  # names that no arm's folder may have


CARD, CARD_ALONE = "card", "card alone"  # with the proofs of the arm, and without
LIVE = "live loop"
FIRST = ("tune", "sampled", "modes", CARD, "locus")  # what takes longest, modes beside the proofs that they share
EVIDENCE = (-1, "evidence")  # for the page on trust: of no arm
TRUST = f"{FOLDER}/index.html"

Task = tuple[int, int | str]  # which arm, which piece (or its card and proof)
Result = SavedSection | Evidence | None


def write(
    arms: Sequence[Arm],
    out: Path,
    *,
    chains: Sequence[Chain] | None = None,
    laws: Sequence[Sequence[GivenLaw]] | None = None,
    fits: Sequence[Fit | None] | None = None,
    measured: Sequence[Measured] = (),
    only: tuple[str, ...] | None = None,
    force: bool = False,
    progress: Progress | None = None,
    notice: Notice | None = None,
) -> Path:
    """Write the report of each arm to out/<name>/, out/trust/ and out/index.html; the page to open first.

    `chains` are the arms' own sampling, converters, actuators and slews; ideal ones at 10 ms if not given.  `laws` are
    those that each arm's page is about; where there is none it is about the default gains.  `fits` are where the arms'
    numbers are from, if they were fitted to measurements: their pages begin with these.  Responses that were `measured`
    are laid over those of every arm.
    `only` ("bode", "modes", "margins", ...) writes those pages alone, out/<name>/bode.html and so on.  An arm whose
    pages are up to date is left as it is, unless `force`.  `progress` is told (done, total, what) after each piece of
    work.  A section that tfarm cannot make of an arm says why in its place, and `notice` is told so in one line, once
    the pages are written, as it is of an arm left as it was.  Raises ParameterError before any work if
    `out` cannot be written, two arms share a name or there is none, or an arm or its clock can make nothing of a law.
    If the work itself fails, `out` is as it was.
    """
    _check(arms, only)
    chains = [Chain()] * len(arms) if chains is None else chains
    laws = [()] * len(arms) if laws is None else laws
    fits = [None] * len(arms) if fits is None else fits
    each = zip(arms, chains, laws, fits, strict=True)
    subjects = [Subject(arm, chain, tuple(own), fit, tuple(measured)) for arm, chain, own, fit in each]
    for subject in subjects:
        check_laws(subject.arm, subject.chain, subject.laws)
    out = Path(out)
    told: list[str] = []
    with _beside(out, [arm.name for arm in arms] + [FOLDER, ASSETS] * (not only)) as beside:
        trust = TRUST if not only or (out / TRUST).is_file() else ""
        left = [
            not force and is_unchanged(out / each.arm.name, _pages(only), _leads(trust, out, each.arm), each)
            for each in subjects
        ]
        told += [_left(each.arm) for each, same in zip(subjects, left, strict=True) if same]
        changed = [each for each, same in zip(subjects, left, strict=True) if not same]
        folders = [beside / str(i) for i in range(len(changed))]
        for folder in folders:
            folder.mkdir()
        evidence = None if only or force else kept_evidence(out / FOLDER)
        sections, gathered = _make_all(changed, folders, only or (), not only and evidence is None, progress)
        for subject, folder, parts in zip(changed, folders, sections, strict=True):
            _write_pages(subject, folder, parts, only, trust, out / subject.arm.name)
            failures = list(_failures(subject.arm, parts))
            told += failures
            note_made(
                folder,
                out / subject.arm.name,
                () if failures else _pages(only),
                key_of(subject, _leads(trust, out, subject.arm)),
            )
        if not only and any(map(is_live, subjects)) and (changed or not has_assets(out / ASSETS)):
            write_assets(beside / ASSETS, out / ASSETS)
            move_into(beside / ASSETS, out / ASSETS)
        for subject, folder in zip(changed, folders, strict=True):
            move_into(folder, out / subject.arm.name)
        if (evidence := gathered or evidence) is not None:
            write_trust(evidence, written_proofs(out), beside / FOLDER)
            move_into(beside / FOLDER, out / FOLDER)
        index = index_page(written_cards(out), trust=trust, compared=kept_comparison(out)[0])
        (beside / "index.html").write_text(index, encoding="utf-8", newline="")
        os.replace(beside / "index.html", out / "index.html")
    for text in told:
        if notice is not None:
            notice(text)
    alone = len(arms) == 1 and only is not None and len(only) == 1
    return out / arms[0].name / f"{only[0]}.html" if alone and only else out / "index.html"


def _check(arms: Sequence[Arm], only: tuple[str, ...] | None) -> None:
    if not arms:
        raise ParameterError(key="arms", value=(), remedy="name at least one arm to report on")
    for question in only or ():
        if question not in QUESTIONS:
            raise ParameterError(key="only", value=question, remedy=did_you_mean(str(question), QUESTIONS))
    seen: set[str] = set()
    for arm in arms:
        if arm.name.casefold() in seen:
            remedy = "two arms of this name would share one folder; give one of them another name"
            raise ParameterError(key="name", value=arm.name, remedy=remedy)
        if arm.name.casefold() in {name.casefold() for name in OURS}:
            remedy = "the folder of reports has a file of this name; give the arm another name"
            raise ParameterError(key="name", value=arm.name, remedy=remedy)
        seen.add(arm.name.casefold())


@contextmanager
def _beside(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """A temporary folder in `out`, gone afterwards; what was made for it goes too if the work fails."""
    made: list[Path] = []
    why = "cannot be written ({}); give a folder that can"
    try:
        _make_folders(out, made)
        with temporary_folder(out) as beside:
            for name in names:
                _make_folders(out / name, made)
            why = "could not be written to ({}); free some space, or give another folder"
            yield beside
    except OSError as error:
        remedy = why.format(error.strerror or error)
        raise ParameterError(key="out", value=str(out), remedy=remedy) from None
    finally:
        _remove(made)


def _make_folders(folder: Path, made: list[Path]) -> None:
    """Make a folder and its parents, noting each that was not there.  Raises OSError if it cannot be written."""
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    for part in reversed(missing):
        part.mkdir(exist_ok=True)
        made.append(part)
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _remove(made: Sequence[Path]) -> None:
    """Take back the folders that were made, last first, as far as nothing is in them."""
    for folder in reversed(made):
        with suppress(OSError):
            folder.rmdir()


def _make_all(
    subjects: Sequence[Subject],
    folders: Sequence[Path],
    only: tuple[str, ...],
    with_evidence: bool,
    progress: Progress | None,
) -> tuple[list[list[SavedSection]], Evidence | None]:
    """The sections of each arm's page, in the order of PIECES, and the evidence if that is asked for."""
    tasks: list[Task] = [EVIDENCE] * with_evidence
    tasks += [
        (i, j)
        for i, subject in enumerate(subjects)
        for j, piece in enumerate(pieces_of(subject))
        if piece.is_for(subject) and (not only or set(only) & set(piece.questions))
    ]
    tasks += [(i, LIVE) for i, subject in enumerate(subjects) if not only and is_live(subject)]
    tasks += [(i, CARD_ALONE if subject.laws and only else CARD) for i, subject in enumerate(subjects)]
    done: dict[Task, Result] = {}
    if progress is not None:
        progress(0, len(tasks), _name_of(subjects, tasks[0]) if tasks else "nothing to make")
    for task, section in _results(subjects, folders, tasks):
        done[task] = section
        if progress is not None:
            progress(len(done), len(tasks), _name_of(subjects, task))
    places = range(len(subjects))
    sections = [[s for t in tasks if t[0] == i and isinstance(s := done[t], SavedSection)] for i in places]
    evidence = done.get(EVIDENCE)
    return sections, evidence if isinstance(evidence, Evidence) else None


def _results(
    subjects: Sequence[Subject], folders: Sequence[Path], tasks: Sequence[Task]
) -> Iterator[tuple[Task, Result]]:
    """Each task with its result as it comes: here, or by two processes where there is work for them."""
    if not tasks or (len(subjects) == 1 and len(tasks) < ENOUGH) or WORKERS == 1 or not may_start_processes():
        for task in tasks:
            yield task, _make(subjects[task[0]], task[1], folders[task[0]])
        return

    def submit(pool: Executor, task: Task) -> Future[Result]:
        i, piece = task
        return pool.submit(_make, subjects[i], piece, folders[i])

    yield from shared(_by_arm(subjects, tasks), submit, WORKERS)


def _by_arm(subjects: Sequence[Subject], tasks: Sequence[Task]) -> list[list[Task]]:
    """The tasks of each arm, and before them those of none; what takes longest first, so that no end is long."""

    def place(task: Task) -> int:
        i, piece = task
        what = piece if isinstance(piece, str) else pieces_of(subjects[i])[piece].anchor
        return FIRST.index(what) if what in FIRST else len(FIRST)

    return [sorted(each, key=place) for _, each in groupby(sorted(tasks, key=itemgetter(0)), itemgetter(0))]


def _make(subject: Subject, piece: int | str, folder: Path) -> Result:
    if piece == EVIDENCE[1]:
        return gather()
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


def _failures(arm: Arm, parts: Sequence[SavedSection]) -> Iterator[str]:
    """A line for each section that could not be made."""
    for part in parts:
        if part.section.failure:
            yield f"{arm.name}: the page leaves out “{part.section.title}” and says why: {part.section.failure}"


def _pages(only: tuple[str, ...] | None) -> tuple[str, ...]:
    """The pages written of an arm, as made.json names them."""
    return only or ("index",)


def _left(arm: Arm) -> str:
    return f"{arm.name}: left as it is, for nothing that its page is made of has changed; --force makes it again"


def _name_of(subjects: Sequence[Subject], task: Task) -> str:
    piece = task[1]
    if task == EVIDENCE:
        return "why trust this"
    subject = subjects[task[0]]
    return f"{subject.arm.name}: {piece if isinstance(piece, str) else pieces_of(subject)[piece].name}"


def _write_pages(
    subject: Subject,
    folder: Path,
    sections: Sequence[SavedSection],
    only: tuple[str, ...] | None,
    trust: str,
    earlier: Path,
) -> None:
    """The arm's file, with the chain that the page is about, and its page, or the page of each question asked.

    These lead to each other, and to what is in the `earlier` folder of the arm.
    """
    (folder / "arm.toml").write_text(file_of(subject), encoding="utf-8", newline="")
    for question in only or (None,):
        wanted = [s for s in sections if question is None or _answers(s.section.anchor, question)]
        live = (folder / PAGE).is_file()
        others = [*beside(earlier, _pages(only), question or "index"), *_compared(earlier.parent, subject.arm)]
        page = arm_page(subject, wanted, question, trust=f"../{trust}" if trust else "", live=live, others=others)
        (folder / f"{question or 'index'}.html").write_text(page, encoding="utf-8", newline="")


def _compared(out: Path, arm: Arm) -> list[tuple[str, str]]:
    """(file, title) of the comparison beside the reports, as an arm's page sees it, where it is one of this arm."""
    title, arms = kept_comparison(out)
    return [(f"../{COMPARISON}", title)] if arm.name in arms else []


def _leads(trust: str, out: Path, arm: Arm) -> str:
    """The pages that an arm's page leads to besides its own."""
    return "\n".join((trust, *(title for _, title in _compared(out, arm))))


def _answers(anchor: str, question: str) -> bool:
    return anchor in ("arm", "law", "no-loop") or anchor.startswith(question)


def move_into(made: Path, folder: Path) -> None:
    """Every file replaced in one step each, pages last, so that a page never names a file that is not there."""
    files = [file for file in made.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file.relative_to(made).as_posix())):
        place = folder / file.relative_to(made)
        place.parent.mkdir(exist_ok=True)
        os.replace(file, place)
