"""Tables of the documentation that are computed when it is built: the directive `computed` and its functions.

    ```{computed} published
    ```

A function returns lines of Markdown.  No number is typed here: all come from the package, its data and its surveys.
"""

import ast
import json
import re
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

import tfarm
from tfarm.arm.chain import load_chain
from tfarm.arm.law_tables import load_law
from tfarm.assessment.card import GRADE_LIMITS
from tfarm.audit.published import Validation, validate
from tfarm.digits import general
from tfarm.fitting.decays import fit_ringdown
from tfarm.fitting.recording import read_recording
from tfarm.fitting.run_files import load_run
from tfarm.fitting.signals import UNITS
from tfarm.spectrum.table import hub_locked
from tfarm.synthesis.requirements import MEASURES
from tfarm.synthesis.structures import STRUCTURES

ROOT = Path(__file__).parent.parent
RIG = ROOT / "tests" / "data" / "quanser-2dsfl"
BENCH = ROOT / "reports" / "bench.json"
ARMS, SEED = 300, 5  # of the survey of accuracy that a build makes
TABLES: dict[str, Callable[[], list[str]]] = {}


def table(make: Callable[[], list[str]]) -> Callable[[], list[str]]:
    """Register a function as the table of its name."""
    TABLES[make.__name__.replace("_", "-")] = make
    return make


