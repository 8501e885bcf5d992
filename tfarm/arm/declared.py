"""A TOML table is declared by what it builds: a strict pydantic model with the parameters of a record's constructor."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import Parameter, signature
from typing import Any, ClassVar, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, create_model

_Table = TypeVar("_Table", bound="TomlTable")


class TomlTable(BaseModel):
    """A TOML table: no unknown keys, no conversions."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
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
