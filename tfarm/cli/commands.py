"""The verbs.  Rooms are imported inside them, so that `tfarm --help` answers at once."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.exceptions import TyperException

from tfarm.errors import CertificationError, ConvergenceError, ParameterError, TfarmError, one_line

if TYPE_CHECKING:
    from tfarm.arm import Arm

app = typer.Typer(
    name="tfarm",
    help="Exact frequency-domain analysis of a rotating flexible Timoshenko arm.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

ArmName = Annotated[str, typer.Argument(metavar="ARM", help="a preset's name or a TOML file", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on standard output")]
Digits = Annotated[str | None, typer.Option("--digits", metavar="D", help="right digits, proven; strings above 15")]


@app.command()
def presets(json: Json = False) -> None:
    """List the arms that come with tfarm."""
    import tfarm

    arms = [tfarm.load(name) for name in tfarm.presets()]
    if json:
        from tfarm.cli.answers import presets_answer, to_json

        print(to_json(presets_answer(arms)))
    else:
        from tfarm.cli.tables import print_presets

        print_presets(arms)


@app.command()
def modes(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 10000")] = "10",
    theory: Annotated[str, typer.Option(help="timoshenko, shear, rayleigh or euler-bernoulli")] = "timoshenko",
    digits: Digits = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each bracket, and that no mode is missing")] = False,
    json: Json = False,
) -> None:
    """Natural frequencies and modes, complete by construction."""
    wanted, right = _whole("--count", count, 1, 10_000), _digits(digits)
    subject = _load(arm)
    from tfarm.cli.answers import modes_answer, to_json
    from tfarm.spectrum import modes as find_modes

    answer = modes_answer(find_modes(subject, wanted, theory=theory), right, certify)  # type: ignore[arg-type]
    if json:
        print(to_json(answer))
    else:
        from tfarm.cli.tables import print_modes

        print_modes(answer)


@app.command()
def response(
    arm: ArmName,
    output: Annotated[str, typer.Option("--output", help="what is looked at, such as root_moment")],
    s: Annotated[str | None, typer.Option("--s", help="points s [1/s]: 0.3+57.1j,10j")] = None,
    omega: Annotated[str | None, typer.Option("--omega", help="frequencies [rad/s]: 1,10,100")] = None,
    start: Annotated[float, typer.Option("--from", help="lowest frequency [rad/s]")] = 0.1,
    stop: Annotated[float, typer.Option("--to", help="highest frequency [rad/s]")] = 1000.0,
    points: Annotated[str, typer.Option("--points", help="how many, logarithmically spaced")] = "500",
    x: Annotated[float | None, typer.Option("--x", help="place on the arm [m], for outputs along it")] = None,
    digits: Digits = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="write a table to this file")] = None,
    json: Json = False,
) -> None:
    """The exact response to hub torque (to hub angle where the hub is locked)."""
    from tfarm.cli.inputs import grid, omega_values, s_values

    if s is not None and omega is not None:
        raise ParameterError(key="--omega", value=omega, remedy="give --s or --omega, not both")
    right = _digits(digits)
    at = s_values(s) if s is not None else omega_values(omega) if omega is not None else grid(start, stop, points)
    subject = _load(arm)
    from tfarm.cli.answers import response_answer, to_json
    from tfarm.response import transfer

    answer = response_answer(transfer(subject, output, x=x), at, right)
    if csv is not None:
        from tfarm.cli.tables import write_csv

        write_csv(answer, csv)
    if json:
        print(to_json(answer))
    elif csv is None:
        from tfarm.cli.tables import print_response

        print_response(answer)


@app.command()
def report(
    arms: Annotated[
        list[str] | None, typer.Argument(metavar="[ARM ...]", help="presets or files; all presets if none")
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="the folder to write to")] = Path("reports"),
    only: Annotated[str | None, typer.Option("--only", help="one page of each arm: bode or modes")] = None,
) -> None:
    """Write pages with pictures, tables and data: open index.html in a browser."""
    import tfarm

    subjects = [_load(name) for name in arms or tfarm.presets()]
    from tfarm.cli.tables import progress
    from tfarm.report import write

    with progress() as advance:
        page = write(subjects, out, only=None if only is None else (only,), progress=advance)
    print(page)


@app.command()
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check that tells them apart."""
    from tfarm.audit import audit_answer

    answer = audit_answer()
    if json:
        from tfarm.cli.answers import to_json

        print(to_json(answer))
    else:
        from tfarm.cli.tables import print_audit

        print_audit(answer)


def _load(name: str) -> Arm:
    import tfarm

    return tfarm.load(name)


def _digits(text: str | None) -> int | None:
    return None if text is None else _whole("--digits", text, 1, 1000)


def _whole(key: str, text: str, least: int, most: int) -> int:
    """A whole number in a range; it may be typed as 1e3."""
    remedy = f"a whole number from {least} to {most}"
    try:
        number = float(text)
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not (least <= number <= most and number == int(number)):
        raise ParameterError(key=key, value=text, remedy=remedy)
    return int(number)


def main(arguments: list[str] | None = None) -> None:
    """Run one command and exit: 0, 2 for bad input, 3 for what could not be solved or proven."""
    given = sys.argv[1:] if arguments is None else arguments
    sys.exit(_run(given or ["--help"]))


def _run(arguments: list[str]) -> int:
    try:
        result: Any = typer.main.get_command(app).main(arguments, prog_name="tfarm", standalone_mode=False)
        sys.stdout.flush()
    except typer.Exit as stop:
        return stop.exit_code
    except (ConvergenceError, CertificationError) as error:
        return _fail(str(error), 3)
    except TfarmError as error:
        return _fail(str(error), 2)
    except BrokenPipeError:  # the reader, head for instance, has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (KeyboardInterrupt, typer.Abort):
        return _fail("stopped", 130)
    except TyperException as error:
        return _fail(_usage(error), 2)
    return result if isinstance(result, int) else 0


def _usage(error: Any) -> str:
    """The parser's complaint, in the words of our own errors."""
    near = getattr(error, "possibilities", None)
    if near:
        return f"{error.option_name}: no such option: did you mean {' or '.join(near)}?"
    return str(error.format_message()) if hasattr(error, "format_message") else str(error)


def _fail(message: str, code: int) -> int:
    print(f"tfarm: {one_line(message, 1000)}", file=sys.stderr)
    return code
