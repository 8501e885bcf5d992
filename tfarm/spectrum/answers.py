"""The modal table as commands and pages have it: its columns, and the answer of `tfarm modes`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tfarm.arm import WITH_SHEAR, Arm
from tfarm.arrays import Real
from tfarm.columns import ANSWER, JSON, REPORT, TERMINAL, Column, Table
from tfarm.digits import DOUBLE_DIGITS, aligned, general, kept_digits, lined, significant, singly, within
from tfarm.errors import MISSING
from tfarm.exact.methods import Method, roads_answer

from .damped import DampedModes, damped_modes
from .table import FEWEST_LISTED, Modes, compare_theories, hub_locked

SHAPE_DIGITS = 10  # in a report's files, of what shapes are needed for: these differ by 1e-14 between processors
EIGENVALUE_ERROR = 2e-14  # of its size: what a float64 may be off (tests: 1e-14 to 50 digits, 64 eps in closed form)
SMALL_RATIO = 1e-3  # a damping ratio below this has less than three digits in five decimals
LESS_DAMPED = "they are ever less damped, as no segment is (C = 0)"
OF_SHEAR = "shear is undamped in this model, so lightly damped modes exist at ever higher frequency"
OF_ELASTIC = "segments without damping have lightly damped modes at ever higher frequency"
OF_BENDING = "in this theory, which leaves out shear, all of them are overdamped from some frequency on"
ACCUMULATE = "the slow real eigenvalues of overdamped bending modes accumulate at -1/C"
LOCKED_NOTE = (
    "hub locked: the frequencies with the hub held still. A hub that dry friction holds, as it mostly does once a slew "
    "is over, rings there and not at the free ones: a measured number near this column says that the hub stood still."
)


def _by_row(columns: Mapping[Any, Real]) -> list[dict[str, float]]:
    """A dictionary a mode of a dictionary of columns."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


MODE_COLUMNS = (  # of `Modes`; a page adds the nodes, which it rounds to a share of the length
    Column("index", "mode"),
    Column(
        "natural_frequency_rad_s", "natural frequency", "rad/s", of="natural_frequency", digits=lined(8, 7),
        head="rad/s", printed=singly(general, 12),
    ),
    Column("natural_frequency_hz", "", "Hz", digits=lined(8, 7), head="Hz", printed=singly(general, 9)),
    Column("hub_participation", "hub participation b", printed=singly(general, 6), on=ANSWER),
    Column("modal_moment", "modal moment", "N m", printed=singly(general, 6), on=ANSWER),
    Column("nodes_m", "nodes", "m", of=lambda modes: [x.tolist() for x in modes.nodes], folds=True, on=ANSWER,
           printed=lambda nodes: [" ".join(f"{x:.4f}" for x in each) or "-" for each in nodes]),
    Column("theories_rad_s", of=lambda modes: _by_row(compare_theories(modes)), on=(JSON,)),
    Column("sensitivity", of=lambda modes: _by_row(modes.sensitivity), on=(JSON,)),
    Column("hub_participation", "hub participation b", "1/√(kg m²)",
           of=lambda modes: kept_digits(modes.hub_participation, SHAPE_DIGITS), digits=lined(7, 4), on=REPORT),
    Column("modal_moment", "modal moment", "N m/√(kg m²)",
           of=lambda modes: kept_digits(modes.modal_moment + 0.0, SHAPE_DIGITS), digits=lined(7, 4), on=REPORT),
)  # fmt: skip


def _imaginary(damped: DampedModes) -> list[str]:
    """Im s, or of an overdamped mode the second of its real eigenvalues."""
    rising = aligned(damped.eigenvalues[:, 0].imag, 8, least=7)
    pairs = zip(damped.eigenvalues[:, 1].real.tolist(), damped.is_overdamped, rising, strict=True)
    return [f"overdamped, and {significant(second, 7)}" if over else text for second, over, text in pairs]


