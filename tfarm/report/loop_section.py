"""The continuous loop on an arm's page: the map of its gains, verdict and margins, Nyquist (loci: `locus_section`)."""

from __future__ import annotations

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, unit_of, written_unit
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.nyquist import Nyquist, nyquist_of
from tfarm.loop.plane import DEEPEST_MOMENT_GAIN
from tfarm.loop.stability import stability
from tfarm.loop.windows import Windows
from tfarm.plots.disc import draw_nyquist
from tfarm.report.loop_laws import (
    DESIGNED_MODES,
    NamedLaw,
    brief_on,
    edge_of_K2,
    has_loop,
    laws,
    margins_of,
    why_no_loop,
)
from tfarm.report.map import MapOfArm, draw_map_of_arm, map_data, map_of_arm
from tfarm.report.margins_table import margin_table, verdict_fact, verdict_words, window_table
from tfarm.report.nyquist import RINGS_CAPTION, TO_COMPARE, PlotOfLaw, count_table, curve_data
from tfarm.report.sections import PageSection, Picture
from tfarm.report.words import typeset, upper
from tfarm.spectrum.scales import default_gains, default_words, rate_unit

UNSTABLE_K2 = 1.5  # at least, of the law whose encirclements are counted for comparison
TIMES_THE_EDGE = 1.2  # and at least so many times the K2 at which the loop loses its stability

MAP_SEEN = (
    "Green: every pole is in the left half-plane{apart}; orange: the number of unstable poles. The black edge and the "
    "counts are exact, of the arm itself and no reduced model{reach}. Blue: damping ratio of the least damped pole "
    "below {band} rad/s. {proof} K1 is scaled by J ω₁ = {unit}{held}."
)
APART_FROM_HUB, WITH_INERTIA = (
    ", that of the hub angle at 0 apart",
    ", with J the inertia of what turns: hub, link and finite payload",
)
ALL_MODES, UP_TO = ", with all its infinitely many modes", ", with every crossing up to {band} rad/s"
PROOF = "The purple frame is what the Lyapunov argument proves at C = 0: K1 > 0 and K2 < 1, all of the stable region."
NO_PROOF = (
    "The dashed frame is what the Lyapunov argument proves for an arm without damping; it is not a proof here, because "
    "the gauge does not feel C. At C > 0 it proves K2 = 0 alone (solid line). The true edge is the black line."
)
OF_ELASTIC = (
    "Lyapunov's argument proves all with K1 > {least} and K2 < {whole}: the links are elastic, and what hub, clamp and "
    "joint lose only adds to K1."
)
OF_DAMPED = "At C > 0 Lyapunov's argument proves K2 = 0 alone, as the gauge does not feel C; the edge is computed."
OF_OTHER_GAUGE = (
    "The gauge does not read the moment on the hub, so Lyapunov's argument proves K2 = 0 alone; the edge is computed."
)
OF_LAG = "The voltage comes late through an inductance, so Lyapunov's argument proves nothing; the edge is computed."
SAMPLED_SEEN = (
    " Hatched: what is stable when the loop is sampled every {clock}, its edge exact for the first {modes} modes; with "
    "that clock no gains outside the hatching hold, whatever the continuous loop promises."
)
SAMPLED_NOT_SEEN = " Where the loop is stable when it is sampled every {clock} could not be settled and is not drawn."
DEPTH_WORDS = " For this map unstable windows below K2 = {deepest} were not looked for."
NYQUIST_WORDS = (
    "Every size of L(iω) from 0 to infinity is in the picture: a size r is drawn as r/(1 + r), so nothing is cut off, "
    "and infinity is the outer rim. The loop is stable when the curve does not turn around −1. {poles}"
)
ONE_POLE = (
    "L has one pole on the imaginary axis, at s = 0 (the rigid arm turning): there the contour steps to the right, and "
    "the curve turns through a quarter circle at infinity, drawn dashed beyond the rim."
)
ALL_POLES = (
    "Without damping L has a pole on the imaginary axis at 0 and at every natural frequency. At each the contour steps "
    "to the right, and the curve turns clockwise through half a circle at infinity, drawn dashed beyond the rim: "
    "of the {count} poles up to {band} rad/s one arc for all that turn alike, with their number."
)
HELD_POLES = (
    "Without damping L has a pole on the imaginary axis at every natural frequency; past each the curve turns "
    "clockwise through half a circle at infinity, drawn dashed beyond the rim, one arc for all that turn alike."
)
NO_POLE = "L has no pole on the imaginary axis."


