"""The README's examples, run as they stand."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tfarm
from tests.shell import heard

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


def test_python_examples_run_one_after_the_other(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    names: dict[str, object] = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), names)
    out = capsys.readouterr().out
    assert "71.50568247" in out
    assert names["shapes"].shape == (11, 201)  # type: ignore[attr-defined]


SHELL = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines() if line.strip()]


@pytest.mark.parametrize("line", [line for line in SHELL if line.startswith("tfarm ")])
def test_shell_examples_run(line: str, tmp_path: Path) -> None:
    command = line.replace("tfarm", f"{sys.executable} -c 'from tfarm.cli import main; main()'", 1)
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=False
    )
    assert (done.returncode, heard(done.stderr)) == (0, "")
    written = re.findall(r"--(?:csv|out) (\S+)", line)
    assert all((tmp_path / name).exists() for name in written)
    assert done.stdout or written


def test_make_has_the_verbs_of_the_readme() -> None:
    done = subprocess.run(["make"], cwd=ROOT, capture_output=True, text=True, check=True)
    verbs = {line.split()[1] for line in done.stdout.splitlines()}
    assert {line.split()[1] for line in SHELL if line.startswith("make ")} <= verbs
    assert {"install", "reports", "modes", "bode", "test", "survey", "lint", "bench", "clean"} <= verbs


def test_the_example_of_an_arm_is_an_arm(tmp_path: Path) -> None:
    (toml,) = blocks("toml")
    file = tmp_path / "my-arm.toml"
    file.write_text(toml, encoding="utf-8")
    arm = tfarm.load(str(file))
    assert arm.name == "my-arm"
    assert tfarm.modes(arm, 1).natural_frequency[1] > 0


def test_every_dependency_has_its_line() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    for requirement in [*project["dependencies"], *extras["dev"], *extras["bench"]]:
        name = re.match(r"[A-Za-z0-9-]+", requirement).group()  # type: ignore[union-attr]
        assert re.search(rf"\b{name}\b", TEXT), name
