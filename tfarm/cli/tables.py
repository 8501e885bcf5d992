"""What the commands print for a person, and tables written to files.

The same number by three roads, beside each other: what `--compare` prints.

A measured response over the exact one: what `tfarm response --measured` prints and writes.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from threading import Event, Thread
from typing import Any

from rich.console import Console

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.cli.app import give, load_arm, tell
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.errors import ParameterError
from tfarm.exact.methods import METHODS_AGREE, Method, known_method
from tfarm.files import is_standard_output
from tfarm.fitting.data import data_of
from tfarm.fitting.overlay import curves_table, overlay, overlay_answer, required_table
from tfarm.tables.files import write_csv
from tfarm.tables.terminal import show

PROGRESS_EVERY = 4.0  # seconds from one line of progress to the next: few lines in a log, and no long silence
MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each
BESIDE_COMPARE = "--compare prints a table of its own: ask for one of them"
MOST_LISTED_ROOTS = 12  # poles, or zeros, in one line of a terminal; --json has them all


def presets_table(arms: list[Arm]) -> Table:
    """Name, size and assumptions of each preset."""
    names = {
        "name": "name",
        "length": "length",
        "damping": "damping",
        "hub_inertia": "hub.inertia",
        "payload_mass": "payload.mass",
        "payload_inertia": "payload.inertia",
        "assumptions": "assumptions",
    }
    return Table(columns=tuple(Column(key, of=of) for key, of in names.items()), record=arms)


def print_presets(answer: dict[str, Any]) -> None:
    """A line an arm, with its assumptions."""
    console = Console()
    for arm in answer["presets"]:
        console.print(f"[bold]{arm['name']}[/bold]", highlight=False)
        for text in arm["assumptions"]:
            console.print(f"  - {text}", highlight=False, markup=False)


def print_modes(answer: dict[str, Any]) -> None:
    """The modal table; with damping, each eigenvalue beside its undamped frequency."""
    show(answer["modes"])
    if "proof" in answer:
        proof = answer["proof"]
        print(f"proven: each frequency enclosed, and {proof['count']} in all below {proof['below_rad_s']} rad/s")
    if "box" in answer:
        left, right, low, high = answer["box"]
        proven = "proven" if "proven_complete_in_box" in answer else "by winding number"
        print(f"{answer['eigenvalues_in_box']} eigenvalues with Re s from {left:.6g} to {right:.6g} 1/s and")
        print(f"Im s from {low:.6g} to {high:.6g} rad/s, all listed ({proven}). Beyond the box there are more:")
        print(f"{answer['box_note'].partition(': ')[2]}.")
        for each in answer.get("circuit_eigenvalues", ()):
            print(f"One more, {each:.8g} 1/s, belongs to no mode: it is the motor's circuit.")
        for each in answer.get("unassigned_eigenvalues", ()):
            re, im = each["eigenvalue"]
            print(f"One more, {re:.8g}{f' +- {im:.8g}i' if im else ''} 1/s, is assigned to no mode: {each['origin']}.")
        if "damped_note" in answer:
            print(answer["damped_note"])
    if answer["hub_locked_note"]:
        print(answer["hub_locked_note"])
    print(f"{answer['arm']}: the first {answer['count']} flexible modes, none missing ({answer['theory']} theory)")


def print_audit(answer: dict[str, Any]) -> None:
    """A row an equation: the verdict, and what it was and should be where the paper is corrected."""
    print(answer["paper"])
    show(answer["rows"])


def print_assumptions(answer: dict[str, Any]) -> None:
    """A table over the candidate sections and one over the hub inertias; a star marks the arm's own."""
    section, hub = answer["section"], answer["hub"]
    print(f"Rectangles of the arm's area, {section['area_m2']:g} m^2, shear factor {section['shear_factor']:.6g}:")
    show(section["candidates"])
    if hub is None:
        print("\nHub inertia: none to choose, the hub is locked or a free pin.")
    else:
        print("\nHub inertias:")
        show(hub["candidates"])
        print("limits: I_h = 0 gives " + ", ".join(f"{x:.8g}" for x in hub["pinned_rad_s"]), end=" rad/s; ")
        print("I_h = inf gives " + ", ".join(f"{x:.8g}" for x in hub["locked_rad_s"]) + " rad/s")
    print(
        f"\n* is {answer['arm']} itself. Frequencies of the undamped arm, exact; behind each, per cent of frequency for"
    )
    print(f"one per cent more of I (with {section['held']})")
    print("or of I_h (with all else held).")
    gains = ", ".join(f"{name} = {value:g}" for name, value in answer["gains"].items())
    print(f"loop: the verdict at {gains}, and up to which {MOMENT_GAIN} it stays stable.")