def _ratio(ratio: float) -> str:
    """Five decimals; a ratio that would lose its digits there has four of its own; 0 of a rigid body."""
    return "0" if ratio == 0 else f"{ratio:.5f}" if ratio >= SMALL_RATIO else significant(ratio, 4)


DAMPED_MODE_COLUMNS = (  # of `DampedModes`, on a page; a command has them beside the undamped ones
    Column("index", "mode"),
    Column("eigenvalue_re", "Re s", "1/s", of=lambda damped: damped.eigenvalues[:, 0].real, digits=lined(7, 6)),
    Column("eigenvalue_im", "Im s", "rad/s", of=lambda damped: damped.eigenvalues[:, 0].imag, shown=_imaginary),
    Column("damping_ratio", "damping ratio", "-", digits=singly(_ratio)),
)


def modes_by_methods_answer(modes: Modes) -> dict[str, Any]:
    """The frequencies by each method, and by what share each differs from the closed form."""
    answer = {"arm": modes.arm.name, "theory": modes.theory, "index": [int(index) for index in modes.index]}
    return answer | roads_answer(modes.by_methods())


def modes_answer(
    modes: Modes, digits: int | None, certify: bool = False, method: Method = "closed-form"
) -> dict[str, Any]:
    """The modal table, frequencies as strings of so many digits where more than 15 are asked for.

    With `certify` each flexible mode gets its proven bracket, and the whole the count that proves it complete; `method`
    is the road to the frequencies.  Beside each stands that of the same number with the hub locked.
    """
    columns = _undamped(modes, digits, method)
    answer: dict[str, Any] = {
        "arm": modes.arm.name,
        "count": int(modes.index.max()),
        "complete": True,
        "theory": modes.theory,
        "method": method,
        "input": modes.arm.input,
        "hub_locked_note": None if modes.arm.is_locked else LOCKED_NOTE,
    }
    if digits is not None:
        answer["digits"] = digits
    wanted = None if not certify else DOUBLE_DIGITS if digits is None else digits
    if wanted is not None:
        proof = modes.certify(wanted)
        rigid = [MISSING] * (len(modes) - len(proof.brackets))
        for key, ends in zip(("lower_rad_s", "upper_rad_s"), zip(*proof.brackets, strict=True), strict=True):
            columns.append(Column(key, of=[*rigid, *ends], on=(JSON,)))
        answer |= {"proven_complete": True, "proof": {"count": proof.count, "below_rad_s": proof.below}}
    if not modes.arm.is_undamped:
        damped = damped_modes(modes)
        columns = [replace(column, on=(JSON,)) if column.key == "nodes_m" else column for column in columns]
        discs = [] if wanted is None else [_discs(damped, len(modes), wanted)]
        columns = [*columns[:3], *_damped(damped, len(modes)), *columns[3:], *discs]
        answer |= _damped_answer(damped) | ({} if wanted is None else {"proven_complete_in_box": True})
    return answer | {"modes": Table(columns=tuple(columns), record=modes)}


def _undamped(modes: Modes, digits: int | None, method: Method) -> list[Column]:
    """`MODE_COLUMNS`, frequencies in the digits asked for, and beside each that of its number with the hub locked.

    None stands beside a rigid body's; on a terminal the column is there if the hub turns.
    """
    exact = modes.digits(digits) if digits is not None else []
    found = modes.frequencies(method)
    given = {
        "natural_frequency_rad_s": exact if digits is not None and digits > DOUBLE_DIGITS else found,
        "natural_frequency_hz": found / (2 * math.pi),
    }
    columns = [replace(column, of=given.get(column.key, column.of)) for column in MODE_COLUMNS]
    held_still, rigid = hub_locked(modes), [MISSING] * int(np.sum(modes.index == 0))
    flexible = held_still.index > 0
    if digits is not None and digits > DOUBLE_DIGITS:
        still: list[Any] = held_still.digits(digits)[-int(flexible.sum()) :]
    else:
        still = held_still.natural_frequency[flexible].tolist()
    texts = ["-"] * len(rigid) + [each if isinstance(each, str) else general(each, FEWEST_LISTED) for each in still]
    on = (JSON,) if modes.arm.is_locked else ANSWER
    locked = Column("hub_locked_rad_s", "hub locked", "rad/s", of=[*rigid, *still], shown=texts, on=on)
    return [*columns[:3], locked, *columns[3:]]


