"""From arms to a folder of pages: everything is made in a temporary folder, and moved into place when complete.

The sections of an arm's page in their order, its page by templates, the index, and the page of a comparison.
"""

import hashlib
import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup

from tfarm.arm import PLANE, Arm
from tfarm.case import Comparison
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, TfarmError, must_be_known, require
from tfarm.files import temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.plots.frequency import draw_card
from tfarm.plots.regions import comparison
from tfarm.plots.style import save_figure
from tfarm.processes import shared
from tfarm.report.arm_section import arm_section, assumptions_section, headline_numbers
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live, save_live, write_assets
from tfarm.report.loop_section import (
    law_section,
    locus_section,
    map_section,
    margins_section,
    no_loop_section,
    nyquist_section,
)
from tfarm.report.page import (
    PICTURES,
    Case,
    Controller,
    Fact,
    GivenLaw,
    PageSection,
    brief_on,
    check_laws,
    command_of,
    file_of,
    has_loop,
    keep,
    kept,
    kept_in,
    margins_of,
    picture,
    prose,
    render,
    save_section,
    sheet,
    sign_words,
    upper,
    write_text,
)
from tfarm.report.response_sections import bode_section, fit_section, measured_section, modes_section
from tfarm.report.sampled_section import sampled_section
from tfarm.report.trust import TRUST_FOLDER, gather, save_proof, write_trust, written_proofs
from tfarm.report.tuner_section import tuner_section
from tfarm.response.frequency import bode
from tfarm.schema import quantities, table
from tfarm.schema.glossary import GLOSSARY_TERMS
from tfarm.schema.html import with_symbols
from tfarm.stopping import undone_if_stopped

ReportProgress = Callable[[int, int, str], object]
Notice = Callable[[str], object]
Calls = Mapping[str, Sequence[Callable[[], Any]]]  # by task: what one process does in turn
MOST_WORKERS = 2  # processes that share the pieces of a report: as many cores as a small machine has
WORTH_A_PROCESS = 8  # pieces for which a second process, which takes a second or two to start, is worth it
EVIDENCE, SCRIPTS = "why trust this", "scripts of the live pages"  # tasks of no arm
LOOP_TASK, SAMPLED_TASK = "continuous loop", "sampled loop"  # each of sections that share a design or damped modes
LONGEST = (SAMPLED_TASK, LOOP_TASK, EVIDENCE)  # tasks of five seconds and more, which are begun first
TRUST_PAGE, COMPARISON_PAGE = f"{TRUST_FOLDER}/index.html", "compare.html"
RESERVED_NAMES = {  # of folders that no arm may have
    "index.html", "readme.md", "pictures", "bench.json", TRUST_FOLDER, "data", COMPARISON_PAGE, "compare.json", ASSETS,
}  # fmt: skip
BADGES = {"stable": "ok", "yes": "ok", "unstable": "corrected", "no": "corrected", "marginal": "undecided",
            "undecided": "undecided"}  # fmt: skip
PROMISES = (
    "certified", "complete", "converged", "default gains", "enclosed", "Lyapunov region", "not determined", "proven",
    "small gain", "winding number",
)  # fmt: skip


# ------------------------------------------------------------ the sections of a page


@dataclass(frozen=True, slots=True)
class Piece:
    """One section of one arm's page: a name for the progress bar, the section's anchor, and how to make it of a case.

    A page that it does not suit has no such section.  The page that `report --only` asks for is called by the first
    word of its sections' anchors; its `title` is that of one of them, and `is_also_on` picks the other pages of that
    kind that have the section.  The full page has all, and at its top the answers of those that have one.
    Sections of one `task` are made one after the other in one process.
    """

    name: str
    anchor: str
    make: Callable[[Case], PageSection]
    suits: Callable[[Case], Any] = lambda case: True
    title: str = ""
    is_also_on: Callable[[str], bool] = lambda page: False
    task: str = ""

    @property
    def page(self) -> str:
        """The page that has it when it is asked for alone."""
        return self.anchor.partition("-")[0]

    def is_on(self, page: str | None) -> bool:
        """Whether the page has the section: that one asked for alone, or the full one."""
        return not page or page == self.page or self.is_also_on(page)


