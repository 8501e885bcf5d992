"""Root loci on an arm's page: where the poles go along each gain, and what K2 = 1 and beyond does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, shown_unit, written_unit
from tfarm.arrays import Real
from tfarm.columns import Column, Table
from tfarm.digits import how_many, kept_digits, plain, scientific, significant, singly
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.loci import GAPS_HELD, POLE_DIGITS, Loci, held_branches, loci, most_damped
from tfarm.loop.stability import MARGIN_OF_ZERO, Stability, stability
from tfarm.plots.roots import draw_loci
from tfarm.report.cases import continuous_cases, edge_of_K2, has_loop
from tfarm.report.loop_section import poles_of
from tfarm.report.sections import PageSection, Picture
from tfarm.spectrum.table import default_gains, rate_unit

LISTED_MOMENT_GAINS = (0.9, 1.0, 1.01, 1.1, 1.5)  # values of K2 whose exact poles are listed
AROUND_EDGE = (0.9, 1.1)  # times the edge, if that lies above all of them
RANGE_OF_K2 = (-1.0, 1.6)  # of the locus, times what balances a torque: both sides of 0, and beyond 1
shortly = partial(plain, digits=4)  # how a gain is written in a sentence
LOCUS_CAPTION = (
    "Broad lines: exact poles, followed along {name}. Dashed: python-control on a modal model of order {order}, "
    "with an error of at most {worst} of |s|. At the left all branches on one scale, at the right each mode on its "
    "own. Shown are Im s ≥ 0, and the lower half of a pair that meets on the real axis."
)
BEYOND_UNDAMPED = (
    "Exact poles, each list complete in its box. At C = 0 and K2 = 1 the law cancels the root moment: the hub no "
    "longer feels the arm, and every mode with the hub at rest stays undamped. Any K2 above 1 makes every flexible "
    "mode unstable."
)
BEYOND_DAMPED = "Exact poles, each list complete in its box."
BACKWARDS = " At K1 = 0 a real pole is unstable from K2 = J/(J − I_h) = {K2} on: torque then turns the arm backwards."
NOT_FOLLOWED = (
    "Along {name} the branches of this arm could not be followed: on the way poles come too near to each other, or to "
    "−1/C, to be told apart. No line is drawn rather than one that may jump; where the poles are at a few gains, each "
    "list complete, stands in the table."
)
BRANCH_ENDS = (
    " A branch ends at {name} = {gain}: there its pole comes to −1/C, where real poles accumulate, or cannot be told."
)
LISTED_RATE_GAINS = (
    0.0,
    0.05,
    0.2,
    0.5,
    1.0,
    2.0,
)  # times J w1: values of K1 whose poles are listed for want of a locus


def crossing_table(data: Loci, stem: str) -> Table:
    """Where the branches cross the imaginary axis."""
    found = list(data.exact.crossings)
    gain, omega = (kept_digits([getattr(each, key) for each in found], POLE_DIGITS) for key in ("gain", "omega"))
    return Table(
        stem=stem,
        title=f"Crossings of the imaginary axis along {data.name}",
        caption="Solved for gain and frequency together on the exact characteristic function, to the digits shown.",
        record=found,
        columns=(
            Column(data.name, data.name, data.unit, of=gain, digits=singly(significant, 8)),
            Column("omega_rad_s", "frequency", "rad/s", of=omega, digits=singly(significant, 7)),
            Column("frequency_hz", "", "Hz", of=[w / (2 * math.pi) for w in omega], digits=singly(significant, 7)),
            Column(
                "mode",
                "mode",
                of=lambda each: "of no branch" if each.branch is None else int(data.exact.mode[each.branch]),
            ),
            Column("becomes", "becomes", of="direction"),
        ),
    )


def gap_table(data: Loci, stem: str) -> Table:
    """How far each reduced branch is from the exact one."""
    gap, names = kept_digits(data.reduced.gap, GAPS_HELD), [f"mode {n}" if n else "rigid body" for n in data.exact.mode]
    return Table(
        stem=stem,
        title=f"How far python-control's locus is from the exact one, along {data.name}",
        caption=f"Largest distance over the whole range, as a share of |s| (or of the first natural frequency, where "
        f"that is more). The reduced model has order {data.reduced.order}; its poles are those of "
        "control.root_locus_map, taken to their last digits by Newton's method.",
        columns=(
            Column("branch", "branch from", of=names),
            Column("gap", "largest gap", "of |s|", of=gap, digits=singly(scientific, 3)),
        ),
    )


def loci_data(data: Loci, stem: str) -> Table:
    """The exact and the reduced branches, to the digits that hold on every processor."""
    pairs = (("exact", data.exact.branches), ("reduced", data.reduced.branches))
    columns = [Column(data.name, data.name, data.unit, of=data.exact.gain)]
    for name, branches in pairs:
        for n, row in enumerate(held_branches(branches)):
            for part, values in (("re", row.real), ("im", row.imag)):
                cells = ["" if np.isnan(value) else value for value in values.tolist()]
                columns.append(Column(f"{name}_{n}_{part}", f"{name} branch {n}, {part}", "1/s", of=cells))
    return Table(stem=stem, title=f"Loci along {data.name}", columns=tuple(columns))


def locus_section(arm: Arm, chain: Chain) -> PageSection:
    """Root loci along each gain, poles at K2 = 1 and beyond, and those of the default and the best gains."""
    words, blocks = [], list[Picture | Table]()
    held = default_gains(arm)
    low, high = (share * arm.input_per_torque for share in RANGE_OF_K2)
    ranges = {RATE_GAIN: (0.0, 2.0 * rate_unit(arm)), **({MOMENT_GAIN: (low, high)} if has_loop(arm) else {})}
    for name, (start, stop) in ranges.items():
        try:
            data = loci(arm, held, name, start, stop)
        except ConvergenceError:
            words.append(NOT_FOLLOWED.format(name=name))
            blocks += [rates_table(arm, held)] * (name == RATE_GAIN)
            continue
        words.append(_along(data))
        blocks += [_locus_picture(data), gap_table(data, f"locus-{name}-gap")]
        if data.exact.crossings:
            blocks.append(crossing_table(data, f"locus-{name}-crossings"))
    if has_loop(arm):
        blocks.append(beyond_table(arm, held))
    more, tables = poles_of(continuous_cases(arm, chain))
    return PageSection(anchor="locus", title="Root loci", words=[*words, *more], blocks=[*blocks, *tables])


def _along(data: Loci) -> str:
    """The first crossing of the imaginary axis, where mode 1 is damped most, and the gap to python-control's locus."""
    exact, found, name = data.exact, most_damped(data.exact), data.name
    unit, fixed = (
        written_unit(name, exact.arm),
        [exact.gains.gain_text(each, shortly) for each in PLANE if each != name],
    )
    unstable = [each.gain for each in exact.crossings if each.direction == "unstable"]
    parts = ["no drawn branch becomes unstable"]
    if unstable:
        parts = [f"a branch becomes unstable at {name} = {significant(min(unstable), 6)}{unit}"]
    if found is not None:
        damped = f"is damped most, {significant(100 * found.damping_ratio, 3)} % of critical, at" * found.swings_on
        parts.append(
            f"mode 1 {damped or 'no longer oscillates a little above'} {name} = {significant(found.gain, 3)}{unit}"
        )
    size = scientific(data.reduced.worst, 2)
    parts.append(f"python-control's locus of order {data.reduced.order} is within {size} of |s| of the exact one")
    ended = "".join(BRANCH_ENDS.format(name=name, gain=significant(gain, 3)) for _, gain in exact.ends)
    return f"Along {name}, with {fixed[0]}: {'; '.join(parts)}.{ended}"


