"""From arms to a folder of pages: everything is made in a temporary folder, and moved into place when complete."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from tfarm.arm import Arm
from tfarm.case import Comparison
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, TfarmError, must_be_known
from tfarm.files import temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.plots.regions import comparison
from tfarm.processes import may_start_processes, shared
from tfarm.report.cases import Case, GivenLaw, check_laws
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live, save_live, write_assets
from tfarm.report.page import (
    COMPARISON_KIND,
    COMPARISON_PAGE,
    QUESTIONS,
    Piece,
    arm_page,
    file_of,
    index_page,
    keep,
    kept_comparison,
    other_pages,
    pieces_of,
    save_card,
    written_cards,
)
from tfarm.report.sections import PageSection, Picture, SavedSection, prose, render, save_section, upper
from tfarm.report.trust import TRUST_FOLDER, Evidence, gather, save_proof, write_trust, written_proofs
from tfarm.schema import quantities, table
from tfarm.stopping import undone_if_stopped

ReportProgress = Callable[[int, int, str], object]
Notice = Callable[[str], object]
MOST_WORKERS = 2  # processes that share the pieces of a report: as many cores as a small machine has
WORTH_A_PROCESS = 8  # pieces for which a second process, which takes a second or two to start, is worth it
EVIDENCE, SCRIPTS = "why trust this", "scripts of the live pages"  # pieces of no arm
RESERVED_NAMES = {  # of folders that no arm may have
    "index.html", "readme.md", "pictures", "bench.json", "trust", "data", "compare.html", "compare.json", ASSETS,
}  # fmt: skip
TRUST_PAGE = f"{TRUST_FOLDER}/index.html"


class Task(NamedTuple):
    """What one process makes at a time, and about how long that takes [s] where it is long."""

    name: str
    call: Callable[[], Any]
    seconds: float = 0.0


def make_all(
    cases: Sequence[Case],
    folders: Sequence[Path],
    only: tuple[str, ...],
    scripts: Path | None,
    progress: ReportProgress | None,
) -> tuple[list[list[SavedSection]], Evidence | None]:
    """The sections of each arm's page, in their order, and the evidence of a full report.

    `scripts` is the folder that the live pages' scripts are made in.
    """
    tasks = [] if only else [Task(EVIDENCE, gather)]
    tasks += [] if scripts is None else [Task(SCRIPTS, partial(write_assets, scripts))]
    pages = [[piece for piece in pieces_of(case) if not only or any(map(piece.is_on, only))] for case in cases]
    for case, folder, pieces in zip(cases, folders, pages, strict=True):
        tasks += tasks_of(case, folder, pieces, is_whole=not only)
    tasks.sort(key=lambda task: -task.seconds)  # the longest first
    done: dict[str, Any] = {}

    def begun(running: Sequence[str]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(running))

    if len(tasks) < WORTH_A_PROCESS or MOST_WORKERS == 1 or not may_start_processes():
        for task in tasks:
            begun([task.name])
            done[task.name] = task.call()
    else:
        for name, result in shared({task.name: task.call for task in tasks}, MOST_WORKERS, begun):
            done[name] = result  # noqa: PERF403  `begun` counts them meanwhile
    begun(["pages"])
    sections = [
        [done[task_name(case, piece)][piece.anchor] for piece in pieces]
        for case, pieces in zip(cases, pages, strict=True)
    ]
    return sections, done.get(EVIDENCE)


def task_name(case: Case, piece: Piece) -> str:
    """The name of the task that makes a section of an arm's page."""
    return f"{case.arm.name}: {piece.task or piece.name}"


def tasks_of(case: Case, folder: Path, pieces: Sequence[Piece], *, is_whole: bool) -> Iterator[Task]:
    """The tasks of one arm: its sections, its card and proof, and of a full report its live page.

    Proof and live page are made by the process of the section that has computed most of them: the proof certifies the
    modes that are listed, the live page has the regions of the map.
    """
    of = f"{case.arm.name}: "
    more: dict[str, Task] = {}
    if is_whole or not case.laws:
        more["modes"] = Task(f"{of}proof", partial(save_proof, case.arm, folder, case.chain))
    if is_whole and is_live(case):
        more["margins-map"] = Task(f"{of}live loop", partial(save_live, case, folder))
    for name in dict.fromkeys(task_name(case, piece) for piece in pieces):
        parts = [piece for piece in pieces if task_name(case, piece) == name]
        makers = [(piece.name, piece.anchor, piece.make) for piece in parts]
        also = [more.pop(piece.anchor).call for piece in parts if piece.anchor in more]
        yield Task(name, partial(make_sections, makers, case, folder, also), sum(piece.seconds for piece in parts))
    yield Task(f"{of}card", partial(save_card, case, folder))
    yield from more.values()