LOOP_PAGES = ("margins", "locus", "sampled", "tune")  # on which an arm without a loop has nothing but that it has none
OF_LAWS = (*LOOP_PAGES, "law", "no")  # first words of the sections that a page about laws begins with


def _in_s(case: Case) -> bool:
    """Whether a controller of the case acts in continuous time."""
    return not case.arm.is_locked and any(not each.law.is_discrete for each in case.controllers)


def _of_gains(case: Case) -> bool:
    """Whether the page is about both gains of the arm itself."""
    return not case.laws and has_loop(case.arm)


PIECES = (
    Piece("fit to measurements", "fit", fit_section, lambda case: case.fit),
    Piece("stability region of both gains", "margins-map", map_section, _of_gains, task=LOOP_TASK),
    Piece("the arm", "arm", arm_section, is_also_on=lambda page: True),
    Piece("response of the root moment", "bode-root-moment", partial(bode_section, output="root_moment"),
          title="Bode plots"),
    Piece("response of the tip", "bode-tip-displacement", partial(bode_section, output="tip_displacement")),
    Piece("measured responses", "bode-measured", measured_section, lambda case: case.measured),
    Piece("modes", "modes", modes_section, title="Modes"),
    Piece("the loop", "no-loop", no_loop_section, lambda case: not case.has_loop, is_also_on=LOOP_PAGES.__contains__),
    Piece("stability margins", "margins", margins_section, _in_s, "Gains and margins", task=LOOP_TASK),
    Piece("root loci", "locus", locus_section, _in_s, "Root loci", task=LOOP_TASK),
    Piece("Nyquist plot", "margins-nyquist", nyquist_section, _in_s, task=LOOP_TASK),
    Piece("sampled loop", "sampled", sampled_section, lambda case: case.has_loop, "The sampled loop",
          task=SAMPLED_TASK),
    Piece("controllers", "law", law_section, lambda case: case.laws and not case.arm.is_locked,
           is_also_on=LOOP_PAGES.__contains__),
    Piece("gain tuner", "tune", tuner_section, _of_gains, "The gain tuner", task=SAMPLED_TASK),
    Piece("assumptions", "assumptions", assumptions_section, title="What the assumptions do"),
)  # fmt: skip
QUESTIONS = {piece.page: piece.title for piece in PIECES if piece.title}  # pages that may be asked for alone
PAGES = {"index": "full report", "live": "live loop", **QUESTIONS}


def pieces_of(case: Case) -> list[Piece]:
    """The sections of a page, in their order; a page about laws begins with its loops."""
    suited = [piece for piece in PIECES if piece.suits(case)]
    return sorted(suited, key=lambda piece: bool(case.laws) and piece.page not in OF_LAWS)


def make_section(name: str, anchor: str, make: Callable[[Case], PageSection], case: Case, folder: Path) -> PageSection:
    """A section saved in the arm's folder, or in its place why tfarm could not make it; a bug of ours stays loud."""
    try:
        section = replace(make(case), anchor=anchor)
    except TfarmError as error:
        answer = f"This section could not be made for this arm: {error}."
        section = PageSection(anchor=anchor, title=upper(name), answer=answer, failure=str(error))
    return save_section(section, folder, case.is_paper)


# ------------------------------------------------------------ a report


