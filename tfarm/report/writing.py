"""From arms to a folder of pages: everything is made beside, and moved into place only when all of it is there."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from tfarm.arm import Arm
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, must_be_known
from tfarm.files import temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.report.card import written_cards
from tfarm.report.frame import other_pages
from tfarm.report.given_laws import GivenLaw, Subject, check_laws
from tfarm.report.kept import COMPARISON_PAGE, kept_comparison
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live
from tfarm.report.making import ReportProgress, make_all, pieces_of
from tfarm.report.page import arm_page, file_of, index_page
from tfarm.report.pieces import QUESTIONS
from tfarm.report.sections import SavedSection
from tfarm.report.trust import TRUST_FOLDER, write_trust
from tfarm.report.trust_proofs import written_proofs
from tfarm.stopping import undone_if_stopped

Notice = Callable[[str], object]

RESERVED_NAMES = (  # which no arm's folder may have
    "index.html", "README.md", "pictures", "bench.json", "trust", "data", "compare.html", "compare.json", ASSETS,
)  # fmt: skip


TRUST_PAGE = f"{TRUST_FOLDER}/index.html"
LEFT_OUT_OF = "{name}: the page leaves out “{title}” and says why: {why}"


def write(
    arms: Sequence[Arm],
    out: Path,
    *,
    chains: Sequence[Chain] | None = None,
    laws: Sequence[Sequence[GivenLaw]] | None = None,
    fits: Sequence[Fit | None] | None = None,
    measured: Sequence[Measured] = (),
    only: tuple[str, ...] | None = None,
    progress: ReportProgress | None = None,
    notice: Notice | None = None,
) -> Path:
    """Write the report of each arm to out/<name>/, out/trust/ and out/index.html; the page to open first.

    `chains` are the arms' own sampling, converters, actuators and slews; ideal ones at 10 ms if not given.  `laws` are
    those that each arm's page is about; where there is none it is about the default gains.  `fits` are where the arms'
    numbers are from, if they were fitted to measurements: their pages begin with these.  Responses that were `measured`
    are laid over those of every arm.
    `only` ("bode", "modes", "margins", ...) writes those pages alone, out/<name>/bode.html and so on.  `progress` gets
    (done, total, what runs) whenever a piece of work begins, and at the end.  A section that tfarm cannot make of an
    arm says why in its place, and `notice` gets the same in one line once the pages are written.  Raises ParameterError
    before any work if `out` cannot be written, two arms share a name or there is none, or an arm or its chain does not
    suit a law; ConvergenceError if a process dies.  If the work itself fails, `out` is as it was.
    """
    _check(arms, only)
    subjects = _subjects(arms, chains, laws, fits, measured)
    out = Path(out)
    names = [arm.name for arm in arms] + [TRUST_FOLDER, ASSETS] * (not only)
    with _beside(out, names) as beside:
        told = _written(subjects, out, beside, only, progress)
    for text in told:
        if notice is not None:
            notice(text)
    alone = len(arms) == 1 and only is not None and len(only) == 1
    return out / arms[0].name / f"{only[0]}.html" if alone and only else out / "index.html"


def _subjects(
    arms: Sequence[Arm],
    chains: Sequence[Chain] | None,
    laws: Sequence[Sequence[GivenLaw]] | None,
    fits: Sequence[Fit | None] | None,
    measured: Sequence[Measured],
) -> list[Subject]:
    """What each arm's page is about.  Raises ParameterError where an arm or its clock can make nothing of a law."""
    chains = [Chain()] * len(arms) if chains is None else chains
    laws = [()] * len(arms) if laws is None else laws
    fits = [None] * len(arms) if fits is None else fits
    each = zip(arms, chains, laws, fits, strict=True)
    subjects = [Subject(arm, chain, tuple(own), fit, tuple(measured)) for arm, chain, own, fit in each]
    for subject in subjects:
        check_laws(subject.arm, subject.chain, subject.laws)
    return subjects


