"""The commands that begin an arm's file and check it."""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.arm.parts import SHAPES
from tfarm.cli.app import add_command
from tfarm.cli.options import SAMPLING, Png, TheoryName, preset_names, refuse
from tfarm.cli.output import emit_record
from tfarm.cli.progress import advance
from tfarm.errors import MISSING, ParameterError, must_be_known, require
from tfarm.files import write_file
from tfarm.schema import Quantity

Size = Annotated[float | None, typer.Option(rich_help_panel="Section")]


def value_or_prompt(option: str, value: Any, text: str, kind: type = float, usual: Any = None) -> Any:
    """Return the value of an option, where it is None the answer to a question on a terminal.

    Raises ParameterError where standard input is no terminal.
    """
    if value is not None:
        return value
    require(
        sys.stdin and sys.stdin.isatty(), option, MISSING, f"give the {text}; on a terminal tfarm asks for it"
    )
    # no lines of progress between question and answer
    advance(0, 0, "")
    return typer.prompt(text, type=kind, default=usual, err=True)


def link_table(*, material: str | None = None, length: float | None = None) -> dict[str, Any]:
    """Return the table of a link without its section.

    Options:
    material: steel, spring steel, aluminium 6061, titanium 6Al-4V, brass, CFRP UD 0, GFRP, PLA or ABS
    length: length of the link [m]
    """
    from tfarm.arm.materials import materials

    chosen = value_or_prompt("--material", material, f"material ({', '.join(materials())})", str, "steel")
    must_be_known("--material", chosen, materials())
    return {"length": value_or_prompt("--length", length, "length of the link [m]"), "material": chosen}


def section_table(
    *,
    width: Size = None,
    depth: Size = None,
    diameter: Size = None,
    outer_diameter: Size = None,
    inner_diameter: Size = None,
) -> dict[str, Any]:
    """Return the table of a section, whose shape follows from its sizes.

    Options:
    width: side of a rectangle along the axis of rotation [m]
    depth: side of a rectangle in the plane of bending [m]
    diameter: of a solid round bar [m]
    outer_diameter: of a round tube [m]
    inner_diameter: of a round tube [m]
    """
    sections = "rectangle (--width, --depth), round (--diameter) or tube (--outer-diameter, --inner-diameter)"
    from tfarm.arm.schema import file_key

    sizes = {
        "width": width,
        "depth": depth,
        "diameter": diameter,
        "outer_diameter": outer_diameter,
        "inner_diameter": inner_diameter,
    }
    options = {name: f"--{name.replace('_', '-')}" for name in sizes}
    given = [name for name, size in sizes.items() if size is not None]
    last = given[-1] if given else "width"
    shapes = [shape for shape, of in SHAPES.items() if set(given) <= set(of.dimensions)]
    require(shapes, options[last], sizes[last], f"give the sizes of one section: {sections}")
    shape = shapes[0]
    if not given:
        shape = value_or_prompt(options[last], None, f"section: {sections}", str, "rectangle")
    must_be_known("section", shape, SHAPES)
    table = {"shape": shape}
    for name in SHAPES[shape].dimensions:
        key = file_key(f"link.section.{name}")
        table[name] = value_or_prompt(options[name], sizes[name], f"{key.label} ({key.help}) [m]")
    return table


@dataclass(frozen=True)
class Preset:
    """An arm that comes with tfarm."""

    name: Annotated[str, Quantity("name", help="argument ARM of every command")]
    length: Annotated[float, Quantity("length", "m", help="of all elastic links together", key="length")]
    damping: Annotated[
        float,
        Quantity(
            "damping C",
            "s",
            help="Kelvin-Voigt, the largest of all links: stress E (strain + C strain rate)",
            key="damping",
        ),
    ]
    hub_inertia: Annotated[
        float, Quantity("hub inertia", "kg m^2", help="about the axis of rotation, without a motor")
    ]
    payload_mass: Annotated[float, Quantity("payload mass", "kg", help="at the tip")]
    payload_inertia: Annotated[float, Quantity("payload inertia", "kg m^2", help="about the tip")]
    assumptions: Annotated[
        tuple[str, ...],
        Quantity("assumptions", help="numbers that the source of the arm does not give, and their origin"),
    ]