def write(
    arms: Sequence[Arm],
    out: Path,
    *,
    chains: Sequence[Chain] | None = None,
    laws: Sequence[Sequence[GivenLaw]] | None = None,
    fits: Sequence[Fit | None] | None = None,
    measured: Sequence[Measured] = (),
    only: tuple[str, ...] | None = None,
    paper: bool = False,
    progress: ReportProgress | None = None,
    notice: Notice | None = None,
) -> Path:
    """Write the report of each arm to out/<name>/, out/trust/ and out/index.html; the page to open first.

    `chains` are the arms' own sampling, converters, actuators and slews; ideal ones at 10 ms if not given.  `laws` are
    those that each arm's page is about; where there is none it is about the default gains.  `fits` are where the arms'
    numbers are from, if they were fitted to measurements: their pages begin with these.  Responses that were `measured`
    are laid over those of every arm.
    `only` ("bode", "modes", "margins", ...) writes those pages alone, out/<name>/bode.html and so on.  With `paper`
    each picture of a section is a PDF at the width of a paper's column too, pictures/*.pdf.  `progress` gets
    (done, total, what runs) whenever a piece of work begins, and at the end.  A section that tfarm cannot make of an
    arm has the reason in its place, and `notice` gets the same in one line at the end.  Raises ParameterError before
    any work if `out` cannot be written, two arms share a name or there is none, or an arm or its chain does not suit a
    law; ConvergenceError if a process dies.  If the work itself fails, `out` is as it was.
    """
    out, n, names, only = Path(out), len(arms), [arm.name for arm in arms], only or ()
    _check(names, only)
    each = zip(arms, chains or [Chain()] * n, laws or [()] * n, fits or [None] * n, strict=True)
    cases = [Case(arm, chain, tuple(own), fit, tuple(measured), paper) for arm, chain, own, fit in each]
    for case in cases:
        check_laws(case)
    with _temporary(out, "out", names + [TRUST_FOLDER, ASSETS] * (not only)) as place:
        sections = _written(cases, out, place, only, progress)
    for name, section in sections:
        if section.failure and notice is not None:
            notice(f"{name}: the page leaves out “{section.title}”: {section.failure}")
    return out / (f"{names[0]}/{only[0]}.html" if n == len(only) == 1 else "index.html")


def _check(names: Sequence[str], only: tuple[str, ...]) -> None:
    """Raise ParameterError for a page that there is none of, and where an arm would have no folder of its own."""
    require(bool(names), "arms", (), "name at least one arm to report on")
    for question in only:
        must_be_known("only", question, QUESTIONS)
    taken = dict.fromkeys(RESERVED_NAMES, "the folder of reports has a file of this name; give the arm another name")
    for name in names:
        require(name.casefold() not in taken, "name", name, taken.get(name.casefold(), ""))
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


def _written(
    cases: Sequence[Case], out: Path, place: Path, only: tuple[str, ...], progress: ReportProgress | None
) -> list[tuple[str, PageSection]]:
    """Make all pages in `place` and move them to `out`, the index last; every section with the name of its arm."""
    tasks: dict[str, Sequence[Callable[[], Any]]] = {} if only else {EVIDENCE: [gather]}
    if not only and any(map(is_live, cases)):
        tasks[SCRIPTS] = [partial(write_assets, place / ASSETS)]
    own = [tasks_of(case, place / case.arm.name, only) for case in cases]
    for each in own:
        tasks |= each
    done = make_all(tasks, progress)
    trust = TRUST_PAGE if not only or (out / TRUST_PAGE).is_file() else ""
    sections = []
    for case, each in zip(cases, own, strict=True):
        made = [section for task in each for section in done[task] if section is not None]
        _write_pages(case, place / case.arm.name, made, only, trust, out / case.arm.name)
        sections += [(case.arm.name, section) for section in made]
    move_into(place, out)
    if not only:
        audited, printed = done[EVIDENCE][0]
        write_trust(audited, printed, written_proofs(out), place / TRUST_FOLDER)
    write_text(place / "index.html", index_page(out, trust=trust))
    move_into(place, out)
    return sections


