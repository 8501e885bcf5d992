"""Responses as commands have them: the answers of `tfarm response` and `tfarm bode`, and their tables."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tfarm.columns import ANSWER, REPORT, Column, Table
from tfarm.digits import general, lined, scientific, singly, unit, within
from tfarm.exact.values import roads_answer
from tfarm.spectrum.answers import EIGENVALUE_ERROR

from .frequency import Bode, Extremum
from .transfer import TransferFunction

HERTZ = 2 * math.pi  # rad/s
ZERO_ON_AXIS = 1e-13  # of |s|: what rounding leaves of Re s where a zero of an elastic link lies on the axis


def response_answer(G: TransferFunction, s: np.ndarray[Any, Any], digits: int | None) -> dict[str, Any]:
    """Values of one output at the points s; pairs of strings where more than 15 digits are asked for."""
    if digits is not None and digits > 15:
        value: list[Any] = [list(G.digits(complex(point), digits)) for point in s]
    else:
        value = [[float(v.real), float(v.imag)] for v in G(s)]
    return {
        "arm": G.arm.name,
        "input": G.input,
        "input_unit": G.input_unit,
        "output": G.outputs[0],
        "unit": G.units[0],
        "method": G.method,
        **({} if G.x is None else {"x": G.x}),
        "s": [[float(p.real), float(p.imag)] for p in s],
        "value": value,
    }


def by_methods_answer(G: TransferFunction, s: np.ndarray[Any, Any]) -> dict[str, Any]:
    """One output at s by each method, and by what share of its size each differs from the closed form."""
    return {
        "arm": G.arm.name,
        "output": G.outputs[0],
        "unit": G.units[0],
        "s": [[float(p.real), float(p.imag)] for p in s],
        **roads_answer(G.by_methods(s)),
    }


def points_table(answer: dict[str, Any]) -> Table:
    """A row a point: s, and the output over the input."""
    output, unit, twelve = answer["output"], f"{answer['unit']} / {answer['input_unit']}", singly(general, 12)
    (re_s, im_s), (re, im) = (zip(*answer[name], strict=True) for name in ("s", "value"))
    return Table(
        columns=(
            Column("re_s", "Re s", "1/s", of=re_s, digits=twelve),
            Column("im_s", "Im s", "1/s", of=im_s, digits=twelve),
            Column(f"re_{output}", f"Re {output}", unit, of=re, digits=twelve),
            Column(f"im_{output}", f"Im {output}", unit, of=im, digits=twelve, head="Im"),
        )
    )


class Root(NamedTuple):
    """A pole or zero of a Bode plot: s [1/s], and |G| at i Im s, of a real one at i |s|.

    `real` is Re s as a page has it: 0 of a zero of an elastic link where rounding alone is left of it.
    """

    kind: str
    s: complex
    magnitude: float
    real: float


def roots_table(data: Bode, *kinds: str, stem: str = "", caption: str = "") -> Table:
    """A row a pole or zero of the upper half-plane, of these kinds."""
    elastic, rows = data.arm.has_elastic_link, []
    roots = {"pole": (data.poles, data.at_poles), "zero": (data.zeros, data.at_zeros)}
    for kind in kinds:
        for s, size in zip(*(each.tolist() for each in roots[kind]), strict=True):
            on_axis = kind == "zero" and elastic and abs(s.real) < ZERO_ON_AXIS * abs(s)
            rows.append(Root(kind, s, size, 0.0 if on_axis else s.real + 0.0))
    columns = (  # of `Root`
        Column("kind", "kind", on=REPORT),
        Column("re", "Re s", "1/s", of="s.real", on=ANSWER,
               shown=lambda root: within(root.s.real, EIGENVALUE_ERROR * abs(root.s), 10)),
        Column("im", "Im s", "rad/s", of="s.imag", digits=singly(general, 10), on=ANSWER),
        Column("real_1_s", "Re s", "1/s", of="real", digits=lined(8, 4), on=REPORT),
        Column("imaginary_rad_s", "Im s", "rad/s", of="s.imag", digits=lined(8, 7), on=REPORT),
        Column("frequency_hz", "Im s/2π", "Hz", of=lambda root: root.s.imag / HERTZ, digits=lined(8, 7),
               head="Im s/2 pi [Hz]", printed=singly(general, 8)),
        Column("damping_percent", "damping ratio", "%", of=lambda root: -100 * root.real / abs(root.s) + 0.0,
               digits=lined(5, 3), on=REPORT),
        Column("magnitude", "magnitude there", unit(data.gain_unit), digits=singly(scientific, 4),
               head="|G| there", printed=singly(general, 6)),
    )  # fmt: skip
    title = f"Poles and zeros, {data.input_label} to {data.label}"
    return Table(stem=stem, title=title, caption=caption, columns=columns, record=rows)


def extrema_table(extrema: tuple[Extremum, ...], unit_of_gain: str) -> Table:
    """A row a peak or dip: its frequency, and |G| there."""
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of="omega", digits=singly(general, 7)),
        Column("frequency_hz", "frequency", "Hz", of=lambda each: each.omega / HERTZ, digits=singly(general, 7)),
        Column("magnitude", "|G|", unit(unit_of_gain), digits=singly(general, 6), head="|G|"),
    )
    return Table(columns=columns, record=extrema)


def bode_answer(data: Bode) -> dict[str, Any]:
    """Poles and zeros of a Bode plot with |G| at i Im s ("inf" and 0 on the axis), peaks and dips, then its curve.

    Poles and zeros are complete up to the band's end in Im s, and in Re s between the two numbers beside each.  Peaks
    and dips are the local maxima and minima of |G| inside the band.
    """
    return {
        "arm": data.arm.name,
        "input": "hub_angle" if data.arm.is_locked else data.arm.input,
        "output": data.output,
        **({} if data.x is None else {"x": data.x}),
        "unit": data.gain_unit,
        "band_rad_s": list(data.band),
        "poles": roots_table(data, "pole"),
        "zeros": roots_table(data, "zero"),
        "peaks": extrema_table(data.peaks, data.gain_unit),
        "dips": extrema_table(data.dips, data.gain_unit),
        "poles_between_re_1_s": list(data.pole_width),
        "zeros_between_re_1_s": list(data.zero_width),
        "omega_rad_s": data.omega.tolist(),
        "value": [[v.real, v.imag] for v in data.value.tolist()],
        "phase_deg": data.phase.tolist(),
    }


def bode_table(data: Bode, stem: str = "") -> Table:
    """The curve of a Bode plot, a row a frequency: the numbers of its picture."""
    of = data.gain_unit
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of="omega"),
        Column("frequency_hz", "frequency", "Hz", of=data.omega / HERTZ),
        Column("real", "real part", of, of="value.real"),
        Column("imaginary", "imaginary part", of, of="value.imag"),
        Column("magnitude", "magnitude", of, of=abs(data.value)),
        Column("phase_deg", "phase", "deg", of="phase"),
    )
    return Table(stem=stem, title=f"{data.input_label} to {data.label}", columns=columns, record=data)
