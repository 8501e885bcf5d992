"""What the verbs of the continuous loop print for a person."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

from rich.text import Text

from tfarm.cli.tables import HELD, held, new_table, show
from tfarm.files import write_file


def print_poles(answer: dict[str, Any]) -> None:
    """A row a pole, then the box."""
    rows = new_table(("Re s [1/s]", "Im s [rad/s]", "damping ratio"))
    for re, im in answer["poles"]:
        size = math.hypot(re, im)
        rows.add_row(held(re, HELD * size, 12), f"{im:.12g}", held(-re / size, HELD, 6) if im else "-")
    show(rows)
    left, right, _, top = answer["box"]
    proven = "proven" if "discs" in answer else "by winding number"
    print(f"all poles with {left:.6g} < Re s < {right:.6g} and |Im s| < {top:.6g} ({proven}),")
    print(f"{answer['unstable']} of them unstable")
    if answer["ends_at_shear_cutoff"]:
        print(f"no more lie below the shear cut-off, {answer['shear_cutoff_rad_s']:.6g} rad/s, where the list ends;")
        print("--count goes on above it, into shear, which this model hardly damps")
    print(answer["sign_convention"])


def print_margins(answer: dict[str, Any]) -> None:
    """The verdict, then everything else."""
    print(f"{answer['arm']}: {answer['verdict'].upper()} (apart from the pole at 0 that Kp = 0 leaves)")
    more = " (infinitely many in all)" if answer["unstable_roots_infinite"] else ""
    print(f"unstable poles up to {answer['band_rad_s']:.6g} rad/s: {answer['unstable_roots']}{more}")
    print(answer["beyond_the_band"])
    print(f"Lyapunov: {answer['lyapunov']['reason']}")
    _print_windows(answer)
    if answer["in_band"] is not None:
        _print_loop_margins(answer)
    print(answer["sign_convention"])


def _print_windows(answer: dict[str, Any]) -> None:
    """A row a gain; a search bound is marked, as it is no edge."""
    rows = new_table(("gain", "value", "stable around it", "all stable windows"))
    for name in ("K1", "K2", "Kp"):
        around, ends = answer[f"{name}_interval"], answer[f"{name}_interval_ends"]
        pairs = zip(answer[f"{name}_windows"], answer[f"{name}_windows_ends"], strict=True)
        windows = " ".join(_window(*pair) for pair in pairs) or "none"
        rows.add_row(name, f"{answer[name]:g}", "-" if around is None else _window(around, ends), windows)
    show(rows)
    looked_at = ", ".join(f"{name} ({low:.6g}, {high:.6g})" for name in ("K1", "K2", "Kp")
                          for low, high in [answer[f"{name}_looked_at"]])  # fmt: skip
    print(f"looked at: {looked_at}; * no limit was found up to there, and beyond none was looked for")


def _window(pair: list[float], ends: list[str]) -> str:
    """An interval with a star at each end that only bounds the search."""
    low, high = (f"{value:.8g}{'*' * (end == 'search bound')}" for value, end in zip(pair, ends, strict=True))
    return f"({low}, {high})"


LIMITS = {
    "phase_margin_deg": "phase", "phase_lag_deg": "phase_lag", "phase_lead_deg": "phase_lead",
    "delay_margin_s": "delay", "disk_margin": "disk", "peak_sensitivity": "peak_sensitivity",
}  # fmt: skip
UNITS = {"_deg": " [deg]", "_s": " [s]"}


def _print_loop_margins(answer: dict[str, Any]) -> None:
    band = answer["in_band"]
    rows = new_table(("margin", "exact", f"up to {band['band_rad_s']:.6g} rad/s", "at [rad/s]"))
    rows.add_row("gain (factors)", _pair(answer["gain_margin"]), "", "")
    for key, at in LIMITS.items():
        unit = next((unit for unit in UNITS if key.endswith(unit)), "")
        name = key.removesuffix(unit).replace("_", " ") + UNITS.get(unit, "")
        value = "not known" if answer[key] is None else f"{answer[key]:.6g}"
        exact = "" if at.startswith("phase") and not answer["delay_margin_s"] else value
        where = "-" if math.isinf(band[key]) else f"{band['at_rad_s'][at]:.6g}"
        rows.add_row(Text(name), exact, f"{band[key]:.6g}", where)
    show(rows)
    phase = band["phase_margin_deg"]
    if phase < 0:
        print(f"phase margin {phase:.6g} deg: lead; not an instability")


def _pair(pair: Any) -> str:
    return f"({pair[0]:.8g}, {pair[1]:.8g})"


def print_map(answer: dict[str, Any]) -> None:
    """The shares of the plane, and a coarse picture."""
    counts = answer["unstable_roots"]
    flat = [count for row in counts for count in row]
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} gain pairs are stable")
    step = max(1, len(counts) // 24), max(1, len(counts[0]) // 60)
    for K2, row in list(zip(answer["K2"], counts, strict=True))[:: -step[0]]:
        print(f"{K2:9.3g} " + "".join("." if count == 0 else "#" for count in row[:: step[1]]))
    print(f"K2 up, K1 from {answer['K1'][0]:g} to {answer['K1'][-1]:g} to the right; . stable, # unstable")
    print(answer["sign_convention"])


def print_design(answer: dict[str, Any]) -> None:
    """The gains and what they reach."""
    print(f"{answer['arm']}, objective {answer['objective']}, {answer['modes']} modes in the band: {answer['verdict']}")
    print(f"K1 = {answer['K1']:.6g} N m s/rad, K2 = {answer['K2']:.6g}, Kp = {answer['Kp']:.6g}: {answer['value']:.6g}")
    sampled = answer["sampled"]
    warning = "" if sampled["stable"] else "BUT "
    print(f"{warning}{sampled['in_words']}")
    print(f"within one per cent of it: K1 {_pair(answer['flat_K1'])}, K2 {_pair(answer['flat_K2'])}")
    if answer["at_bound"]:
        ends = [f"{name} = {answer[name]:.6g} of {_pair(answer['bounds'][name])}" for name in answer["at_bound"]]
        print(f"no optimum: {' and '.join(ends)} is where the search was cut off; it may get better beyond")
    print(answer["sign_convention"])


def write_map(answer: dict[str, Any], path: Path) -> None:
    """K1, K2 and the number of unstable poles, one row a point."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("K1", "K2", "unstable_roots"))
    for K2, row in zip(answer["K2"], answer["unstable_roots"], strict=True):
        writer.writerows((repr(K1), repr(K2), count) for K1, count in zip(answer["K1"], row, strict=True))
    write_file(path, text.getvalue().encode(), key="--csv")
