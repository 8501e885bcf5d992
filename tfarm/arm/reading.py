"""Arms of presets and TOML files, and warnings of legal values that may have a wrong unit."""

import math
import os
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from tfarm.arm.parts import Link
from tfarm.arm.records import Arm
from tfarm.errors import ParameterError, did_you_mean, name_file, require, short_text
from tfarm.files import read_file

PRESETS = files("tfarm.arm") / "presets"


@cache
def presets() -> tuple[str, ...]:
    """Return the names of the arms that come with tfarm."""
    names = (each.name for each in PRESETS.iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


class ArmFile(NamedTuple):
    """The tables of a TOML file, read and parsed once, and the file's name."""

    tables: dict[str, Any]
    name: str


# a preset's name, a path, or what was read of either
AnyFile = str | os.PathLike[str] | ArmFile


def load(name_or_path: AnyFile) -> Arm:
    """Return the arm of a preset's name or of a TOML file's path.  Raises ParameterError, naming the file."""
    # here, as the import of pydantic is slow
    from tfarm.arm.schema import arm_of_table

    tables, name = load_tables(name_or_path)
    with name_file(name):
        return arm_of_table(tables)


def load_tables(name_or_path: AnyFile, key: str = "arm") -> ArmFile:
    """Return the tables of a preset's name or a path; those of a file that was read already as they are.

    `key` names it in a refusal.
    """
    # that of an arm of 64 segments has 15 KB
    most_bytes = 64 * 1024
    if isinstance(name_or_path, ArmFile):
        return name_or_path
    is_named = not isinstance(name_or_path, os.PathLike)
    name: Any = name_or_path if is_named else os.fspath(name_or_path)
    is_text = isinstance(name, str) and bool(name.strip()) and "\0" not in name
    require(is_text, key, name, f"give a preset ({', '.join(presets())}) or a path")
    if is_named and name in presets():
        name = f"{name}.toml"
        data = (PRESETS / name).read_bytes()
    elif is_named and not _is_path(name):
        remedy = f"no such preset: {did_you_mean(name, presets())}; or give the path of a .toml file"
        raise ParameterError(key=key, value=name, remedy=remedy)
    else:
        data = read_file(name, most_bytes, key=key, what="a .toml file")
    with name_file(name):
        return ArmFile(_table_of(data), name)


def _is_path(name: str) -> bool:
    """Whether a name that is no preset's is a path: by a separator or its ending, or as there is such a file."""
    return bool({"/", "\\", os.sep} & set(name)) or name.endswith(".toml") or os.path.lexists(name)


def decode_text(data: bytes, remedy: str) -> str:
    """Return the text of a file in UTF-8.  Raises ParameterError, naming the first other byte, with the remedy."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        bad = data[error.start : error.start + 1]
        raise ParameterError(key=f"byte {error.start}", value=bad, remedy=remedy) from None


def _table_of(data: bytes) -> dict[str, Any]:
    """Return the TOML table of a file.

    Raises ParameterError for an error of the parser with its line, the last one where the error has none.
    """
    text = decode_text(data, "is not UTF-8; save the file as UTF-8")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, _, where = str(error).rstrip(")").partition(" (at ")
        at = re.match(r"line (\d+)", where)
        line = text.split("\n")[int(at[1]) - 1 if at else -1]
        raise ParameterError(key=where or "TOML", value=line, remedy=f"is not TOML: {what}") from None
    except (ValueError, RecursionError):
        remedy = "an integer of thousands of digits, or brackets nested too deep"
        raise ParameterError(key="TOML", value=text, remedy=remedy) from None


# ------------------------------------------------------------ plausible values


class UsualRange(NamedTuple):
    """Least and largest value of a number of a segment, each with the warning beyond it.

    Each bound is far outside the range of materials and mechanisms.  A wrong unit (GPa for Pa, mm for m, g/cm^3 for
    kg/m^3, a damping ratio for seconds) changes a value by a factor of 50 or more.
    """

    least: float
    below: str
    most: float
    above: str


def implausible(arm: Arm) -> tuple[str, ...]:
    """Return a warning for each value that may have a wrong unit: its key in the TOML file, the value, and the reason.

    Empty for a plausible arm.
    """
    warnings: list[str] = []
    for i, link in enumerate(arm.links, 1):
        key = f"link.{i}" if arm.outer else "link"
        warnings += _segment_warnings(key, link, arm.length)
    return (*warnings, *_part_warnings(arm))


def _segment_warnings(key: str, link: Link, length: float) -> Iterator[str]:
    """Yield the warnings of a segment of an arm of that length [m], each beginning with its key in the file.

    They are of material, size, and the damping ratio C w/2 of the clamped arm in its first mode,
    w = (b/L)^2 sqrt(EI/rhoA).
    """
    soft = "softer than any rubber; its unit is Pa, not in GPa"
    stiff = "stiffer than diamond; its unit is Pa"
    light = "lighter than foam; its unit is kg/m^3, not in g/cm^3"
    dense = "denser than osmium; its unit is kg/m^3"
    long = "longer than any arm; its unit is m, not in mm"
    # soft silicone has 3e5 Pa, diamond 1.2e12 Pa
    modulus = UsualRange(1e5, soft, 2e12, stiff)
    usual = {
        "youngs_modulus": modulus,
        "shear_modulus": modulus,
        # light foam has 30 kg/m^3, osmium 22,600; in g/cm^3 everything is below 25
        "density": UsualRange(25.0, light, 25_000.0, dense),
        # that of the space station has 17 m
        "length": UsualRange(0.0, "", 100.0, long),
    }
    for name, limits in usual.items():
        value = getattr(link, name)
        if value < limits.least:
            yield f"{key}.{name} = {short_text(value)}: {limits.below}"
        elif value > limits.most:
            yield f"{key}.{name} = {short_text(value)}: {limits.above}"
    depth = math.sqrt(12) * link.section.radius_of_gyration
    sides = link.section.dimensions or (("second_moment means a depth of", depth),)
    for name, side in sides:
        if name != "inner_diameter" and side > length:
            what = name if name.startswith("second_moment") else f"{name} is"
            yield f"{key}.section.{what} {side:.4g} m, above the length of {length:.4g} m: no slender link"
    # of the clamped Euler-Bernoulli beam, whose first root of 1 + cos(b) cosh(b) = 0 this is; rubber has about 0.05
    ratio = link.damping * (1.8751040687119611 / length) ** 2 * math.sqrt(link.EI / link.rhoA) / 2
    if ratio > 0.1:
        yield (
            f"{key}.damping = {short_text(link.damping)}: a damping ratio of {ratio:.2g} in the first mode "
            "of the clamped link; its unit is s, as in E (1 + C s)"
        )


def _part_warnings(arm: Arm) -> Iterator[str]:
    """Yield the warnings of hub, payload, clamp, motor and attachments: values by a ratio to those of the link."""
    # times the link's own mass or inertia
    heaviest = 1e5
    # times the link's length; a hub's radius and a payload's offset are a fraction of it
    farthest_offset = 10.0
    hub = arm.hub
    payload = arm.payload
    length = arm.length
    mass = arm.own_mass
    # kg m^2, spread evenly from the axis
    beam = mass * length**2 / 3
    # N m
    bending = 3 * arm.bending_scale
    radius = math.sqrt(payload.inertia / payload.mass) if 0.0 < payload.mass < math.inf else 0.0
    heavy = "{:.1g} times the link's; in kg?"
    far = "{:.3g} times the link's length; its unit is m, not mm"
    # key, value, its ratio, the largest ratio, and the warning
    limits = [
        ("hub.inertia", hub.inertia, hub.inertia / beam, heaviest, "{:.1g} times the link's; in kg m^2?"),
        ("payload.mass", payload.mass, payload.mass / mass, heaviest, heavy),
        (
            "payload.inertia",
            payload.inertia,
            radius / length,
            1.0,
            f"a radius of gyration of {radius:.3g} m, above the link's length; in kg m^2?",
        ),
        ("hub.radius", hub.radius, hub.radius / length, farthest_offset, far),
        ("payload.offset", abs(payload.offset), abs(payload.offset) / length, farthest_offset, far),
        (
            "clamp.stiffness",
            arm.clamp.stiffness,
            bending / arm.clamp.stiffness,
            # a usual clamp has a tenth of the flexibility of its link
            10.0,
            "a clamp {:.2g} times as flexible as its link; its unit is N m/rad",
        ),
        (
            "hub.friction",
            hub.friction,
            hub.friction / (2 * math.sqrt(bending * arm.total_inertia)),
            # beyond it the link cannot turn the hub; a harmonic drive reaches 1
            50.0,
            "{:.2g} times the critical damping of the first mode; its unit is N m s/rad, on the hub's side of a gear",
        ),
    ]
    if arm.motor is not None:
        rotor = "through the gear {:.1g} times the link's; its unit is kg m^2, before the gear"
        own = arm.motor.rotor_inertia
        reflected = arm.motor.reflected_inertia
        limits.append(("motor.rotor_inertia", own, reflected / beam, heaviest, rotor))
    for i, each in enumerate(arm.attachments, 1):
        limits.append((f"attachment.{i}.mass", each.mass, each.mass / mass, heaviest, heavy))
    for key, value, ratio, most, text in limits:
        if most < ratio < math.inf:
            yield f"{key} = {short_text(value)}: {text.format(ratio)}"
