"""The verb that sets two arms, or two laws on one arm, beside each other."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import Json, TheoryName, app, load_arm, whole_number
from tfarm.cli.inputs import GAIN_OPTIONS, Given, Png, Typed, asked_law, with_options
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.comparing import Comparison

Arms = Annotated[list[str], typer.Argument(metavar="ARM [ARM]", help="presets or TOML files", show_default=False)]
Laws = Annotated[
    list[str] | None,
    typer.Option("--law", metavar="FILE", help="of one arm two laws; of two arms one for both, or one each"),
]


@app.command()
@with_options(GAIN_OPTIONS, after="arms")
def compare(
    arms: Arms,
    law: Laws = None,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="flexible modes, 1 to 30")] = "10",
    output: Annotated[str, typer.Option("--output", help="what the Bode plot of two arms shows")] = "root_moment",
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    theory: TheoryName = None,
    png: Png = None,
    out: Annotated[Path | None, typer.Option("--out", help="write a page, compare.html, to this folder")] = None,
    json: Json = False,
    *,
    gains: Typed,
) -> None:
    """Two arms, or two laws on one arm, compared: modes, poles, verdicts, margins; differences in per cent or deg."""
    count, files = whole_number("--modes", modes, 1, 30), law or []
    _check_number(arms, files)
    subjects = [load_arm(name, theory) for name in arms]
    chain = asked_chain(dsp or arms[0], period, delay_samples)
    pairs = [(subjects[min(n, len(arms) - 1)], arms[min(n, len(arms) - 1)]) for n in (0, 1)]
    wanted = [None, None] if not files else files * (2 // len(files))
    laws = [asked_law(arm, Given(gains, file, name))[0] for (arm, name), file in zip(pairs, wanted, strict=True)]
    from tfarm.cli.tables import hand_out
    from tfarm.comparing import compare as find
    from tfarm.comparing.answers import compared_answer

    names = _names([arm.name for arm in subjects], files)
    found = find(subjects, laws, names=names, modes=count, output=output, chain=chain)
    page = None
    if out is not None:
        from tfarm.report.writing import write_comparison

        page = write_comparison(found, out)
    hand_out(lambda: compared_answer(found), partial(_print, found), json, png=png, picture=(found,), also=(page,))


def _check_number(arms: list[str], files: list[str]) -> None:
    """Raise ParameterError where there are not two of anything."""
    if len(arms) > 2 or len(files) > 2:
        key, given = ("ARM", arms) if len(arms) > 2 else ("--law", files)
        raise ParameterError(key=key, value=given[2], remedy="two at most can be compared")
    if len(arms) == 1 and len(files) < 2:
        raise ParameterError(key="ARM", value=arms[0], remedy="give a second arm, or --law FILE twice")


def _names(arms: list[str], files: list[str]) -> list[str]:
    """What the two are called: by their arms, else by their laws' files, else by their numbers."""
    stems, whole_names = [Path(file).stem for file in files], [str(file) for file in files]
    for names in (arms, stems, whole_names):
        if len(names) == 2 and names[0] != names[1]:
            return names
    return ["first", "second"]


def _print(found: Comparison, answer: dict[str, Any]) -> None:
    """The verdicts, then each table; of two laws on one arm its modes are the same, and left out."""
    from tfarm.comparing.answers import compared_windows, side_words
    from tfarm.tables.terminal import show

    for side in found.sides:
        print(side_words(side))
    if found.is_of_arms:
        print("\nnatural frequencies and damping of the arms by themselves:")
        show(answer["modes"])
    if found.is_sampled:
        print("\none law is a law in z: both loops are compared at their samples, each pole z as s = ln(z)/T")
    print("\noscillating closed-loop poles, by the mode whose open-loop pole each is nearest to:")
    show(answer["poles"])
    if len(answer["unpaired_poles"]):
        print("\npoles of one side alone:")
        show(answer["unpaired_poles"])
    print()
    show(answer["margins"])
    if (windows := compared_windows(found)) is not None:
        show(windows)
        print("* no limit was found up to there, and beyond none was looked for")
    print(answer["loops"][0]["sign_convention"])