def print_validation(answer: dict[str, Any]) -> None:
    """A table a source: their number, ours, the relative difference; below it why a row differs beyond its digits."""
    citations, table = {source["key"]: source for source in answer["sources"]}, answer["rows"]
    rows = list(table)
    for key, places in groupby(range(len(rows)), key=lambda i: rows[i]["source"]):
        print(f"{citations[key]['citation']}\n({citations[key]['reached']})")
        part = table.rows(list(places))
        reasons = list(dict.fromkeys(row["why"] for row in part if row["why"]))
        marks = ["" if row["agrees"] else f"[{reasons.index(row['why']) + 1}]" for row in part]
        show(Table(columns=(*part.columns, Column("", of=marks))))
        for number, reason in enumerate(reasons, start=1):
            print(f"[{number}] {reason}")
        print()
    print(f"{answer['agree']} agree to the last printed digit, {answer['explained']} differ for the reason given")


def print_found(answer: dict[str, Any]) -> None:
    """How many points, and where the response is largest, for those who have the table in a file."""
    sizes = [abs(complex(*map(float, value))) for value in answer["value"]]
    largest = max(range(len(sizes)), key=sizes.__getitem__)
    re, im = answer["s"][largest]
    what = f"largest |{answer['output']} / {answer['input']}| {sizes[largest]:.6g}"
    unit = f"{answer['unit']} / {answer['input_unit']}"
    print(f"{answer['arm']}: {len(sizes)} points, {what} {unit} at s = {re:.10g}{im:+.10g}i 1/s")


def hand_out(
    answer: Callable[[], dict[str, Any]],
    printed: Callable[[dict[str, Any]], None],
    json: bool,
    *,
    csv: Path | None = None,
    table: Callable[[], Table] | None = None,
    png: Path | None = None,
    picture: Sequence[object] = (),
    also: Sequence[Path | None] = (),
) -> None:
    """What was found: its table and its picture to the files asked for, then the answer, as JSON or `printed`.

    `picture` is the record that is drawn, with what stands beside it; `also` are files that are written already.
    Nothing is printed where standard output holds one of them.
    """
    if csv is not None and table is not None:
        write_csv(table(), csv)
    if png is not None:
        import tfarm.plots  # noqa: F401  every picture is known once they are loaded
        from tfarm.plots.files import save_png
        from tfarm.plots.style import FIGURES

        save_png(FIGURES[type(picture[0])](*picture), png)
    if say_written(*also, csv, png) or json:
        give(answer(), json, printed)


def say_written(*paths: Path | None) -> bool:
    """Say on standard error which files were written; False where one is standard output, which holds the table."""
    given = [path for path in paths if path is not None]
    if any(map(is_standard_output, given)):
        return False
    for path in given:
        print(f"written: {path}", file=sys.stderr)
    return True


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on a terminal; in a pipe a line every few seconds, of what runs."""
    if sys.stderr.isatty():
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("", total=None)
            yield lambda done, total, text: bar.update(task, completed=done, total=total, description=text)
        return
    state, over = ["starting"], Event()

    def advance(done: int, total: int, text: str) -> None:
        state[0] = f"{done} of {total} done" + f", running: {text}" * bool(text)

    def speak() -> None:
        while not over.wait(PROGRESS_EVERY):
            tell(state[0])

    speaker = Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield advance
    finally:
        over.set()
        speaker.join()


def slow_method(method: str, number: int, digits: int | None, compare: bool) -> Method:
    """The method asked for.  Raises ParameterError for an unknown one, too many points, digits beside a slow one."""
    chosen = known_method(method)
    if chosen == "closed-form" and not compare:
        return chosen
    if digits is not None:
        remedy = "they are proven by balls in any case: leave --method and --compare out"
        raise ParameterError(key="--digits", value=digits, remedy=remedy)
    if number > MOST_SLOW:
        remedy = f"at most {MOST_SLOW} by balls or the appendix, which take milliseconds for each"
        raise ParameterError(key="points", value=number, remedy=remedy)
    return chosen


def refuse_beside(others: dict[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option that another one would leave unheard."""
    for key, value in others.items():
        if value is not None:
            raise ParameterError(key=key, value=value, remedy=remedy)


