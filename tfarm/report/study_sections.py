"""The sections on the page of a study: findings, distributions, drivers, responses, worst arm, failures."""

from collections.abc import Callable, Iterator
from functools import partial

from tfarm.errors import TfarmError
from tfarm.plots import studies as drawn
from tfarm.report.page import Fact, PageSection, Picture, picture, prose, sheet
from tfarm.schema import Column, Table, curve_table, table, text
from tfarm.studies.bands import ResponseBand, frequency_band, step_band
from tfarm.studies.study import Study

OUTPUTS = ("root_moment", "tip_displacement")  # of the frequency responses
PERCENT = "%"


def findings_section(found: Study) -> PageSection:
    """Stable share of each loop, ranges of the quantities, and the varied numbers."""
    facts = [
        Fact(f"{each.loop}: stable share, at least", text(each.at_least, 4).removesuffix(f" {PERCENT}"),
             PERCENT * (each.at_least is not None), each.finding)
        for each in found.shares
    ]  # fmt: skip
    facts += [Fact("arms computed", f"{found.done:,}", note=f"of {found.rows:,}")]
    blocks = [sheet("study_ranges", table(found.spreads))] * bool(found.spreads)
    return PageSection(
        title="Findings", facts=facts, words=[prose("study", found=found)],
        blocks=[*blocks, sheet("study_numbers", _numbers(found), found=found)],
    )  # fmt: skip


def _numbers(found: Study) -> list[Column]:
    """A row a varied number: its distribution, and its ends among the arms."""
    plan, values = found.parts.plan, found.table()
    space = plan.space
    kinds = {key: f"{each.kind} {', '.join(map(text, each.numbers))}" for key, each in space.distributions.items()}
    kinds |= {key: f"{len(points)} values" for key, points in space.grids.items()}
    kinds |= dict.fromkeys(space.listed[0], "list")
    ends = [(values[key].min(initial=float("inf")), values[key].max(initial=-float("inf"))) for key in space.keys]
    least, largest = zip(*ends, strict=True)
    return [
        Column("key", "number", of=[drawn.key_label(key, plan) for key in space.keys]),
        Column("distribution", "distribution", of=[kinds.get(key, "posterior") for key in space.keys]),
        Column("least", "least", of=list(map(float, least)), shown=[text(float(each), 4) for each in least]),
        Column("largest", "largest", of=list(map(float, largest)), shown=[text(float(each), 4) for each in largest]),
    ]


def distributions_section(found: Study) -> PageSection:
    """Histograms of the quantities."""
    shown = [each for both in drawn.distributions(found).values() for each in both]
    data = curve_table(found).columns
    figure = drawn.study.figure(found)
    return PageSection(
        title="Distributions",
        blocks=[picture("study_distributions", figure, found=found, shown=shown,
                        data=[each for each in data if each.key in ("row", *(of.name for of in shown))])],
    )  # fmt: skip


def drivers_section(found: Study) -> PageSection:
    """Quantities over the varied numbers, and Sobol' indices where they were computed."""
    led = [each for each in found.spreads if each.driver]
    blocks: list[Picture | Table] = [picture("study_scatter", drawn.study_scatter.figure(found), found=found)]
    if found.sobol:
        blocks.append(sheet("study_sobol", table(found.sobol)))
    return PageSection(title="Drivers", words=[prose("study_drivers", led=led)], blocks=blocks)


def responses_section(found: Study, workers: int) -> PageSection:
    """Bands of the exact frequency responses, and of the slew where that is asked for; the reason where one has none."""
    words, blocks = [], []
    calls: dict[str, Callable[[], ResponseBand]] = {each: partial(frequency_band, found, each) for each in OUTPUTS}
    if any(name.startswith("step.") for name in found.parts.plan.names):
        calls["slew"] = partial(step_band, found, workers=workers)
    for name, call in calls.items():
        try:
            band = call()
        except TfarmError as error:
            words.append(f"{name}: {error}.")
            continue
        if (band.curves.max(axis=0) > band.curves.min(axis=0)).any():
            data = [Column(key, of=values) for key, values in drawn.band_data(band).items()]
            stem = f"study-{name.replace('_', '-')}"
            blocks.append(picture("study_band", drawn.study_band.figure(band), stem=stem, data=data, band=band))
    return PageSection(title="Responses", words=words, blocks=blocks)


def worst_section(found: Study) -> PageSection:
    """The worst arm of the search, with its numbers."""
    worst = found.worst
    assert worst is not None
    columns = [
        Column("key", "number", of=[drawn.key_label(key, found.parts.plan) for key in worst.numbers]),
        Column("value", "value", of=list(worst.numbers.values()), shown=[text(x, 6) for x in worst.numbers.values()]),
    ]
    return PageSection(
        title="Worst arm", words=[prose("study_worst", worst=worst)], blocks=[sheet("study_worst_numbers", columns)]
    )


def failures_section(found: Study) -> PageSection:
    """Arms without a result by reason."""
    return PageSection(title="Arms without a result", blocks=[sheet("study_failures", table(found.failures))])


def sections_of(found: Study, workers: int) -> Iterator[tuple[str, Callable[[], PageSection]]]:
    """Yield the anchor of each section of the page of a study, with the call that makes it."""
    yield "findings", partial(findings_section, found)
    if found.spreads:
        yield "distributions", partial(distributions_section, found)
        yield "drivers", partial(drivers_section, found)
    if found.done:
        yield "responses", partial(responses_section, found, workers)
    if found.worst is not None:
        yield "worst", partial(worst_section, found)
    if found.failures:
        yield "failures", partial(failures_section, found)
