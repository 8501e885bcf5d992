"""What `tfarm sampled` and `tfarm simulate` print for a person, and the files that they write."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.arm import LISTED
from tfarm.cli.app import tell
from tfarm.columns import Column, Table
from tfarm.dsp.results import AT_SAMPLES_COLUMNS, traced_columns
from tfarm.files import write_file
from tfarm.tables.files import write_csv
from tfarm.tables.terminal import show


def print_sampled(answer: dict[str, Any]) -> None:
    """A row a mode, then the verdict."""
    show(answer["modes"])
    print(answer["law"])
    shown, band = answer["shown"], answer["band_rad_s"]
    for gain in LISTED:
        windows = shown[f"{gain.name}_intervals"]
        spans = " and ".join(f"({low['text']}, {high['text']})" for low, high in windows)
        known = _held([edge for pair in windows for edge in pair], band) if windows else "no interval"
        print(f"stable, the other gains held, for {gain.name} in {spans}{known}")
    delay, damping = shown["delay_margin_samples"], shown["required_damping_s"]
    more = " or more" if answer["delay_margin_is_lower_bound"] else ""
    print(f"further delay it bears: {delay['text']} samples{more}{_held([delay], band)}")
    print(f"damping C from which these gains are safe: {damping['text']} s{_held([damping], band)}")
    print(f"{answer['arm']}: {answer['verdict_in_words']}; spectral radius {answer['spectral_radius']:.12g}")


def print_sampled_law(answer: dict[str, Any]) -> None:
    """What a law is, how far it is from its edges, then the verdict."""
    print(f"{answer['law']}, order {answer['law_order']}, {answer['rule_in_words']}: {answer['sign_convention']}")
    late = f", {answer['delay_samples']:g} of them late" if answer["delay_samples"] else ""
    print(f"samples every {answer['period_s']:g} s{late}; {answer['modes_used']} flexible modes in what follows")
    for warning in answer["warnings"]:
        print(f"warning: {warning}")
    if answer["free_hub_angle"]:
        print("nothing regulates the hub's angle: its pole at z = 1 is left out")
    for low, high in answer["stable_gain_factors"]:
        print(f"stable with the whole law times {low:.6g} to {high:.6g}")
    if answer["stable"]:
        more = " or more" if answer["delay_margin_is_lower_bound"] else ""
        seconds = f"{1e3 * answer['delay_margin_s']:.4g} ms"
        print(f"further delay it bears: {answer['delay_margin_samples']:.4g} samples{more}, {seconds}")
    elif not answer["stable_gain_factors"]:
        print("stable with no factor on the law")
    show(answer["windows"])
    print(f"{answer['arm']}: {answer['verdict_in_words']}; spectral radius {answer['spectral_radius']:.12g}")


def print_simulation(answer: dict[str, Any]) -> None:
    """What the simulation comes to."""
    if "rule_in_words" in answer:
        print(f"{answer['law']}, order {answer['law_order']}, {answer['rule_in_words']}: {answer['sign_convention']}")
    print(f"{answer['arm']}, {answer['scenario_in_words']}: {len(answer['t'])} samples of {answer['period_s']:g} s")
    change, known = answer["modes_change"], "as asked"
    if change is not None:
        known = f"half of them change the signals by {change:.2g} of their largest"
    print(f"{answer['modes_used']} flexible modes{', ' if change is None else ': '}{known}")
    print(f"residual root moment, less the rigid arm's: {_residual(answer)}")
    settled = answer["settling_time_s"]
    print(f"not settled within {answer['t'][-1]:.4g} s" if settled is None else f"settled (5 %) at: {settled:.4g} s")
    print(f"saturated samples: {', '.join(f'{k} {n}' for k, n in answer['saturated_samples'].items())}")
    if answer["limit_cycle"] is not None:
        cycle = answer["limit_cycle"]
        at = cycle["frequency_rad_s"]
        size = f"root moment +-{cycle['root_moment_amplitude']:.4g} N m at {at:.4g} rad/s"
        print(f"limit cycle, kept up by {cycle['kept_up_by']}: {size}")


def _residual(answer: dict[str, Any]) -> str:
    """What is left after the slew, or why that was not computed."""
    residual, stopped = answer["residual_moment_rms"], answer["stopped_at_s"]
    if residual is not None:
        return f"{residual:.6g} N m rms"
    ends = "the record ends before the slew" if stopped is None else f"the run stops at {stopped:.6g} s"
    return f"not computed, as {ends}"


def warn_of_runaway(answer: dict[str, Any]) -> None:
    """A line on standard error where the loop ran away."""
    if answer["stopped_at_s"] is not None:
        what = f"mode {answer['growing_mode']}" if answer["growing_mode"] else "the hub"
        tell(f"unstable: stopped at {answer['stopped_at_s']:.6g} s, {what} grows")


def write_signals(answer: dict[str, Any], path: Path) -> None:
    """The signals as a table in the order of time, written beside and then renamed.

    Rows between the samples leave empty what changes at the samples only: torque, gain and volts.
    """
    finer = answer.get("between", {"t": []})
    empty, order = [""] * len(finer["t"]), np.argsort([*answer["t"], *finer["t"]], kind="stable")
    columns = []
    for column in _present(answer):
        values = [*answer[column.key], *finer.get(column.key, empty)]
        columns.append(replace(column, of=[values[i] for i in order]))
    write_csv(Table(columns=tuple(columns)), path)


def write_mat(answer: dict[str, Any], path: Path) -> None:
    """The signals at the samples, and those between them, as a MATLAB file (level 5)."""
    from scipy.io import savemat

    signals: dict[str, Any] = {_variable(each.key): np.array(answer[each.key]) for each in _present(answer)}
    if "between" in answer:
        signals["between"] = {_variable(name): np.array(values) for name, values in answer["between"].items()}
    data = io.BytesIO()
    savemat(data, signals, oned_as="column")  # type: ignore[arg-type]  # a stream will do
    content = data.getvalue()
    header = b"MATLAB 5.0 MAT-file, tfarm".ljust(116)  # scipy writes the date here
    write_file(path, header + content[116:], key="--mat")


def _variable(name: str) -> str:
    """A signal's name as MATLAB takes it: strain_0_05 of strain@0.05."""
    return re.sub(r"\W", "_", name)


def _present(answer: dict[str, Any]) -> list[Column]:
    units, columns = {"torque": answer["torque_unit"]}, (*traced_columns(answer["outputs"]), *AT_SAMPLES_COLUMNS)
    return [replace(each, unit=units.get(each.key, each.unit)) for each in columns if answer.get(each.key)]


def _held(figures: list[dict[str, Any]], band: float | None) -> str:
    """For which modes the figures hold; nothing where that is the band of the verdict."""
    modes = [figure["modes"] for figure in figures if not figure["settled"]]
    if modes:
        return f" (holds for the first {max(modes)} modes)"
    narrowest = min(figure["band_rad_s"] for figure in figures)
    return "" if band is not None and narrowest >= band else f" (proven below {narrowest:.3g} rad/s)"
