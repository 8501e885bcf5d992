"""From arms to a folder of pages: everything is made in a temporary folder, and moved into place when complete."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from tfarm.arm import PLANE, Arm
from tfarm.comparing import Comparison
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, TfarmError, must_be_known
from tfarm.files import temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.plots.regions import comparison
from tfarm.processes import may_start_processes, shared
from tfarm.report.cards import COMPARISON_KIND, COMPARISON_PAGE, keep, kept_comparison, save_card, written_cards
from tfarm.report.cases import GivenLaw, Subject, check_laws
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live, save_live, write_assets
from tfarm.report.page import (
    ARM_PIECES,
    LAW_PIECES,
    QUESTIONS,
    Piece,
    arm_page,
    file_of,
    index_page,
    other_pages,
    render,
)
from tfarm.report.sections import PageSection, Picture, SavedSection, save_section, typeset, upper
from tfarm.report.trust import TRUST_FOLDER, Evidence, gather, write_trust
from tfarm.report.trust_proofs import save_proof, written_proofs
from tfarm.schema import table
from tfarm.stopping import undone_if_stopped

ReportProgress = Callable[[int, int, str], object]
MOST_WORKERS = 2  # processes that share the pieces of a report: as many cores as a small machine has
WORTH_A_PROCESS = 8  # pieces for which a second process, which takes a second or two to start, is worth it
CARD_WORK, CARD_ALONE_WORK = "card", "card alone"  # with the proofs of the arm, and without
LIVE_WORK = "live loop"
PieceWork = tuple[int, int | str]  # which arm, which piece (or its card and proof)
Made = SavedSection | Evidence | None
EVIDENCE_WORK: PieceWork = (-1, "why trust this")  # of no arm
SCRIPTS_WORK: PieceWork = (-1, "scripts of the live pages")
Notice = Callable[[str], object]
RESERVED_NAMES = (  # which no arm's folder may have
    "index.html", "README.md", "pictures", "bench.json", "trust", "data", "compare.html", "compare.json", ASSETS,
)  # fmt: skip
TRUST_PAGE = f"{TRUST_FOLDER}/index.html"
LEFT_OUT_OF = "{name}: the page leaves out “{title}” and says why: {why}"
DIFFERENCE_NOTE = "Differences are the second less the first, in the unit of the quantity."
PAIRED_NOTE = "By the mode whose open-loop pole each is nearest to."
UNPAIRED_NOTE = "Of a mode that has no oscillating pole on the other side, or of none."
IN_Z_NOTE = "One of the laws is a law in z: both loops are compared at their samples, each pole z as s = ln(z)/T."


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
    work: dict[PieceWork, Callable[[], Made]] = {} if only else {EVIDENCE_WORK: gather}
    if scripts is not None:
        work[SCRIPTS_WORK] = partial(write_assets, scripts)
    for i, (subject, folder) in enumerate(zip(subjects, folders, strict=True)):  # of each the longest work first
        suited = {j: piece for j, piece in enumerate(pieces_of(subject)) if piece.is_for(subject)}
        wanted = [j for j, piece in suited.items() if not only or any(map(piece.is_on, only))]
        pieces: list[int | str] = [*sorted(wanted, key=lambda j: -suited[j].seconds)]
        pieces += [LIVE_WORK] * (not only and is_live(subject))
        pieces.append(CARD_ALONE_WORK if subject.laws and only else CARD_WORK)
        work |= {(i, piece): partial(make, subject, piece, folder) for piece in pieces}
    done: dict[PieceWork, Made] = {}

    def tell(running: Sequence[PieceWork]) -> None:
        if progress is not None:
            progress(len(done), len(work), ", ".join(_name_of(subjects, task) for task in running))

    tell(())
    if len(work) < WORTH_A_PROCESS or MOST_WORKERS == 1 or not may_start_processes():
        for task, call in work.items():
            tell([task])
            done[task] = call()
    else:
        for task, result in shared(work, MOST_WORKERS, [__name__], tell):
            done[task] = result  # noqa: PERF403  `tell` counts them meanwhile
    tell(())
    sections = [
        [s for j in range(len(pieces_of(subject))) if isinstance(s := done.get((i, j)), SavedSection)]
        for i, subject in enumerate(subjects)
    ]
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
    out, n = Path(out), len(arms)
    each = zip(arms, chains or [Chain()] * n, laws or [()] * n, fits or [None] * n, strict=True)
    subjects = [Subject(arm, chain, tuple(own), fit, tuple(measured)) for arm, chain, own, fit in each]
    for subject in subjects:
        check_laws(subject.arm, subject.chain, subject.laws)
    names = [arm.name for arm in arms] + [TRUST_FOLDER, ASSETS] * (not only)
    with _beside(out, names) as beside:
        told = _written(subjects, out, beside, only, progress)
    for text in told:
        if notice is not None:
            notice(text)
    alone = len(arms) == 1 and only is not None and len(only) == 1
    return out / arms[0].name / f"{only[0]}.html" if alone and only else out / "index.html"


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


def write_comparison(found: Comparison, out: Path) -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    It leads to the index and to the arms' own pages, as far as they are in the folder.  An index of reports that is
    there leads to it from then on, and pages of its arms that are made later.
    """
    title, arms = (
        f"{found.one.name} and {found.other.name} compared",
        list(dict.fromkeys(s.arm.name for s in found.sides)),
    )
    lead = "Two arms, exact." if found.is_of_arms else f"Two laws on {found.one.arm.name}, exact."
    try:
        out.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as made:
            saved = [save_section(section, made) for section in _sections(found)]
            others = [("index.html", "all arms"), *((f"{name}/index.html", name) for name in arms)]
            pages = [(file, name) for file, name in others if (out / file).is_file()]
            page = render(COMPARISON_PAGE, title=title, lead=lead, sections=saved, pages=pages)
            (made / COMPARISON_PAGE).write_text(page, encoding="utf-8", newline="")
            keep(made, COMPARISON_KIND, {"title": title, "arms": arms})
            if (out / "index.html").is_file():
                trust = TRUST_PAGE if (out / TRUST_PAGE).is_file() else ""
                index = index_page(written_cards(out), trust=trust, compared=title)
                (made / "index.html").write_text(index, encoding="utf-8", newline="")
            move_into(made, out)
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key="--out", value=str(out), remedy=remedy) from None
    return out / COMPARISON_PAGE


