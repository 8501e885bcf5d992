"""A measured response over the exact one: what `tfarm response --measured` prints and writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tfarm.cli.app import load_arm
from tfarm.cli.methods import refuse_beside
from tfarm.cli.tables import hand_out
from tfarm.fitting.overlay import overlay
from tfarm.fitting.overlay_answer import curves_table, overlay_answer, required_table
from tfarm.fitting.reading import data_of
from tfarm.tables.terminal import show

MOST_LISTED_ROOTS = 12  # poles, or zeros, in one line of a terminal; --json has them all


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
