"""The modal table as commands and pages have it: its columns, and the answer of `tfarm modes`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import WITH_SHEAR, Arm
from tfarm.arrays import Complex, Real
from tfarm.columns import ANSWER, JSON, REPORT, TERMINAL, Column, Table
from tfarm.digits import DOUBLE_DIGITS, CellsOf, general, kept_digits, lined, significant, singly, within
from tfarm.errors import MISSING, CertificationError, ConvergenceError
from tfarm.exact.values import Method, roads_answer

from .damped import NOT_ASSIGNED, DampedModes, damped_modes
from .proofs import Disc
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


def _every(damped: DampedModes) -> Complex:
    """The first eigenvalue of each mode, NaN where it has none, then the unassigned ones."""
    return np.r_[damped.eigenvalues[:, 0], damped.unassigned_pairs[:, 0]]


def _every_ratio(damped: DampedModes) -> Real:
    """The damping ratio of each of `_every`; NaN of an unassigned real one, which is of no pair."""
    alone = damped.unassigned_pairs[:, 0]
    ratio: Real = np.where(alone.imag > 0, -alone.real / abs(alone), np.nan)
    return np.r_[damped.damping_ratio, ratio]


def _imaginary(damped: DampedModes) -> list[str]:
    """Im s, or of an overdamped mode the second of its real eigenvalues."""
    cells = _cells(_every(damped).imag, lined(8, 7))
    for row in np.flatnonzero(damped.is_overdamped):
        cells[row] = f"overdamped, and {significant(float(damped.eigenvalues[row, 1].real), 7)}"
    return cells


def _cells(values: NDArray[np.floating[Any]], digits: CellsOf, without: str = NOT_ASSIGNED) -> list[str]:
    """The numbers in these digits, and words where there is none."""
    known = iter(digits(values[np.isfinite(values)].tolist()))
    return [next(known) if known_here else without for known_here in np.isfinite(values)]


def _known(values: NDArray[np.floating[Any]]) -> list[Any]:
    """The numbers, MISSING where there is none."""
    return [MISSING if math.isnan(value) else value for value in values.tolist()]


def _ratio(ratio: float) -> str:
    """Five decimals; a ratio that would lose its digits there has four of its own; 0 of a rigid body."""
    return "0" if ratio == 0 else f"{ratio:.5f}" if ratio >= SMALL_RATIO else significant(ratio, 4)


DAMPED_MODE_COLUMNS = (  # of `DampedModes`, on a page; a command has them beside the undamped ones
    Column("index", "mode", of=lambda damped: [*damped.index.tolist(), *[MISSING] * len(damped.unassigned)],
           shown=lambda damped: [*map(str, damped.index), *(each.origin for each in damped.unassigned)]),
    Column("eigenvalue_re", "Re s", "1/s", of=lambda damped: _known(_every(damped).real),
           shown=lambda damped: _cells(_every(damped).real, lined(7, 6))),
    Column("eigenvalue_im", "Im s", "rad/s", of=lambda damped: _known(_every(damped).imag), shown=_imaginary),
    Column("damping_ratio", "damping ratio", "-", of=lambda damped: _known(_every_ratio(damped)), digits=singly(_ratio),
           shown=lambda damped: _cells(_every_ratio(damped), singly(_ratio), "-")),
)  # fmt: skip


def modes_by_methods_answer(modes: Modes) -> dict[str, Any]:
    """The frequencies by each method, and by what share each differs from the closed form."""
    answer = {"arm": modes.arm.name, "theory": modes.theory, "index": [int(index) for index in modes.index]}
    return answer | roads_answer(modes.by_methods())


def modes_answer(
    modes: Modes, digits: int | None, certify: bool = False, method: Method = "closed-form"
) -> dict[str, Any]:
    """The modal table, frequencies as strings of so many digits where more than 15 are asked for.

    With `proofs` each flexible mode gets its proven bracket, and the whole the count that proves it complete; `method`
    is the road to the frequencies.  Beside each stands that of the same number with the hub locked.  Where damped modes
    cannot be found or proven, `damped_failure` is why.
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
        try:
            damped = damped_modes(modes)
            discs = None if wanted is None else damped.certify(wanted)
        except (ConvergenceError, CertificationError) as error:
            answer["damped_failure"] = f"damped modes: {error}"
        else:
            columns = [replace(column, on=(JSON,)) if column.key == "nodes_m" else column for column in columns]
            columns = [*columns[:3], *_damped(damped, len(modes)), *columns[3:]]
            answer |= _damped_answer(damped, discs)
            if discs is not None:
                columns.append(_disc_column(damped, len(modes), discs))
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