def no_loop_section(arm: Arm) -> PageSection:
    """One sentence for an arm that has no loop."""
    return PageSection(anchor="no-loop", title="The loop", words=(why_no_loop(arm),))


# ------------------------------------------------------------ the map


def map_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """How high may the gains go?  And how high when the loop is sampled by the chain's clock?"""
    data = map_of_arm(arm, chain)
    picture = Picture(
        stem="map",
        title="The plane of both gains",
        caption=_map_caption(data),
        alt="Map of K1 and K2: the stable gains, and how many poles are unstable elsewhere; how far each gain may go "
        "is said above.",
        figure=draw_map_of_arm(data),
        data=map_data(data),
    )
    words = (_answer(arm), _best_words(data))
    return PageSection(
        anchor="margins-map", title="How high may the gains go?", words=[w for w in words if w], blocks=(picture,)
    )


def _answer(arm: Arm) -> str:
    """The windows of both gains through the default ones, in words."""
    found = margins_of(arm, default_gains(arm))
    start = f"With the default gains {typeset(default_words(arm))} the loop is {found.stability.verdict}"
    across, up = PLANE
    if any(found.windows[name].around is None for name in PLANE):
        return f"{start}; the picture shows which gains are stable."
    many = len(found.windows[up].all)
    again = f" {up} has {many} separate stable windows at that {across}, listed below." if many > 1 else ""
    more = {name: _room(found.windows[name], written_unit(name, arm)) for name in PLANE}
    return f"{start}: at that {across}, {up} may {more[up]}; at that {up}, {across} may {more[across]}.{again}"


def _room(windows: Windows, unit: str) -> str:
    """How far a gain may go up and down: to an edge and what happens there, to where the search ends, or anywhere."""
    assert windows.around is not None
    ways = []
    for value, way in zip(reversed(windows.around), ("up", "down"), strict=True):
        place = f"{plain(value, 5)}{unit}"
        if windows.end(value) == "no limit":
            ways.append(f"go {way} without limit")
        elif windows.end(value) == "search bound":
            ways.append(f"go {way} with no limit found as far as {place}")
        else:
            ways.append(f"go {way} to {place}{_crossing_there(windows, value)}")
    return ", and may ".join(ways)


def _crossing_there(windows: Windows, value: float) -> str:
    """What reaches the axis at that edge."""
    crossing = next((each for each in windows.crossings if each.t == value), None)
    if crossing is None:
        return ""
    if crossing.at == 0:
        return ", where a real pole passes through 0"
    if not np.isfinite(crossing.at):
        return ", where every flexible mode crosses at once"
    return f", where poles cross at {significant(crossing.at, 4)} rad/s"


def _best_words(data: MapOfArm) -> str:
    found = data.design
    if found is None:
        return ""
    cut = " and ".join(
        found.law.told(name, lambda gain: plain(gain, 4)) for name in found.at_bound if name not in found.at_limit
    )
    gains = " and ".join(found.law.told(name, lambda gain: significant(gain, 4), data.arm) for name in PLANE)
    brief = data.briefs[-1]
    words = typeset(brief.words)
    sampled = f"{words[0].upper()}{words[1:]}" if brief.is_stable else f"But {words}"
    edge = f" That is no optimum: the dotted frame cuts the search off at {cut}, and there is more beyond." * bool(cut)
    return (
        f"The best damping of the first {DESIGNED_MODES} modes that the sampled loop holds within the dotted frame is "
        f"{significant(100 * found.value, 3)} % of critical, at {gains} (tfarm design), without a clock "
        f"{found.verdict.verdict}.{edge} {sampled}."
    )


def _map_caption(data: MapOfArm) -> str:
    proof = proof_words(data.arm)
    unit = f"{plain(rate_unit(data.arm), 4)} {unit_of(RATE_GAIN, data.arm)}"
    reach = ALL_MODES if data.region.is_known else UP_TO.format(band=significant(data.region.band, 5))
    free = data.arm.has_rigid_mode
    seen = MAP_SEEN.format(
        band=significant(data.band, 5),
        proof=proof,
        unit=unit,
        reach=reach,
        apart=APART_FROM_HUB * free,
        held=WITH_INERTIA * (not free),
    )
    sampled = SAMPLED_NOT_SEEN if data.sampled is None else SAMPLED_SEEN
    clock = f"{plain(1e3 * data.chain.sampling.period)} ms"
    modes = 0 if data.sampled is None else data.sampled.modes_used
    deepest = plain(DEEPEST_MOMENT_GAIN * data.arm.input_per_torque, 4)
    depth = "" if data.arm.loses_at_hub_alone else DEPTH_WORDS.format(deepest=deepest)  # by a theorem, however deep
    return seen + sampled.format(clock=clock, modes=modes) + depth


