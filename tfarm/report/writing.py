"""From records to a folder of pages: everything is made in a temporary folder, and moved into place when complete.

The sections of an arm's page in their order, its page by templates, the index, the pages of a comparison and a study.
"""

import hashlib
import shutil
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, product
from operator import attrgetter
from pathlib import Path
from typing import Any

from tfarm.arm import Arm
from tfarm.assessment import Comparison
from tfarm.digits import how_many
from tfarm.dsp import Chain
from tfarm.dsp.plant import arm_under_chain
from tfarm.errors import TfarmError, must_be_known, require
from tfarm.exact.outputs import signal_words
from tfarm.files import move_into, place_in, temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.plots import studies
from tfarm.plots.regions import comparison
from tfarm.plots.style import drawn_for
from tfarm.processes import share_tasks
from tfarm.report import loop_section, response_sections
from tfarm.report.blocks import (
    Fact,
    PageSection,
    Picture,
    anchor,
    explain_commands,
    keep,
    kept_in,
    picture,
    prose,
    read_records,
    render,
    save_section,
    sheet,
    upper,
    write_text,
)
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live, save_live, write_assets
from tfarm.report.overview import SHORT, Card, blocks, save_card, summary
from tfarm.report.page import ArmReport, GivenLaw, command_of, file_of, gather, has_loop
from tfarm.report.response_sections import bode_section
from tfarm.report.sampled_section import sampled_section, tuner_section
from tfarm.report.trust import TRUST_FOLDER, save_proof, write_trust, written_proofs
from tfarm.schema import Table, quantities, table
from tfarm.stopping import Progress
from tfarm.studies.study import Study

# by task: what one process does in turn
Calls = Mapping[str, Sequence[Callable[[], Any]]]
# processes that share the pieces of a report: as many cores as a small machine has
MOST_WORKERS = 2
# a task of no arm
EVIDENCE = "method and proofs"
# anchor of the section that the overview begins with
MAP = "margins-map"
# of sections that share a design
LOOP_TASK = "continuous loop"
# of sections that share damped modes
SAMPLED_TASK = "sampled loop"
TRUST_PAGE = f"{TRUST_FOLDER}/index.html"
COMPARISON_PAGE = "compare.html"
# names of folders that no arm may have
RESERVED_NAMES = {
    "index.html",
    "readme.md",
    "pictures",
    "bench.json",
    TRUST_FOLDER,
    "data",
    COMPARISON_PAGE,
    "compare.json",
    ASSETS,
}


# ------------------------------------------------------------ the sections of a page


@dataclass(frozen=True, slots=True)
class SectionSpec:
    """A section of an arm's pages: a name for the progress bar, the section's anchor, and how to make it of a report.

    A report that it does not suit has no such section.  The page that has it is called by the first word of its anchor,
    or `on`; the `title` of the page is that of one of its sections.  The first page shows blocks of some.
    Sections of one `task` are made one after the other in one process.
    """

    name: str
    anchor: str
    make: Callable[[ArmReport], PageSection]
    suits: Callable[[ArmReport], Any] = bool
    title: str = ""
    on: str = ""
    task: str = ""

    @property
    def page(self) -> str:
        """The page that has it."""
        return self.on or self.anchor.partition("-")[0]


def _in_s(report: ArmReport) -> bool:
    """Whether a controller of the report acts in continuous time."""
    return not report.arm.is_locked and any(not each.law.is_discrete for each in report.cases)


def _of_laws(report: ArmReport) -> bool:
    """Whether the page is about given laws of a hub that turns."""
    return bool(report.laws) and not report.arm.is_locked


def _of_gains(report: ArmReport) -> bool:
    """Whether the page is about both gains of the arm itself."""
    return not report.laws and has_loop(report.arm)