def _damped_answer(damped: DampedModes, discs: Sequence[Sequence[Disc]] | None) -> dict[str, Any]:
    """The box of the eigenvalues, and what of them is in no row."""
    note = f"complete in the box; beyond it there are more: {beyond_the_box(damped.undamped.arm)}"
    answer: dict[str, Any] = {"box": list(damped.box), "eigenvalues_in_box": damped.count, "box_note": note}
    if damped.others:
        answer["circuit_eigenvalues"] = list(damped.others)
    if damped.unassigned:
        proven: list[dict[str, Any]] = [{}] * len(damped.unassigned)
        if discs is not None:
            proven = [{"discs": _as_entries(each)} for each in discs[-len(damped.unassigned) :]]
        answer["unassigned_eigenvalues"] = [
            {"eigenvalue": [s.real, s.imag], "origin": origin, **disc}
            for (s, origin), disc in zip(damped.unassigned, proven, strict=True)
        ]
    if discs is not None:
        answer["proven_complete_in_box"] = True
    if damped.left_out:
        last = damped.index[-1]
        answer["damped_note"] = f"eigenvalues up to mode {last} only: branches above cannot be told apart"
    return answer


def _damped(damped: DampedModes, rows: int) -> list[Column]:
    """Eigenvalue, or two real ones, and damping ratio of each mode that was followed, in as many rows as there are."""
    turning = (damped.index == 0) & (damped.eigenvalues[:, 1] != 0)  # friction resists the rigid body
    over, ratios = (damped.is_overdamped | turning).tolist(), damped.damping_ratio
    pairs = list(zip(damped.eigenvalues.tolist(), over, strict=True))
    words = [
        "-" if math.isnan(ratio) else f"{ratio:.6g} (overdamped)" if ratio and both else _precise_ratio(ratio)
        for ratio, both in zip(ratios.tolist(), over, strict=True)
    ]
    single = [[p.real, p.imag] if np.isfinite(p) and not both else MISSING for (p, _), both in pairs]
    double = [[p.real, None if math.isnan(q.real) else q.real] if both else MISSING for (p, q), both in pairs]
    rest = [MISSING] * (rows - len(pairs))
    texts = [_pair_words(*each) for each in pairs] + ["not followed"] * len(rest)
    return [
        Column("eigenvalue", of=single + rest, on=(JSON,)),
        Column("eigenvalues", of=double + rest, on=(JSON,)),
        Column("eigenvalue", "eigenvalue", "1/s", of=texts, on=(TERMINAL,)),
        Column("damping_ratio", "damping ratio", of=_known(ratios) + rest, shown=words + ["-"] * len(rest)),
    ]


def _precise_ratio(ratio: float) -> str:
    return within(ratio, EIGENVALUE_ERROR, 6)


def _pair_words(pair: Sequence[complex], is_real: bool) -> str:
    """Both eigenvalues of a mode as a terminal shows them."""
    p, q = pair
    if not np.isfinite(p):
        return NOT_ASSIGNED
    if is_real:
        return f"{p.real:.8g} and {NOT_ASSIGNED if math.isnan(q.real) else f'{q.real:.8g}'}"
    return f"{within(p.real, EIGENVALUE_ERROR * abs(p), 8)} + {p.imag:.10g}i"


def _as_entries(discs: Sequence[Disc]) -> list[dict[str, str]]:
    return [{"re": disc.re, "im": disc.im, "radius": disc.radius} for disc in discs]


def _disc_column(damped: DampedModes, rows: int, discs: Sequence[Sequence[Disc]]) -> Column:
    """The proven discs of each flexible mode that was followed."""
    found: list[Any] = [_as_entries(each) or MISSING for each in discs]
    flexible, turning = int(np.sum(damped.index > 0)), damped.single.size - len(damped.others)
    found, alone = found[:flexible], found[flexible : flexible + turning]
    rigid = alone or [MISSING] * int(np.sum(damped.index == 0))
    return Column("discs", of=[*rigid, *found, *[MISSING] * (rows - len(rigid) - len(found))], on=(JSON,))
