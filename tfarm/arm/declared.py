"""A TOML table is declared by what it builds: a strict pydantic model with the parameters of a record's constructor."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import Parameter, signature
from typing import Any, ClassVar, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from tfarm.errors import MISSING, ParameterError, did_you_mean

_Strict = TypeVar("_Strict", bound="StrictTable")
_Table = TypeVar("_Table", bound="TomlTable")


class StrictTable(BaseModel):
    """What a file says: no unknown keys, no conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class TomlTable(StrictTable):
    """A TOML table of a record's numbers."""

    makes: ClassVar[Callable[..., Any]]

    def given(self) -> dict[str, Any]:
        """What the file says, and nothing that it leaves out."""
        return {name: getattr(self, name) for name in self.model_fields_set}

    def build(self) -> Any:
        """What the table declares.  Raises ParameterError where its numbers make none."""
        known = _parameters(type(self).makes)
        return type(self).makes(**{name: value for name, value in self.given().items() if name in known})


@cache  # a fit builds a thousand arms
def _parameters(makes: Callable[..., Any]) -> frozenset[str]:
    """The names of a constructor's parameters."""
    return frozenset(signature(makes).parameters)


def validated(model: type[_Strict], table: object, place: str) -> _Strict:
    """The table headed [place] of a file.

    Raises ParameterError for what is no table, or one wrong key: a misspelt one comes before those that are then
    missing.
    """
    if not isinstance(table, dict):
        raise ParameterError(key=place, value=table, remedy=f"give a table, headed [{place}]")
    try:
        return model.model_validate(table)
    except ValidationError as error:
        problem = min(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    word, value = str(problem["loc"][0]), problem["input"]
    if problem["type"] == "extra_forbidden":
        remedy = f"unknown key; {did_you_mean(word, model.model_fields)}"
    elif problem["type"] == "missing":
        value, remedy = MISSING, f"[{place}] is nothing without it"
    else:
        remedy = f"wrong value; {problem['msg'][:1].lower()}{problem['msg'][1:]}"
    raise ParameterError(key=f"{place}.{word}", value=value, remedy=remedy)


def of(makes: Callable[..., Any]) -> Callable[[type[_Table]], type[_Table]]:
    """A decorator: the table has the parameters of a dataclass, or of another constructor, as its keys.

    Names, types and defaults are theirs, but for keys that the class itself declares.
    """

    def with_keys(table: type[_Table]) -> type[_Table]:
        hints, known = get_type_hints(makes), signature(makes).parameters.values()
        own: dict[str, Any] = {
            each.name: (hints[each.name], ... if each.default is Parameter.empty else each.default)
            for each in known
            if each.name not in table.model_fields
        }
        made: type[_Table] = create_model(table.__name__, __base__=table, __doc__=table.__doc__, **own)
        made.makes = makes
        return made

    return with_keys