def tasks_of(case: Case, folder: Path, only: tuple[str, ...]) -> Calls:
    """What is to be made of one arm: its sections, its card and proof, and of a full report its live page.

    Card, proof and live page are made by the process of the section that has computed most of them: the card has the
    verdicts, the proof certifies the modes that are listed, the live page has the regions of the map.
    """
    folder.mkdir()
    tasks: dict[str, list[Callable[[], Any]]] = defaultdict(list)
    for piece in pieces_of(case):
        if any(map(piece.is_on, only or ("",))):
            make = partial(make_section, piece.name, piece.anchor, piece.make, case, folder)
            tasks[piece.task or piece.name].append(make)
    tasks[LOOP_TASK if LOOP_TASK in tasks else "card"].append(partial(save_card, case, folder))
    if not (only and case.laws):
        tasks["modes"].append(partial(save_proof, case.arm, folder, case.chain))
    if not only and is_live(case):
        tasks[LOOP_TASK].append(partial(save_live, case, folder))
    return {f"{case.arm.name}: {task}": calls for task, calls in tasks.items()}


def make_all(tasks: Calls, progress: ReportProgress | None) -> dict[str, Sequence[Any]]:
    """The results of all calls, by task."""
    longest = sorted(tasks, key=lambda task: not task.endswith(LONGEST))
    done: dict[str, Sequence[Any]] = {}

    def begun(running: Sequence[str]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(running))

    count = MOST_WORKERS if len(tasks) >= WORTH_A_PROCESS else 1
    for task, results in shared({task: partial(_in_turn, tasks[task]) for task in longest}, count, begun):
        done[task] = results  # noqa: PERF403  `begun` counts them meanwhile
    begun(["pages"])
    return done


def _in_turn(calls: Sequence[Callable[[], Any]]) -> list[Any]:
    return [call() for call in calls]


def move_into(made: Path, folder: Path) -> None:
    """Every file replaced in one step each, pages last, so that a page never names a file that is not there."""
    files = [file.relative_to(made) for file in made.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file.as_posix())):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        os.replace(made / file, folder / file)


# ------------------------------------------------------------ an arm's page


def _write_pages(
    case: Case, folder: Path, made: Sequence[PageSection], only: Sequence[str], trust: str, earlier: Path
) -> None:
    """The arm's file, with the chain that the page is about, and its page, or the page of each question asked.

    These lead to each other, to what is in the `earlier` folder of the arm, and to the page on `trust`, if any.
    """
    arm, file, compared = case.arm, file_of(case), kept_comparison(earlier.parent)
    write_text(folder / "arm.toml", file)
    pages = [page for page in pages_in(earlier, only or ("index",)) if page[0] != LIVE_PAGE]
    pages += [(f"../{COMPARISON_PAGE}", compared.title)] if arm.name in compared.arms else []
    by_anchor = {section.anchor: section for section in made}
    for question in only or ("",):
        name = f"{question or 'index'}.html"
        anchors = [piece.anchor for piece in pieces_of(case) if piece.is_on(question)]
        page = render(
            "arm.html",
            title=f"{arm.name}: {QUESTIONS[question]}" if question else arm.name,
            sections=[by_anchor[anchor] for anchor in anchors if anchor in by_anchor],
            looks=BADGES,
            open_pictures=2,  # of a section: those that answer its question; the rest is a click away
            only=question,
            others=[page for page in pages if page[0] != name],
            signs="" if arm.is_locked else sign_words(arm),
            glossary=[term for term in GLOSSARY_TERMS if term.name in PROMISES],
            trust=f"../{trust}" if trust else "",
            live=(folder / LIVE_PAGE).is_file(),
            summary=summary(case),
            sha256=hashlib.sha256(file.encode()).hexdigest(),
            command=command_of(case, question),
            has_proof=not (case.laws and question),
            explained=explained,
            word_id=word_id,
        )
        write_text(folder / name, page)


def explained(text: str) -> Markup:
    """A sentence as a page shows it; a word that promises something leads to its meaning at its first place."""
    shown = str(with_symbols(text))
    for word in PROMISES:
        linked = rf'<a class="term" href="#{word_id(word)}">\g<0></a>'
        shown = re.sub(rf"\b{word}\b", linked, shown, count=1, flags=re.IGNORECASE)
    return Markup(shown)


