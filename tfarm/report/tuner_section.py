"""Does a self-tuning gain help?  The tuner beside what it has to beat, what it learns, and where it is proven."""

from __future__ import annotations

import math

import numpy as np

from tfarm.arm import Arm
from tfarm.dsp import Gains
from tfarm.errors import CertificationError
from tfarm.report.digits import aligned, plain, significant
from tfarm.report.figures import Picture
from tfarm.report.loop_laws import SIGN, has_loop, why_no_loop
from tfarm.report.overlay import overlay
from tfarm.report.sampled_section import SHORT_SIGN
from tfarm.report.sections import Fact, Section
from tfarm.report.tables import Column, Table, data_column, number_column, text_column
from tfarm.report.time_responses import signal_columns
from tfarm.report.tuner_pictures import draw_cost_map, draw_curves, draw_gain, draw_response
from tfarm.report.tuner_study import COARSE, MAP_SEEDS, MAP_TRIALS, NOMINAL, SEEDS, Curves, TunerStudy, tuner_study

TITLE = "The gain tuner: does a self-tuning gain help?"
UNDAMPED = (
    "This arm has no damping. At 10 ms its high modes then neither decay by themselves nor are they all damped by the "
    "loop, so no range of moving gains can be proven for all of them, and the tuner is not trained here. The page of "
    "sasaki2012-lab, the same arm as the paper's with a little damping, has the answer."
)


def tuner_section(arm: Arm) -> Section:
    """The tuner with the paper's figures on a damped arm; one sentence for any other."""
    reason = why_not(arm)
    if reason:
        return Section(anchor="tune", title=TITLE, words=(reason,))
    try:
        data = tuner_study(arm)
    except CertificationError as error:
        words = f"No tuner here: no range of gains is proven stable for a gain that moves ({error})."
        return Section(anchor="tune", title=TITLE, words=(words,))
    return section_of(data)


def section_of(data: TunerStudy) -> Section:
    """The section on numbers that are there already."""
    return Section(
        anchor="tune",
        title=TITLE,
        facts=headline_facts(data),
        words=(short_answer(data), shaping_words(data), bound_words(data), learning_words(data), SIGN),
        blocks=(
            _gain_picture(data),
            _slew_picture(data),
            _coarse_picture(data),
            comparison_table(data),
            _curves_picture(data),
            _map_picture(data),
        ),
    )


def why_not(arm: Arm) -> str:
    """The sentence for an arm on which no tuner is trained; empty where one is."""
    if not has_loop(arm):
        return why_no_loop(arm)
    if not arm.has_rigid_mode:
        return "The tip of this arm is held: it makes no slew, and there is nothing for the tuner to learn from."
    return UNDAMPED if arm.link.damping == 0 else ""


# ------------------------------------------------------------ words


def short_answer(data: TunerStudy) -> str:
    """How much the tuner gains over the best constant gain."""
    tuning, final = data.tuning, data.curves[0].final
    best, without = tuning.best_constant.cost, tuning.without.cost
    median = float(np.quantile(final, 0.5, method="nearest"))
    free = float(np.quantile(data.curves[1].final, 0.5, method="nearest"))
    below = int((final < best).sum())
    taken = 100 * (1 - best / without)
    gain = 100 * (1 - median / best)
    lead = "A little" if 0 < gain < 15 else "Yes" if gain >= 15 else "No"
    more = "lowers it by" if gain > 0 else "raises it by"
    return (
        f"{lead}. A constant K2 of {significant(tuning.best_constant.gain, 3)} already takes {significant(taken, 2)} % "
        f"off the cost of a slew ({significant(without, 3)} without moment feedback, {significant(best, 3)} with it); "
        f"a gain that tunes itself {more} another {significant(abs(gain), 2)} %, to {significant(median, 3)} in the "
        f"median of {final.size} seeds. {below} of {final.size} seeds end below the best constant gain. Without the "
        f"guard, and so without a proof, it would be {significant(100 * (1 - free / best), 2)} %."
    )


