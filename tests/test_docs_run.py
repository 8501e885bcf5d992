"""Every code block of the documentation is executed, and every number of a tutorial is one that its cells print."""

import ast
import contextlib
import html
import importlib.util
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib import pyplot

import tfarm
from tests.bench import Row
from tests.octave import ABSENT, OCTAVE, left_by_octave
from tests.shared import docs_module
from tests.shell import heard
from tfarm.arm.chain import CHAIN_TABLES, load_chain
from tfarm.arm.law_tables import load_law
from tfarm.assessment.card import GRADE_LIMITS, grade_of
from tfarm.audit import audit
from tfarm.audit.published import validate
from tfarm.cli import main
from tfarm.cli.running import whole_command
from tfarm.exact.outputs import OUTPUTS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
MADE = {"reference/commands", "reference/json", "reference/arm-file"}  # by docs/conf.py; their examples are the help's
PAGES = {str(path.relative_to(DOCS).with_suffix("")): path for path in sorted(DOCS.rglob("*.md"))}
PAGES = {name: path for name, path in PAGES.items() if name not in MADE and not name.startswith("_build")}
DEAR = {  # more than a second and a half each: run by `make survey`
    "tutorials/design", "tutorials/sampling", "tutorials/fit", "howto/compare", "howto/controllers", "howto/studies",
    "howto/figures", "howto/measurements", "howto/sensors-motors", "howto/time-responses", "howto/input-shaping",
    "howto/experiment", "theory/design",
}  # fmt: skip
SHOWN = {"{toctree}", "{computed}", "{eval-rst}", "{math}", "{note}", "{tip}", "{seealso}", "{figure}"}
FENCE = re.compile(r"^(?P<fence>`{3,}|:{3,})(?P<kind>[^\n`]*)\n(?P<text>.*?)^(?P=fence)[ ]*$", re.MULTILINE | re.DOTALL)
OPTIONS = re.compile(r"(?::([\w-]+):[ ]*(.*)\n)")


@dataclass(frozen=True)
class Block:
    """A fenced block: language or directive, options, text."""

    kind: str
    options: dict[str, str]
    text: str


def blocks_of(page):
    """Return the fenced blocks of a page, in order."""
    found = []
    for match in FENCE.finditer(page.read_text(encoding="utf-8")):
        head = re.match(rf"(?:{OPTIONS.pattern})*", match["text"]).group() if match["kind"].startswith("{") else ""
        kind = match["kind"].strip().removeprefix("{code-block} ")
        text = re.sub(r"\A---\n.*?^---\n", "", match["text"][len(head) :], flags=re.MULTILINE | re.DOTALL)
        found.append(Block(kind, dict(OPTIONS.findall(head)), text.lstrip("\n")))
    return found


