"""Data sets 58 of a UFF file by the format's own table: double precision, even spacing (4E20.12)."""

import numpy as np


def data_set(values, start, step, function=4, abscissa=18, name="NONE", unit="NONE"):
    """The text of one: a frequency response function unless its function and abscissa are named."""
    pairs = [[value.real, value.imag] if np.iscomplexobj(values) else [value] for value in values]
    flat = [f"{x:20.12E}" for pair in pairs for x in pair]
    body = ["".join(flat[i : i + 4]) for i in range(0, len(flat), 4)]
    place = f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{1:10d}{3:4d} {'NONE':10s}{2:10d}{3:4d}"
    kind = 6 if np.iscomplexobj(values) else 4
    form = f"{kind:10d}{len(values):10d}{1:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}"
    labels = [(abscissa, "NONE"), (12, unit), (13, "NONE"), (0, "NONE")]
    axes = [f"{of:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {label:20s}" for of, label in labels]
    return "\n".join(["    -1", "    58", name, *["NONE"] * 4, place, form, *axes, *body, "    -1", ""])
