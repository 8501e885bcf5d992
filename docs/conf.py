"""Sphinx configuration.  Pages are prose in MyST; those of commands and of the arm file are made from the code."""

from pathlib import Path
from typing import Any

import typer
from latex2mathml.converter import convert
from pydantic_core import PydanticUndefined
from typer.cli import get_docs_for_click

import tfarm
import tfarm.cli.running  # loads every command
from tfarm.arm.schema import ARM_TABLES, SHAPE_TABLES, TomlTable
from tfarm.cli.app import whole_command

HERE = Path(__file__).parent

project = "tfarm"
author = copyright = "The tfarm authors"
release = version = tfarm.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
html_math_renderer = "mathml"
html_title = f"tfarm {release}"
html_show_sphinx = False
html_copy_source = False
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
add_module_names = False
napoleon_google_docstring = False
napoleon_use_rtype = False
exclude_patterns = ["_build"]


def commands_page() -> str:
    """Every command with its arguments and options, as Typer writes them."""
    whole = whole_command()
    context, commands = typer.Context(whole), whole.commands.values()
    pages = [get_docs_for_click(obj=each, ctx=context, indent=1, call_prefix="tfarm") for each in commands]
    rows = [f"| [`{each.name}`](#tfarm-{each.name}) | {each.help.splitlines()[0]} |" for each in commands]
    return "\n".join(["# Commands", "", "| command | purpose |", "|---|---|", *rows, "", *pages])


def arm_file_page() -> str:
    """Every table of an arm's TOML file: key, type, default, and the meaning with units from the record's docstring."""
    lines = ["# Arm file", "", "Tables of an arm's TOML file, in SI units. A key without a default is required.", ""]
    for name, table in {**ARM_TABLES, **{f"link.section, {each}": of for each, of in SHAPE_TABLES.items()}}.items():
        lines += [f"## {f'[{name}]' if name else 'Top of the file'}", "", *table_of(table), ""]
    return "\n".join(lines)


def table_of(table: type[TomlTable]) -> list[str]:
    """The lines of one table: the meaning of its record, then its keys."""
    record: Any = getattr(table, "makes", None)
    meaning = [" ".join((record.__doc__ or "").split()), ""] if record else []
    return [*meaning, "| key | type | default |", "|---|---|---|", *map(row_of, table.model_fields.items())]


def row_of(field: tuple[str, Any]) -> str:
    """One key of a table."""
    key, known = field
    made = known.annotation.__name__ if isinstance(known.annotation, type) else str(known.annotation)
    is_table = "Table" in made or key == "section"
    kind = "table" if is_table else made.replace("typing.", "").replace("|", "or")
    default = "" if known.default is PydanticUndefined or is_table else f"`{known.default!r}`"
    return f"| `{key}` | {kind} | {default} |"


def write_references(app: Any) -> None:
    """Write the pages that are made from the code, where they have changed."""
    for name, text in {"commands": commands_page(), "arm-file": arm_file_page()}.items():
        path = HERE / "reference" / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write_formula(translator: Any, node: Any) -> None:
    """A formula as MathML, which browsers draw without a script or the network."""
    from docutils import nodes  # comes with Sphinx; the tests read this file without

    display = "block" if isinstance(node, nodes.math_block) else "inline"
    translator.body.append(convert(node.astext(), display=display))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Sphinx calls this."""
    app.connect("builder-inited", write_references)
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))
