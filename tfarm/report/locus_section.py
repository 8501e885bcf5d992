"""Root loci on an arm's page: where the poles go along each gain, and what K2 = 1 and beyond does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.errors import ConvergenceError
from tfarm.loop.stability import Stability, stability
from tfarm.report.digits import plain, scientific, significant
from tfarm.report.figures import Picture
from tfarm.report.loci import Loci, crossing_table, draw_loci, gap_table, loci, loci_data
from tfarm.report.loop_laws import SIGN
from tfarm.report.sections import Section
from tfarm.report.tables import Column, Table, number_column, text_column
from tfarm.spectrum.scales import default_gains, rate_unit

BEYOND = (0.9, 1.0, 1.01, 1.1, 1.5)  # values of K2 whose exact poles are listed
RANGE_OF_K2 = (-1.0, 1.6)

SEEN = (
    "Broad lines: exact poles, followed along {name}. Dashed: python-control on a modal model of order {order}, its "
    "error band (at most {worst} of |s|) shaded where it is wider than the line. At the left all branches on one "
    "scale, at the right each mode on its own. Shown are Im s ≥ 0, and the lower half of a pair that meets on the real "
    "axis."
)
UNDAMPED = (
    "Exact poles. At C = 0 and K2 = 1 the law cancels the root moment: the hub no longer feels the arm, and every mode "
    "with the hub at rest stays undamped. Any K2 above 1 makes every flexible mode unstable."
)
DAMPED = (
    "Exact poles. The material damps the modes, so the edge is not exactly at K2 = 1; from the first unstable row on, "
    "more K2 drives more modes."
)
BACKWARDS = (
    " From K2 = J/(J − I_h) = {K2} on, a real pole is unstable even at K1 = 0: torque then turns the arm backwards."
)


def locus_section(arm: Arm) -> Section:
    """Where the poles go as each gain grows, and what K2 = 1 and beyond does."""
    held = default_gains(arm)
    words, blocks = [], list[Picture | Table]()
    ranges = {"K1": (0.0, 2.0 * rate_unit(arm)), "K2": RANGE_OF_K2}
    for name, (start, stop) in ranges.items():
        try:
            data = loci(arm, held, name, start, stop)
        except ConvergenceError as error:
            words.append(f"The locus along {name} could not be computed and is left out: {error}.")
            continue
        words.append(_locus_words(data))
        blocks += [_locus_picture(data), gap_table(data, f"locus-{name}-gap")]
        if data.exact.crossings:
            blocks.append(crossing_table(data, f"locus-{name}-crossings"))
    blocks.append(beyond_table(arm, held))
    return Section(anchor="locus", title="Where do the poles go?", words=[*words, SIGN], blocks=blocks)


def _locus_words(data: Loci) -> str:
    size = scientific(data.reduced.worst, 2)
    gap = f"python-control's locus of order {data.reduced.order} is within {size} of |s| of the exact one."
    return f"{_more_K1(data) if data.name == 'K1' else _more_K2(data)}; {gap}"


def _more_K1(data: Loci) -> str:
    """How the damping of the first mode rises, and whether it falls again."""
    exact = data.exact
    rows = exact.branches[(exact.mode == 1) & (exact.branches.imag > 0).any(axis=1)]
    if not rows.size:
        return f"More K1, with K2 = {plain(exact.law.K2)} held"
    ratio = np.where(rows[0].imag > 0, -rows[0].real / np.maximum(abs(rows[0]), 1e-300), -np.inf)
    at = int(np.argmax(ratio))
    then = ", and less from there on: the hub is then held too firmly to take energy out" if at < ratio.size - 1 else ""
    best_ratio, gain = significant(100 * float(ratio[at]), 3), significant(float(exact.gain[at]), 3)
    return (
        f"More K1 (K2 = {plain(exact.law.K2)} held) damps the first mode up to {best_ratio} % of critical at "
        f"K1 = {gain} N m s/rad{then}"
    )


def _more_K2(data: Loci) -> str:
    """From where on the loop is unstable."""
    exact = data.exact
    more = f"More K2 (K1 = {plain(exact.law.K1, 4)} held)"
    unstable = [each for each in exact.crossings if each.direction == "unstable"]
    if not unstable:
        return f"{more} makes no branch that is drawn unstable in this range"
    first = min(each.gain for each in unstable)
    many = [significant(each.omega, 4) for each in unstable if each.gain < first + 1e-6]
    return (
        f"{more} makes the loop unstable from K2 = {significant(first, 6)} on, where poles cross at {_list(many)} rad/s"
    )


def _list(texts: list[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def _locus_picture(data: Loci) -> Picture:
    name = data.name
    many = len(data.exact.crossings)
    return Picture(
        stem=f"locus-{name}",
        title=f"Closed-loop poles along {name}",
        caption=SEEN.format(name=name, order=data.reduced.order, worst=scientific(data.reduced.worst, 2)),
        alt=f"Root locus along {name}: {len(data.exact.branches)} branches, {many} crossing{'s' * (many != 1)} of the "
        "imaginary axis; exact and reduced branches coincide.",
        figure=draw_loci(data),
        data=loci_data(data, f"locus-{name}-data"),
    )


def beyond_table(arm: Arm, held: HubFeedback) -> Table:
    """Verdict and poles of the exact loop for a few K2 around 1 and beyond."""
    found = [_judged(arm, replace(held, K2=K2)) for K2 in BEYOND]
    K2 = np.array(BEYOND)
    growth = np.array([it.poles.spectral_abscissa if it else np.inf for it in found])
    counts: list[int | str] = [_count(it) for it in found]
    pairs = [_first_pairs(it) for it in found]
    return Table(
        stem="beyond",
        title="What K2 = 1 and beyond does, at K1 = " + plain(held.K1, 4),
        caption=_beyond_caption(arm),
        columns=(
            number_column("K2", "K2", "", K2, [plain(float(x)) for x in K2]),
            text_column("verdict", "verdict", [it.verdict if it else "on the axis, not decided" for it in found]),
            Column(key="unstable_poles", title="unstable poles", values=counts, cells=[str(c) for c in counts]),
            number_column("spectral_abscissa_1_s", "fastest growth", "1/s", growth,
                          [significant(float(x), 4) for x in growth]),
            text_column("first_pairs", "first pairs of poles, Re ± i Im [1/s]", pairs),
        ),
    )  # fmt: skip


def _judged(arm: Arm, law: HubFeedback) -> Stability | None:
    """The verdict, or None where it cannot be had: a pole on the axis to working precision at C > 0."""
    try:
        return stability(arm, law)
    except ConvergenceError:
        return None


def _count(it: Stability | None) -> int | str:
    if it is None:
        return "not decided"
    return "infinitely many" if it.unstable_roots_infinite else it.unstable_roots


def _first_pairs(it: Stability | None) -> str:
    if it is None:
        return ""
    swinging = it.poles.values[it.poles.values.imag > 0][:3]
    return ",  ".join(f"{plain(p.real, 4)} ± {significant(p.imag, 5)} i" for p in swinging)


def _beyond_caption(arm: Arm) -> str:
    J, hub = arm.total_inertia, arm.hub.inertia
    backwards = BACKWARDS.format(K2=significant(J / (J - hub), 5)) if arm.has_rigid_mode else ""
    return (DAMPED if arm.link.damping else UNDAMPED) + backwards
