"""Stages of one sample, and what each answer does with every key of an arm and its chain: `stages.toml`.

An answer begins with `admit`: a key that the table does not have is refused, so that none is ever left out in silence.
"""

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any

from tfarm.arm import Arm, must_be_arm
from tfarm.arm.chain import Chain, chain_or_usual, stated
from tfarm.arm.writing import arm_table
from tfarm.dsp.plant import driven
from tfarm.errors import require

NAMED, REFUSED = ("named", "partly"), "refused"
REMAINDERS = {"converters.arithmetic": "rounding of float32 signals"}  # of what acts partly


@cache
def stages() -> dict[str, dict[str, dict[str, str]]]:
    """Return the word of every answer by stage and key; an arm's own keys act in all of them."""
    table = tomllib.loads((files("tfarm.dsp") / "stages.toml").read_text("utf-8"))
    answers, arm = table.pop("answers"), table.pop("arm")
    found = {
        stage: {key: dict(zip(answers, words.split(), strict=True)) for key, words in keys.items()}
        for stage, keys in table.items()
    }
    return {**found, "arm": {key: dict.fromkeys(answers, "acts") for key in arm}}


def word_of(key: str, answer: str) -> str:
    """Return the word of an answer for a key, "refused" of one without a row."""
    return next((keys[key][answer] for keys in stages().values() if key in keys), REFUSED)


def admit(answer: str, arm: Arm, chain: Chain | None) -> tuple[Arm, Chain]:
    """Return the arm that a chain drives, and that chain, as an answer takes them (`driven`).

    Raises ParameterError for a key that the answer does not have.
    """
    must_be_arm(arm)
    chain = chain_or_usual(chain)
    for key, value in _keys_in_use(arm, chain).items():
        require(word_of(key, answer) != REFUSED, key, value, f"{answer} does not have this key: leave it out")
    return driven(arm, chain)


@lru_cache(maxsize=64)
def _keys_in_use(arm: Arm, chain: Chain) -> dict[str, Any]:
    """The keys in the file of an arm and its chain, with their values."""
    return dict(_flat({**arm_table(arm), **stated(chain)}))


def _flat(table: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Each key of tables in tables, with its place."""
    for key, value in table.items():
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, dict):
                yield from _flat(each, f"{place}{key}.")
            else:
                yield f"{place}{key}", each


def not_covered(answer: str, chain: Chain) -> str:
    """Return the end of the line of certainty of an answer: the keys of its chain that it is without."""
    keys = [key for key, _ in _flat(stated(chain)) if word_of(key, answer) in NAMED]
    names = [REMAINDERS.get(key, key.partition(".")[2]) for key in keys]
    return f"; not covered: {', '.join(names)}" if names else ""