def shaping_words(data: TunerStudy) -> str:
    """What input shaping does instead."""
    costs = {kind: record.cost for kind, (_, record) in data.tuning.shaped.items()}
    late = {
        kind: trial.task.busy_until - data.tuning.trial.task.busy_until
        for kind, (trial, _) in data.tuning.shaped.items()
    }
    told = " and ".join(
        f"{kind} has {significant(costs[kind], 2)}, arriving {significant(1e3 * late[kind], 3)} ms later"
        for kind in costs
    )
    return (
        f"What one would try first is cheaper: shaping the reference, with no moment feedback at all, {told} (each "
        "judged by its own slew). Shaping cannot answer disturbances, which feedback can."
    )


def bound_words(data: TunerStudy) -> str:
    """How far everything is from what is possible, and what is proven."""
    bound, guard = data.tuning.bound.cost, data.tuning.training.guard
    return (
        f"No controller of this slew gets below {significant(bound, 3)}, the linear-quadratic optimum that knows the "
        f"whole state and the slew beforehand. The tuner's gain stays in {guard.sentence}."
    )


def learning_words(data: TunerStudy) -> str:
    """What each rule does, and whether the paper's pair is the best."""
    best = data.tuning.best_constant.cost
    told = [
        f"{curves.title[0].upper()}{curves.title[1:]}: {int((curves.final < best).sum())} of {curves.final.size} below "
        f"the best constant gain, {_ends(curves)}"
        for curves in data.curves
    ]
    found = data.cost_map
    answer = "Yes" if found.is_papers_best else "No"
    return (
        f"Seed by seed. {'. '.join(told)}. The guard costs part of the gain, "
        "and buys the proof. Is (0.6, 0.8) the best pair of momentum and learning rate? "
        f"{answer}: {found.verdict.partition(': ')[2]}."
    )


def _ends(curves: Curves) -> str:
    finite = curves.final[np.isfinite(curves.final)]
    low, middle, high = (
        significant(float(x), 3) for x in (finite.min(), np.quantile(curves.final, 0.5, method="nearest"), finite.max())
    )
    gone = [
        f"{count} {what}" for count, what in ((curves.diverged, "diverged"), (curves.died, "died at K = 0")) if count
    ]
    spread = f"median {middle}, from {low} to {high}"
    return ", ".join([*gone, spread])


def headline_facts(data: TunerStudy) -> tuple[Fact, ...]:
    """The costs, from nothing to what is possible."""
    tuning, final = data.tuning, data.curves[0].final
    median = float(np.quantile(final, 0.5, method="nearest"))
    low, high = (float(np.quantile(final, q, method="nearest")) for q in (0.25, 0.75))
    gain = 100 * (1 - median / tuning.best_constant.cost)
    guard = tuning.training.guard
    helps = f"by {significant(gain, 2)} %" if gain > 0 else "no"
    K = significant(tuning.best_constant.gain, 3)
    shaped = min((record.cost, kind) for kind, (_, record) in tuning.shaped.items())
    return (
        Fact(label="does tuning beat a constant gain?", value=helps, beside=f"median of {final.size} seeds"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4), beside=f"K2 = {K}"),
        Fact(label="tuner", value=significant(median, 4), beside=f"half between {low:.3f} and {high:.3f}"),
        Fact(label="nothing is below", value=significant(tuning.bound.cost, 4), beside="linear-quadratic optimum"),
        Fact(label="input shaping instead", value=significant(shaped[0], 3), beside=f"{shaped[1]}, a later slew"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", beside="any K(t) in it: proven stable"),
    )


# ------------------------------------------------------------ pictures


