"""Arguments as people type them, turned into numbers; what cannot be is refused in one line."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import numpy as np
import typer
from numpy.typing import NDArray

from tfarm.arm import FED_BACK, GAINS, LISTED, MOMENT_GAIN, RATE_GAIN, Gain
from tfarm.cli.app import TheoryName, load_arm, plain_number, whole_number
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.arm import Arm, HubFeedback, Input, Law
    from tfarm.report.cases import GivenLaw


Command = Callable[..., None]
Typed = dict[str, float | None]  # gains by name, None where not given


@dataclass(frozen=True)
class Given:
    """What is typed of a law: `gains` by name, None where not given; the `law` of a file; and the `arm`'s own name."""

    gains: Typed
    law: str | None = None
    arm: str = ""
    theory: str | None = None

    def loop(self) -> tuple[Arm, HubFeedback | Law, dict[str, Any]]:
        """The arm, its law, and what the answer says of gains that were not given."""
        subject = load_arm(self.arm, self.theory)
        return subject, *asked_law(subject, self)


HELP_ON_GAINS = {  # of the gains that have a default of their own
    RATE_GAIN: "hub rate gain [N m s/rad, V s/rad or A s/rad]; by default 0.00642 J w1, the paper's 0.3 on its arm",
    MOMENT_GAIN: f"root moment gain, u = ... - {MOMENT_GAIN} E I phi'(0); 0.3 by default, 0 on a hub without inertia",
}
LawFile = Annotated[str | None, typer.Option("--law", metavar="FILE", help="TOML file with a [law]; else the arm's")]
LawFiles = Annotated[
    list[str] | None,
    typer.Option("--law", metavar="FILE", help="TOML file with a [law]; again for more, on one page; else the arm's"),
]
Png = Annotated[Path | None, typer.Option("--png", help="draw it into this file")]


def gain_option(gain: Gain, kind: Any = float | None) -> Any:
    """The type of the option of a gain: a number, or None where it is not given."""
    words = HELP_ON_GAINS.get(gain.name, f"{gain.output.replace('_', ' ')} gain [{gain.unit}]")
    return Annotated[kind, typer.Option(f"--{gain.name}", help=words)]


def range_option(name: str, words: str) -> Any:
    """The type of the option of a range, typed as two numbers, or None where it is not given."""
    return Annotated[str | None, typer.Option(f"--{name}", metavar="LO,HI", help=words)]


GAIN_OPTIONS = {gain.name: gain_option(gain) for gain in LISTED}
HeldAngle = gain_option(GAINS[FED_BACK.index("hub_angle")], float)  # of commands on the plane of the other two gains


def with_options(
    options: Mapping[str, Any],
    after: str,
    gathered: Callable[[dict[str, Any], Mapping[str, Any]], Any] | None = None,
    defaults: Mapping[str, Any] = MappingProxyType({}),
) -> Callable[[Command], Command]:
    """A command with these options after the argument of that name, instead of its last argument.

    The last one is what they are by name, or what `gathered` makes of that and of the other arguments.  An option that
    is not given has its default, or is None.
    """

    def decorated(command: Command) -> Command:
        own = signature(command, eval_str=True)
        *kept, last = (each.replace(kind=Parameter.KEYWORD_ONLY) for each in own.parameters.values())
        added = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=defaults.get(name), annotation=options[name])
            for name in options
        ]
        place = 1 + [each.name for each in kept].index(after)

        @wraps(command)
        def called(**arguments: Any) -> None:
            typed = {name: arguments.pop(name) for name in options}
            command(**{last.name: gathered(typed, arguments) if gathered else typed, **arguments})

        called.__signature__ = own.replace(parameters=[*kept[:place], *added, *kept[place:]])  # type: ignore[attr-defined]
        return called

    return decorated


def under_a_law(command: Command) -> Command:
    """The command with options for each gain and for a law's file after its arm, instead of its last argument."""

    def given(typed: dict[str, Any], others: Mapping[str, Any]) -> Given:
        gains = {gain.name: typed[gain.name] for gain in GAINS}
        return Given(gains, typed["law"], others["arm"], typed["theory"])

    return with_options({**GAIN_OPTIONS, "law": LawFile, "theory": TheoryName}, "arm", given)(command)


MOST_GRID = 1_000_000  # points of a response, as many lines of a table: more are a slip of the keyboard
_Number = TypeVar("_Number", float, complex)