def _locus_picture(data: Loci) -> Picture:
    name = data.name
    many = len(data.exact.crossings)
    return Picture(
        stem=f"locus-{name}",
        title=f"Closed-loop poles along {name}",
        caption=LOCUS_CAPTION.format(name=name, order=data.reduced.order, worst=scientific(data.reduced.worst, 2)),
        alt=f"Root locus along {name}: {len(data.exact.branches)} branches, {how_many(many, 'crossing')} of the "
        f"imaginary axis; the reduced branches are within {scientific(data.reduced.worst, 2)} of |s|.",
        figure=draw_loci(data),
        data=loci_data(data, f"locus-{name}-data"),
    )


def beyond_table(arm: Arm, held: HubFeedback) -> Table:
    """Verdict and poles of the exact loop for a few K2 around 1 and beyond."""
    edge, unit = edge_of_K2(arm, held) or 0.0, arm.input_per_torque
    more = [float(f"{share * edge:.3g}") for share in AROUND_EDGE if edge > LISTED_MOMENT_GAINS[-1] * unit]
    gains = np.array(
        [
            *(share * unit for share in LISTED_MOMENT_GAINS),
            *(gain for gain in more if LISTED_MOMENT_GAINS[-1] * unit < gain),
        ]
    )
    on_edge = np.isclose(gains, edge, rtol=1e-9, atol=0.0) & (not arm.is_undamped)  # no list of poles ends there
    laws = [held.having(MOMENT_GAIN, float(gain)) for gain in gains]
    found = [None if on else _judged(arm, law) for law, on in zip(laws, on_edge, strict=True)]
    one = held.having(MOMENT_GAIN, unit).gain_text(MOMENT_GAIN, shortly, arm)
    title = f"What {one} and beyond does, at {held.gain_text(RATE_GAIN, shortly)}"
    return _poles_table("beyond", title, _beyond_caption(arm), MOMENT_GAIN, arm, gains, found)


