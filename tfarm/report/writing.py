"""From records to a folder of pages: everything is made in a temporary folder, and moved into place when complete.

The pages of an arm by templates, the index, and the page of a comparison.
"""

import hashlib
import shutil
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Any

from tfarm.arm import Arm
from tfarm.assessment import Comparison
from tfarm.dsp import Chain
from tfarm.dsp.plant import arm_under_chain
from tfarm.errors import must_be_known, require
from tfarm.files import move_into, place_in, temporary_folder
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.plots.regions import comparison
from tfarm.processes import share_tasks
from tfarm.report.arm_file import command_of, file_of
from tfarm.report.blocks import (
    PageSection,
    explain_commands,
    keep,
    kept_in,
    picture_block,
    prose,
    read_records,
    render,
    save_section,
    sheet,
    write_text,
)
from tfarm.report.live import ASSETS, LIVE_PAGE, is_live, save_live, write_assets
from tfarm.report.overview import SHORT, Card, blocks, save_card, summary
from tfarm.report.page import ArmReport, GivenLaw, gather
from tfarm.report.sections import QUESTIONS, Task, make_section, pieces_of
from tfarm.report.trust import TRUST_FOLDER, save_proof, write_trust, written_proofs
from tfarm.schema import quantities, table
from tfarm.stopping import Progress

# by task: what one process does in turn
Calls = Mapping[str, Sequence[Callable[[], Any]]]
# processes that share the pieces of a report: as many cores as a small machine has
MOST_WORKERS = 2
COMPARISON_PAGE = "compare.html"


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
        if report.laws and not report.arm.is_locked:
            for case in report.cases:
                case.check()
    with place_in(out, "out", names + [TRUST_FOLDER, ASSETS] * (not only)) as place:
        sections = _write_all(reports, out, place, only, progress, announce)
    for name, section in sections:
        if section.failure and notice is not None:
            notice(f"{name}: the page leaves out “{section.title}”: {section.failure}")
    if n == len(only) == 1:
        return out / names[0] / f"{only[0]}.html"
    return out / "index.html"


def _check(names: Sequence[str], only: tuple[str, ...]) -> None:
    """Raise ParameterError for a page that there is none of, and where an arm would have no folder of its own."""
    require(bool(names), "arms", (), "name at least one arm to report on")
    for question in only:
        must_be_known("only", question, QUESTIONS)
    files = ["index.html", "readme.md", "bench.json", "compare.json", COMPARISON_PAGE]
    folders = ["pictures", "data", TRUST_FOLDER, ASSETS]
    reserved = "the folder of reports has a file of this name; give the arm another name"
    taken = dict.fromkeys(files + folders, reserved)
    for name in names:
        key = name.casefold()
        require(key not in taken, "name", name, taken.get(key, ""))
        taken[key] = "two arms of this name would share one folder; give one of them another name"


