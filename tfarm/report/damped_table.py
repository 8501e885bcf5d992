"""The damped modes beside the undamped ones: eigenvalues, damping ratios, and the box in which none is missing."""

from __future__ import annotations

from tfarm.report.digits import aligned
from tfarm.report.tables import Column, Table, number_column
from tfarm.spectrum import DampedModes, Modes, damped_modes

DAMPED = (
    "Eigenvalues of the arm with its own damping, C = {C:g} s, each continued from the undamped mode of its number. "
    "All {count} eigenvalues with {left} < Re s < {right} 1/s and |Im s| < {top} rad/s are listed (conjugates "
    "counted{rigid}): each is enclosed in a disc of 12 digits that holds exactly one, and the argument principle in "
    "ball arithmetic counts those in the box. Beyond any such box there are more: shear is undamped in this model, so "
    "lightly damped modes exist at ever higher frequency, and the slow real eigenvalues of overdamped bending modes "
    "accumulate at -1/C = {limit} 1/s."
)


def damped_table(modes: Modes) -> Table:
    """The table of the arm's damped modes, each number proven to 12 digits and printed to fewer."""
    damped = damped_modes(modes)
    damped.certify(12)
    C, box, one = modes.arm.link.damping, damped.box, damped.eigenvalues[:, 0]
    edges = {"left": box.re_min, "right": box.re_max, "top": box.im_max, "limit": -1 / C}
    rigid = ", with 0 twice" if modes.arm.has_rigid_mode else ""
    words = {name: _rounded(value) for name, value in edges.items()}
    return Table(
        stem="damped-modes",
        title="Damped modes",
        caption=DAMPED.format(C=C, count=damped.count, rigid=rigid, **words),
        columns=(
            Column(key="index", title="mode", values=damped.index.tolist(), cells=[str(i) for i in damped.index]),
            number_column("eigenvalue_re", "Re s", "1/s", one.real, aligned(one.real, 7, least=6)),
            _imaginary(damped),
            number_column("damping_ratio", "damping ratio", "-", damped.damping_ratio, _ratios(damped)),
        ),
    )


def _imaginary(damped: DampedModes) -> Column:
    """Im s, or the second of two real eigenvalues."""
    one, two = damped.eigenvalues.T
    plain = aligned(one.imag, 8, least=7)
    cells = [
        f"overdamped, and {two[n].real:.7g}" if overdamped else plain[n]
        for n, overdamped in enumerate(damped.is_overdamped)
    ]
    return Column(key="eigenvalue_im", title="Im s", unit="rad/s", values=one.imag.tolist(), cells=cells)


def _ratios(damped: DampedModes) -> list[str]:
    return [f"{ratio:.5f}" if index else "0" for ratio, index in zip(damped.damping_ratio, damped.index, strict=True)]


def _rounded(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
