"""A script that builds the systems of a task with python-control."""

from collections.abc import Iterable

from tfarm.exported.result import Export, ExportTask, names_of
from tfarm.exported.systems import linear
from tfarm.exported.texts import python_text, render


def py(task: ExportTask) -> Export:
    """Return the script of a task."""
    found = linear(task)
    content = render("systems.txt", of=found, listed=listed)
    every = [name for each in found.systems.values() for name in (*each.inputs, *each.outputs)]
    changed = {name: new for name, new in zip(every, plain(every), strict=True) if new != name}
    return Export(
        what=task.what, form=task.form, contents={f"{task.what}.py": content}, names=names_of(changed),
        verdict=found.verdict, sha256=task.sha256,
    )  # fmt: skip


def plain(names: Iterable[str]) -> list[str]:
    """Return names of signals without dots, which separate system and signal in python-control."""
    return [name.replace(".", "_") for name in names]


def listed(names: Iterable[str]) -> str:
    """Return a literal of these names."""
    return f"[{', '.join(map(python_text, plain(names)))}]"