PIECES = (
    SectionSpec("stability region of both gains", MAP, loop_section.map_section, _of_gains, task=LOOP_TASK),
    SectionSpec(
        "recommended gains",
        "margins-recommended",
        loop_section.recommended_section,
        _of_gains,
        task=LOOP_TASK,
    ),
    SectionSpec(
        "stability margins",
        "margins",
        loop_section.margins_section,
        _in_s,
        "Gains and margins",
        task=LOOP_TASK,
    ),
    SectionSpec("Nyquist plot", "margins-nyquist", loop_section.nyquist_section, _in_s, task=LOOP_TASK),
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
    SectionSpec("root loci", "locus", loop_section.locus_section, _in_s, "Root loci", task=LOOP_TASK),
    SectionSpec(
        "sampled loop",
        "sampled",
        sampled_section,
        attrgetter("has_loop"),
        "The sampled loop",
        task=SAMPLED_TASK,
    ),
    SectionSpec("controllers", "law", loop_section.law_section, _of_laws, "The controller"),
    SectionSpec("gain tuner", "tune", tuner_section, _of_gains, "The gain tuner", task=SAMPLED_TASK),
    SectionSpec(
        "fit to measurements", "fit", response_sections.fit_section, attrgetter("fit"), "Fitted numbers"
    ),
    SectionSpec("assumptions", "assumptions", response_sections.assumptions_section, title="Assumptions"),
)
# pages that may be asked for alone
QUESTIONS = {piece.page: piece.title for piece in PIECES if piece.title}
PAGES = {"index": "Overview", "live": "Live loop", **QUESTIONS}


def pieces_of(report: ArmReport) -> list[SectionSpec]:
    """The sections of a report, in their order."""
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
    progress: Progress | None = None,
    notice: Callable[[str], object] | None = None,
    announce: Callable[[str], object] | None = None,
) -> Path:
    """Write the report of each arm to out/<name>/, out/trust/ and out/index.html; the page to open first.

    `chains` are the arms' own sampling, converters, actuators and slews; ideal ones at 10 ms if not given.  `laws` are
    those that each arm's page is about; where there is none it is about the default gains.  `fits` are where the arms'
    numbers are from, if they were fitted to measurements: their pages begin with these.  Responses that were `measured`
    are laid over those of every arm.
    `only` ("bode", "modes", "margins", ...) writes those pages alone, out/<name>/bode.html and so on.  With `paper`
    each picture of a section is a PDF at the width of a paper's column too, pictures/*.pdf.  `progress` gets
    (done, total, what runs) whenever a piece of work begins, and at the end.  Overview and live page of an arm are
    written before the other pages, and stay if these fail; `announce`, a function of a module, is called with a line
    that names them, by the process that wrote them.  A section that tfarm cannot make of an arm has the reason in its
    place, and `notice` gets the same in one line at the end.  Raises ParameterError before any work if `out` cannot be
    written, two arms share a name or there is none, or an arm or its chain does not suit a law; ConvergenceError if a
    process dies.  If the work itself fails, the other pages in `out` are as they were.
    """
    out = Path(out)
    n = len(arms)
    names = [arm.name for arm in arms]
    only = only or ()
    _check(names, only)
    each = zip(arms, chains or [Chain()] * n, laws or [()] * n, fits or [None] * n, strict=True)
    reports = [
        ArmReport(*arm_under_chain(arm, chain), tuple(own), fit, tuple(measured), paper)
        for arm, chain, own, fit in each
    ]
    for report in reports:
        for case in report.cases if report.laws and not report.arm.is_locked else ():
            case.check()
    with place_in(out, "out", names + [TRUST_FOLDER, ASSETS] * (not only)) as place:
        sections = _written(reports, out, place, only, progress, announce)
    for name, section in sections:
        if section.failure and notice is not None:
            notice(f"{name}: the page leaves out “{section.title}”: {section.failure}")
    return out / (f"{names[0]}/{only[0]}.html" if n == len(only) == 1 else "index.html")


def _check(names: Sequence[str], only: tuple[str, ...]) -> None:
    """Raise ParameterError for a page that there is none of, and where an arm would have no folder of its own."""
    require(bool(names), "arms", (), "name at least one arm to report on")
    for question in only:
        must_be_known("only", question, QUESTIONS)
    taken = dict.fromkeys(
        RESERVED_NAMES, "the folder of reports has a file of this name; give the arm another name"
    )
    for name in names:
        require(name.casefold() not in taken, "name", name, taken.get(name.casefold(), ""))
        taken[name.casefold()] = "two arms of this name would share one folder; give one of them another name"


