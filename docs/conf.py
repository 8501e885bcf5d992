"""Sphinx configuration.  Pages are prose in MyST, tutorials are notebooks; references and tables come from the code."""

import hashlib
import inspect
import logging
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import typer
from latex2mathml.converter import convert
from pydantic_core import PydanticUndefined
from typer.cli import get_docs_for_click

import tfarm
from tfarm.arm.chain import CHAIN_TABLES
from tfarm.arm.law_tables import LawTable, SignalTable, WeightTable
from tfarm.arm.materials import materials
from tfarm.arm.schema import PART_TABLES, SHAPE_TABLES, ArmTable, StrictTable, file_keys
from tfarm.arm.stages import ARM_KEYS, STAGES
from tfarm.assessment import step
from tfarm.cli.running import whole_command
from tfarm.dsp import kernel
from tfarm.exported import controller, fmu, live_loop, systems, tuner_code
from tfarm.fitting.run_files import RunTable
from tfarm.loop import sampled_verdict, stability
from tfarm.schema.glossary import CERTAINTY, declared_records
from tfarm.synthesis import design
from tfarm.tuner import kernel as tuner_kernel

HERE = Path(__file__).parent
sys.path[:0] = [
    str(HERE),
    str(HERE.parent),
]  # `tables`; and `tests`, with the surveys that tables are measured by

from tables import markdown_table  # noqa: E402

project = "tfarm"
author = copyright = "The tfarm authors"
release = version = tfarm.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "tables"]
myst_enable_extensions = ["colon_fence", "dollarmath", "amsmath", "deflist", "substitution"]
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
html_static_path = ["static"]
html_css_files = ["notebook.css"]


def hash_of_sources() -> str:
    """Return a hash of the package: what a notebook shows is kept until the package changes."""
    digest = hashlib.sha256()
    for path in sorted(Path(tfarm.__file__).parent.rglob("*")):
        if path.suffix in (".py", ".toml"):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "notebooks" / hash_of_sources())
nb_execution_in_temp = True
nb_execution_timeout = 600  # seconds of a cell: kernels are compiled in some, on a slow machine
nb_execution_raise_on_error = (
    False  # a failed cell is a warning, for which the build fails after the other pages
)
nb_execution_show_tb = True
nb_output_stderr = "remove"  # progress and names of written files
nb_merge_streams = True
os.environ["PATH"] = (
    f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # the command tfarm, in notebooks
)
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["IPYTHONDIR"] = str(HERE / "_build" / "ipython")  # no profile of the user's own
logging.getLogger("traitlets").setLevel(logging.WARNING)


FILE_TABLES: dict[str, type[StrictTable]] = {
    "": ArmTable,
    **PART_TABLES,
    **{f'link.section] with shape = "{shape}': table for shape, table in SHAPE_TABLES.items()},
    "law": LawTable,
    "law.SIGNAL": SignalTable,
    "weights": WeightTable,
    **CHAIN_TABLES,
    "measured": RunTable,
}


def commands_page() -> str:
    """Return every command with its arguments, options and example, as Typer writes them."""
    whole = whole_command()
    context, commands = typer.Context(whole), whole.commands.values()
    rows = (
        [each.rich_help_panel, f"[`{each.name}`](#tfarm-{each.name})", each.help.splitlines()[0]]
        for each in commands
        if not each.hidden
    )
    pages = [get_docs_for_click(obj=each, ctx=context, indent=1, call_prefix="tfarm") for each in commands]
    text = re.sub(r"(?m)^Example: (.*)$", "**Example**:\n\n```console\n$ \\1\n```", "\n".join(pages))
    return "\n".join(["# Commands", "", *markdown_table(("chapter", "command", "purpose"), rows), "", text])


