"""Check of an arm's file: derived numbers, warnings, controller, and the tables that it leaves out."""

import math
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from tfarm.arm import Arm, Theory, implausible
from tfarm.arm.chain import PERIOD, chain_of_tables, load_chain
from tfarm.arm.law_tables import load_law, load_weights
from tfarm.arm.reading import load, load_tables
from tfarm.arm.schema import arm_of_table
from tfarm.assessment.card import reference_damping
from tfarm.dsp import Chain
from tfarm.errors import require
from tfarm.schema import Percent, Quantity
from tfarm.spectrum import modes
from tfarm.spectrum.listing import listed_modes

# of the tables that a file may leave out
DEFAULTS = {
    "clamp": "rigid, no spring between hub and link",
    "joint": "rigid, no spring between drive and hub",
    "motor": "none, the input is the torque on the hub, or its angle where it is locked",
    "attachment": "none, no body or spring on the link",
    "gauge": "at the root, x = 0 m",
    "payload": "none, a free tip",
    "sampling": f"period {Chain().sampling.period:g} s, no computational delay, no anti-aliasing filter",
    "converters": "ideal, without quantisation and range",
    "actuator": "no limit of the input, no analog damping of the hub",
    "slew": f"1.15 times the reach at the tip, in {Chain().slew.rise_time:g} s",
    "reference": "bang-bang, without input shaping",
    "law": "default gains: K1 = 0.00642 J w1, and K2 = 0.3 with hub inertia; scaled from the paper's, not a design",
}


class Note(NamedTuple):
    """A key or table of a file, or a signal, and what there is to it."""

    name: Annotated[
        str, Quantity("item", help="key with its value, heading of a table, or signal of the controller")
    ]
    text: Annotated[str, Quantity("note", help="warning, default without the table, or factor of the signal")]


