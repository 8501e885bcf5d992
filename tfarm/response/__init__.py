"""Exact transfer functions of the arm: values, derivatives, poles and zeros."""

from tfarm.response.transfer import TransferFunction, Wanted, transfer

__all__ = ["TransferFunction", "Wanted", "transfer"]
