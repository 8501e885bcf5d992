"""What happens in one sample of a loop, stage by stage in this order, declared once in `stages.toml`.

    reference, sensors, converters, law, saturation, hold, plant

Kernel, exact solution, tuner, code in C, functional mock-up unit, page and verdicts are consumers of these stages.
Each states in its own file what it does with them (`Consumer`); an arm or a chain with a stage that a consumer does not
state is refused by the name of that stage, so that none is ever left out in silence.
"""

import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from typing import Any, NamedTuple

from tfarm.errors import ParameterError


class Stage(NamedTuple):
    """A stage, the keys of an arm's file that it acts by, its equation, its meaning, and whether it is linear.

    `remainder` names the part of it that an answer is without, where that is not all that its key does.
    """

    name: str
    keys: tuple[str, ...]
    equation: str
    meaning: str
    is_linear: bool = True
    remainder: str = ""


_TABLES = tomllib.loads((files("tfarm.arm") / "stages.toml").read_text("utf-8"))
STAGES = tuple(Stage(**{**each, "keys": tuple(each["keys"])}) for each in _TABLES["stage"])
STAGE_OF = {key: stage for stage in STAGES for key in stage.keys}
# those of the arm itself
ARM_KEYS = STAGE_OF["link.length"].keys


class Consumer(NamedTuple):
    """What a consumer does with the stages, by their names; one that it does not state is refused.

    It has those that are `acts`.  It is without those that are `named`, and its line of certainty names them; of those
    that are `partly` it has a part.  Those that are `none` do not concern it.
    """

    name: str
    acts: tuple[str, ...]
    named: tuple[str, ...] = ()
    partly: tuple[str, ...] = ()
    none: tuple[str, ...] = ()

    def word(self, stage: str) -> str | None:
        """Return what it does with a stage, as the field that names it; None for one that it refuses."""
        words = self._fields[1:]
        return next((word for word in words if stage in getattr(self, word)), None)

    def refuse_others(self, *tables: Mapping[str, Any]) -> None:
        """Raise ParameterError for a key of tables of a file whose stage it does not state, or that no stage has."""
        for key, value in flat_keys(*tables):
            stage = STAGE_OF.get(key)
            if stage is None or self.word(stage.name) is None:
                what = f"the stage {stage.name}" if stage else "this key"
                raise ParameterError(
                    key=key, value=value, remedy=f"{self.name} does not have {what}: leave it out"
                )

    def not_covered(self, *tables: Mapping[str, Any]) -> str:
        """Return the end of its line of certainty: the keys of these tables that it is without."""
        names = []
        for key, _ in flat_keys(*tables):
            stage = STAGE_OF[key]
            if self.word(stage.name) in ("named", "partly"):
                names.append(stage.remainder or key.partition(".")[2])
        return f"; not covered: {', '.join(names)}" if names else ""


def are_linear(*tables: Mapping[str, Any]) -> bool:
    """Return whether every stage by which these tables of a file act is linear."""
    return all(STAGE_OF[key].is_linear for key, _ in flat_keys(*tables))


def flat_keys(*tables: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each key of tables in tables, with its place, and its value."""
    for table in tables:
        for key, value in table.items():
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, dict):
                    yield from flat_keys(each, place=f"{place}{key}.")
                else:
                    yield f"{place}{key}", each
