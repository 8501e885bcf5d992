"""The command that says which record to take next."""

import math
from typing import Annotated, Any

import typer

import tfarm
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    ArmName,
    File,
    TheoryName,
    chain_of_options,
    load_arm,
    name_and,
    numbers,
)
from tfarm.cli.output import emit
from tfarm.cli.progress import advance
from tfarm.files import write_file


@add_command(
    "Measure",
    epilog="experiment sasaki2012-lab --free hub.inertia,link.damping --duration 5 --limit 1 --angle 0.5 "
    "--noise hub_angle=1e-3 --noise root_moment=0.01 --csv excitation.csv",
)
def experiment(
    *,
    arm: ArmName,
    free: Annotated[str, typer.Option(metavar="KEY,KEY")],
    duration: float,
    outputs: str = "hub_angle,root_moment",
    noise: Annotated[
        list[Any] | None, typer.Option(metavar="SIGNAL=STD", parser=name_and(numbers("SIGNAL=NUMBER", 1)))
    ] = None,
    limit: Annotated[float | None, typer.Option("--limit", "--torque")] = None,
    angle: float = math.inf,
    rate: float = math.inf,
    c: File = None,
    theory: TheoryName = None,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Excitation whose record determines free numbers best.

    Binary sequences, multisines, sweeps and double steps within the limits, ranked by the intervals to expect
    (D-optimal).  The record is in open loop, at the arm's own numbers.

    Options:
    free: numbers to be fitted: keys of the arm's file, drive.gain, drive.delay, gain:SIGNAL
    duration: length of the record [s]
    outputs: measured signals, separated by commas
    noise: standard deviation of a signal's noise in SI units, if not that of its converter; may be repeated
    limit: largest input, in its unit; by default the chain's
    angle: largest hub angle [rad]
    rate: largest hub rate [rad/s]
    c: write the samples as C
    """
    found = tfarm.experiment(
        load_arm(arm, theory),
        [key.strip() for key in free.split(",") if key.strip()],
        duration,
        limit=limit,
        angle=angle,
        rate=rate,
        outputs=[name.strip() for name in outputs.split(",") if name.strip()],
        noise={name: value for name, (value,) in noise or []},
        chain=chain(arm),
        progress=advance,
    )
    if c is not None:
        from tfarm.exported.excitation import excitation_code

        write_file(c, excitation_code(found), key="--c")
    show(found, also=(c,))
