"""The output of commands: a record as text, JSON, CSV file and picture."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.arm.reading import ArmFile
from tfarm.cli.options import Png, load_driven_loop
from tfarm.files import is_standard_output, write_file
from tfarm.schema import Table, as_csv, curve_table, to_dict, to_json


def emit_record(
    record: Any,
    defaults: Mapping[str, Any] | None = None,
    also: Sequence[Path | None] = (),
    rows: Table | None = None,
    summary: Any = None,
    *,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> None:
    """Print a record as JSON or as text.

    `defaults` is what JSON has of default gains; `also` are files that are written already.  The text ends with the
    `rows` of a table, and begins with the result card `summary`, as the "summary" of JSON.  Nothing is printed where
    standard output is one of the files.
    """
    written = [path for path in also if path is not None]
    if any(map(is_standard_output, written)):
        return
    for path in written:
        print(f"written: {path}", file=sys.stderr)
    if json:
        head = {"summary": to_dict(summary)} if summary else {}
        print(to_json({**head, **to_dict(record), **(defaults or {})}))
        return
    from tfarm.schema.terminal import show, show_table, show_text

    if summary is not None:
        show_table(summary.table)
        show_text("\n".join(summary.notes))
        print()
    if defaults and defaults["default_gains"]:
        words = f"by default {defaults['default_gains_in_words']}"
    else:
        words = ""
    show(record, rows, words)


def emit(
    record: Any,
    defaults: Mapping[str, Any] | None = None,
    also: Sequence[Path | None] = (),
    rows: bool = False,
    picture: str | None = None,
    summary: Any = None,
    *,
    show: Any = emit_record,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="write the table to this file")
    ] = None,
    png: Png = None,
) -> None:
    """Write the curves or rows of a record to CSV and its `picture` to a file, then print it.

    The `rows` of the CSV file are printed where they are wanted and not written; `summary` is that of `emit_record`.
    """
    if csv is not None:
        write_file(csv, as_csv(curve_table(record), units=True).encode(), key="--csv")
    if png is not None:
        # every picture is registered once they are loaded
        from tfarm import plots

        draw = getattr(plots, picture).figure if picture else plots.style.FIGURES[type(record)]
        plots.files.save_picture(draw, record, png)
    table = curve_table(record) if rows and csv is None else None
    show(record, defaults, (*also, csv, png), table, summary)


def emit_loop(picture: str, file: ArmFile, loop: Any, chain: Any, show: Any) -> None:
    """Emit the loop function of a command with that picture of it; of the sampled loop where sampling is given."""
    if has_options(chain):
        case, defaults = loop(file)
        found = case.through(chain(file)).loop_function()
    else:
        case, defaults = load_driven_loop(file, loop=loop)
        found = tfarm.loop_function(case.arm, case.law)
    show(found, defaults, picture=picture)


def has_options(options: Any) -> bool:
    """Return whether one of the options of a function is given."""
    return any(value is not None for value in options.keywords.values())
