"""Realisations of a sampled law, and the one with the least round-off noise in the closed loop.

    x_{k+1} = A x_k + B e_k,  u_k = r_k + C x_k + D e_k,      e = reference - signal of each column

States T^-1 x have A T^-1 ... T.  With K the covariance of the states under white noise at the signals, and W the sum
of squares of the responses of u to a rounding of each state, both in the closed loop, the noise gain is

    g = sum_i K_ii W_ii / variance of u,

which no scaling of the states changes: where every state has unit variance, the variance of u by roundings, over that
of one of them and over that of u under the noise (Mullis and Roberts, IEEE Trans. Circuits and Systems 23, 1976).  It
is compared for the law as given, for second-order
sections, each balanced, and for the balanced realisation, K = W = diag(sigma).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from tfarm.arm import Law
from tfarm.arm.blocks import Matrices, StateSpace
from tfarm.arm.law import Part
from tfarm.arrays import Real
from tfarm.dsp.discretise import with_estimate
from tfarm.dsp.sampled import Sampled
from tfarm.schema import Quantity

MOST_DOUBLINGS = 40  # of the samples that a sum has: 1e12 of them
SUMMED = 1e-9  # of a sum of squares: its last terms
LEAST_SHARE = 1e-12  # of the largest singular value: below it a state is not controllable or not observable
WORST_CONDITION = 1e8  # of the eigenvectors: beyond it poles are not separated
GIVEN, SECTIONS, BALANCED = "law as given", "second-order sections", "balanced state space"


class NoiseGain(NamedTuple):
    """A realisation and its noise gain."""

    realisation: Annotated[str, Quantity("realisation", help="structure of the states of the controller")]
    gain: Annotated[float | None, Quantity("noise gain", "", 5,
            help="variance of the output by roundings, for states of unit variance, in the closed loop")]  # fmt: skip


@dataclass(frozen=True)
class Around:
    """The closed loop around a law of one state space: matrix, input of each signal and of each rounding, output u.

    `of_signals` (n, signals), `of_rounding` (n, states + 1) (the last is a rounding of u), `output` (n,), `reads`
    (signals, n); the states of the law are the `states` last.
    """

    matrix: Real
    of_signals: Real
    of_rounding: Real
    output: Real
    reads: Real
    states: slice


def as_one(law: Law) -> Law:
    """The law in z with one state space of all columns, signals first, with the sign of v = -sum."""
    columns = (*law.signals, *law.wanted)
    return with_matrices(law, law.matrices(columns))


def with_matrices(law: Law, matrices: Matrices) -> Law:
    """The law with another state space of all its columns; sign of v = -sum."""
    return replace(law, parts=(Part((*law.signals, *law.wanted), StateSpace(*matrices)),), sign=-1)


def around(law: Law, loop: Sampled) -> Around:
    """The closed loop of `Sampled.matrix`, around a law of one state space."""
    A, B, C = loop.pulse.matrices()
    own, Bk, Ck, Dk = with_estimate(law, loop.chain).matrices(loop.in_z.signals)
    n, m, order = len(A), len(own), law.order
    output = -np.hstack([Dk @ C, Ck])[0]
    push = np.r_[B, np.zeros(m)]
    of_states = np.eye(n + m)[:, n : n + order]
    return Around(
        matrix=np.block([[A, np.zeros((n, m))], [Bk @ C, own]]) + np.outer(push, output),
        of_signals=np.vstack([np.outer(B, -Dk[0]), Bk]),
        of_rounding=np.c_[of_states, push],
        output=output,
        reads=np.hstack([C, np.zeros((len(C), m))]),
        states=slice(n, n + order),
    )


def gramians(of: Around) -> tuple[Real, Real] | None:
    """K over the variance of u, and W, of the states of the law; None where their sums do not converge."""
    M, K, W = of.matrix, of.of_signals @ of.of_signals.T, np.outer(of.output, of.output)
    rows = of.states
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(MOST_DOUBLINGS):
            more, seen = M @ K @ M.T, M.T @ W @ M
            K, W, M = K + more, W + seen, M @ M
            left = [(a[rows, rows], b[rows, rows]) for a, b in ((more, K), (seen, W))]
            if all(np.abs(a).max() <= SUMMED * np.abs(b).max() < np.inf for a, b in left):
                return K[rows, rows] / (of.output @ K @ of.output), W[rows, rows]
    return None


def balancing(K: Real, W: Real) -> Real | None:
    """T with T^-1 K T^-T = T^T W T = diag(sigma); None where a state is not controllable or not observable."""
    size, vectors = np.linalg.eigh(K)
    if size[-1] <= 0 or size[0] <= LEAST_SHARE * size[-1]:
        return None
    root = vectors * np.sqrt(size)
    square, turned = np.linalg.eigh(root.T @ W @ root)
    if square[-1] <= 0 or square[0] <= LEAST_SHARE**2 * square[-1]:
        return None
    return root @ turned / square**0.25


def sections(A: Real, K: Real, W: Real) -> Real | None:
    """T of second-order sections, a pair of poles each, and first-order ones, each balanced; None of multiple poles."""
    poles, vectors = np.linalg.eig(A)
    upper = np.flatnonzero(poles.imag >= 0)
    blocks = [np.c_[vectors[:, n].real, vectors[:, n].imag][:, : 1 + (poles[n].imag > 0)] for n in upper]
    modal = np.hstack(blocks)
    if modal.shape != A.shape or np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > WORST_CONDITION:
        return None
    inverse, first, own = np.linalg.inv(modal), 0, []
    K, W = inverse @ K @ inverse.T, modal.T @ W @ modal
    for block in blocks:
        part = slice(first, first := first + block.shape[1])
        own.append(balancing(K[part, part], W[part, part]))
    known = [each for each in own if each is not None]
    return modal @ block_diag(*known) if len(known) == len(own) else None


def transformed(matrices: Matrices, T: Real) -> Matrices:
    """The same system with states T^-1 x."""
    A, B, C, D = matrices
    return np.asarray(np.linalg.solve(T, A @ T)), np.asarray(np.linalg.solve(T, B)), C @ T, D


def candidates(law: Law, loop: Sampled) -> Iterator[tuple[NoiseGain, Matrices]]:
    """The realisations of a law in z of one state space, each with its noise gain."""
    matrices = law.parts[0].block.matrices()
    if not law.order:
        yield NoiseGain(GIVEN, 0.0), matrices
        return
    found = gramians(around(law, loop))
    if found is None:
        yield NoiseGain(GIVEN, None), matrices
        return
    K, W = found
    for name, T in ((GIVEN, np.eye(law.order)), (SECTIONS, sections(matrices[0], K, W)), (BALANCED, balancing(K, W))):
        if T is not None:
            variances = np.diag(np.linalg.solve(T, np.linalg.solve(T, K).T))
            yield NoiseGain(name, float(variances @ np.diag(T.T @ W @ T))), transformed(matrices, T)


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """The law in the realisation with the least noise gain, its name, and the gains of all.

    Where no noise gain is determined the law is as given.
    """
    found = list(candidates(law, loop))
    _, name, matrices = min(
        ((np.inf if gain.gain is None else gain.gain, gain.realisation, each) for gain, each in found),
        key=lambda each: each[0],
    )
    return with_matrices(law, matrices), name, [gain for gain, _ in found]
