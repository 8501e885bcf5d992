"""Reduced models of the exact arm, each with its error.

reduction          the model of an order, or the smallest one within an error
modal              the modal model: exact residues, a static or slow remainder; state spaces of loops
rational           the smallest lossless model: AAA in s^2 above the frequency range
partial_fractions  the record of all of these, its values, its state space, and its error against the exact arm
"""

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