def arm_file_page() -> str:
    """Return every table of an arm's file: key, label, unit, default and meaning, from the declaration of its keys."""
    lines = ["# Arm file", "", "Tables of an arm's TOML file, in SI units. A key without a default is required; in "
             "`[link]` a material replaces the density and the moduli.", ""]  # fmt: skip
    for name, table in FILE_TABLES.items():
        meaning = inspect.getdoc(getattr(table, "makes", table)) or ""
        lines += [f"## {f'[{name}]' if name else 'Top of the file'}", "", " ".join(meaning.split()), ""]
        rows = (row_of(name.partition("]")[0] or "top", *field) for field in table.model_fields.items())
        lines += [*markdown_table(("key", "label", "unit", "type", "default", "meaning"), rows), ""]
        lines += materials_table() if name == "link" else []
    return "\n".join([*lines, *stages_table()])


CONSUMERS = (
    stability.CONTINUOUS, sampled_verdict.SAMPLED_LOOP, step.CONSUMER, kernel.CONSUMER, design.CONSUMER,
    tuner_kernel.CONSUMER, controller.CONSUMER, tuner_code.CONSUMER, fmu.CONSUMER, systems.CONSUMER, live_loop.CONSUMER,
)  # fmt: skip


def stages_table() -> list[str]:
    """Return the stages of one sample, and what each consumer does with their keys."""
    shown = [(stage, ", ".join(f"`{key}`" for key in stage.keys if key not in ARM_KEYS)) for stage in STAGES]
    head = markdown_table(
        ("stage", "keys", "equation", "meaning", "linear"),
        (
            [stage.name, keys, f"`{stage.equation}`", stage.meaning, "yes" if stage.is_linear else "no"]
            for stage, keys in shown
        ),
    )
    text = (
        "**acts**: the stage changes the answer. **named**: the answer is without it, and its line of certainty names "
        "the key where a file has it. **partly**: both. **none**: the stage does not concern the answer. **refused**: "
        "a file with such a key has no such answer. Every other key of an arm is one of the stage plant. The sampled "
        "loop has its verdict, its margins and its column of the card."
    )
    rows = (
        [keys, *(consumer.word(stage.name) or "refused" for consumer in CONSUMERS)]
        for stage, keys in shown
        if keys
    )
    words = markdown_table(("keys", *(consumer.name for consumer in CONSUMERS)), rows)
    intro = "What happens in one sample, in this order. A stage that an answer does not state is refused by its name."
    return [
        "## Stages of one sample",
        "",
        intro,
        "",
        *head,
        "",
        "## Keys and answers",
        "",
        text,
        "",
        *words,
        "",
    ]


def materials_table() -> list[str]:
    """Return the materials of a link: numbers, source and usual range."""
    rows = (
        [f"`{name}`", f"{of.density:g}", f"{of.youngs_modulus / 1e9:g}",
         f"ν = {of.poissons_ratio:g}" if of.is_isotropic else f"G = {(of.shear_modulus or 0) / 1e9:g} GPa",
         of.source, of.range]
        for name, of in materials().items()
    )  # fmt: skip
    text = (
        "`material` fills the density and the moduli that are left out; each key in the file replaces its number. "
        "Laminates have E along the link and G in the plane of bending, and the shear factor of ν = 0 unless given."
    )
    titles = ("material", "density [kg/m^3]", "E [GPa]", "shear", "source", "usual range")
    return ["### Materials", "", text, "", *markdown_table(titles, rows), ""]


def json_page() -> str:
    """Return every record of the results: JSON keys with label, unit and meaning."""
    text = """# JSON keys

Records that the commands print with `--json`, one section each. A record inside another one is an object there, a list
of records a list of objects. A complex number is `[real, imaginary]`, an infinity `"inf"` or `"-inf"`, a missing value
`null`. Columns of CSV files have the same keys.
"""
    lines = [text]
    for kind, declared in sorted(declared_records(), key=lambda each: (each[0].__name__, each[0].__module__)):
        title = f"{kind.__name__} ({kind.__module__.split('.')[1]})"
        meaning = (inspect.getdoc(kind) or "").split("\n\n")[0]
        rows = ([f"`{of.key}`", of.label, of.unit, of.help] for of in declared.values())
        lines += [f"## {title}", "", " ".join(meaning.split()), ""]
        lines += [*markdown_table(("key", "label", "unit", "meaning"), rows), ""]
    return "\n".join(lines)