def rates_table(arm: Arm, held: HubFeedback) -> Table:
    """Verdict and poles of the exact loop for a few rate gains."""
    gains = np.array([float(f"{share * rate_unit(arm):.3g}") for share in LISTED_RATE_GAINS])
    found = [_judged(arm, held.having(RATE_GAIN, float(gain))) for gain in gains]
    title = f"Poles at a few {RATE_GAIN}, at {held.gain_text(MOMENT_GAIN, shortly)}"
    caption = "Exact poles, each list complete in its box."
    return _poles_table("rates", title, caption, RATE_GAIN, arm, gains, found)


def _poles_table(
    stem: str, title: str, caption: str, name: str, arm: Arm, gains: Real, found: Sequence[Stability | None]
) -> Table:
    """A row a gain: verdict, unstable poles, the rightmost and the first pairs."""
    return Table(
        stem=stem,
        title=title,
        caption=caption,
        record=list(found),
        columns=(
            Column(name, name, shown_unit(name, arm), of=gains, digits=singly(plain, 4)),
            Column("verdict", "verdict", of=lambda it: it.verdict if it else "on the axis, not decided"),
            Column("unstable_poles", "unstable poles",
                   of=lambda it: ("infinitely many" if it.unstable_roots_infinite else it.unstable_roots)
                   if it else "not decided"),
            Column("spectral_abscissa_1_s", "fastest growth", "1/s",
                   of=lambda it: it.poles.spectral_abscissa if it else "", shown=_growth),
            Column("first_pairs", "first pairs of poles, Re ± i Im [1/s]", of=_first_pairs),
        ),
    )  # fmt: skip


def _growth(it: Stability | None) -> str:
    """The largest real part; 0 where rounding is all there is of it."""
    if it is None:
        return "-"
    rightmost = it.poles.spectral_abscissa
    size = abs(it.poles.moving[it.poles.moving.real == rightmost]).max(initial=0.0)
    return "0" if abs(rightmost) <= MARGIN_OF_ZERO * size else significant(rightmost, 4)


def _judged(arm: Arm, law: HubFeedback) -> Stability | None:
    """The verdict, or None where it cannot be had: a pole on the axis to working precision at C > 0."""
    try:
        return stability(arm, law)
    except ConvergenceError:
        return None


def _first_pairs(it: Stability | None) -> str:
    if it is None:
        return ""
    swinging = it.poles.values[it.poles.values.imag > 0][:3]
    return ",  ".join(f"{plain(p.real, 4)} ± {significant(p.imag, 5)} i" for p in swinging)


def _beyond_caption(arm: Arm) -> str:
    """What is known without damping, and where torque turns the arm backwards."""
    J, hub = arm.total_inertia, arm.hub.inertia
    backwards = BACKWARDS.format(K2=significant(J / (J - hub), 5)) if arm.has_rigid_mode and arm.is_uniform else ""
    return (BEYOND_UNDAMPED if arm.is_uniform and not arm.damping else BEYOND_DAMPED) + backwards