def _gain_picture(data: TunerStudy) -> Picture:
    tuning = data.tuning
    plane = overlay(data.arm, Gains(K1=tuning.plan.K1, K2=tuning.best_constant.gain), tuning.trial.loop.chain)
    guard, K = tuning.training.guard, tuning.training.result.K
    return Picture(
        stem="tune-gain",
        title="The tuner's path and its guard on the map",
        caption=(
            "Left: the map of both gains, sand where the continuous loop is stable, blue where the sampled one is, for "
            "constant gains. A gain that moves needs its own proof, and gets it only in the green bar: "
            f"{guard.sentence}. Black: the gains that the tuner takes, {significant(float(K.min()), 3)} to "
            f"{significant(float(K.max()), 3)}, at K1 = {plain(tuning.plan.K1)}. Right: the same over time (the "
            f"paper's Figure 3), seed {tuning.plan.seed}; without the tuner K2 = 0. {SHORT_SIGN}"
        ),
        alt=f"Map of K1 and K2 with the tuner's guard from {guard.lo:.3f} to {guard.hi:.3f}, and its gain over time.",
        figure=draw_gain(data, plane),
        data=Table(
            stem="tune-gain-data",
            title="The tuner's gain",
            caption="",
            is_data=True,
            columns=(
                data_column("t_s", "time", "s", tuning.training.result.t),
                data_column("K", "gain", "", K),
                data_column("x_N_m", "root moment less the rigid arm's", "N m", tuning.training.result.x),
            ),
        ),
    )


def _slew_picture(data: TunerStudy) -> Picture:
    return Picture(
        stem="tune-slew",
        title="The slew without and with the tuner",
        caption=(
            f"Root moment, tip and motor over an ideal chain (the paper's Figures 4 and 6). {_residuals(data, 0)} The "
            f"dotted line is the end of the slew; dashed, the rigid arm. {SHORT_SIGN}"
        ),
        alt=f"Root moment, tip and motor torque of the slew. {_residuals(data, 0)}",
        figure=draw_response(data.arm.name, data.arm, data.slews, "the slew, ideal chain"),
        data=_signals(data, 0, "tune-slew-data"),
    )


def _coarse_picture(data: TunerStudy) -> Picture:
    return Picture(
        stem="tune-dsp",
        title="The same with the DSP's effects on",
        caption=(
            "With 12-bit ADC and DAC, a hub rate differenced from an encoder of 8192 counts, and one sample of delay "
            f"(the paper's Figures 8 and 9). {_residuals(data, 1)} Nothing regulates the hub angle (no Kp), so what it "
            "loses to delay and steps it keeps. The motor is in N m: the paper gives no motor constant to turn it "
            f"into volts. {SHORT_SIGN}"
        ),
        alt=f"The slew with converters and delay. {_residuals(data, 1)}",
        figure=draw_response(data.arm.name, data.arm, data.coarse, "the slew, converters and one sample of delay"),
        data=_signals(data, 1, "tune-dsp-data"),
    )


def _residuals(data: TunerStudy, which: int) -> str:
    """What is left after the slew, from the table's rows: as trained, or with converters and delay."""
    row = next(row for row in data.rows if row.condition == (NOMINAL, COARSE)[which])
    return (
        f"Left after the slew: {significant(row.without.residual, 3)} N m rms without moment feedback, "
        f"{significant(row.tuner.residual, 3)} N m with the tuner, {significant(row.best_constant.residual, 3)} N m "
        "with the best constant gain."
    )


def _signals(data: TunerStudy, which: int, stem: str) -> Table:
    each = (data.slews, data.coarse)[which]
    without, tuned = each.values()
    n = min(without.t.size, tuned.t.size)
    columns: list[Column] = [data_column("t_s", "time", "s", without.t[:n])]
    for key, simulation in (("without", without), ("tuner", tuned)):
        columns += signal_columns(key, simulation, n)
    assert tuned.gain is not None
    columns.append(data_column("K", "gain", "", tuned.gain[:n]))
    return Table(stem=stem, title="The slew", caption="", is_data=True, columns=tuple(columns))


