"""Reduced models of the exact arm: the one place where its exactness is left, with the error printed."""

from tfarm.reduced.conversions import discrete, save_mat, to_pymor, transfer_function
from tfarm.reduced.modal import ModalModel, modal_model, relaxed_model, slow_model
from tfarm.reduced.partial_fractions import PartialFractions
from tfarm.reduced.rational import rational_model
from tfarm.reduced.reduction import BAND, ReducedModel, reduce

__all__ = [
    "BAND",
    "ModalModel",
    "PartialFractions",
    "ReducedModel",
    "discrete",
    "modal_model",
    "rational_model",
    "reduce",
    "relaxed_model",
    "save_mat",
    "slow_model",
    "to_pymor",
    "transfer_function",
]
