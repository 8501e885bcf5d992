"""Weights on the closed-loop transfer functions S, K S and T, ratios of polynomials in s or z."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tfarm.arm.blocks import LawBlock, block_of
from tfarm.arm.checks import positive
from tfarm.errors import MISSING, must_be_known, require
from tfarm.records import frozen

# S = 1/(1 + L), K S and T = L/(1 + L), K the controller
WEIGHTED = ("S", "KS", "T")
# where none is given: the norms are Ms and Mt
USUAL_WEIGHTS = {"S": 1.0, "T": 1.0}


@frozen
class Weights:
    """The `blocks` of weights by their names, S, KS and T; in s, or with a `period` [s] in z."""

    blocks: Mapping[str, LawBlock]
    period: float | None = None

    def __post_init__(self) -> None:
        require(self.blocks, "weights", MISSING, f"give one of {', '.join(WEIGHTED)}")
        for name, block in self.blocks.items():
            must_be_known("weights", name, WEIGHTED)
            key = f"weights.{name}"
            require(block.signals == 1, key, type(block).__name__, "a weight has one input and one output")


def weights_of(entries: Mapping[str, Any] | Weights, period: float | None = None) -> Weights:
    """Return the weights of entries as a law has them: {"S": ([0.5, 2.0], [1.0, 0.02]), "KS": 0.1}.

    Systems of python-control with a period, and all entries with a `period` [s], are in z.
    Raises ParameterError, naming the weight, for illegal entries and for periods that differ.
    """
    if isinstance(entries, Weights):
        return entries
    remedy = 'a weight for each of S, KS and T, such as {"S": ([0.5, 2.0], [1.0, 0.02]), "KS": 0.1}'
    require(isinstance(entries, Mapping), "weights", entries, remedy)
    found = {str(name): block_of(f"weights.{name}", entry) for name, entry in entries.items()}
    known = {each for _, each in found.values() if each is not None}
    if period is not None:
        known.add(positive("weights.period", period, "a sampling period in s; leave it out for weights in s"))
    require(len(known) <= 1, "weights.period", sorted(known), "weights in z have one sampling period")
    return Weights({name: block for name, (block, _) in found.items()}, known.pop() if known else None)