def _written(
    reports: Sequence[ArmReport],
    out: Path,
    place: Path,
    only: tuple[str, ...],
    progress: Progress | None,
    announce: Callable[[str], object] | None,
) -> list[tuple[str, PageSection]]:
    """Make all pages in `place` and move them to `out`, the index last; every section with the name of its arm."""
    tasks: dict[str, Sequence[Callable[[], Any]]] = {} if only else {EVIDENCE: [gather]}
    own = [tasks_of(report, place / report.arm.name, only, out, announce) for report in reports]
    for each in own:
        tasks |= each
    done = make_all(tasks, progress)
    trust = TRUST_PAGE if not only else trust_in(out)
    sections = []
    for report, each in zip(reports, own, strict=True):
        made = [section for task in each for section in done[task] if section is not None]
        _write_pages(report, place / report.arm.name, made, only, trust, out / report.arm.name)
        sections += [(report.arm.name, section) for section in made]
    move_into(place, out)
    if not only:
        audited, printed = done[EVIDENCE][0]
        write_trust(audited, printed, written_proofs(out), place / TRUST_FOLDER)
        move_into(place, out)
    write_index(out, place)
    return sections


def tasks_of(
    report: ArmReport,
    folder: Path,
    only: tuple[str, ...],
    out: Path,
    announce: Callable[[str], object] | None,
) -> Calls:
    """What is to be made of one arm: its sections, its card and proof, and of a full report its first pages.

    Card, proof and first pages are made by the process of the section that has computed most of them: the card has the
    verdicts, the proof certifies the modes that are listed, the live page has the regions of the map.
    """
    folder.mkdir()
    tasks: dict[str, list[Callable[[], Any]]] = defaultdict(list)
    if not only:
        tasks[LOOP_TASK].append(partial(first_pages, report, folder, out, announce))
    for piece in pieces_of(report):
        if piece.page in only or (not only and piece.anchor != MAP):
            tasks[piece.task or piece.name].append(partial(make_section, piece, report, folder))
    if only:
        tasks[LOOP_TASK if LOOP_TASK in tasks else "card"].append(partial(save_card, report, folder))
    if not (only and report.laws):
        tasks["modes"].append(partial(save_proof, report, folder))
    return {f"{report.arm.name}: {task}": calls for task, calls in tasks.items()}


def first_pages(
    report: ArmReport, folder: Path, out: Path, announce: Callable[[str], object] | None
) -> PageSection | None:
    """Write map, card, live page and overview of an arm to `out` at once, and to `folder` for its report: the map."""
    name = report.arm.name
    with temporary_folder(folder.parent) as stage:
        own = stage / name
        own.mkdir()
        made = [make_section(piece, report, own) for piece in pieces_of(report) if piece.anchor == MAP]
        save_card(report, own)
        if is_live(report):
            save_live(report, own)
            write_assets(stage / ASSETS)
        _write_pages(report, own, made, ("index",), "", out / name)
        shutil.copytree(stage, folder.parent, dirs_exist_ok=True)
        move_into(stage, out)
        write_index(out, stage)
    if announce is not None:
        pages = [page for page in (out / name / "index.html", out / name / LIVE_PAGE) if page.is_file()]
        announce(f"written first: {' and '.join(map(str, pages))}; the other pages follow")
    return made[0] if made else None


def _results(calls: Sequence[Callable[[], Any]]) -> list[Any]:
    return [call() for call in calls]


def make_all(tasks: Calls, progress: Progress | None) -> dict[str, Sequence[Any]]:
    """The results of all calls, by task."""
    # those of five seconds and more are begun first
    longest = sorted(tasks, key=lambda task: not task.endswith((SAMPLED_TASK, LOOP_TASK, EVIDENCE)))
    done: dict[str, Sequence[Any]] = {}

    def begun(running: Sequence[str]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(running))

    # a second process takes a second or two to start
    count = MOST_WORKERS if len(tasks) >= 8 else 1
    calls = ((task, partial(_results, tasks[task])) for task in longest)
    for task, results in share_tasks(calls, count, begun, joins=True):
        done[task] = results  # noqa: PERF403  `begun` counts them meanwhile
    begun(["pages"])
    return done