def make_sections(
    makers: Sequence[tuple[str, str, Any]], case: Case, folder: Path, also: Sequence[Callable[[], None]]
) -> dict[str, SavedSection]:
    """Sections by anchor, made one after the other, and what is `also` made in the same process.

    Each section is given by its name, its anchor and how to make it of a case.
    """
    sections = {anchor: make_section(name, anchor, make, case, folder) for name, anchor, make in makers}
    for call in also:
        call()
    return sections


def make_section(name: str, anchor: str, make: Callable[[Case], PageSection], case: Case, folder: Path) -> SavedSection:
    """A section saved in the arm's folder, or in its place why tfarm could not make it; a bug of ours stays loud."""
    try:
        section = make(case)
    except TfarmError as error:
        answer = f"This section could not be made for this arm: {error}."
        section = PageSection(anchor=anchor, title=upper(name), answer=answer, failure=str(error))
    return save_section(section, folder)


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
    arm has the reason in its place, and `notice` gets the same in one line at the end.  Raises ParameterError before
    any work if `out` cannot be written, two arms share a name or there is none, or an arm or its chain does not suit a
    law; ConvergenceError if a process dies.  If the work itself fails, `out` is as it was.
    """
    out, n = Path(out), len(arms)
    _check([arm.name for arm in arms], only or ())
    each = zip(arms, chains or [Chain()] * n, laws or [()] * n, fits or [None] * n, strict=True)
    cases = [Case(arm, chain, tuple(own), fit, tuple(measured)) for arm, chain, own, fit in each]
    for case in cases:
        check_laws(case)
    with _temporary(out, [arm.name for arm in arms] + [TRUST_FOLDER, ASSETS] * (not only)) as folder:
        failed = _written(cases, out, folder, only, progress)
    for name, section in failed:
        if notice is not None:
            notice(f"{name}: the page leaves out “{section.title}”: {section.failure}")
    alone = f"{arms[0].name}/{only[0]}.html" if n == 1 and only and len(only) == 1 else "index.html"
    return out / alone


def _written(
    cases: Sequence[Case], out: Path, place: Path, only: tuple[str, ...] | None, progress: ReportProgress | None
) -> list[tuple[str, PageSection]]:
    """Make all pages in `place`, move them to `out`, and the index last; the sections that failed, by their arms."""
    trust = TRUST_PAGE if not only or (out / TRUST_PAGE).is_file() else ""
    folders = [place / str(i) for i in range(len(cases))]
    for folder in folders:
        folder.mkdir()
    scripts = place / ASSETS if not only and any(map(is_live, cases)) else None
    sections, evidence = make_all(cases, folders, only or (), scripts, progress)
    for case, folder, parts in zip(cases, folders, sections, strict=True):
        _write_pages(case, folder, parts, only, trust, out / case.arm.name)
    if scripts is not None:
        move_into(scripts, out / ASSETS)
    for case, folder in zip(cases, folders, strict=True):
        move_into(folder, out / case.arm.name)
    if evidence is not None:
        write_trust(evidence, written_proofs(out), place / TRUST_FOLDER)
        move_into(place / TRUST_FOLDER, out / TRUST_FOLDER)
    _write_index(place, out, trust, kept_comparison(out)[0])
    os.replace(place / "index.html", out / "index.html")
    named = [(case.arm.name, part.section) for case, parts in zip(cases, sections, strict=True) for part in parts]
    return [(name, section) for name, section in named if section.failure]


def _write_index(place: Path, out: Path, trust: str, compared: str) -> None:
    """The index of the arms in a folder of reports, made in another place."""
    page = index_page(written_cards(out), trust=trust, compared=compared)
    (place / "index.html").write_text(page, encoding="utf-8", newline="")


def _check(names: Sequence[str], only: tuple[str, ...]) -> None:
    if not names:
        raise ParameterError(key="arms", value=(), remedy="name at least one arm to report on")
    for question in only:
        must_be_known("only", question, QUESTIONS)
    for number, name in enumerate(names):
        if name.casefold() in (other.casefold() for other in names[:number]):
            remedy = "two arms of this name would share one folder; give one of them another name"
            raise ParameterError(key="name", value=name, remedy=remedy)
        if name.casefold() in RESERVED_NAMES:
            remedy = "the folder of reports has a file of this name; give the arm another name"
            raise ParameterError(key="name", value=name, remedy=remedy)


@contextmanager
def _temporary(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """A temporary folder in `out`, gone afterwards; what was made for it goes too if the work fails."""
    folders = [out, *(out / name for name in names)]
    missing = [part for folder in folders for part in (*reversed(folder.parents), folder) if not part.exists()]

    def remove_empty() -> None:
        for folder in reversed(missing):
            with suppress(OSError):
                folder.rmdir()

    try:
        with undone_if_stopped(remove_empty):
            for folder in folders:
                folder.mkdir(parents=True, exist_ok=True)
                with temporary_folder(folder):  # which fails where it cannot be written to
                    pass
            with temporary_folder(out) as place:
                yield place
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key="out", value=str(out), remedy=remedy) from None
    finally:
        remove_empty()


def _write_pages(
    case: Case,
    folder: Path,
    sections: Sequence[SavedSection],
    only: tuple[str, ...] | None,
    trust: str,
    earlier: Path,
) -> None:
    """The arm's file, with the chain that the page is about, and its page, or the page of each question asked.

    These lead to each other, and to what is in the `earlier` folder of the arm.
    """
    (folder / "arm.toml").write_text(file_of(case), encoding="utf-8", newline="")
    title, compared = kept_comparison(earlier.parent)
    for question in only or (None,):
        anchors = {piece.anchor for piece in pieces_of(case) if question and piece.is_on(question)}
        wanted = [each for each in sections if question is None or each.section.anchor in anchors]
        live = (folder / LIVE_PAGE).is_file()
        others = list(other_pages(earlier, only or ("index",), question or "index"))
        others += [(f"../{COMPARISON_PAGE}", title)] if case.arm.name in compared else []
        page = arm_page(case, wanted, question, trust=f"../{trust}" if trust else "", live=live, others=others)
        (folder / f"{question or 'index'}.html").write_text(page, encoding="utf-8", newline="")


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
    title = f"{found.one.name} and {found.other.name} compared"
    arms = list(dict.fromkeys(side.arm.name for side in found.sides))
    try:
        out.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as made:
            saved = save_section(_comparison_section(found), made)
            others = [("index.html", "all arms"), *((f"{name}/index.html", name) for name in arms)]
            pages = [(file, name) for file, name in others if (out / file).is_file()]
            page = render(COMPARISON_PAGE, title=title, saved=saved, pages=pages)
            (made / COMPARISON_PAGE).write_text(page, encoding="utf-8", newline="")
            keep(made, COMPARISON_KIND, {"title": title, "arms": arms})
            if (out / "index.html").is_file():
                _write_index(made, out, TRUST_PAGE if (out / TRUST_PAGE).is_file() else "", title)
            move_into(made, out)
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key="--out", value=str(out), remedy=remedy) from None
    return out / COMPARISON_PAGE


def _comparison_section(found: Comparison) -> PageSection:
    """The verdicts and the picture of a comparison, then its tables of differences."""
    picture = Picture(
        stem="comparison", title="Frequency response and stability region",
        alt=f"{found.verdict.replace(chr(10), '; ')}.",
        caption=prose("compared_picture", found=found), figure=comparison.figure(found),
    )  # fmt: skip
    quantities_of = quantities(type(found)).items()
    rows = ((of, getattr(found, name)) for name, of in quantities_of if of.label and name != "is_sampled")
    tables = [
        table(each, stem=f"compare-{of.key}", title=upper(of.label), caption=prose("compared", key=of.key))
        for of, each in rows if each
    ]  # fmt: skip
    return PageSection(anchor="compared", title="Compared", words=[prose("comparison", found=found)],
                       blocks=[tables[0], picture, *tables[1:]])  # fmt: skip