@dataclass(frozen=True)
class Presets:
    """All of them."""

    presets: Annotated[list[Preset], Quantity("arms", help="arms that come with tfarm")]


def list_presets() -> Presets:
    """Return the arms that come with tfarm."""
    names = [each.name for each in fields(Preset)]
    return Presets([Preset(*attrgetter(*names)(tfarm.load(preset))) for preset in tfarm.presets()])


@add_command(
    "Arm",
    epilog="new my-arm.toml --material steel --length 0.8 --width 0.06 --depth 0.004 --hub-inertia 0.05",
)
def new(
    *,
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="the file to write, .toml", show_default=False)
    ] = None,
    presets: Annotated[
        bool, typer.Option("--list", help="list the arms that come with tfarm, with their assumptions")
    ] = False,
    link: Callable[..., Any] = link_table,
    section: Callable[..., Any] = section_table,
    hub_inertia: float | None = None,
    payload_mass: float = 0.0,
    payload_inertia: float = 0.0,
    damping: float | None = None,
    damping_ratio: float | None = None,
    period: Annotated[float | None, typer.Option(rich_help_panel=SAMPLING)] = None,
    force: bool = False,
    show: Any = emit_record,
) -> None:
    """Arm file from options, with comments; --list shows the presets.

    On a terminal tfarm asks for a missing number.  A preset is an ARM of every command.

    Options:
    hub_inertia: inertia of the hub about the axis [kg m^2]; inf locks it, 0 is a free pin
    payload_mass: mass at the tip [kg]
    payload_inertia: inertia of the payload about its own centre of mass [kg m^2]
    damping: Kelvin-Voigt damping C of the link [s]
    damping_ratio: or the damping ratio of mode 1, such as 0.005
    period: sampling period of the controller [s]
    force: replace the file
    """
    from tfarm.arm.writing import first_file
    from tfarm.assessment.arm_check import with_damping

    if presets:
        require(file is None, "FILE", str(file), "--list writes no file: leave this out")
        show(list_presets())
        return
    refuse(
        {"json": show.keywords["json"]}, "a file is written: give --list for the arms that come with tfarm"
    )
    if file is None:
        raise ParameterError(key="FILE", value=MISSING, remedy="give a name that ends with .toml, or --list")
    require(file.suffix == ".toml", "FILE", str(file), "give a name that ends with .toml")
    require(force or not os.path.lexists(file), "FILE", str(file), "exists already; --force replaces it")
    refuse({"damping-ratio": None if damping is None else damping_ratio}, "give it or --damping, not both")
    tables = {
        "name": file.stem,
        "link": ({} if damping is None else {"damping": damping}) | link() | {"section": section()},
        "hub": {
            "inertia": value_or_prompt(
                "--hub-inertia", hub_inertia, "inertia of the hub about the axis [kg m^2]"
            )
        },
        "payload": {"mass": payload_mass, "inertia": payload_inertia},
        **({} if period is None else {"sampling": {"period": period}}),
    }
    write_file(file, first_file(with_damping(tables, damping_ratio)).encode(), key="FILE")
    print(f"written: {file}; next: tfarm check {file}")


@add_command("Arm", epilog="check my-arm.toml --figure my-arm.png")
def check(
    *,
    arm: Annotated[
        str, typer.Argument(metavar="ARM", help="preset or TOML file", autocompletion=preset_names)
    ],
    theory: TheoryName = None,
    png: Png = None,
    show: Any = emit_record,
) -> None:
    """Arm file as read: mass, inertia, first frequency, warnings.

    Tables that are missing are listed with their defaults; its picture is a sketch to scale.
    """
    from tfarm.assessment.arm_check import check_arm

    found = check_arm(arm, theory)
    if png is not None:
        from tfarm import plots
        from tfarm.arm import load

        plots.files.save_picture(plots.sketch.figure, load(arm), png)
    show(found, also=(png,))