def row_of(place: str, key: str, known: Any) -> list[str]:
    """Return the cells of one key of a file's table."""
    words = file_keys()[f"{place}.{key}"]
    made = known.annotation.__name__ if isinstance(known.annotation, type) else str(known.annotation)
    is_table = key in PART_TABLES or key == "section"
    kind = "table" if is_table else made.replace("typing.", "").replace("|", "or")
    default = "" if known.default is PydanticUndefined or is_table else f"`{known.default!r}`"
    return [f"`{key}`", words.label, words.unit, kind, default, words.help]


myst_substitutions = {
    "certainty": "\n".join(
        markdown_table(
            ("word", "meaning", "condition"),
            ([f"**{each.name}**", *each.meaning.split(" Shown: ")] for each in CERTAINTY),
        )
    )
}


def write_references(app: Any) -> None:
    """Write the pages that are made from the code, where they have changed."""
    for name, text in {"commands": commands_page(), "json": json_page(), "arm-file": arm_file_page()}.items():
        path = HERE / "reference" / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def escape_bars(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep |L| of a docstring a magnitude: in reStructuredText it is a substitution."""
    lines[:] = [re.sub(r"(?<!\\)\|", r"\|", line) for line in lines]


def write_kernel_settings(app: Any) -> None:
    """Write the profile of the kernels of notebooks, of whose messages only errors are shown; leave no older cache."""
    for each in Path(nb_execution_cache_path).parent.glob("*"):
        if each.name != Path(nb_execution_cache_path).name:
            shutil.rmtree(each)
    profile = Path(os.environ["IPYTHONDIR"]) / "profile_default"
    (profile / "startup").mkdir(parents=True, exist_ok=True)
    (profile / "startup" / "kernel.py").write_bytes((HERE / "kernel.py").read_bytes())
    settings = 'get_config().IPKernelApp.log_level = "ERROR"\n'
    (profile / "ipython_kernel_config.py").write_text(settings, encoding="utf-8")


def check_figures(app: Any, error: Exception | None) -> None:
    """Raise ExtensionError for a tutorial with fewer figures than its cells draw."""
    from sphinx.errors import ExtensionError

    for path in () if error else (HERE / "tutorials").glob("*.md"):
        drawn = path.read_text(encoding="utf-8").count("tfarm.plots.")
        shown = (
            (Path(app.outdir) / "tutorials" / f"{path.stem}.html").read_text(encoding="utf-8").count("<img ")
        )
        if shown < drawn:
            raise ExtensionError(f"{path.name}: {drawn} figures are drawn, {shown} shown")


ACCESSIBLE = (  # of the theme's pages: names and levels that a screen reader wants, and scrolling by keyboard
    ('role="heading">', 'role="heading" aria-level="2">'),
    ('<aside class="sidebar-drawer">', '<aside class="sidebar-drawer" aria-label="pages">'),
    ('<aside class="toc-drawer', '<aside aria-label="contents of this page" class="toc-drawer'),
    ("<pre>", '<pre tabindex="0">'),
    ('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper'),
    ('<div class="output text_html">', '<div tabindex="0" class="output text_html">'),
    ('display="block">', 'display="block" tabindex="0">'),
)


def make_accessible(app: Any, error: Exception | None) -> None:
    """Complete the attributes of finished pages."""
    for path in () if error else Path(app.outdir).rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        made = text
        for old, new in ACCESSIBLE:
            made = made.replace(old, new)
        if made != text:
            path.write_text(made, encoding="utf-8")


def write_formula(translator: Any, node: Any) -> None:
    """Write a formula as MathML, which browsers draw without a script or the network."""
    from docutils import nodes  # comes with Sphinx; the tests read this file without

    display = "block" if isinstance(node, nodes.math_block) else "inline"
    translator.body.append(convert(node.astext(), display=display))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Connect the pages and formulas above to Sphinx."""
    app.connect("builder-inited", write_references)
    app.connect("builder-inited", write_kernel_settings)
    app.connect("autodoc-process-docstring", escape_bars, priority=900)  # after napoleon
    app.connect("build-finished", check_figures)
    app.connect("build-finished", make_accessible)
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))
