"""What the commands print for a person, and tables written to files."""

from __future__ import annotations

import csv
import io
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.console import Console

from tfarm.arm import Arm
from tfarm.cli.layout import new_table as new_table
from tfarm.cli.layout import show as show
from tfarm.files import is_standard_output, write_file


def print_presets(arms: list[Arm]) -> None:
    """A line an arm, with its assumptions."""
    console = Console()
    for arm in arms:
        console.print(f"[bold]{arm.name}[/bold]", highlight=False)
        for text in arm.assumptions:
            console.print(f"  - {text}", highlight=False, markup=False)


def print_modes(answer: dict[str, Any]) -> None:
    """The modal table; with damping, each eigenvalue beside its undamped frequency."""
    is_damped = "box" in answer
    damped = ("eigenvalue [1/s]", "damping ratio") if is_damped else ()
    last = ("hub participation b", "modal moment [N m]", *(() if is_damped else ("nodes [m]",)))
    table = new_table(("mode", "rad/s", "Hz", *damped, *last), fold=("nodes [m]",))
    for mode in answer["modes"]:
        frequency = mode["natural_frequency_rad_s"]
        table.add_row(
            str(mode["index"]),
            frequency if isinstance(frequency, str) else f"{frequency:.12g}",
            f"{mode['natural_frequency_hz']:.9g}",
            *(_damping(mode) if is_damped else ()),
            f"{mode['hub_participation']:.6g}",
            f"{mode['modal_moment']:.6g}",
            *(() if is_damped else (" ".join(f"{x:.4f}" for x in mode["nodes_m"]) or "-",)),
        )
    show(table)
    if "proof" in answer:
        proof = answer["proof"]
        print(f"proven: each frequency enclosed, and {proof['count']} in all below {proof['below_rad_s']} rad/s")
    if is_damped:
        left, right, low, high = answer["box"]
        proven = "proven" if "proven_complete_in_box" in answer else "by winding number"
        print(f"{answer['eigenvalues_in_box']} eigenvalues with Re s from {left:.6g} to {right:.6g} 1/s and")
        print(f"Im s from {low:.6g} to {high:.6g} rad/s, all listed ({proven}). Beyond the box there are more:")
        print("shear is undamped, so lightly damped modes exist above any box; real ones accumulate at -1/C.")
        if "damped_note" in answer:
            print(answer["damped_note"])
    print(f"{answer['arm']}: the first {answer['count']} flexible modes, none missing ({answer['theory']} theory)")


def _damping(mode: dict[str, Any]) -> tuple[str, str]:
    if "damping_ratio" not in mode:
        return "not followed", "-"
    if "eigenvalues" in mode:
        pair = " and ".join(f"{value:.8g}" for value in mode["eigenvalues"])
        return pair, f"{mode['damping_ratio']:.6g} (overdamped)"
    re, im = mode["eigenvalue"]
    return f"{held(re, HELD * math.hypot(re, im), 8)} + {im:.10g}i", held(mode["damping_ratio"], HELD, 6)


HELD = 2e-14  # of an eigenvalue's size: what its float64 may be off (tests: 1e-14 to 50 digits, 64 eps in closed form)


def held(value: float, error: float, most: int) -> str:
    """A number in the digits that an absolute error leaves, at most so many; where it leaves none, 0 and the error."""
    if value == 0:
        return "0"
    digits = math.floor(math.log10(abs(value) / error))
    return f"{value:.{min(digits, most)}g}" if digits > 0 else f"0 (+-{error:.0e})"


def print_response(answer: dict[str, Any]) -> None:
    """The values, one row a point."""
    table = new_table(("Re s [1/s]", "Im s [1/s]", f"Re {answer['output']} [{_unit(answer)}]", "Im"))
    for point, value in zip(answer["s"], answer["value"], strict=True):
        table.add_row(*(f"{part:.12g}" for part in point), *(_text(part) for part in value))
    show(table)


def print_audit(answer: dict[str, Any]) -> None:
    """A row an equation: the verdict, and what it was and should be where the paper is corrected."""
    print(answer["paper"])
    residuals = ("residual as printed", "as corrected")
    table = new_table(("equation", "verdict", *residuals), fold=("equation", *residuals))
    for row in answer["rows"]:
        table.add_row(row["equation"], row["verdict"], row["residual_printed"], row["residual_corrected"])
    show(table)


