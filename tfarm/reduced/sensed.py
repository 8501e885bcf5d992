"""Modal models of what a controller reads, signals at several places together, and their loop with a state space."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.reduced.modal import modal_model
from tfarm.response.signals import Signals

ALGEBRAIC = 1e-9  # a feedthrough of the loop so near to -1 leaves its input undetermined


def sensed_model(arm: Arm, signals: Sequence[str], count: int) -> Matrices:
    """A, B, C, D from the input to the named signals, with `count` flexible modes and a static remainder.

    Raises ParameterError for an unknown signal, a count out of range, and one that grows with s without bound.
    """
    read = Signals(arm, tuple(signals))
    with_angle = not arm.is_locked  # so that the rigid body is among the states wherever a signal is read
    rows: dict[int, Real] = {}
    through: dict[int, float] = {}
    A, B = np.empty((0, 0)), np.empty((0, 1))
    for share in dict.fromkeys(read.places):
        mine = [n for n, place in enumerate(read.places) if place == share]
        wanted = [read.outputs[n] for n in mine]
        along = any(each.place == "x" for each in wanted)
        extra = ["hub_angle"] if with_angle else []
        model = modal_model(arm, [*extra, *wanted], count, share * arm.length if along else None)
        A, B, C, D = model.matrices()
        for row, n in enumerate(mine, start=len(extra)):
            rows[n], through[n] = C[row], float(D[row, 0])
    order = range(len(read.names))
    return A, B, np.array([rows[n] for n in order]), np.array([[through[n]] for n in order])


def closed(plant: Matrices, law: Matrices) -> Real:
    """The matrix of the loop v = -(law of y), the plant's states first.

    Raises ParameterError where what both pass at once makes an algebraic loop.
    """
    A, B, C, D = plant
    Ak, Bk, Ck, Dk = law
    whole = 1.0 + (Dk @ D)[0, 0]
    if abs(whole) < ALGEBRAIC:
        remedy = "the law and the model pass a signal on at once, and their product is -1: an algebraic loop"
        raise ParameterError(key="law", value=float((Dk @ D)[0, 0]), remedy=remedy)
    v = np.hstack([-Dk @ C, -Ck]) / whole  # of plant and law states
    y = np.hstack([C, np.zeros((len(C), len(Ak)))]) + D @ v
    top = np.hstack([A, np.zeros((len(A), len(Ak)))]) + B @ v
    bottom = np.hstack([np.zeros((len(Ak), len(A))), Ak]) + Bk @ y
    return np.vstack([top, bottom])


def pade(delay: float, order: int) -> Rational:
    """The Pade approximation of e^{-s delay} of that order, numerator and denominator alike."""
    powers = np.arange(order, -1, -1)
    sizes = [math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(2 * order) for k in powers]
    terms = np.array(sizes) * delay**powers
    return Rational(tuple(terms * (-1.0) ** powers), tuple(terms))


def in_series(first: Matrices, second: Matrices) -> Matrices:
    """The second state space, of one signal, behind the first."""
    A, B, C, D = first
    a, b, c, d = second
    whole = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
    return whole, np.vstack([B, b @ D]), np.hstack([d @ C, c]), d @ D
