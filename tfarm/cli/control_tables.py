"""What the verbs of the continuous loop print for a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tfarm.arm import ANGLE_GAIN, PLANE
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.loop.answers import POLE_COLUMNS, WINDOW_COLUMNS, gain_rows, margin_rows
from tfarm.loop.margins import Margins
from tfarm.loop.windows import BEYOND_LAW
from tfarm.tables.terminal import heading, show


def print_poles(answer: dict[str, Any]) -> None:
    """A row a pole, then the box."""
    show(Table(columns=POLE_COLUMNS, record=[complex(*pole) for pole in answer["poles"]]))
    left, right, _, top = answer["box"]
    proven = "proven" if "discs" in answer else "by winding number"
    print(f"all poles with {left:.6g} < Re s < {right:.6g} and |Im s| < {top:.6g} ({proven}),")
    print(f"{answer['unstable']} of them unstable")
    if answer["ends_at_shear_cutoff"]:
        print(f"no more lie below sqrt(kGA/rhoI), {answer['shear_cutoff_rad_s']:.6g} rad/s, where the list ends;")
        print("--count goes on above it, in Timoshenko's theory into shear, which that hardly damps")
    print(answer["sign_convention"])


def print_margins(found: Margins, answer: dict[str, Any]) -> None:
    """The verdict, then everything else: of gains at the hub Lyapunov's argument, and how far each may go alone."""
    far = answer["verdict"] == "unstable" or answer["known_beyond_the_band"]
    reach = "" if far else f" up to {answer['band_rad_s']:.4g} rad/s, not known beyond"
    poles = found.stability.poles
    is_of_gains = "lyapunov" in answer
    why = f"that {ANGLE_GAIN} = 0 leaves" if is_of_gains else "of a hub whose angle is not held"
    apart = f" (apart from the pole at 0 {why})" if poles.moving.size < poles.values.size else ""
    print(f"{answer['arm']}: {answer['verdict'].upper()}{reach}{apart}")
    more = " (infinitely many in all)" if answer["unstable_roots_infinite"] else ""
    print(f"unstable poles up to {answer['band_rad_s']:.6g} rad/s: {answer['unstable_roots']}{more}")
    print(answer["beyond_the_band"])
    for warning in answer.get("warnings", ()):
        print(f"warning: {warning}")
    ends = "no limit was found up to there, and beyond none was looked for"
    if is_of_gains:
        print(f"Lyapunov: {answer['lyapunov']['reason']}")
        show(Table(columns=WINDOW_COLUMNS, record=gain_rows(found)))
        ranges = ((name, *each.looked_at) for name, each in found.windows.items())
        spans = ", ".join(f"{name} ({low:.6g}, {high:.6g})" for name, low, high in ranges)
        print(f"looked at: {spans}; * {ends}")
    elif answer["passivity"]["kind"]:
        print(answer["passivity"]["reason"])
    if found.windows and not is_of_gains:
        show(answer["windows"])
        print(f"each looked at up to {BEYOND_LAW:g} times its size, of either sign; * {ends}")
    if answer["in_band"] is not None:
        _print_loop_margins(found, answer)
    print(answer["sign_convention"])


def _print_loop_margins(found: Margins, answer: dict[str, Any]) -> None:
    assert found.in_band is not None
    rows, band, six = list(margin_rows(found, found.in_band)), answer["in_band"], singly(general, 6)
    columns = (
        Column("margin", "margin", of=["gain (factors)", *(heading(row.column) for row in rows)]),
        Column("exact", "exact", of=[_pair(answer["gain_margin"]), *(row.exact for row in rows)], digits=six),
        Column("band", f"up to {band['band_rad_s']:.6g} rad/s", of=["", *(row.in_band for row in rows)], digits=six),
        Column("at", "at", "rad/s", of=["", *("-" if row.at == "" else row.at for row in rows)], digits=six),
    )
    show(Table(columns=columns))
    for key, empty in (("gain_crossovers", "|L| = 1"), ("phase_crossovers", "L < 0")):
        if answer[key]:
            show(answer[key])
        else:
            print(f"nowhere in the band {empty}")
    phase = band["phase_margin_deg"]
    if phase < 0:
        print(f"phase margin {phase:.6g} deg: lead; not an instability")


def _pair(pair: Any) -> str:
    return f"({pair[0]:.8g}, {pair[1]:.8g})" if pair else ""


def print_spill(answer: dict[str, Any]) -> None:
    """What it means, then a row a model."""
    print(f"{answer['arm']}: {answer['in_words']}")
    print(answer["beyond_the_band"])
    show(answer["models"])
    print(answer["sign_convention"])


def print_map(answer: dict[str, Any]) -> None:
    """The shares of the plane, and a coarse picture."""
    counts = answer["unstable_roots"]
    flat = [count for row in counts for count in row]
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} gain pairs are stable")
    _print_plane(answer, *PLANE)