def markdown_table(titles: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a table."""
    cells = ([cell.replace("|", r"\|").replace("\n", " ") for cell in row] for row in rows)
    head = [*titles]
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *cells)]


@table
def grades() -> list[str]:
    """Limits of the grades of the result card, from the code that grades."""
    rows = [
        (
            "gain margin, upwards and downwards",
            GRADE_LIMITS["gain"],
            "at least",
            "dB",
            "[2] section 6.4, [5] section 7-7",
        ),
        ("phase margin", GRADE_LIMITS["phase"], "at least", "deg", "[2] section 6.4, [5] section 7-7"),
        (
            "delay margin",
            GRADE_LIMITS["periods"],
            "at least",
            "sampling periods",
            "one more sample of computing time",
        ),
        ("peak sensitivity Ms", GRADE_LIMITS["peak"], "at most", "", "[1] section 10.3, [3] section 2.4"),
    ]
    beyond = {"at least": "below", "at most": "above"}
    return markdown_table(
        ("quantity", "good", "low", "poor", "source"),
        (
            [name, *(f"{side} {limit:g} {unit}".strip() for limit in limits),
             f"{beyond[side]} {limits[1]:g} {unit}".strip(), source]
            for name, limits, side, unit, source in rows
        ),
    )  # fmt: skip


@table
def published() -> list[str]:
    """Published numbers by source: how many, how many agree, and the largest relative difference."""
    found = Validation(validate())
    rows = []
    for source in found.sources:
        of = [row for row in found.rows if row.source == source.key]
        largest = max(abs(row.difference) for row in of)
        rows.append([source.citation, str(len(of)), str(sum(row.agrees for row in of)), f"{largest:.1e}"])
    rows.append(["all", str(len(found.rows)), str(found.agree), ""])
    return markdown_table(
        ("source", "numbers", "agree to the last printed digit", "largest difference"), rows
    )


@table
def differences() -> list[str]:
    """Published numbers whose printed digits are not reached, with the reason of each."""
    rows = (
        [each.source, each.case, each.modes, f"{each.largest:.1e}", each.why]
        for each in Validation(validate()).differences
    )
    return markdown_table(("source", "case", "modes", "difference", "reason"), rows)


@table
def audit() -> list[str]:
    """Equations of the paper that are not right as printed, each with both readings and the check."""
    from tfarm.audit import audit as audited

    lines = []
    for row in (rows := audited()):
        if row.verdict != "ok":
            lines += [
                f"**{row.equation}**, {row.verdict}",
                "",
                "as printed",
                f": $$ {row.printed_tex} $$",
                "",
            ]
            lines += ["as corrected", f": $$ {row.corrected_tex} $$", "", "check", f": {row.evidence}", ""]
    return [*lines, f"Right as printed: {', '.join(row.equation for row in rows if row.verdict == 'ok')}."]


@table
def accuracy() -> list[str]:
    """Errors of float64 values against ball arithmetic: a small survey, made when the documentation is built."""
    from tests.exact.accuracy import measure
    from tests.strategies import some_arm, some_s

    rng, errors = np.random.default_rng(SEED), defaultdict(list)
    while len(errors["hub_angle"]) < ARMS:
        arm = some_arm(rng)
        for point in measure(arm, some_s(rng), float(rng.random())):
            if not point.flagged:
                errors[point.name].append(point.error)
    rows = (
        [f"`{name}`", str(len(each)), f"{np.median(each):.1e}", f"{max(each):.1e}"]
        for name, each in sorted(errors.items())
    )
    return markdown_table(("output", "values", "median error", "largest error"), rows)


@table
def speed() -> list[str]:
    """What `make bench` measured on this machine, if it was run."""
    if not BENCH.exists():
        return ["*Not measured on the machine that built this page: run `make bench` first.*"]
    kept = json.loads(BENCH.read_text(encoding="utf-8"))
    rows = (
        [each["what"], str(each["n"]),
         *("" if each[name] is None else _time(each[name]) for name in ("seconds", "median", "worst")),
         "" if each["ratio"] is None else f"{general(each['ratio'], 3)} × {each['to']}",
         "" if each["error"] is None else f"{each['error']:.0e}"]
        for each in kept["rows"]
    )  # fmt: skip
    versions = ", ".join(f"{name} {version}" for name, version in kept["versions"].items())
    titles = (
        "computation",
        "number",
        "time of each",
        "random arms: median",
        "worst",
        "ratio",
        "largest error",
    )
    return [*markdown_table(titles, rows), "", f"Versions: {versions}."]


def _time(seconds: float) -> str:
    unit, scale = next(
        each for each in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)) if seconds >= each[1]
    )
    return f"{general(seconds / scale, 3)} {unit}"


@table
def rig_laws() -> list[str]:
    """Verdicts on the two controllers of a real rig, and their measured steps against the predicted ones."""
    arm, chain = tfarm.load(str(RIG / "rig.toml")), load_chain(RIG / "rig.toml")
    rows = []
    for name in ("lqg", "hinf"):
        law, run = load_law(RIG / f"{name}.toml"), load_run(RIG / f"{name}.toml")
        measured, predicted, *_ = tfarm.predict(arm, run.run, chain).rows
        shares = [f"{100 * each.overshoot:.1f} %" for each in (measured, predicted)]
        rows.append([name, tfarm.sampled(arm, law, chain).verdict.sentence, *shares])
    titles = ("controller", "sampled loop", "overshoot, measured", "overshoot, predicted")
    return markdown_table(titles, rows)


@table
def units() -> list[str]:
    """Units of records by the SI unit that they are converted to."""
    rows: dict[str, list[str]] = {}
    for name, (unit, _) in UNITS.items():
        rows.setdefault(unit, []).append(f"`{name}`")
    return markdown_table(("SI unit", "units"), ((unit, ", ".join(names)) for unit, names in rows.items()))


@table
def rig_ring() -> list[str]:
    """Measured decays of a real rig, and its exact frequency with a locked hub."""
    locked = hub_locked(tfarm.modes(tfarm.load("quanser-2dsfl"), 1)).natural_frequency_hz[-1]
    rows = []
    for name in ("ring-20deg", "ring-neg-10deg"):
        found = fit_ringdown(read_recording(RIG / f"{name}.csv"), "tip_angle_against_hub", start=2.0)
        (mode,) = found.modes
        rows.append([name, f"{mode.frequency:.4g}", f"{mode.frequency_low:.4g} to {mode.frequency_high:.4g}",
                     f"{locked:.4g}"])  # fmt: skip
    return markdown_table(("record", "measured [Hz]", "95 % interval [Hz]", "exact, hub locked [Hz]"), rows)


@table
def rooms() -> list[str]:
    """The rooms of the package, from the highest to the lowest, each with the first line of its docstring."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = "|".join(settings["contracts"][0]["layers"]).replace("(", "").replace(")", "")
    names = [name.strip() for name in re.split("[|:]", layers) if "__main__" not in name]
    return markdown_table(("room", "purpose"), ([f"`tfarm.{name}`", _purpose(name)] for name in names))


def _purpose(name: str) -> str:
    folder = Path(tfarm.__file__).parent / name
    path = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    meaning = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return meaning.split("\n\n")[0].rstrip(":")


@table
def presets() -> list[str]:
    """The arms that come with the package, and what each assumes."""
    arms = [tfarm.load(name) for name in tfarm.presets()]
    rows = (
        [
            f"`{arm.name}`",
            f"{arm.length:g}",
            f"{arm.damping:g}",
            f"{arm.hub.inertia:g}",
            f"{arm.payload.mass:g}",
        ]
        for arm in arms
    )
    lines = markdown_table(
        ("name", "length [m]", "damping C [s]", "hub inertia [kg m²]", "payload [kg]"), rows
    )
    for arm in arms:
        lines += ["", f"**{arm.name}**", "", *(f"* {each}" for each in arm.assumptions)]
    return lines


@table
def outputs() -> list[str]:
    """Named outputs, their units and places."""
    from tfarm.exact.outputs import OUTPUTS

    rows = ([f"`{name}`", each.label, each.unit] for name, each in OUTPUTS.items())
    return markdown_table(("name", "meaning", "unit"), rows)


@table
def structures() -> list[str]:
    """Structures of a design and their formulas, as they are declared."""
    rows = ((f"`{name}`", of.formula) for name, of in STRUCTURES.items())
    return markdown_table(("`--structure`", "controller"), rows)


@table
def measures() -> list[str]:
    """Quantities that a requirement limits, with their short forms."""
    rows = []
    for name, each in MEASURES.items():
        loops = "sampled, in the slew" if each.of_slew else "both" if each.is_of(1) else "sampled"
        names = ", ".join(f"`{word}`" for word in dict.fromkeys((each.short[0], name, *each.short[1:])))
        rows.append((each.title, names, "share, or %" if each.is_share else each.unit, each.sense, loops))
    return markdown_table(("quantity", "names", "unit", "limited by", "loops"), rows)


@table
def dependencies() -> list[str]:
    """Packages that the package needs, with the lowest version of each."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [f"* `{each}`" for each in project["dependencies"]]


def setup(app: Any) -> dict[str, bool]:
    """Register the directive; Sphinx is imported here, as tests read the functions without it."""
    from docutils import nodes
    from docutils.statemachine import StringList
    from sphinx.util.docutils import SphinxDirective

    class Computed(SphinxDirective):
        """The table of a name."""

        required_arguments = 1

        def run(self) -> list[nodes.Node]:
            self.env.note_reread()  # with every build: no table is older than the code
            part, name = nodes.container(), self.arguments[0]
            self.state.nested_parse(StringList(TABLES[name](), source=name), self.content_offset, part)
            return part.children

    app.add_directive("computed", Computed)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
