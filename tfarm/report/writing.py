"""From arms to a folder of pages: everything is made in a temporary folder, and moved into place when complete."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    COMPARISON_PAGE,
    LOOP_TASK,
    QUESTIONS,
    arm_page,
    file_of,
    index_page,
    keep,
    kept_comparison,
    pages_in,
    pieces_of,
    save_card,
)
from tfarm.report.sections import PageSection, picture, prose, render, save_section, sheet, upper
from tfarm.report.trust import TRUST_FOLDER, gather, save_proof, write_trust, written_proofs
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


class Job(NamedTuple):
    """A piece of a report: jobs of one task are done in turn by one process, and the longest tasks are begun first."""

    task: str
    call: Callable[[], Any]
    seconds: float = 0.0


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
    out, n, names = Path(out), len(arms), [arm.name for arm in arms]
    _check(names, only or ())
    each = zip(arms, chains or [Chain()] * n, laws or [()] * n, fits or [None] * n, strict=True)
    cases = [Case(arm, chain, tuple(own), fit, tuple(measured)) for arm, chain, own, fit in each]
    for case in cases:
        check_laws(case)
    with _temporary(out, "out", names + [TRUST_FOLDER, ASSETS] * (not only)) as place:
        sections = _written(cases, out, place, only or (), progress)
    for name, section in ((case.arm.name, section) for case, own in sections for section in own):
        if section.failure and notice is not None:
            notice(f"{name}: the page leaves out “{section.title}”: {section.failure}")
    alone = f"{names[0]}/{only[0]}.html" if n == 1 and only and len(only) == 1 else "index.html"
    return out / alone


def _check(names: Sequence[str], only: tuple[str, ...]) -> None:
    """Raise ParameterError for a page that there is none of, and where an arm would have no folder of its own."""
    if not names:
        raise ParameterError(key="arms", value=(), remedy="name at least one arm to report on")
    for question in only:
        must_be_known("only", question, QUESTIONS)
    taken = dict.fromkeys(RESERVED_NAMES, "the folder of reports has a file of this name; give the arm another name")
    for name in names:
        if name.casefold() in taken:
            raise ParameterError(key="name", value=name, remedy=taken[name.casefold()])
        taken[name.casefold()] = "two arms of this name would share one folder; give one of them another name"


@contextmanager
def _temporary(out: Path, key: str, names: Sequence[str] = ()) -> Iterator[Path]:
    """A temporary folder in `out`, gone afterwards; what was made for it goes too if the work fails.

    Raises ParameterError, naming `key`, before any work where `out` or a folder of these names in it cannot be written.
    """
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
        raise ParameterError(key=key, value=str(out), remedy=remedy) from None
    finally:
        remove_empty()


# ------------------------------------------------------------ the work


def jobs_of(case: Case, folder: Path, only: tuple[str, ...]) -> Iterator[Job]:
    """The jobs of one arm: its sections, its card and proof, and of a full report its live page.

    Card, proof and live page are made by the process of the section that has computed most of them: the card has the
    verdicts, the proof certifies the modes that are listed, the live page has the regions of the map.
    """
    of = f"{case.arm.name}: "
    pieces = [piece for piece in pieces_of(case) if not only or any(map(piece.is_on, only))]
    for piece in pieces:
        make = partial(make_section, piece.name, piece.anchor, piece.make, case, folder)
        yield Job(of + (piece.task or piece.name), make, piece.seconds)
    has_loop = any(piece.task == LOOP_TASK for piece in pieces)
    yield Job(of + (LOOP_TASK if has_loop else "card"), partial(save_card, case, folder))
    if not (only and case.laws):
        yield Job(f"{of}modes", partial(save_proof, case.arm, folder, case.chain))
    if not only and is_live(case):
        yield Job(of + LOOP_TASK, partial(save_live, case, folder))


def make_section(name: str, anchor: str, make: Callable[[Case], PageSection], case: Case, folder: Path) -> PageSection:
    """A section saved in the arm's folder, or in its place why tfarm could not make it; a bug of ours stays loud."""
    try:
        section = make(case)
    except TfarmError as error:
        answer = f"This section could not be made for this arm: {error}."
        section = PageSection(anchor=anchor, title=upper(name), answer=answer, failure=str(error))
    return save_section(section, folder)


def make_all(jobs: Sequence[Job], progress: ReportProgress | None) -> Mapping[str, Sequence[Any]]:
    """The results of all jobs, by task."""
    own = {name: [job for job in jobs if job.task == name] for name in (job.task for job in jobs)}
    longest = sorted(own, key=lambda name: -sum(job.seconds for job in own[name]))
    tasks = {name: partial(_in_turn, [job.call for job in own[name]]) for name in longest}
    done: dict[str, Sequence[Any]] = {}

    def begun(running: Sequence[str]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(running))

    if len(tasks) < WORTH_A_PROCESS or MOST_WORKERS == 1 or not may_start_processes():
        for name, task in tasks.items():
            begun([name])
            done[name] = task()
    else:
        for name, result in shared(tasks, MOST_WORKERS, begun):
            done[name] = result  # noqa: PERF403  `begun` counts them meanwhile
    begun(["pages"])
    return done