def prose_of(page):
    """Return the text of a page without blocks, front matter, displayed formulas, literals and targets of links."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    text = re.sub(r"\A---\n.*?^---\n", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    return re.sub(r"`[^`\n]*`|\]\([^)]*\)", "", text)


class Run:
    """The blocks of a page, executed in sequence in the current folder; `printed` is all that they print."""

    def __init__(self):
        self.names, self.printed, self.last = {}, "", ""

    def block(self, block):
        """Execute one block, by its kind."""
        kind, text = block.kind.removeprefix("{code-cell} "), block.text
        if kind.split()[0] in SHOWN:
            return
        if kind == "text":
            lines = [line.split() for line in self.last.splitlines()]
            assert all(line.split() in lines for line in text.splitlines() if line.strip(" .")), (text, self.last)
            return
        before = len(self.printed)
        if kind == "ipython3" and text.startswith("%%writefile "):
            head, _, text = text.partition("\n")
            self.file(head.split()[1], text)
        elif kind == "sh" or (kind == "ipython3" and text.startswith("%%bash\n")):
            for line in text.removeprefix("%%bash\n").replace("\\\n", "").splitlines():
                self.command(line)
        elif kind == "matlab":
            self.printed += left_by_octave(Path.cwd(), text)[1] if OCTAVE else ABSENT
        elif kind in ("python", "ipython3"):
            if text.startswith("import fmpy") and importlib.util.find_spec("fmpy") is None:
                pytest.skip("FMPy is not installed: the last blocks of howto/export-fmu")
            self.python(text)
        elif kind == "toml":
            self.file(block.options["caption"], text)
        else:
            raise AssertionError(f"no way to execute a block of {kind!r}")
        self.last = self.printed[before:]

    def python(self, text):
        """Execute statements; the value of a last expression is shown, unless a semicolon ends it, as in a notebook."""
        out, tree = io.StringIO(), ast.parse(text.removeprefix("%matplotlib inline\n"))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        with contextlib.redirect_stdout(out):
            exec(compile(tree, "block", "exec"), self.names)
            value = eval(compile(ast.Expression(last.value), "block", "eval"), self.names) if last else None
        self.printed += out.getvalue()
        if value is not None and not text.rstrip().endswith(";"):
            shown = value._repr_html_() if hasattr(value, "_repr_html_") else repr(value)
            self.printed += html.unescape(re.sub(r"<[^>]*>", " ", shown)) + "\n"

    def command(self, line):
        """Run a command of tfarm; of other programs only verbs of the Makefile and modules of the tests are known."""
        words = shlex.split(line, comments=True)
        match words:
            case []:
                return
            case ["tfarm", "report", *arguments]:  # minutes; its options alone
                whole_command().commands["report"].make_context("report", arguments)
            case ["tfarm", *arguments]:
                out, err = io.StringIO(), io.StringIO()
                with (
                    contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stop
                ):  # fmt: skip
                    main(arguments)
                assert not stop.value.code, (line, heard(err.getvalue()))
                self.printed += out.getvalue()
            case ["make", *verbs]:
                makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
                assert all("=" in verb or f"\n{verb}:" in makefile for verb in verbs), line
            case ["python", "-m", module, *_] if module != "pip":
                assert importlib.util.find_spec(module), line
            case ["cc" | "./self_test", *_] if shutil.which("cc"):
                self.printed += subprocess.run(words, capture_output=True, text=True, timeout=60, check=True).stdout
            case ["cc" | "./self_test", *_]:
                pytest.skip("cc is not installed on this machine")
            case ["pip" | "git" | "cd" | "python", *_]:
                return
            case _:
                raise AssertionError(f"not understood: {line}")

    def file(self, caption, text):
        """Write a file, or the end of one ("FILE, continued"), and read it as the arm, law or chain that it is."""
        name, _, rest = caption.partition(", ")
        path = Path(name)
        path.write_text((path.read_text(encoding="utf-8") if rest else "") + text, encoding="utf-8")
        if path.suffix == ".toml":
            tables = tomllib.loads(path.read_text(encoding="utf-8"))
            if "link" in tables:
                assert tfarm.modes(tfarm.load(f"./{name}"), 1).natural_frequency.size == 2
            elif "law" in tables:
                assert load_law(f"./{name}").signals
            else:
                assert tables.keys() <= CHAIN_TABLES.keys()
                load_chain(f"./{name}")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to run a page in, with the data of the tests and an IPython that only looks for files."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tests").symlink_to(ROOT / "tests", target_is_directory=True)
    pyplot.switch_backend("Agg")
    show = SimpleNamespace(Image=lambda name: len(Path(name).read_bytes()))
    monkeypatch.setitem(
        sys.modules, "IPython", SimpleNamespace(display=show, version_info=(9, 18), get_ipython=lambda: None)
    )
    monkeypatch.setitem(sys.modules, "IPython.display", show)
    yield tmp_path
    pyplot.close("all")


def unprinted(prose, printed):
    """Return the decimal numbers of a text that are no rounding of a number printed."""
    numbers = [float(each) for each in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", printed)]
    written = re.findall(r"(?<![\w.])(-?\d+\.(\d+)(?:e(\d+))?)", prose)
    return [
        text
        for text, decimals, power in written
        if all(abs(each - float(text)) > 0.5001 * 10.0 ** (int(power or 0) - len(decimals)) for each in numbers)
    ]


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.survey] * (name in DEAR)) for name in PAGES])
def test_every_block_of_a_page_runs(name, folder):
    page, run = PAGES[name], Run()
    blocks = blocks_of(page)
    for block in blocks:
        run.block(block)
    if name.startswith("tutorials/"):
        code = "\n".join(block.text for block in blocks)
        assert unprinted(prose_of(page), code + run.printed) == [], run.printed


def anchors_of(name):
    """Return the anchors of the headings of a page, as Sphinx makes them."""
    heads = re.findall(r"^#{1,3} (.*)$", FENCE.sub("", PAGES[name].read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("name", PAGES)
def test_links_of_a_page_lead_somewhere(name):
    """Offline: pages and their headings, files of the repository, and the form of what is elsewhere."""
    page = PAGES[name]
    for target in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", page.read_text(encoding="utf-8"))):
        file, _, anchor = target.partition("#")
        if "://" in target:
            assert re.fullmatch(r"https://[\w.-]+\.[a-z]+(/\S*)?", target), target
            continue
        path = (page.parent / file).resolve() if file else page
        known = str(path.relative_to(ROOT).with_suffix("")).removeprefix("docs/")
        assert path.exists() or known in MADE, target
        assert not anchor or known in MADE or anchor in anchors_of(known), target


@pytest.fixture(scope="module")
def tables():
    return docs_module("tables")


def test_every_computed_table_is_on_a_page_and_every_one_on_a_page_is_computed(tables):
    named = [
        block.kind.split()[1] for page in PAGES.values() for block in blocks_of(page) if "{computed}" in block.kind
    ]
    assert sorted(named) == sorted(tables.TABLES)


def test_tables_have_the_numbers_of_their_sources(tables, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "ARMS", 3)
    made = {name: make() for name, make in tables.TABLES.items() if name != "audit"}
    assert all(lines and all(lines[0]) for lines in made.values())
    found = validate()
    assert made["published"][-1].split(" | ")[1:3] == [str(len(found)), str(sum(row.agrees for row in found))]
    assert len(made["differences"]) - 2 == len({(row.source, row.case, row.why) for row in found if row.why})
    assert len(made["outputs"]) - 2 == len(OUTPUTS)
    assert any(line.startswith("| lqg | unstable") for line in made["rig-laws"])
    assert all(1.7 < float(line.split(" | ")[1]) < 2.0 for line in made["rig-ring"][2:])
    assert all(float(line.split(" | ")[3].rstrip(" |")) < 1e-14 for line in made["accuracy"][2:])
    kept = {"versions": {"tfarm": "1"}, "rows": [asdict(Row("modes", 100, 2e-5, 0.5, "other", 1e-16, 3e-5, 1e-3))]}
    (tmp_path / "bench.json").write_text(json.dumps(kept), encoding="utf-8")
    monkeypatch.setattr(tables, "BENCH", tmp_path / "bench.json")
    assert "| modes | 100 | 20 µs | 30 µs | 1 ms | 0.5 × other | 1e-16 |" in tables.speed()


def test_grades_of_the_documentation_are_those_of_the_card(tables):
    """Each limit of the table has the grade of its column, and a thousandth beyond it the next one."""
    page = (DOCS / "words.md").read_text(encoding="utf-8")
    assert not re.search(r"(phase|gain) margin[^:\n]*\d+ (deg|dB)", page)  # no second limits next to the table
    caption = (ROOT / "tfarm/report/templates/index.html").read_text(encoding="utf-8")
    assert ", ".join("{:g} and {:g}".format(*each) for each in GRADE_LIMITS.values()) in re.sub(
        " (dB|deg|sampling periods)", "", caption
    )
    for row in tables.grades()[2:]:
        name, *cells = row.strip("| ").split(" | ")
        for cell, word, beyond in zip(cells, ("good", "low"), ("low", "poor"), strict=False):
            side, number, *_ = cell.removeprefix("at ").split()
            worse = float(number) * (0.999 if side == "least" else 1.001)
            margin = name.split()[0].replace("delay", "periods")
            assert (grade_of(float(number), margin), grade_of(worse, margin)) == (word, beyond), row


@pytest.mark.usefixtures("audited")
def test_the_table_of_the_paper_has_each_equation_once(tables):
    text = "\n".join(tables.audit())
    assert "**(8)**, corrected" in text
    assert all(row.equation in text for row in audit())


def test_a_number_that_no_cell_prints_is_found():
    prose, printed = "7.53 Hz, 38.43 deg, -0.5759 % and 6.60e10 Pa", "7.5337 Hz 38.4 -0.57592 6.604e+10"
    assert unprinted(prose, printed) == ["38.43"]
