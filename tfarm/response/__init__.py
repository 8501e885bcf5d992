"""Exact transfer functions of the arm: values, derivatives, poles and zeros."""

from tfarm.response.frequency import Bode, bode
from tfarm.response.transfer import TransferFunction, Wanted, transfer

__all__ = ["Bode", "TransferFunction", "Wanted", "bode", "transfer"]