def _in_turn(calls: Sequence[Callable[[], Any]]) -> list[Any]:
    return [call() for call in calls]


def _written(
    cases: Sequence[Case], out: Path, place: Path, only: tuple[str, ...], progress: ReportProgress | None
) -> list[tuple[Case, list[PageSection]]]:
    """Make all pages in `place`, move them to `out`, and the index last; the sections of each case."""
    folders = {case.arm.name: place / str(i) for i, case in enumerate(cases)}
    jobs = [] if only else [Job(EVIDENCE, gather, seconds=8.0)]
    jobs += [Job(SCRIPTS, partial(write_assets, place / ASSETS))] if not only and any(map(is_live, cases)) else []
    for case in cases:
        folders[case.arm.name].mkdir()
        jobs += jobs_of(case, folders[case.arm.name], only)
    done = make_all(jobs, progress)
    trust = TRUST_PAGE if not only or (out / TRUST_PAGE).is_file() else ""
    sections = [(case, _sections_of(case, done)) for case in cases]
    for case, own in sections:
        _write_pages(case, folders[case.arm.name], own, only or None, trust, out / case.arm.name)
    if (place / ASSETS).is_dir():
        move_into(place / ASSETS, out / ASSETS)
    for name, folder in folders.items():
        move_into(folder, out / name)
    if not only:
        audited, printed = done[EVIDENCE][0]
        write_trust(audited, printed, written_proofs(out), place / TRUST_FOLDER)
        move_into(place / TRUST_FOLDER, out / TRUST_FOLDER)
    _write(place / "index.html", index_page(out, trust=trust))
    os.replace(place / "index.html", out / "index.html")
    return sections


def _sections_of(case: Case, done: Mapping[str, Sequence[Any]]) -> list[PageSection]:
    """The sections of a page that were made, in their order."""
    tasks = {f"{case.arm.name}: {piece.task or piece.name}" for piece in pieces_of(case)}
    made = {each.anchor: each for task in tasks & done.keys() for each in done[task] if each is not None}
    return [made[piece.anchor] for piece in pieces_of(case) if piece.anchor in made]


def _write_pages(
    case: Case,
    folder: Path,
    sections: Sequence[PageSection],
    only: tuple[str, ...] | None,
    trust: str,
    earlier: Path,
) -> None:
    """The arm's file, with the chain that the page is about, and its page, or the page of each question asked.

    These lead to each other, and to what is in the `earlier` folder of the arm.
    """
    _write(folder / "arm.toml", file_of(case))
    compared = kept_comparison(earlier.parent)
    for question in only or (None,):
        anchors = {piece.anchor for piece in pieces_of(case) if not question or piece.is_on(question)}
        name = f"{question or 'index'}.html"
        others = [page for page in pages_in(earlier, only or ("index",)) if page[0] not in (name, LIVE_PAGE)]
        others += [(f"../{COMPARISON_PAGE}", compared.title)] if case.arm.name in compared.arms else []
        page = arm_page(
            case,
            [each for each in sections if each.anchor in anchors],
            question,
            trust=f"../{trust}" if trust else "",
            live=(folder / LIVE_PAGE).is_file(),
            others=others,
        )
        _write(folder / name, page)


def _write(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8", newline="")


def move_into(made: Path, folder: Path) -> None:
    """Every file replaced in one step each, pages last, so that a page never names a file that is not there."""
    files = [file for file in made.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file.relative_to(made).as_posix())):
        place = folder / file.relative_to(made)
        place.parent.mkdir(exist_ok=True)
        os.replace(file, place)


# ------------------------------------------------------------ a comparison


def write_comparison(found: Comparison, out: Path) -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    It leads to the index and to the arms' own pages, as far as they are in the folder.  An index of reports that is
    there leads to it from then on, and pages of its arms that are made later.
    """
    title = f"{found.one.name} and {found.other.name} compared"
    arms = list(dict.fromkeys(side.arm.name for side in found.sides))
    with _temporary(out, "--out") as made:
        saved = save_section(_comparison_section(found), made)
        others = [("index.html", "all arms"), *((f"{name}/index.html", name) for name in arms)]
        pages = [(file, name) for file, name in others if (out / file).is_file()]
        _write(made / COMPARISON_PAGE, render(COMPARISON_PAGE, title=title, saved=saved, pages=pages))
        keep(made, "compare", {"title": title, "arms": arms})
        move_into(made, out)
        if (out / "index.html").is_file():
            _write(made / "index.html", index_page(out, trust=TRUST_PAGE if (out / TRUST_PAGE).is_file() else ""))
            move_into(made, out)
    return out / COMPARISON_PAGE


def _comparison_section(found: Comparison) -> PageSection:
    """The verdicts and the picture of a comparison, then its tables of differences."""
    drawn = picture("comparison_picture", comparison.figure(found), stem="comparison", found=found)
    quantities_of = quantities(type(found)).items()
    rows = ((of, getattr(found, name)) for name, of in quantities_of if of.label and name != "is_sampled")
    first, *tables = (sheet("compared", table(each).columns, stem=f"compare-{of.key}", of=of) for of, each in rows)
    words = [prose("comparison", found=found)]
    return PageSection(anchor="compared", title="Compared", words=words, blocks=[first, drawn, *tables])
