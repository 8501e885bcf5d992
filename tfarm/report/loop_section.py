"""The continuous loop on an arm's page: map of the gains, verdict and margins, Nyquist plot, poles."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, unit_of, written_unit
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import Chain
from tfarm.errors import TfarmError
from tfarm.loop.answers import CROSSOVERS, POLE_COLUMNS, crossovers
from tfarm.loop.edges import DEEPEST_MOMENT_GAIN
from tfarm.loop.margins import Margins, loop_curve
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.poles import Poles, closed_loop_poles
from tfarm.loop.spill import SPILL, Spill, spill
from tfarm.loop.windows import Windows
from tfarm.plots.disc import draw_nyquist
from tfarm.plots.loop import draw_loop
from tfarm.report.given_laws import GivenLaw, LawOnArm
from tfarm.report.loop_laws import DESIGNED_MODES, brief_on, continuous_cases, margins_of, why_no_loop
from tfarm.report.map import MapOfArm, draw_map_of_arm, map_data, map_of_arm
from tfarm.report.margins_table import margin_table, verdict_fact, verdict_words, window_table
from tfarm.report.nyquist import RINGS_CAPTION, PlotOfLaw, count_table, curve_data
from tfarm.report.sections import PageSection, Picture
from tfarm.report.words import typeset, upper
from tfarm.spectrum.scales import default_gains, default_words, rate_unit

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
    "Every size r of L(iω) is drawn as r/(1 + r): nothing is cut off, infinity is the outer rim. The loop is stable "
    "where the curve encircles −1 counter-clockwise as often as L has poles right of the axis{own}. Poles of L on the "
    "imaginary axis are passed on their right: there the curve turns clockwise through half a circle at infinity (a "
    "quarter at a single pole at s = 0), drawn dashed beyond the rim, one arc for all that turn alike, with its number."
)
MOST_SPILLED = 12  # flexible modes of the largest model that is put beside the exact loop
CROSSINGS_CAPTION = (
    "Every frequency up to the band where |L| = 1, with the phase margin there, above 0 for lag that the loop bears "
    "and below 0 for lead; and every one where L is real and below 0, with the factor on the whole law that puts a "
    "pole there."
)
BODE_CAPTION = (
    "Diamonds: |L| = 1, with the phase margin there, green for lag and purple for lead. Dots: L is real and below 0, "
    "and the dashed line is the way to −1, with the factor on the whole law that goes it."
)
SPILL_CAPTION = (
    "What models of so many flexible modes say of the same law: how many poles are unstable, and the rightmost."
)
POLES_CAPTION = (
    "Poles with Im s ≥ 0, those below the real axis being their mirror images. All of the box {box} 1/s are here, by "
    "the winding number around it."
)


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


def margins_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> PageSection:
    """Verdict, margins, crossings and spillover of each case, with the verdict on its sampled loop."""
    cases = continuous_cases(arm, chain, laws)
    found = [margins_of(each.arm, each.law) for each in cases]
    both = list(zip(cases, found, strict=True))
    undamped = arm.is_told_by_lyapunov and all(it.stability.loop.gains is not None for it in found)
    blocks: list[Picture | Table] = [_bode_picture(*each) for each in both]
    if any(it.in_band is not None for it in found):
        blocks.append(margin_table(cases, found, undamped))
    blocks += [crossings_table(each, it) for each, it in both if it.in_band is not None]
    if windowed := [(each, it) for each, it in both if it.windows]:
        blocks.append(window_table([each for each, _ in windowed], [it for _, it in windowed]))
    facts, words = [], []
    for each, it in both:
        far = "" if it.stability.is_known_beyond or it.stability.verdict == "unstable" else ", not known beyond"
        facts.append(verdict_fact(each, it, f"{far}; {brief_on(each.arm, each.law, chain).short}"))
        words.append(verdict_words(f"{upper(each.name)}, {each.gains}", it))
        try:
            spilled = spill(each.arm, each.any_law, MOST_SPILLED)
        except TfarmError as error:
            words.append(f"Spillover of {each.name} is not determined: {typeset(str(error))}.")
            continue
        words.append(f"Spillover of {each.name}: {typeset(spilled.in_words)}.")
        blocks.append(spill_table(each, spilled))
    title = "Is the loop stable, and by how much?"
    return PageSection(anchor="margins", title=title, facts=facts, words=words, blocks=blocks)


def _bode_picture(each: LawOnArm, found: Margins) -> Picture:
    omega, L = loop_curve(found)
    stem = f"{each.key.replace('_', '-')}-bode"
    none = "" if found.in_band is not None else " No margin is marked: the loop is not stable, and has none."
    columns = (
        Column("omega_rad_s", "angular frequency", "rad/s", of=omega),
        Column("re_L", "Re L", of=L.real),
        Column("im_L", "Im L", of=L.imag),
    )
    return Picture(
        stem=stem,
        title=f"The loop function of {each.name}",
        caption=(BODE_CAPTION if found.in_band is not None else "Size and phase of L(iω).") + none,
        alt=f"Bode plot of the loop function of {each.name}, {found.stability.verdict}.",
        figure=draw_loop(found, each.name),
        data=Table(stem=f"{stem}-data", title=f"The loop function of {each.name}", columns=columns),
    )


def crossings_table(each: LawOnArm, found: Margins) -> Table:
    """Every crossing of |L| = 1 and of L < 0 in the band, ascending."""
    assert found.in_band is not None
    rows = sorted(itertools.chain(*crossovers(found.in_band)), key=lambda row: row.omega_rad_s)
    return Table(
        stem=f"{each.key.replace('_', '-')}-crossings",
        title=f"Every crossing of {each.name}",
        caption=CROSSINGS_CAPTION if rows else "Nowhere in the band is |L| = 1, or L real and below 0.",
        columns=CROSSOVERS,
        record=rows,
    )


def spill_table(each: LawOnArm, found: Spill) -> Table:
    """A row a model, what the exact loop says in the caption."""
    return Table(
        stem=f"{each.key.replace('_', '-')}-spill",
        title=f"Models of few modes under {each.name}",
        caption=f"{SPILL_CAPTION} {upper(typeset(found.in_words))}.",
        columns=SPILL,
        record=found,
    )


# ------------------------------------------------------------ Nyquist


def nyquist_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> PageSection:
    """The loop function of each case on a contour that hides nothing, two in a picture, its encirclements counted."""
    cases = continuous_cases(arm, chain, laws)
    plots = [PlotOfLaw(each, nyquist_of(margins_of(each.arm, each.law).stability)) for each in cases]
    counts = {}  # of each case: encirclements, poles of its own, and the unstable poles that follow
    for named, found in plots:
        own = f", {how_many(found.unstable_open, 'unstable pole')} of its own" if found.unstable_open else ""
        poles = how_many(found.verdict.unstable_roots, "unstable pole")
        turns = how_many(abs(found.encirclements), "encirclement")
        counts[named.name] = f"{named.name}: {found.verdict.verdict}, {turns} of −1{own}, {poles} of the loop."
    blocks: list[Picture | Table] = []
    for first in range(0, len(plots), 2):
        pair = plots[first : first + 2]
        stem = "nyquist" if first == 0 else f"nyquist-{1 + first // 2}"
        blocks.append(Picture(
            stem=stem, title="Nyquist plots of the exact loop function", caption=RINGS_CAPTION,
            alt="; ".join(counts[plot.named.name] for plot in pair),
            figure=draw_nyquist(arm.name, {plot.named.name: plot.data for plot in pair}),
            data=curve_data(pair, f"{stem}-data"),
        ))  # fmt: skip
    own = "" if any(plot.data.unstable_open for plot in plots) else ", which here is never"
    names = [f"{plot.named.name}: {plot.named.gains}" for plot in plots]
    words = [*map(upper, counts.values()), NYQUIST_WORDS.format(own=own)]
    title = "Nyquist plot: encirclements of −1"
    return PageSection(anchor="margins-nyquist", title=title, words=words, blocks=[*blocks, count_table(plots, names)])


# ------------------------------------------------------------ poles


def poles_of(cases: Sequence[LawOnArm]) -> tuple[list[str], list[Table]]:
    """The first closed-loop poles of each case, complete in a box: the dominant one in words, and the tables."""
    words, tables = [], []
    for each in cases:
        try:
            poles = closed_loop_poles(each.arm, each.law)
        except TfarmError as error:
            words.append(f"{upper(each.name)}: poles not determined, {typeset(str(error))}.")
            continue
        moving = poles.moving
        found = "no pole but those at 0 lies in the box"
        if moving.size:
            furthest = moving[int(np.argmax(moving.real))]
            imaginary = f" ± {significant(furthest.imag, 6)} i" if furthest.imag else ""
            found = f"rightmost pole {significant(furthest.real, 6)}{imaginary} 1/s"
        words.append(f"{upper(each.name)}: {found}.")
        tables.append(_poles_table(each, poles))
    return words, tables


def poles_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> PageSection:
    """The closed-loop poles of the laws given."""
    words, tables = poles_of(continuous_cases(arm, chain, laws))
    return PageSection(anchor="locus", title="Closed-loop poles", words=words, blocks=tables)


def _poles_table(each: LawOnArm, poles: Poles) -> Table:
    """Poles with Im s >= 0, with their damping ratio."""
    left, right, _, top = poles.box
    box = f"{plain(left, 5)} < Re s < {plain(right, 5)} and |Im s| < {plain(top, 6)}"
    return Table(
        stem=f"{each.key.replace('_', '-')}-poles",
        title=f"Closed-loop poles under {each.name}",
        caption=POLES_CAPTION.format(box=box),
        columns=POLE_COLUMNS,
        record=poles.values.tolist(),
    )