def beyond_the_box(arm: Arm) -> str:
    """What the eigenvalues of a damped arm are that lie beyond any box."""
    if arm.has_elastic_link:
        return LESS_DAMPED
    dampings = {link.damping for link in arm.links}
    light = OF_SHEAR if arm.theory in WITH_SHEAR else OF_BENDING if all(dampings) else OF_ELASTIC
    most = " of the most damped segment" * (len(dampings) > 1)
    return f"{light}, and {ACCUMULATE}{most}, {-1 / arm.damping:.6g} 1/s"


def _damped_answer(damped: DampedModes) -> dict[str, Any]:
    """The box of the eigenvalues, and what of them is in no row."""
    note = f"complete in the box; beyond it there are more: {beyond_the_box(damped.undamped.arm)}"
    answer: dict[str, Any] = {"box": list(damped.box), "eigenvalues_in_box": damped.count, "box_note": note}
    if damped.others:
        answer["circuit_eigenvalues"] = list(damped.others)
    if damped.left_out:
        last = damped.index[-1]
        answer["damped_note"] = f"eigenvalues up to mode {last} only: branches above cannot be told apart"
    return answer


def _damped(damped: DampedModes, rows: int) -> list[Column]:
    """Eigenvalue, or two real ones, and damping ratio of each mode that was followed, in as many rows as there are."""
    turning = (damped.index == 0) & (damped.eigenvalues[:, 1] != 0)  # friction resists the rigid body
    over, ratios = (damped.is_overdamped | turning).tolist(), damped.damping_ratio.tolist()
    pairs = list(zip(damped.eigenvalues.tolist(), over, strict=True))
    texts = [
        f"{p.real:.8g} and {q.real:.8g}" if both else f"{within(p.real, EIGENVALUE_ERROR * abs(p), 8)} + {p.imag:.10g}i"
        for (p, q), both in pairs
    ]
    words = [
        f"{ratio:.6g} (overdamped)" if ratio and both else within(ratio, EIGENVALUE_ERROR, 6)
        for ratio, both in zip(ratios, over, strict=True)
    ]
    rest = [MISSING] * (rows - len(pairs))
    return [
        Column("eigenvalue", of=[MISSING if both else [p.real, p.imag] for (p, _), both in pairs] + rest, on=(JSON,)),
        Column("eigenvalues", of=[[p.real, q.real] if both else MISSING for (p, q), both in pairs] + rest, on=(JSON,)),
        Column("eigenvalue", "eigenvalue", "1/s", of=texts + ["not followed"] * len(rest), on=(TERMINAL,)),
        Column("damping_ratio", "damping ratio", of=ratios + rest, shown=words + ["-"] * len(rest)),
    ]


def _discs(damped: DampedModes, rows: int, digits: int) -> Column:
    """The proven discs of each flexible mode that was followed."""
    found = [
        [{"re": disc.re, "im": disc.im, "radius": disc.radius} for disc in discs] for discs in damped.certify(digits)
    ]
    flexible = int(np.sum(damped.index > 0))
    found, alone = found[:flexible], found[flexible : len(found) - len(damped.others)]
    rigid: list[Any] = [*alone] or [MISSING] * int(np.sum(damped.index == 0))
    return Column("discs", of=[*rigid, *found, *[MISSING] * (rows - len(rigid) - len(found))], on=(JSON,))
