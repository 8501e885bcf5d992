"""What the commands print for a person, and tables written to files."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from threading import Event, Thread
from typing import Any

from rich.console import Console

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.cli.app import give, tell
from tfarm.columns import Column, Table
from tfarm.files import is_standard_output
from tfarm.tables.files import write_csv
from tfarm.tables.terminal import show

PROGRESS_EVERY = 4.0  # seconds from one line of progress to the next: few lines in a log, and no long silence


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
        from tfarm.plots.drawn import picture_of
        from tfarm.plots.files import save_png

        save_png(picture_of(*picture), png)
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