def _sections(found: Comparison) -> Iterator[PageSection]:
    sides = table(found.rows, stem="compare-sides", title="Compared", caption="")
    words = [IN_Z_NOTE] * found.is_sampled
    yield PageSection(anchor="verdicts", title="Verdicts", words=words, blocks=(sides,))
    curves = "exact response" if found.is_of_arms else "loop function"
    plane = f"{' and '.join(PLANE)}, with exact edges"
    if found.is_sampled or found.regions is None:
        plane = "further delay and a factor on its law, with exact edges"
    picture = Picture(
        stem="comparison", title=f"{upper(curves)} and stable region", alt=f"{found.verdict}.",
        caption=f"The {curves} of both over frequency, and where each loop is stable over {plane}; the points are the "
        "laws.",
        figure=comparison.figure(found),
    )  # fmt: skip
    yield PageSection(anchor="both", title="Both in one picture", blocks=(picture,))
    tables = (
        ("modes", "Natural frequencies and damping", found.mode_differences, DIFFERENCE_NOTE),
        ("poles", "Closed-loop poles that oscillate", found.pole_differences, PAIRED_NOTE),
        ("unpaired-poles", "Poles of one side alone", found.unpaired_poles, UNPAIRED_NOTE),
        ("margins", "Stability and margins", found.margin_differences, DIFFERENCE_NOTE),
    )
    for stem, title, rows, caption in tables:
        if rows:
            blocks = (table(rows, stem=f"compare-{stem}", title=title, caption=caption),)
            yield PageSection(anchor=stem, title=title, blocks=blocks)