def proof_words(arm: Arm) -> str:
    """What Lyapunov's argument proves in the plane of gains, as the margins' table says it of each law."""
    if arm.is_uniform:
        return PROOF if arm.is_undamped else NO_PROOF
    if arm.input_lags:
        return OF_LAG
    if not arm.reads_hub_moment:
        return OF_OTHER_GAUGE
    if not arm.has_elastic_link:
        return OF_DAMPED
    whole, least = arm.input_per_torque, 0.0 - arm.rate_loss
    return OF_ELASTIC.format(
        whole=plain(whole, 5) + written_unit(MOMENT_GAIN, arm), least=plain(least, 5) + written_unit(RATE_GAIN, arm)
    )


# ------------------------------------------------------------ margins


def margins_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """The verdict on each law, continuous and at the chain's clock, then its margins."""
    chain = Chain() if chain is None else chain
    named = laws(arm, chain)
    found = [margins_of(arm, each.law) for each in named]
    both = list(zip(named, found, strict=True))
    return PageSection(
        anchor="margins",
        title="Is the loop stable, and by how much?",
        facts=[verdict_fact(each, it, f"; {brief_on(arm, each.law, chain).short}") for each, it in both],
        words=[verdict_words(f"{upper(each.name)}, {each.gains}", it) for each, it in both],
        blocks=(margin_table(named, found, arm.is_told_by_lyapunov), window_table(named, found)),
    )


# ------------------------------------------------------------ Nyquist


def nyquist_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """The loop function on a contour that hides nothing."""
    named = laws(arm, Chain() if chain is None else chain)
    plots = [PlotOfLaw(each, nyquist_of(margins_of(arm, each.law).stability)) for each in named]
    every = [*plots, *_to_compare(arm)]
    picture = Picture(
        stem="nyquist",
        title="Nyquist plots of the exact loop function",
        caption=RINGS_CAPTION,
        alt="; ".join(
            f"{p.named.name}: {p.data.verdict.verdict}, {p.data.encirclements} encirclements of −1" for p in plots
        ),
        figure=draw_nyquist(arm.name, {plot.named.name: plot.data for plot in plots}),
        data=curve_data(plots),
    )  # fmt: skip
    names = [f"{plot.named.name}: {plot.named.gains}" for plot in every]
    answer = "; ".join(
        f"{named.name}: {p.verdict.verdict}, {how_many(abs(p.encirclements), 'turn')} around −1 and "
        f"{how_many(p.verdict.unstable_roots, 'unstable pole')}"
        for named, p in plots
    )
    words = (f"{upper(answer)}.", NYQUIST_WORDS.format(poles=_poles_words(plots[0].data)))
    title = "Nyquist: does the loop function turn around −1?"
    return PageSection(anchor="margins-nyquist", title=title, words=words, blocks=(picture, count_table(every, names)))


def _to_compare(arm: Arm) -> list[PlotOfLaw]:
    """An unstable law whose turns are counted too: K2 beyond its edge, on a free pin K1 < 0; none where neither counts.

    K1 is small there: without inertia at the hub a large K1 < 0 drives poles unstable at any frequency.
    """
    law = default_gains(arm)
    beyond = float(f"{TIMES_THE_EDGE * (edge_of_K2(arm, law) or arm.input_per_torque):.3g}")
    drives = (
        law.having(MOMENT_GAIN, max(UNSTABLE_K2 * arm.input_per_torque, beyond))
        if has_loop(arm)
        else law.having(RATE_GAIN, float(f"{-law[RATE_GAIN] / 10:.3g}"))
    )
    try:
        return [PlotOfLaw(NamedLaw(TO_COMPARE, "unstable", drives), nyquist_of(stability(arm, drives)))]
    except ConvergenceError:
        return []


def _poles_words(plot: Nyquist) -> str:
    arm, count = plot.verdict.loop.arm, plot.poles.size
    if not arm.is_undamped:
        return ONE_POLE if count else NO_POLE
    if not arm.has_rigid_mode:
        return HELD_POLES
    return ALL_POLES.format(count=count, band=significant(plot.verdict.band, 5))