def points_on(s: str | None, omega: str | None, start: float, stop: float, points: str) -> NDArray[np.complex128]:
    """The points s [1/s] of a response: those typed, s = i omega for frequencies [rad/s] typed, or a grid of them.

    Numbers are separated by commas: "0.3+57.1j,10j".
    """
    if s is not None and omega is not None:
        raise ParameterError(key="--omega", value=omega, remedy="give --s or --omega, not both")
    if s is not None:
        remedy = "write numbers in 1/s such as 0.3+57.1j,10j"
        return np.array([_number("--s", part, complex, remedy) for part in s.split(",")])
    if omega is None:
        must_be_band(start, stop)
        return np.asarray(1j * np.geomspace(start, stop, whole_number("--points", points, 2, MOST_GRID)))
    remedy = "write frequencies in rad/s such as 1,10,100"
    return 1j * np.array([_number("--omega", part, float, remedy) for part in omega.split(",")])


def bounds(key: str, text: str, remedy: str = "two numbers, the lower first, such as -1,3") -> tuple[float, float]:
    """Two numbers separated by a comma, the lower first."""
    try:
        low, high = (plain_number(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not -math.inf < low < high < math.inf:
        raise ParameterError(key=key, value=text, remedy=remedy)
    return low, high


def must_be_band(start: float, stop: float) -> None:
    """Refuse what are no two frequencies [rad/s], the lower first."""
    if not 0 < start < math.inf:
        raise ParameterError(key="--from", value=start, remedy="a positive frequency in rad/s")
    if not start < stop < math.inf:
        raise ParameterError(key="--to", value=stop, remedy=f"a frequency above --from, {start:g} rad/s")


def asked_law(arm: Arm, given: Given) -> tuple[HubFeedback | Law, dict[str, Any]]:
    """The law of the command line: that of a file, of the arm's own [law] where no gain is typed, or gains at the hub.

    With it what the answer says of gains that were not given.
    """
    from tfarm.arm.law_tables import load_law

    typed = [name for name, value in given.gains.items() if value is not None]
    if given.law is not None:
        if typed:
            remedy = f"the law is that of {given.law}; leave out --{typed[0]}, or --law"
            raise ParameterError(key=f"--{typed[0]}", value=given.gains[typed[0]], remedy=remedy)
        law = load_law(given.law)
        if law is None:
            raise ParameterError(key="--law", value=given.law, remedy="has no table [law]", file=None)
        return law, {}
    own = None if typed or not given.arm else load_law(given.arm)
    return asked_gains(arm, given) if own is None else (own, {})


def asked_laws(arm: Arm, name: str, gains: Typed, files: Sequence[str]) -> tuple[GivenLaw, ...]:
    """The laws that a page is about: those of files, gains that are typed, the arm's own [law]; else none."""
    from tfarm.arm.law_tables import load_law
    from tfarm.fitting.recording import load_run
    from tfarm.report.cases import GivenLaw

    if not files and all(value is None for value in gains.values()) and load_law(name) is None:
        return ()
    wanted = [Given(gains, file, name) for file in files] or [Given(gains, None, name)]
    return tuple(
        GivenLaw(
            asked_law(arm, given)[0],
            file=Path(given.law).name if given.law else "",
            measured=load_run(given.law) if given.law else None,
        )
        for given in wanted
    )


def asked_gains(arm: Arm, given: Given) -> tuple[HubFeedback, dict[str, Any]]:
    """The gains at the hub of the command line, those not given being the arm's default, and what its answer says.

    `default_gains` names those that were not given and have one, `default_gains_in_words` says what they are and why.
    """
    from dataclasses import replace

    from tfarm.spectrum.table import default_gains, default_words

    if given.law is not None:
        remedy = "this command knows gains at the hub; poles, margins, sampled and simulate take any law"
        raise ParameterError(key="--law", value=given.law, remedy=remedy)
    missing = [name for name in HELP_ON_GAINS if given.gains.get(name) is None]
    law = replace(default_gains(arm), **{name: value for name, value in given.gains.items() if value is not None})
    words = default_words(arm, missing) if missing else None
    return law, {"default_gains": missing, "default_gains_in_words": words}


def _number(key: str, text: str, kind: type[_Number], remedy: str) -> _Number:
    try:
        value = kind(text.strip().replace("i", "j") if kind is complex else text)
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not np.isfinite(value):
        raise ParameterError(key=key, value=text, remedy=f"not finite; {remedy}")
    return value


def asked_input(arm: Arm, name: str | None) -> tuple[Arm, str | None]:
    """The arm with another input at its hub, or with its own and the load on its link that is named."""
    if name is None or "@" in name:
        return arm, name
    return replace(arm, input=cast("Input", name)), None  # the record refuses what is none
