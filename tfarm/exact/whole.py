"""Matrices of whole numbers: doubles are such over a power of two, and what is shown of them so is shown exactly."""

from __future__ import annotations

import flint

from tfarm.arrays import Real

IntegerMatrix = list[list[int]]


def as_integers(matrix: Real) -> tuple[IntegerMatrix, int]:
    """The whole numbers N and the shift k with matrix = N / 2^k, exactly."""
    pairs = [[float(value).as_integer_ratio() for value in row] for row in matrix]
    shift = max(bottom.bit_length() - 1 for row in pairs for _, bottom in row)
    return [[top << (shift - bottom.bit_length() + 1) for top, bottom in row] for row in pairs], shift


def is_positive_definite(matrix: IntegerMatrix) -> bool:
    """Whether a symmetric matrix of whole numbers has only positive leading minors (Bareiss' elimination).

    FLINT's whole numbers, as the minors have thousands of digits.
    """
    M, before = [[flint.fmpz(value) for value in row] for row in matrix], flint.fmpz(1)
    n = len(M)
    for k in range(n):
        top = M[k]
        pivot = top[k]
        if pivot <= 0:
            return False
        for i in range(k + 1, n):
            row, factor = M[i], top[i]
            for j in range(i, n):
                row[j] = (pivot * row[j] - factor * top[j]) // before
        before = pivot
    return True


def falls(P: IntegerMatrix, A: Real) -> bool:
    """Whether P - A^T P A > 0."""
    numbers, shift = as_integers(A)
    N, form = flint.fmpz_mat(numbers), flint.fmpz_mat(P)
    return is_positive_definite((form * 4**shift - N.transpose() * form * N).tolist())