def _print_plane(answer: dict[str, Any], x: str, y: str, names: Sequence[str] | None = None) -> None:
    """A coarse picture of a plane over the values under two keys: a dot where nothing is unstable."""
    counts, (across, up) = answer["unstable_roots"], names or (x, y)
    step = max(1, len(counts) // 24), max(1, len(counts[0]) // 60)
    for value, row in list(zip(answer[y], counts, strict=True))[:: -step[0]]:
        print(f"{value:9.3g} " + "".join("." if count == 0 else "#" for count in row[:: step[1]]))
    print(f"{up} up, {across} from {answer[x][0]:g} to {answer[x][-1]:g} to the right; . stable, # unstable")
    print(answer["sign_convention"])


def print_sampled_map(answer: dict[str, Any]) -> None:
    """The share of the plane in which the sampled loop is stable, and a coarse picture."""
    counts, (first, second) = answer["unstable_poles"], answer["vary"]
    flat = [count for row in counts for count in row]
    held = f"stable when sampled every {1e3 * answer['period_s']:g} ms (first {answer['modes_used']} modes)"
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} pairs of {first} and {second} are {held}")
    _print_plane(answer | {"unstable_roots": counts}, "x", "y", (first, second))


def print_law_map(answer: dict[str, Any]) -> None:
    """The share of the plane that is stable, and a coarse picture."""
    counts, (first, second) = answer["unstable_roots"], answer["vary"]
    flat = [count for row in counts for count in row]
    reach = f"no unstable pole below {answer['band_rad_s']:.6g} rad/s"
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} pairs of {first} and {second} have {reach}")
    _print_plane(answer, "x", "y", (first, second))


def print_design(answer: dict[str, Any]) -> None:
    """The law and what it reaches, how sure the optimum is, then a row an arm."""
    loop = f"the {answer['designed_for']} loop, {answer['modes']} modes"
    told = f"{answer['structure']}, objective {answer['objective']} of {loop}: {answer['value']:.6g}"
    print(f"{answer['arm']}, {told}")
    _print_coefficients(answer)
    sampled = answer["sampled"]
    words = (
        sampled["in_words"] if "gain_units" in answer else sampled["in_words"].replace("these gains are", "it is", 1)
    )
    print(f"{'' if sampled['stable'] else 'BUT '}{words}")
    beyond = "" if answer["known_beyond_the_band"] else f" up to {answer['band_rad_s']:.4g} rad/s, not known beyond"
    print(f"continuous-time loop: {answer['verdict']}{beyond}; --save FILE keeps the law for --law FILE")
    print(f"{answer['starts_agreed']} of {answer['starts']} searches agree within half a per cent")
    _print_bounds(answer)
    _print_record(answer)
    _print_arms(answer)
    print(answer["sign_convention"])


def _print_coefficients(answer: dict[str, Any]) -> None:
    """A row a coefficient: its value, how flat the optimum is along it, and where it was searched."""
    names, bounds = list(answer["coefficients"]), answer["bounds"]
    columns = (
        Column("coefficient", "coefficient", of=names),
        Column("value", "value", of=list(answer["coefficients"].values()), digits=singly(general, 7)),
        Column("flat", "within one per cent", of=[_pair(answer.get(f"flat_{name}")) for name in names]),
        Column("bounds", "searched", of=[_pair(bounds.get(name)) for name in names]),
    )
    show(Table(columns=columns))


def _print_bounds(answer: dict[str, Any]) -> None:
    """Which bounds were widened, and where the search was cut off."""
    values = answer["coefficients"]
    for name in answer["widened"]:
        wider = _pair(answer["bounds"][name])
        print(f"the bounds of {name} were widened to {wider}: the best law lay on the first ones")
    for name in answer["at_limit"]:
        print(f"{name} = {values[name]:.6g} is at the physical end of {_pair(answer['bounds'][name])}")
    cut = [name for name in answer["at_bound"] if name not in answer["at_limit"]]
    if cut:
        ends = [f"{name} = {values[name]:.6g} of {_pair(answer['bounds'][name])}" for name in cut]
        print(f"no optimum: {' and '.join(ends)} is where the search was cut off; it may get better beyond")


def _print_record(answer: dict[str, Any]) -> None:
    """The record of the slew that a residual or a cost is of."""
    if (length := answer["slew_duration_s"]) is not None:
        what = "root moment less the rigid arm's, N m rms" if answer["objective"] == "residual" else "cost of the slew"
        print(f"{what}, in a record of {length:.6g} s (tfarm simulate --duration {length:.6g})")


def _print_arms(answer: dict[str, Any]) -> None:
    """A row an arm, where there are several, and how they were chosen."""
    arms = answer["arms"]
    if len(arms) == 1:
        return
    held = ["undecided" if (s := each["sampled"]["stable"]) is None else "stable" if s else "UNSTABLE" for each in arms]
    columns = (
        Column("arm", "arm", of=[each["name"] for each in arms]),
        Column("value", answer["objective"], of=[each["value"] for each in arms], digits=singly(general, 6)),
        Column("sampled", "sampled", of=held),
        Column("verdict", "continuous-time", of=[each["verdict"] for each in arms]),
    )
    show(Table(columns=columns))
    print(f"{answer['value']:.6g} is {answer['worst_case_in_words']}; {answer['worst_arm']} is the worst")