# ------------------------------------------------------------ an arm's page


def _write_pages(
    report: ArmReport,
    folder: Path,
    made: Sequence[PageSection],
    only: Sequence[str],
    trust: str,
    earlier: Path,
) -> None:
    """The arm's file with its chain, its first page and those of its sections, or `only` some.

    These lead to each other, to what is in the `earlier` folder of the arm, and to the page on `trust`, if any.
    """
    file = file_of(report)
    by_anchor = {section.anchor: section for section in made}
    own = defaultdict(list)
    write_text(folder / "arm.toml", file)
    for piece in pieces_of(report):
        if piece.anchor in by_anchor:
            own[piece.page].append(by_anchor[piece.anchor])
    written = only or ("index", *own)
    pages = navigation(report.arm, pages_in(earlier, folder, written=written), trust, earlier)
    facts = [by_anchor[name].facts for name in ("margins-map", "sampled") if name in by_anchor]
    shared = {
        "card": kept_in(folder, "card", Card) or Card(report.arm.name, summary(report), "", (), (), ()),
        "short": SHORT,
        "pages": pages,
        "titles": dict(pages),
        "blocks": [*blocks(by_anchor)],
        "short_facts": [*chain.from_iterable(facts)],
        "recommended": by_anchor.get("margins-recommended"),
        "open_pictures": 2,  # of a section: those that answer its question; the rest is a click away
        "has_proof": (folder / "proof.json").is_file(),
        "sha256": hashlib.sha256(file.encode()).hexdigest(),
        "explained": partial(explain_commands, words=f"../{trust}" if trust else ""),
    }
    for name in written:
        title = f"{report.arm.name}: {QUESTIONS[name]}" if name in QUESTIONS else report.arm.name
        command = command_of(report, name if name in QUESTIONS else "")
        page = render(
            "arm.html", title=title, sections=own[name], here=f"{name}.html", command=command, **shared
        )
        write_text(folder / f"{name}.html", page)


def navigation(arm: Arm, own: Sequence[tuple[str, str]], trust: str, folder: Path) -> list[tuple[str, str]]:
    """(file, title) of all that a page of an arm leads to."""
    compared = kept_comparison(folder.parent)
    more = [(f"../{COMPARISON_PAGE}", compared["title"])] if arm.name in compared["arms"] else []
    # folder in that of an arm
    place = "export"
    exported = product(("controller", "tuner", "plant", "loop"), (".h", ".fmu", ".mat", ".py"))
    files = [f"{place}/{of}{end}" for of, end in exported if (folder / place / f"{of}{end}").is_file()]
    more += [(file, f"Exported: {Path(file).name}") for file in files]
    return [
        ("../index.html", "All arms"),
        *own,
        *more,
        *([(f"../{trust}", "Method and proofs")] if trust else []),
    ]


def pages_in(*folders: Path, written: Sequence[str] = ()) -> list[tuple[str, str]]:
    """(file, title) of the pages in the folders of an arm, and of those that are being written."""
    there = {*written, *(file.stem for folder in folders for file in folder.glob("*.html"))}
    return [(f"{name}.html", title) for name, title in PAGES.items() if name in there]


# ------------------------------------------------------------ the index


def trust_in(out: Path) -> str:
    """Return the page on method and proofs in a folder of reports, if there is one."""
    return TRUST_PAGE if (out / TRUST_PAGE).is_file() else ""


def write_index(out: Path, stage: Path) -> None:
    """Write the page that leads to all others in a folder of reports, through a folder next to it."""
    cards = [
        (card, pages)
        for folder, card in read_records(out, "card", Card).items()
        if (pages := pages_in(folder))
    ]
    compared = kept_comparison(out)["title"]
    page = render(
        "index.html", title="tfarm reports", cards=cards, trust=trust_in(out), compared=compared, short=SHORT
    )
    write_text(stage / "index.html", page)
    move_into(stage, out)


# ------------------------------------------------------------ a comparison


