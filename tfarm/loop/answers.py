"""What the loop's commands print with --json: plain dictionaries."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import (
    ANGLE_GAIN,
    LISTED,
    PLANE,
    SPELT_OUT,
    AnyLaw,
    Arm,
    Law,
    as_law,
    input_words,
    shown_unit,
    unit_of,
)
from tfarm.arrays import Real, Whole
from tfarm.columns import ANSWER, JSON, REPORT, TERMINAL, Column, Table
from tfarm.crossing import Window
from tfarm.digits import general, lined, plain, significant, singly, within
from tfarm.response.answers import HERTZ
from tfarm.response.signals import Signals
from tfarm.spectrum.answers import EIGENVALUE_ERROR

from .margins import LoopMargins, Margins
from .nyquist import Nyquist
from .plane import INFINITE, Plane
from .poles import Poles
from .spill import SPILL, Spill
from .theorem import lyapunov, signs_of_loop
from .windows import Windows, reach_words

WINDOW_DIGITS, PAGE_WINDOW_DIGITS = 8, 5  # of the ends of a window, on a terminal and on a page
POLE_COLUMNS = (  # of complex poles [1/s]
    Column("re", "Re s", "1/s", of=lambda pole: within(pole.real, EIGENVALUE_ERROR * abs(pole), 12), on=(TERMINAL,)),
    Column("im", "Im s", "rad/s", of="imag", digits=singly(general, 12), on=(TERMINAL,)),
    Column("ratio", "damping ratio", on=(TERMINAL,),
           of=lambda pole: within(-pole.real / abs(pole), EIGENVALUE_ERROR, 6) if pole.imag else "-"),
    Column("real_1_s", "Re s", "1/s", of="real", digits=lined(8, 4), on=REPORT),
    Column("imaginary_rad_s", "Im s", "rad/s", of="imag", digits=lined(8, 7), on=REPORT),
    Column("frequency_hz", "Im s/2π", "Hz", of=lambda pole: pole.imag / HERTZ, digits=lined(8, 7), on=REPORT),
    Column("damping_percent", "damping ratio", "%", digits=singly(significant, 4), on=REPORT,
           of=lambda pole: -100 * pole.real / abs(pole) + 0.0 if pole else ""),
)  # fmt: skip


LAW_IN_WORDS = f"u = -{SPELT_OUT} + r"


def sign_of(arm: Arm) -> str:
    """The law, and what a gauge reads of a static torque: with it the sign of its gain; of a rig what u is."""
    if arm.is_uniform and arm.has_rigid_mode:
        return f"{LAW_IN_WORDS}; a static torque u gives the moment -(J - I_h)/J u"
    if not arm.has_rigid_mode:
        return f"{LAW_IN_WORDS}; u is {input_words(arm)}"
    share = arm.gauged_inertia / arm.total_inertia
    static = f"a static torque at the hub gives the moment {-share:.6g} times as much"
    return f"{LAW_IN_WORDS}; u is {input_words(arm)}, and {static}"


def law_answer(law: AnyLaw, arm: Arm) -> dict[str, Any]:
    """The gains, with the sign convention that they need, and what the loop closes through; or what a law reads."""
    plain = as_law(law)
    return signals_answer(plain, arm) if plain.gains is None else plain.gains.by_name | convention(arm)


def signals_answer(law: Law, arm: Arm) -> dict[str, Any]:
    """What a law reads, of which order, how late, and what it drives."""
    sign = "-" if law.sign < 0 else "+"
    late = f", {law.delay:g} s late" if law.delay else ""
    words = f"v = {sign}sum of C_i(s) y_i{late}; v is {input_words(arm)}, y = ({', '.join(law.signals)})"
    return {
        "law": law.name,
        "signals": dict(zip(law.signals, Signals(arm, law.signals).units, strict=True)),
        "law_order": law.order,
        "delay_s": law.delay,
        "sign_convention": words,
        "input": arm.input,
    }


def convention(arm: Arm) -> dict[str, Any]:
    """Of the answers of every loop: the sign of the moment's gain, the input, and each gain's unit."""
    units = {gain.name: unit_of(gain.name, arm) for gain in LISTED}
    return {"sign_convention": sign_of(arm), "input": arm.input, "gain_units": units}


class GainRow(NamedTuple):
    """One gain of a loop, or number of its law, and how far it may go alone."""

    gain: str
    value: float
    windows: Windows
    unit: str

    def spans(self, how: Callable[[float, int], str], digits: int, *pairs: Window | None) -> list[str]:
        """Intervals, with a star at each end that only bounds the search; those that there are."""
        ends = (
            [f"{how(end, digits)}{'*' * (self.windows.end(end) == 'search bound')}" for end in pair]
            for pair in pairs
            if pair is not None
        )
        return [f"({low}, {high})" for low, high in ends]


def gain_rows(found: Margins) -> list[GainRow]:
    """The gains of a loop, or the numbers of its law."""
    loop, rows = found.stability.loop, found.windows.items()
    units = {} if loop.gains is None else {name: shown_unit(name, loop.arm) for name in loop.numbers}
    return [GainRow(name, loop.numbers[name], windows, units.get(name, "")) for name, windows in rows]


def _joined(*pairs: Window) -> str:
    """The ends with every digit, for files."""
    return " ".join(repr(float(end)) for pair in pairs for end in pair)


NOT_STABLE = "none: not stable"
NOT_KNOWN = "not known"  # an exact margin, where nothing bounds L beyond the band
UNLIMITED = {"disk": 2.0, "peak_sensitivity": 1.0}  # sizes of a passive loop, at no frequency of its own; else inf
SAME_SIZE = 1e-7  # of such a size: so much rounding leaves next to a narrow resonance
WINDOW_COLUMNS = (  # of `GainRow`; JSON has the gain's name before each key
    Column("gain", "gain", on=(TERMINAL, *REPORT)),
    Column("unit", "unit", on=REPORT),
    Column("value", "value", digits=singly(plain, 5), printed=singly(general, 6), on=(TERMINAL, *REPORT)),
    Column("interval", of=lambda row: row.windows.around and list(row.windows.around), on=(JSON,)),
    Column("interval_ends", of=lambda row: row.windows.around and list(map(row.windows.end, row.windows.around)),
           on=(JSON,)),
    Column("windows", of=lambda row: list(row.windows.all), on=(JSON,)),
    Column("windows_ends", of=lambda row: [list(map(row.windows.end, pair)) for pair in row.windows.all], on=(JSON,)),
    Column("looked_at", of=lambda row: list(row.windows.looked_at), on=(JSON,)),
    Column("band_rad_s", of=lambda row: row.windows.band, on=(JSON,)),
    Column("", "stable around it", on=(TERMINAL,),
           of=lambda row: " ".join(row.spans(general, WINDOW_DIGITS, row.windows.around)) or "-"),
    Column("", "all stable windows", on=(TERMINAL,),
           of=lambda row: " ".join(row.spans(general, WINDOW_DIGITS, *row.windows.all)) or "none"),
    Column("stable_around_it", "stable around it", on=REPORT,
           of=lambda row: _joined(row.windows.around) if row.windows.around else NOT_STABLE,
           shown=lambda row: " ".join(row.spans(plain, PAGE_WINDOW_DIGITS, row.windows.around)) or NOT_STABLE),
    Column("stable_windows", "all stable windows", on=REPORT,
           of=lambda row: _joined(*row.windows.all) or "none",
           shown=lambda row: ", ".join(row.spans(plain, PAGE_WINDOW_DIGITS, *row.windows.all)) or "none"),
    Column("looked_at", "looked at", on=REPORT, of=lambda row: _joined(row.windows.looked_at),
           shown=lambda row: "({}, {})".format(*(plain(end, PAGE_WINDOW_DIGITS) for end in row.windows.looked_at))),
)  # fmt: skip
LAW_WINDOW_COLUMNS = (  # of `GainRow`, for the numbers of a law
    Column("number", "number of the law", of="gain", on=ANSWER),
    Column("value", "value", printed=singly(general, 6), on=ANSWER),
    *(column for column in WINDOW_COLUMNS if column.key not in ("gain", "value")),
)
MARGIN_COLUMNS = (  # of `LoopMargins`, beside the factors of the gain
    Column("phase_margin_deg", "phase margin", "deg", of="phase"),
    Column("phase_lag_deg", "phase lag", "deg", of="phase_lag"),
    Column("phase_lead_deg", "phase lead", "deg", of="phase_lead"),
    Column("delay_margin_s", "delay margin", "s", of="delay"),
    Column("disk_margin", "disk margin", of="disk"),
    Column("peak_sensitivity", "peak sensitivity", of="peak_sensitivity"),
    Column("peak_complementary_sensitivity", "peak complementary sensitivity", of="peak_complementary"),
)


class Crossover(NamedTuple):
    """Where |L| = 1, with the phase margin there [deg], or where L < 0, with the factor on L that puts a pole there."""

    omega_rad_s: float
    phase_margin_deg: float | str = ""
    factor: float | str = ""


def crossovers(found: LoopMargins) -> tuple[list[Crossover], list[Crossover]]:
    """Those with |L| = 1 and those with L < 0, ascending."""
    return [Crossover(*pair) for pair in found.gain_crossovers], [
        Crossover(w, "", t) for w, t in found.phase_crossovers
    ]


_AT = Column("omega_rad_s", "frequency", "rad/s", digits=singly(significant, 6), printed=singly(general, 7))
_MARGIN, _FACTOR = (
    Column(key, title, unit, digits=singly(significant, 5), printed=singly(general, 6))
    for key, title, unit in (("phase_margin_deg", "phase margin", "deg"), ("factor", "factor on L", ""))
)
_WHAT = Column("what", "what", of=lambda each: "|L| = 1" if each.factor == "" else "L < 0")
GAIN_CROSSOVERS, PHASE_CROSSOVERS, CROSSOVERS = (_AT, _MARGIN), (_AT, _FACTOR), (_AT, _WHAT, _MARGIN, _FACTOR)


def poles_answer(poles: Poles, certify: bool) -> dict[str, Any]:
    """Poles with Im >= 0, how many are unstable, and the box in which they are complete; proven discs if asked."""
    answer = {
        "arm": poles.loop.arm.name,
        **law_answer(poles.loop.law, poles.loop.arm),
        "poles": [[float(pole.real), float(pole.imag)] for pole in poles.values],
        "unstable": poles.unstable,
        "complete": True,
        "box": list(poles.box),
        "ends_at_shear_cutoff": poles.ends_at_shear_cutoff,
        "shear_cutoff_rad_s": poles.loop.arm.shear_cutoff,
    }
    if certify:
        discs = poles.certify()
        answer["proven_complete"] = True
        answer["discs"] = [{"re": disc.re, "im": disc.im, "radius": disc.radius} for disc in discs]
    return answer


def margins_answer(found: Margins) -> dict[str, Any]:
    """The verdict first; margins are null unless the loop is stable."""
    verdict = found.stability
    limits, sizes = found.in_band, sizes_of(found)
    in_band = by_gain = by_phase = None
    if limits is not None:
        by_gain, by_phase = (
            Table(columns=columns, record=each)
            for columns, each in zip((GAIN_CROSSOVERS, PHASE_CROSSOVERS), crossovers(limits), strict=True)
        )
        in_band = {"band_rad_s": limits.band, **{key: size for key, (_, size) in sizes.items()}, "at_rad_s": limits.at}
    return {
        "arm": verdict.loop.arm.name,
        **law_answer(verdict.loop.law, verdict.loop.arm),
        "verdict": verdict.verdict,
        "stable": verdict.is_stable,
        "unstable_roots": verdict.unstable_roots,
        "unstable_roots_infinite": verdict.unstable_roots_infinite,
        "band_rad_s": verdict.band,
        "beyond_the_band": verdict.tail,
        "known_beyond_the_band": verdict.is_known_beyond,
        "spectral_abscissa": verdict.poles.spectral_abscissa,
        **_known_of(found),
        "gain_margin": None if limits is None else list(limits.gain),
        **{key: exact for key, (exact, _) in sizes.items()},
        "at_rad_s": None
        if limits is None
        else {name: limits.at[name] for name in ("phase", "phase_lag", "phase_lead")},
        "in_band": in_band,
        "gain_crossovers": by_gain,
        "phase_crossovers": by_phase,
    }


def _known_of(found: Margins) -> dict[str, Any]:
    """What a theorem says of the law: Lyapunov's argument and the windows of gains at the hub, or the law's sign."""
    loop = found.stability.loop
    if loop.gains is None:
        signs = signs_of_loop(loop)
        return {
            "passivity": {"kind": signs.kind, "reason": signs.reason},
            "warnings": list(loop.warnings),
            "windows": Table(columns=LAW_WINDOW_COLUMNS, record=gain_rows(found)),
            "windows_note": unsettled(found) or None,
        }
    proof = lyapunov(loop.arm, loop.gains)
    rows = gain_rows(found)
    windows = Table(columns=WINDOW_COLUMNS, record=rows)
    return {
        "lyapunov": {"proven": proof.proven, "a1_over_a2": proof.a1_over_a2, "reason": proof.reason},
        **{f"{row.gain}_{key}": value for row, part in zip(rows, windows, strict=True) for key, value in part.items()},
        "windows_note": unsettled(found) or None,
    }


NO_WINDOWS = "no windows of the law's numbers: of a rig with a link without damping all modes meet on the axis"


def unsettled(found: Margins) -> str:
    """What the windows leave open where nothing is known beyond the band, in words; else empty.

    A theorem on the sign of a law, or small gain, tells nothing of the law with another number in it.
    """
    loop, words = found.stability.loop, reach_words(found.windows.values())
    if loop.gains is not None:
        return "" if found.stability.is_known_beyond else words
    if not found.windows and loop.arm.has_elastic_link:
        return NO_WINDOWS
    uncounted = [name for name in loop.law.numbers if found.windows and name not in found.windows]
    return words + (f"; of {', '.join(uncounted)} poles could not be counted" if uncounted else "")


def sizes_of(found: Margins) -> dict[str, tuple[float | None, float | None]]:
    """Of each of `MARGIN_COLUMNS` what is exact and what holds in the band; None where not known, or where none is."""
    limits: Any = found.in_band
    exact = {"delay": found.exact_delay, "disk": found.exact_disk, "peak_sensitivity": found.exact_peak}
    if found.exact_peak is None or math.isinf(found.exact_peak):  # T = 1 - S: as little known, or as large
        exact["peak_complementary"] = found.exact_peak
    sizes = {column.of: None if limits is None else getattr(limits, column.of) for column in MARGIN_COLUMNS}
    return {column.key: (exact.get(column.of, sizes[column.of]), sizes[column.of]) for column in MARGIN_COLUMNS}


class MarginRow(NamedTuple):
    """One of `MARGIN_COLUMNS` of a loop: exact, in the band, and at which frequency [rad/s] there; else words."""

    column: Column
    exact: float | str
    in_band: float
    at: float | str


def margin_rows(found: Margins, limits: LoopMargins) -> Iterator[MarginRow]:
    """A row a margin: not known where nothing bounds L, no exact phase where any delay destabilises."""
    for column, (exact, size) in zip(MARGIN_COLUMNS, sizes_of(found).values(), strict=True):
        assert size is not None
        hidden = column.unit == "deg" and not found.exact_delay
        known = "" if hidden else NOT_KNOWN if exact is None else exact
        is_anywhere = math.isclose(abs(size), UNLIMITED.get(column.of, math.inf), rel_tol=SAME_SIZE)
        yield MarginRow(column, known, size, "" if is_anywhere else limits.at[column.of])


def plane_table(names: Sequence[str], x: Real, y: Real, unstable: Whole) -> Table:
    """A row a point of the plane of two numbers: both, and the count of unstable poles there."""
    across, up = np.meshgrid(x, y)
    columns = (
        *(Column(name, of=values.ravel()) for name, values in zip(names, (across, up), strict=True)),
        Column("unstable_roots", of=["inf" if count == INFINITE else int(count) for count in unstable.ravel()]),
    )
    return Table(columns=columns)


def _counts(found: Plane) -> list[list[int | str]]:
    """Unstable poles over the grid, rows upwards, "inf" where they are infinitely many."""
    return [["inf" if count == INFINITE else int(count) for count in row] for row in found.unstable]


def map_answer(found: Plane) -> dict[str, Any]:
    """Unstable poles over the grid, rows upwards, "inf" where they are infinitely many, and the boundary curve."""
    inside = [
        [float(value) for value in point]
        for point in found.boundary
        if all(values[0] <= value <= values[-1] for value, values in zip(point, found.axes, strict=False))
    ]
    return {
        "arm": found.arm.name,
        ANGLE_GAIN: found.Kp,
        **convention(found.arm),
        **{name: values.tolist() for name, values in zip(PLANE, found.axes, strict=True)},
        "unstable_roots": _counts(found),
        "boundary": inside,
        "band_rad_s": found.band,
    }


def nyquist_answer(found: Nyquist) -> dict[str, Any]:
    """The verdict, the turns around -1 beside the unstable poles found in a box, and L on the contour for Im s >= 0."""
    verdict = found.verdict
    return {
        "arm": verdict.loop.arm.name,
        **law_answer(verdict.loop.law, verdict.loop.arm),
        "verdict": verdict.verdict,
        "encirclements": found.encirclements,
        "unstable_open": found.unstable_open,
        "unstable_by_nyquist": found.expected,
        "unstable_roots": verdict.unstable_roots,
        "on_axis": found.on_axis,
        "band_rad_s": verdict.band,
        "beyond_the_band": verdict.tail,
        "s": [[s.real, s.imag] for s in found.s.tolist()],
        "L": [[L.real, L.imag] for L in found.L.tolist()],
    }


def spill_answer(found: Spill) -> dict[str, Any]:
    """The verdict, what it means in words, and a row a model."""
    verdict = found.verdict
    return {
        "arm": verdict.loop.arm.name,
        **signals_answer(as_law(verdict.loop.gains or verdict.loop.law), verdict.loop.arm),
        "verdict": verdict.verdict,
        "stable": verdict.is_stable,
        "in_words": found.in_words,
        "unstable_roots": verdict.unstable_roots,
        "unstable_roots_infinite": verdict.unstable_roots_infinite,
        "band_rad_s": verdict.band,
        "known_beyond_the_band": verdict.is_known_beyond,
        "beyond_the_band": verdict.tail,
        "driven": [[float(pole.real), float(pole.imag)] for pole in found.driven],
        "first_mode": found.first_mode,
        "shown_from_modes": found.shown_from,
        "models": Table(columns=SPILL, record=found),
    }


def plane_answer(found: Plane) -> dict[str, Any]:
    """Unstable poles over the grid, rows of the second number, as plain lists."""
    return {
        "arm": found.arm.name,
        **signals_answer(found.law, found.arm),
        "vary": list(found.vary),
        "x": found.x.tolist(),
        "y": found.y.tolist(),
        "unstable_roots": _counts(found),
        "band_rad_s": found.band,
    }
