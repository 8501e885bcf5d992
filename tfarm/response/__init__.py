"""Exact transfer functions of the arm: values, derivatives, poles and zeros.

transfer   TransferFunction: G(s) of an output, with complete poles and zeros
frequency  Bode: a frequency response on a grid refined at poles and zeros
extrema    peaks and dips of a frequency response
signals    Signals: the outputs that a controller reads, as functions of s
"""

from tfarm.response.frequency import Bode, bode
from tfarm.response.transfer import TransferFunction, Wanted, transfer

__all__ = ["Bode", "TransferFunction", "Wanted", "bode", "transfer"]