def word_id(name: str) -> str:
    """The anchor of a word of the glossary on a page."""
    return f"word-{name.lower().replace(' ', '-')}"


def pages_in(folder: Path, written: Sequence[str] = ()) -> list[tuple[str, str]]:
    """(file, title) of the pages in an arm's folder, and of those that are being written."""
    there = {name: title for name, title in PAGES.items() if name in written or (folder / f"{name}.html").is_file()}
    return [(f"{name}.html", title) for name, title in there.items()]


def summary(case: Case) -> str:
    """The arm in one sentence, and the laws that its page is about in another."""
    return prose("summary", arm=case.arm, laws=[each.name for each in case.laws])


# ------------------------------------------------------------ the index


@dataclass(frozen=True)
class Card:
    """An arm as the index shows it; `picture` is empty where there is none."""

    name: str
    summary: str
    facts: list[Fact]
    picture: str
    loops: list[dict[str, str]]


def save_card(case: Case, folder: Path) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    (folder / PICTURES).mkdir(exist_ok=True)
    arm, picture = case.arm, ""
    with suppress(TfarmError):
        save_figure(draw_card.figure(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
        picture = "card.svg"
    loops = [loop_cells(each, case.chain) for each in case.controllers if case.laws or has_loop(arm)]
    facts = list(headline_numbers(arm)[:4])
    keep(folder, "card", asdict(Card(arm.name, summary(case), facts, picture, loops)))


def loop_cells(each: Controller, chain: Chain) -> dict[str, str]:
    """A controller in cells of the table of arms; a verdict that cannot be had is left out."""
    cells = {"law": each.given.name}
    with suppress(TfarmError):
        if not each.law.is_discrete:
            found = margins_of(each.arm, each.law)
            cells["verdict"] = found.stability.verdict
            for row in found.stability_intervals:
                if row.name in PLANE:
                    cells[row.name] = f"{row.interval.as_text(5)} {row.unit}".rstrip() if row.interval else "none"
    with suppress(TfarmError):
        cells["sampled"] = brief_on(each.arm, each.law, chain).short
    return cells


def index_page(out: Path, *, trust: str) -> str:
    """The page that leads to all others in a folder of reports."""
    cards = [(card, pages) for folder, card in kept(out, "card", Card).items() if (pages := pages_in(folder))]
    compared = kept_comparison(out).title
    return render("index.html", title="tfarm reports", cards=cards, trust=trust, compared=compared, looks=BADGES)


# ------------------------------------------------------------ a comparison


@dataclass(frozen=True)
class KeptComparison:
    """The title of the comparison in a folder of reports, and the arms that it compares."""

    title: str = ""
    arms: tuple[str, ...] = ()


def kept_comparison(out: Path) -> KeptComparison:
    """The comparison in a folder of reports; an empty one where there is none."""
    found = kept_in(out, "compare", KeptComparison) if (out / COMPARISON_PAGE).is_file() else None
    return found or KeptComparison()


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
        write_text(made / COMPARISON_PAGE, render(COMPARISON_PAGE, title=title, saved=saved, pages=pages))
        keep(made, "compare", {"title": title, "arms": arms})
        move_into(made, out)
        if (out / "index.html").is_file():
            write_text(made / "index.html", index_page(out, trust=TRUST_PAGE if (out / TRUST_PAGE).is_file() else ""))
            move_into(made, out)
    return out / COMPARISON_PAGE


def _comparison_section(found: Comparison) -> PageSection:
    """The verdicts and the picture of a comparison, then its tables of differences."""
    drawn = picture("comparison_picture", comparison.figure(found), stem="comparison", found=found)
    rows = (
        (of, getattr(found, name)) for name, of in quantities(Comparison).items() if of.label and name != "is_sampled"
    )
    first, *tables = (sheet("compared", table(each), stem=f"compare-{of.key}", of=of) for of, each in rows)
    return PageSection(words=[prose("comparison", found=found)], blocks=[first, drawn, *tables])