def _write_all(
    reports: Sequence[ArmReport],
    out: Path,
    place: Path,
    only: tuple[str, ...],
    progress: Progress | None,
    announce: Callable[[str], object] | None,
) -> list[tuple[str, PageSection]]:
    """Make all pages in `place` and move them to `out`, the index last; every section with the name of its arm."""
    tasks: dict[str, Sequence[Callable[[], Any]]] = {}
    if not only:
        tasks[Task.EVIDENCE] = [gather]
    own = [tasks_of(report, place / report.arm.name, only, out, announce) for report in reports]
    for each in own:
        tasks |= each
    done = make_all(tasks, progress)
    trust = trust_in(out, is_planned=not only)
    sections = []
    for report, each in zip(reports, own, strict=True):
        made = [section for task in each for section in done[task] if section is not None]
        _write_pages(report, place / report.arm.name, made, only, trust, out / report.arm.name)
        sections += [(report.arm.name, section) for section in made]
    move_into(place, out)
    if not only:
        audited, printed = done[Task.EVIDENCE][0]
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
    """Return what is to be made of one arm: its sections, its card and proof, and of a full report its first pages.

    Card, proof and first pages are made by the process of the section that has computed most of them: the card has the
    verdicts, the proof certifies the modes that are listed, the live page has the regions of the map.
    """
    folder.mkdir()
    tasks: dict[str, list[Callable[[], Any]]] = defaultdict(list)
    if not only:
        tasks[Task.LOOP].append(partial(first_pages, report, folder, out, announce))
    for piece in pieces_of(report):
        if piece.page in only or not (only or piece.is_first):
            tasks[piece.task].append(partial(make_section, piece, report, folder))
    if only:
        with_card = Task.LOOP if Task.LOOP in tasks else "card"
        tasks[with_card].append(partial(save_card, report, folder))
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
        made = [make_section(piece, report, own) for piece in pieces_of(report) if piece.is_first]
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
    """Return the results of all calls, by task."""
    # those of five seconds and more are begun first
    longest = sorted(tasks, key=lambda task: not task.endswith(tuple(Task)))
    done: dict[str, Sequence[Any]] = {}

    def on_start(running: Sequence[str]) -> None:
        if progress is not None:
            progress(len(done), len(tasks), ", ".join(running))

    # a second process takes a second or two to start
    count = MOST_WORKERS if len(tasks) >= 8 else 1
    calls = ((task, partial(_results, tasks[task])) for task in longest)
    for task, results in share_tasks(calls, count, on_start, joins=True):
        done[task] = results  # noqa: PERF403  `on_start` counts them meanwhile
    on_start(["pages"])
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
    """Write the arm's file with its chain, its first page and those of its sections, or `only` some.

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
        title = report.arm.name
        question = ""
        if name in QUESTIONS:
            title += f": {QUESTIONS[name]}"
            question = name
        here = f"{name}.html"
        command = command_of(report, question)
        page = render("arm.html", title=title, sections=own[name], here=here, command=command, **shared)
        write_text(folder / here, page)


def navigation(arm: Arm, own: Sequence[tuple[str, str]], trust: str, folder: Path) -> list[tuple[str, str]]:
    """Return (file, title) of all that a page of an arm leads to."""
    pages = [("../index.html", "All arms"), *own]
    compared = kept_comparison(folder.parent)
    if arm.name in compared["arms"]:
        pages.append((f"../{COMPARISON_PAGE}", compared["title"]))
    for of, end in product(("controller", "tuner", "plant", "loop"), (".h", ".fmu", ".mat", ".py")):
        file = f"export/{of}{end}"
        if (folder / file).is_file():
            pages.append((file, f"Exported: {of}{end}"))
    if trust:
        pages.append((f"../{trust}", "Method and proofs"))
    return pages


def pages_in(*folders: Path, written: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return (file, title) of the pages in the folders of an arm, and of those that are being written."""
    titles = {"index": "Overview", "live": "Live loop", **QUESTIONS}
    there = {*written}
    for folder in folders:
        there |= {file.stem for file in folder.glob("*.html")}
    return [(f"{name}.html", title) for name, title in titles.items() if name in there]


# ------------------------------------------------------------ the index


def trust_in(out: Path, *, is_planned: bool = False) -> str:
    """Return the page on method and proofs in a folder of reports, if there is one or will be."""
    page = f"{TRUST_FOLDER}/index.html"
    return page if is_planned or (out / page).is_file() else ""


def write_index(out: Path, stage: Path) -> None:
    """Write the page that leads to all others in a folder of reports, through a folder next to it."""
    cards = []
    for folder, card in read_records(out, "card", Card).items():
        pages = pages_in(folder)
        if pages:
            cards.append((card, pages))
    compared = kept_comparison(out)["title"]
    page = render(
        "index.html", title="tfarm reports", cards=cards, trust=trust_in(out), compared=compared, short=SHORT
    )
    write_text(stage / "index.html", page)
    move_into(stage, out)


# ------------------------------------------------------------ a comparison


def kept_comparison(out: Path) -> dict[str, Any]:
    """Return the title of the comparison in a folder of reports, and its arms; empty where there is none."""
    found = kept_in(out, "compare", dict[str, Any]) if (out / COMPARISON_PAGE).is_file() else None
    return {"title": "", "arms": (), **(found or {})}


def write_comparison(found: Comparison, out: Path) -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    It leads to the index and to the arms' own pages, as far as they are in the folder.  An index of reports that is
    there leads to it from then on, and pages of its arms that are made later.
    """
    title = f"{found.one.name} and {found.other.name} compared"
    arms = list(dict.fromkeys(side.arm.name for side in found.sides))
    drawn = picture_block("comparison_picture", comparison.figure(found), stem="comparison", found=found)
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
