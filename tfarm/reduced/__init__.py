"""Reduced models of the exact arm, each with its error."""

from tfarm.reduced.modal import ModalModel, modal_model, relaxed_model, slow_model
from tfarm.reduced.partial_fractions import PartialFractions
from tfarm.reduced.rational import rational_model
from tfarm.reduced.reduction import BAND, ReducedModel, reduce

__all__ = [
    "BAND",
    "ModalModel",
    "PartialFractions",
    "ReducedModel",
    "modal_model",
    "rational_model",
    "reduce",
    "relaxed_model",
    "slow_model",
]