def _written(
    subjects: Sequence[Subject],
    out: Path,
    beside: Path,
    only: tuple[str, ...] | None,
    progress: ReportProgress | None,
) -> list[str]:
    """Make all pages in `beside`, move them to `out`, and the index last; what is to be said of them."""
    trust = TRUST_PAGE if not only or (out / TRUST_PAGE).is_file() else ""
    folders = [beside / str(i) for i in range(len(subjects))]
    for folder in folders:
        folder.mkdir()
    scripts = beside / ASSETS if not only and any(map(is_live, subjects)) else None
    sections, evidence = make_all(subjects, folders, only or (), scripts, progress)
    told = []
    for subject, folder, parts in zip(subjects, folders, sections, strict=True):
        _write_pages(subject, folder, parts, only, trust, out / subject.arm.name)
        failed = [part.section for part in parts if part.section.failure]
        told += [LEFT_OUT_OF.format(name=subject.arm.name, title=each.title, why=each.failure) for each in failed]
    if scripts is not None:
        move_into(scripts, out / ASSETS)
    for subject, folder in zip(subjects, folders, strict=True):
        move_into(folder, out / subject.arm.name)
    if evidence is not None:
        write_trust(evidence, written_proofs(out), beside / TRUST_FOLDER)
        move_into(beside / TRUST_FOLDER, out / TRUST_FOLDER)
    index = index_page(written_cards(out), trust=trust, compared=kept_comparison(out)[0])
    (beside / "index.html").write_text(index, encoding="utf-8", newline="")
    os.replace(beside / "index.html", out / "index.html")
    return told


def _check(arms: Sequence[Arm], only: tuple[str, ...] | None) -> None:
    if not arms:
        raise ParameterError(key="arms", value=(), remedy="name at least one arm to report on")
    for question in only or ():
        must_be_known("only", question, QUESTIONS)
    seen: set[str] = set()
    for arm in arms:
        if arm.name.casefold() in seen:
            remedy = "two arms of this name would share one folder; give one of them another name"
            raise ParameterError(key="name", value=arm.name, remedy=remedy)
        if arm.name.casefold() in {name.casefold() for name in RESERVED_NAMES}:
            remedy = "the folder of reports has a file of this name; give the arm another name"
            raise ParameterError(key="name", value=arm.name, remedy=remedy)
        seen.add(arm.name.casefold())


@contextmanager
def _beside(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """A temporary folder in `out`, gone afterwards; what was made for it goes too if the work fails."""
    made: list[Path] = []
    why = "cannot be written ({}); give a folder that can"
    try:
        with undone_if_stopped(partial(_remove_empty, made)):
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
        _remove_empty(made)


def _remove_empty(folders: Sequence[Path]) -> None:
    """Remove those with nothing in them, the last first."""
    for folder in reversed(folders):
        with suppress(OSError):
            folder.rmdir()


def _make_folders(folder: Path, made: list[Path]) -> None:
    """Make a folder and its parents, noting each that was not there.  Raises OSError if it cannot be written."""
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    for part in reversed(missing):
        made.append(part)
        part.mkdir(exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


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
        anchors = {piece.anchor for piece in pieces_of(subject) if question and piece.is_on(question)}
        wanted = [each for each in sections if question is None or each.section.anchor in anchors]
        live = (folder / LIVE_PAGE).is_file()
        others = [
            *other_pages(earlier, only or ("index",), question or "index"),
            *_compared(earlier.parent, subject.arm),
        ]
        page = arm_page(subject, wanted, question, trust=f"../{trust}" if trust else "", live=live, others=others)
        (folder / f"{question or 'index'}.html").write_text(page, encoding="utf-8", newline="")


def _compared(out: Path, arm: Arm) -> list[tuple[str, str]]:
    """(file, title) of the comparison beside the reports, as an arm's page sees it, where it is one of this arm."""
    title, arms = kept_comparison(out)
    return [(f"../{COMPARISON_PAGE}", title)] if arm.name in arms else []


def move_into(made: Path, folder: Path) -> None:
    """Every file replaced in one step each, pages last, so that a page never names a file that is not there."""
    files = [file for file in made.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file.relative_to(made).as_posix())):
        place = folder / file.relative_to(made)
        place.parent.mkdir(exist_ok=True)
        os.replace(file, place)