@dataclass(frozen=True, kw_only=True)
class ArmCheck:
    """An arm's file as it is read."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    theory: Annotated[str, Quantity("beam theory", help="timoshenko, shear, rayleigh or euler-bernoulli")]
    mass: Annotated[float, Quantity("mass of the link", "kg", 4, "of all segments", key="mass_kg")]
    inertia: Annotated[
        float,
        Quantity("total inertia J", "kg m^2", 4, "of all parts, about the axis", key="total_inertia_kg_m2"),
    ]
    slenderness: Annotated[
        float,
        Quantity(
            "slenderness", "", 4, "length over radius of gyration of the section, the least of all segments"
        ),
    ]
    frequency: Annotated[
        float,
        Quantity(
            "first flexible frequency", "rad/s", 6, "exact, of the undamped arm", key="first_frequency_rad_s"
        ),
    ]
    frequency_hz: Annotated[
        float, Quantity("first frequency", "Hz", 6, "the same in hertz", key="first_frequency_hz")
    ]
    euler_bernoulli: Annotated[
        float,
        Quantity(
            "by Euler-Bernoulli", "rad/s", 6, "without shear and rotary inertia", key="euler_bernoulli_rad_s"
        ),
    ]
    error: Annotated[
        Percent,
        Quantity(
            "error of Euler-Bernoulli",
            "",
            3,
            "its frequency over the exact one, less 1",
            key="euler_bernoulli_error",
        ),
    ]
    damping_ratio: Annotated[
        Percent | None,
        Quantity("damping ratio of mode 1", "", 4, "exact, without controller; null where not determined"),
    ]
    period: Annotated[float, PERIOD]
    torque_limit: Annotated[
        float, Quantity("limit of the input", "", 4, "of [actuator]; inf for none", unit_of="input_unit")
    ]
    input_unit: Annotated[str, Quantity(help="SI unit of the arm's input")]
    assumptions: Annotated[
        tuple[str, ...], Quantity("assumptions", help="of the file, and sources of its materials")
    ]
    next_command: Annotated[str, Quantity("next", help="command to try next")]
    warnings: Annotated[
        list[Note], Quantity("warnings", help="values that may have a wrong unit, and limits")
    ]
    law: Annotated[list[Note], Quantity("controller", help="signals of the file's law with their factors")]
    missing: Annotated[
        list[Note], Quantity("missing tables", help="tables left out, and what is assumed instead")
    ]


def check_arm(name: str, theory: Theory | None = None) -> ArmCheck:
    """Return the check of a preset or an arm's file, all its tables read.

    Raises ParameterError, naming the file and the key, for the first problem.
    """
    file = load_tables(name)
    arm = load(file)
    if theory is not None:
        arm = arm.under(theory)
    law = load_law(file)
    load_weights(file)
    chain = load_chain(file)
    first = listed_modes(modes(arm, 1)).modes[-1]
    omega = float(first.natural_frequency)
    of_bernoulli = first.theories["euler-bernoulli"]
    error = Percent(of_bernoulli / omega - 1)
    ratio = 0.0 if arm.is_undamped else first.damping_ratio
    command = f"design {shlex.quote(name)} --save law.toml"
    if law is not None:
        command = f"margins {shlex.quote(name)}"
    if arm.is_locked:
        command = f"modes {shlex.quote(name)}"
    slenderness = min(arm.length / link.section.radius_of_gyration for link in arm.links)
    return ArmCheck(
        arm=arm.name,
        theory=arm.theory,
        mass=arm.own_mass,
        inertia=arm.total_inertia,
        slenderness=slenderness,
        frequency=omega,
        frequency_hz=first.natural_frequency_hz,
        euler_bernoulli=of_bernoulli,
        error=error,
        damping_ratio=None if ratio is None else Percent(ratio),
        assumptions=arm.assumptions,
        period=chain.sampling.period,
        torque_limit=chain.actuator.torque_limit,
        input_unit=arm.input_unit,
        next_command=f"tfarm {command}",
        warnings=[
            Note(*text.split(": ", 1))
            for text in _warnings(file.tables, arm, slenderness, error, chain, omega)
        ],
        law=[] if law is None else [Note(*each) for each in law.as_typed()],
        missing=[Note(f"[{table}]", text) for table, text in DEFAULTS.items() if table not in file.tables],
    )


def _warnings(
    tables: Mapping[str, Any], arm: Arm, slenderness: float, error: float, chain: Chain, omega: float
) -> Iterator[str]:
    """Yield the warnings of an arm: a motor without input, values that may have a wrong unit, a short link, C = 0."""
    # of the first frequency by Euler-Bernoulli: a steel link of slenderness 20 has some 1.3 %
    large_error = 0.01
    if "motor" in tables and "input" not in tables:
        yield "input: hub_torque is assumed; with a [motor] give hub_torque, motor_voltage or motor_current"
    yield from implausible(arm)
    if error > large_error:
        yield f"slenderness = {slenderness:.3g}: shear and rotary inertia count; Euler-Bernoulli leaves them out"
    if arm.has_elastic_link:
        yield (
            "link.damping = 0: undamped model, in which any delay destabilises a mode; "
            f"damping = {reference_damping(arm):.3g} in [link] is a damping ratio of 0.1 % in mode 1"
        )
    # samples cannot show the mode
    longest = math.pi / omega
    if chain.sampling.period > longest:
        yield (
            f"sampling.period = {chain.sampling.period:g}: above half the period of the first mode, {longest:.3g} s, "
            "which is aliased; choose a tenth of that"
        )


def with_damping(tables: dict[str, Any], ratio: float | None) -> dict[str, Any]:
    """Return the tables of an arm's file, with the damping C of its link of which mode 1 has this ratio, if given.

    Raises ParameterError for tables that are no arm's.
    """
    arm = arm_of_table(tables)
    chain_of_tables(tables)
    if ratio is None:
        return tables
    require(
        0 < ratio < 1, "--damping-ratio", ratio, "above 0 and below 1; 0.005 is 0.5 % of critical damping"
    )
    # of bending alone
    C = reference_damping(arm, ratio)
    found = listed_modes(modes(arm.with_numbers(damping=C), 1)).modes[-1].damping_ratio or ratio
    return tables | {"link": {"damping": float(f"{C * ratio / found:.4g}")} | tables["link"]}