def print_compared(answer: dict[str, Any]) -> None:
    """A row a point or a mode: the closed form's number, and how far the others are from it, relatively."""
    numbers = answer["methods"]["closed-form"]
    if "index" in answer:
        first = Column("index", "mode", of=answer["index"]), Column("", "rad/s", of=numbers, digits=singly(general, 15))
    else:
        points = [f"{complex(*at):.10g}" for at in answer["s"]]
        pairs = ([part if abs(part) > METHODS_AGREE * math.hypot(*pair) else 0.0 for part in pair] for pair in numbers)
        values = [f"{complex(*pair):.15g}" for pair in pairs]  # no part that is less than the rounding of the other
        first = Column("s", "s", "1/s", of=points), Column("", answer["output"], answer["unit"], of=values)
    apart = [
        Column(name, f"{name} differ{end} by", of=answer["differences"][name], digits=singly("{:.1e}".format))
        for name, end in (("balls", ""), ("appendix", "s"))
        if name in answer["differences"]
    ]
    show(Table(columns=(*first, *apart)))
    largest = answer["largest_difference"]
    if largest <= METHODS_AGREE:
        others = " and proven balls" if answer["left_out"] else ", proven balls and the paper's own determinant"
        print(f"Float64{others} agree to {largest:.1e}, their rounding.")
    else:
        print(f"They part by up to {largest:.1e}: more than rounding ({METHODS_AGREE:.0e}); the balls are proven.")
    for method, why in answer["left_out"].items():
        print(f"No {method} here: {why}.")


def lay_over(arm: str, text: str, others: dict[str, Any], csv: Path | None, png: Path | None, json: bool) -> None:
    """Both curves: mode by mode on the terminal or as JSON, point by point as a table, and as a picture.

    Raises ParameterError for one of the `others`, options that would go unheard.
    """
    refuse_beside(others, "a measured response has its own outputs and frequencies; leave this out")
    found = overlay(load_arm(arm), data_of(text, "--measured"))
    hand_out(
        lambda: overlay_answer(found), _print, json,
        csv=csv, table=lambda: curves_table(found), png=png, picture=(found,),
    )  # fmt: skip


def _print(answer: dict[str, Any]) -> None:
    low, high = answer["band_hz"]
    span = f"{answer['points']} points from {low:.6g} to {high:.6g} Hz"
    print(f"{answer['arm']}: {answer['output']} over {answer['input']} [{answer['unit']}], {span}")
    if len(answer["modes"]):
        show(answer["modes"])
    else:
        print("no resonance of the arm lies in the band")
    for peak in answer["unmatched_peaks_hz"]:
        print(f"measured peak at {peak:.6g} Hz: none of the arm's is near")
    if (table := required_table(answer)) is not None:
        print("what the arm's numbers would have to be, each alone and for each mode (to first order in logarithms):")
        show(table)
    for what in ("poles", "zeros"):
        print(f"{what} up to {answer['roots_up_to_rad_s']:.6g} rad/s [1/s]: {_listed(answer[what])}")
    if answer["common"]:
        print(f"common to both signals, and in neither: {_listed(answer['common'])}")
    print(f"noise by {answer['noise']}; rms of ln |measured/exact| {answer['rms_log_error']:.4g}")


def _listed(roots: list[list[float]]) -> str:
    """Those in the upper half-plane, the first of them."""
    texts = [f"{re:.6g}{im:+.6g}i" if im else f"{re:.6g}" for re, im in roots[:MOST_LISTED_ROOTS]]
    rest = f" and {len(roots) - MOST_LISTED_ROOTS} more" if len(roots) > MOST_LISTED_ROOTS else ""
    return ", ".join(texts) + rest if texts else "none"