def kept_comparison(out: Path) -> dict[str, Any]:
    """The title of the comparison in a folder of reports, and the arms that it compares; empty where there is none."""
    found = kept_in(out, "compare", dict[str, Any]) if (out / COMPARISON_PAGE).is_file() else None
    return {"title": "", "arms": (), **(found or {})}


def write_comparison(found: Comparison, out: Path) -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    It leads to the index and to the arms' own pages, as far as they are in the folder.  An index of reports that is
    there leads to it from then on, and pages of its arms that are made later.
    """
    title = f"{found.one.name} and {found.other.name} compared"
    arms = list(dict.fromkeys(side.arm.name for side in found.sides))
    drawn = picture("comparison_picture", comparison.figure(found), stem="comparison", found=found)
    rows = (
        (of, getattr(found, name))
        for name, of in quantities(Comparison).items()
        if of.label and name != "is_sampled"
    )
    first, *tables = (sheet("compared", table(each), stem=f"compare-{of.key}", of=of) for of, each in rows)
    with place_in(out, "--out") as made:
        section = PageSection(words=[prose("comparison", found=found)], blocks=[first, drawn, *tables])
        saved = save_section(section, made)
        others = {"index.html": "all arms"} | {f"{name}/index.html": name for name in arms}
        pages = [(file, name) for file, name in others.items() if (out / file).is_file()]
        write_text(made / COMPARISON_PAGE, render(COMPARISON_PAGE, title=title, saved=saved, pages=pages))
        keep(made, "compare", {"title": title, "arms": arms})
        move_into(made, out)
        if (out / "index.html").is_file():
            write_index(out, made)
    return out / COMPARISON_PAGE


# ------------------------------------------------------------ a study


def write_study(found: Study) -> Path:
    """Write index.html with its pictures and tables to the folder of a study: the page.

    Raises ParameterError where it cannot be written.
    """
    folder = found.parts.folder
    with place_in(folder, "--out") as made:
        with drawn_for("page"):
            saved = [save_section(each, made) for each in study_sections(found)]
        sections = [each for each in saved if each.words or each.blocks]
        title = f"{found.arm}: study of {how_many(found.rows, 'arm')}"
        page = render("study.html", title=title, sections=sections, explained=explain_commands, found=found)
        write_text(made / "index.html", page)
        move_into(made, folder)
    return folder / "index.html"


def study_sections(found: Study) -> list[PageSection]:
    """Return findings, distributions, drivers, responses, worst arm and failures of a study, as far as it has them."""
    facts = [
        *(
            Fact(each.loop, f"{each.stable:,}", f"of {found.done:,} arms stable", each.finding)
            for each in found.shares
        ),
        Fact("arms computed", f"{found.done:,}", note=f"of {found.rows:,}"),
    ]
    distributions: list[Picture | Table] = []
    drivers: list[Picture | Table] = [sheet("study_sobol", table(found.sobol))]
    if found.spreads:
        distributions.append(picture("study_distributions", studies.study.figure(found), found=found))
        drivers.insert(0, picture("study_scatter", studies.study_scatter.figure(found), found=found))
    responses: list[Picture] = []
    missing: list[str] = []
    for output in ("root_moment", "tip_displacement"):
        try:
            figure = studies.study_band.figure(found, output)
            name = signal_words(output)[0]
            responses.append(
                picture("study_band", figure, stem=f"study-{output.replace('_', '-')}", name=name)
            )
        except TfarmError as error:
            missing.append(f"{output}: {error}.")
    numbers = [
        sheet("study_ranges", table(found.spreads)),
        sheet("study_numbers", found.varied_numbers, found=found),
    ]
    worst = [] if found.worst is None else [prose("study_worst", worst=found.worst)]
    sections = (
        PageSection(title="Findings", facts=facts, words=[prose("study", found=found)], blocks=numbers),
        PageSection(title="Distributions", blocks=distributions),
        PageSection(title="Drivers", blocks=drivers),
        PageSection(title="Responses", words=missing, blocks=responses),
        PageSection(title="Worst arm", words=worst),
        PageSection(title="Arms without a result", blocks=[sheet("study_failures", table(found.failures))]),
    )
    return [replace(each, anchor=anchor("study", each.title)) for each in sections]