def _curves_picture(data: TunerStudy) -> Picture:
    columns: list[Column] = []
    for curves in data.curves:
        for name, share in (("lower_quartile", 0.25), ("median", 0.5), ("upper_quartile", 0.75)):
            columns.append(data_column(f"{curves.key}_{name}", name, "", curves.quantile(share)))
        for seed, costs in enumerate(curves.costs):
            columns.append(data_column(f"{curves.key}_seed_{seed}", f"seed {seed}", "", costs))
    trials = np.arange(1, data.curves[0].costs.shape[1] + 1)
    first = Column(key="trial", title="trial", values=trials.tolist(), cells=())
    return Picture(
        stem="tune-curves",
        title="Learning",
        caption=(
            f"Cost of each trial over {SEEDS} seeds (the paper's Figure 5): grey each seed, blue the median and the "
            "middle half; what diverges leaves through the top. The default cuts the gradient to norm 0.5 and takes a "
            "step back where the cost rises; (21) as printed has its sign mended and nothing else."
        ),
        alt=f"Learning curves of {SEEDS} seeds for two rules, beside the best constant gain and the bound.",
        figure=draw_curves(data),
        data=Table(
            stem="tune-curves-data", title="Learning curves", caption="", is_data=True, columns=(first, *columns)
        ),
    )


def _map_picture(data: TunerStudy) -> Picture:
    found = data.cost_map
    alpha, eta = (each.ravel() for each in np.meshgrid(found.alphas, found.etas, indexing="ij"))
    edge = "The lowest is at the edge of this map: larger steps may go lower still." if found.best_at_edge else ""
    columns = (
        data_column("alpha_c", "momentum", "", alpha),
        data_column("eta_c", "learning rate", "", eta),
        data_column("median_cost", "median final cost", "", found.median.ravel()),
    )
    return Picture(
        stem="tune-map",
        title="Momentum and learning rate",
        caption=(
            f"Median of the final cost over {MAP_SEEDS} seeds after {MAP_TRIALS} trials; lower is darker. "
            f"{found.verdict}. {edge}"
        ),
        alt=f"Map of the final cost over momentum and learning rate. {found.verdict}.",
        figure=draw_cost_map(data),
        data=Table(stem="tune-map-data", title="Final cost", caption="", is_data=True, columns=columns),
    )


def comparison_table(data: TunerStudy) -> Table:
    """Cost of a slew, a row a condition, a column a controller; and what is left of the moment after it."""
    rows = data.rows
    kinds = (
        ("without", "none"),
        ("best_constant", "constant"),
        ("own_constant", "own constant"),
        ("tuner", "tuner"),
        ("bound", "bound"),
        ("ZV", "ZV"),
        ("EI", "EI"),
    )
    columns = [text_column("condition", "condition", [row.condition for row in rows])]
    for group, name, digits in (("cost of the slew", "cost", 4), ("left after it, N m rms", "residual", 3)):
        for key, title in kinds:
            values = np.array([getattr(getattr(row, key), name) for row in rows])
            cells = aligned(values, digits, least=2)
            columns.append(number_column(f"{key}_{name}", title, "", values, cells, group=group))
    proven = ["yes" if row.proven else "no" for row in rows]
    columns.append(text_column("guard_proven", "guard proven", proven))
    away = "; ∞ where the loop ran away" if any(math.isinf(row.tuner.cost) for row in rows) else ""
    return Table(
        stem="tune-comparison",
        title="Beside what it has to beat",
        caption=(
            "Every controller knows the arm by its name plate only: what was trained or chosen as trained is used on "
            f"all others. None: no moment feedback. Constant: the best constant gain as trained, {_gain(data)}; own "
            "constant: the best one for that row. Bound: the linear-quadratic optimum. ZV and EI: input shaping with "
            "no moment feedback, judged by their own, later slew, so that the bound is not theirs. Guard proven: "
            f"whether the same range of gains is proven for that arm and chain too{away}. {SHORT_SIGN}"
        ),
        columns=tuple(columns),
    )


def _gain(data: TunerStudy) -> str:
    return f"K2 = {significant(data.tuning.best_constant.gain, 3)}"