def print_assumptions(answer: dict[str, Any]) -> None:
    """A table over the candidate sections and one over the hub inertias; a star marks the arm's own."""
    section, hub = answer["section"], answer["hub"]
    print(f"Rectangles of the arm's area, {section['area_m2']:g} m^2, shear factor {section['shear_factor']:.6g}:")
    _print_candidates(section, ("depth_m", "width_m", "second_moment_m4"), ("depth [m]", "width [m]", "I [m^4]"), "I")
    if hub is None:
        print("\nHub inertia: none to choose, the hub is locked or a free pin.")
    else:
        print("\nHub inertias:")
        _print_candidates(hub, ("hub_inertia_kg_m2",), ("I_h [kg m^2]",), "I_h")
        print("limits: I_h = 0 gives " + ", ".join(f"{x:.8g}" for x in hub["pinned_rad_s"]), end=" rad/s; ")
        print("I_h = inf gives " + ", ".join(f"{x:.8g}" for x in hub["locked_rad_s"]) + " rad/s")
    print(
        f"\n* is {answer['arm']} itself. Frequencies of the undamped arm, exact; behind each, per cent of frequency for"
    )
    print(f"one per cent more of I (with {section['held']})")
    print("or of I_h (with all else held).")
    gains = answer["gains"]
    print(f"loop: the verdict at K1 = {gains['K1']:g}, K2 = {gains['K2']:g}, and up to which K2 it stays stable.")


def _print_candidates(study: dict[str, Any], keys: tuple[str, ...], titles: tuple[str, ...], parameter: str) -> None:
    count = len(study["candidates"][0]["sensitivity"])
    modes = (title for i in range(1, count + 1) for title in (f"w{i} [rad/s]", f"%/% {parameter}"))
    table = new_table(("", *titles, *modes, "loop", "K2 below"), keys=2)
    for row in study["candidates"]:
        pairs = zip(row["natural_frequency_rad_s"], row["sensitivity"], strict=True)
        numbers = (text for w, slope in pairs for text in (f"{w:.8g}", f"{slope:.4f}"))
        edge = "-" if row["K2_below"] is None else f"{row['K2_below']:.6g}"
        values = (f"{row[key]:.4g}" for key in keys)
        table.add_row("*" if row["is_own"] else "", *values, *numbers, row["verdict"], edge)
    show(table)


def print_validation(answer: dict[str, Any]) -> None:
    """A table a source: their number, ours, the relative difference; below it why a row differs beyond its digits."""
    citations = {source["key"]: source for source in answer["sources"]}
    for key, rows in groupby(answer["rows"], key=lambda row: row["source"]):
        print(f"{citations[key]['citation']}\n({citations[key]['reached']})")
        _print_printed_and_exact(list(rows))
        print()
    print(f"{answer['agree']} agree to the last printed digit, {answer['explained']} differ for the reason given")


def _print_printed_and_exact(rows: list[dict[str, Any]]) -> None:
    reasons = list(dict.fromkeys(row["why"] for row in rows if row["why"]))
    titles = ("case", "quantity", "mode", "printed", "exact", "difference", "")
    table = new_table(titles, fold=("case", "quantity"))
    for row in rows:
        mark = "" if row["agrees"] else f"[{reasons.index(row['why']) + 1}]"
        cells = (row["case"], row["quantity"], row["mode"], row["printed"], f"{row['ours']:.10g}")
        table.add_row(*cells, f"{row['difference']:+.1e}", mark)
    show(table)
    for number, reason in enumerate(reasons, start=1):
        print(f"[{number}] {reason}")


def write_csv(answer: dict[str, Any], path: Path) -> None:
    """The response as a table in a file, written beside and then renamed."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    unit = _unit(answer)
    writer.writerow(["re_s [1/s]", "im_s [1/s]", f"re_{answer['output']} [{unit}]", f"im_{answer['output']} [{unit}]"])
    for point, value in zip(answer["s"], answer["value"], strict=True):
        writer.writerow([*point, *value])
    write_file(path, text.getvalue().encode(), key="--csv")


def print_found(answer: dict[str, Any]) -> None:
    """How many points, and where the response is largest, for those who have the table in a file."""
    sizes = [abs(complex(*map(float, value))) for value in answer["value"]]
    largest = max(range(len(sizes)), key=sizes.__getitem__)
    re, im = answer["s"][largest]
    what = f"largest |{answer['output']} / {answer['input']}| {sizes[largest]:.6g} {_unit(answer)}"
    print(f"{answer['arm']}: {len(sizes)} points, {what} at s = {re:.10g}{im:+.10g}i 1/s")


def say_written(*paths: Path | None) -> bool:
    """Say which files were written; False where one is standard output itself, which holds the table then."""
    given = [path for path in paths if path is not None]
    if any(map(is_standard_output, given)):
        return False
    for path in given:
        print(f"written: {path}")
    return True


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total, text: bar.update(task, completed=done, total=total, description=text)


def _unit(answer: dict[str, Any]) -> str:
    return f"{answer['unit']} / {answer['input_unit']}"


def _text(part: float | str) -> str:
    return part if isinstance(part, str) else f"{part:.12g}"
