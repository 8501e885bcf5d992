"""Realisations of a sampled law, and the one with the least round-off noise in the closed loop.

    x_{k+1} = A x_k + B e_k,  u_k = r_k + C x_k + D e_k,      e = reference - signal of each column

States T^-1 x have A T^-1 ... T.  With K the covariance of the states under white noise at the signals, and W the sum
of squares of the responses of u to a rounding of each state, both in the closed loop, the noise gain is

    g = sum_i K_ii W_ii / variance of u,

which no scaling of the states changes: where every state has unit variance, the variance of u by roundings, over that
of one of them and over that of u under the noise (Mullis and Roberts, IEEE Trans. Circuits and Systems 23, 1976).  It
is compared for the law as given, for second-order sections, each balanced, and for the balanced realisation,
K = W = diag(sigma).
"""

from dataclasses import replace
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
NEXT_TO = 1.01  # times the least noise gain: for less a law keeps its states, and an integral its pole z = 1
GIVEN, SECTIONS, BALANCED = "law as given", "second-order sections", "balanced state space"


class NoiseGain(NamedTuple):
    """A realisation and its noise gain."""

    realisation: Annotated[str, Quantity("realisation", help="structure of the states of the controller")]
    gain: Annotated[float | None, Quantity("noise gain", "", 5,
            help="variance of the output by roundings, for states of unit variance, in the closed loop")]  # fmt: skip


class Around(NamedTuple):
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


def with_matrices(law: Law, matrices: Matrices) -> Law:
    """The law with another state space of all its columns, signals first, and the sign of v = -sum."""
    return replace(law, parts=(Part((*law.signals, *law.wanted), StateSpace(*matrices)),), sign=-1)


def matrices_of(law: Law) -> Matrices:
    """A, B, C, D of a law of all columns: u = r + C x + D e."""
    return law.matrices((*law.signals, *law.wanted))


def around(law: Law, loop: Sampled) -> Around:
    """The closed loop of `Sampled.matrix`, around a law of one state space."""
    A, B, C = loop.pulse.matrices()
    own, Bk, Ck, Dk = with_estimate(law, loop.chain).matrices(loop.in_z.signals)
    n, m, order = len(A), len(own), law.order
    output, push = -np.hstack([Dk @ C, Ck])[0], np.r_[B, np.zeros(m)]
    return Around(
        matrix=np.block([[A, np.zeros((n, m))], [Bk @ C, own]]) + np.outer(push, output),
        of_signals=np.vstack([np.outer(B, -Dk[0]), Bk]),
        of_rounding=np.c_[np.eye(n + m)[:, n : n + order], push],
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
            left = [(abs(a[rows, rows]).max(), abs(b[rows, rows]).max()) for a, b in ((more, K), (seen, W))]
            if all(last <= SUMMED * whole < np.inf for last, whole in left):
                return K[rows, rows] / (of.output @ K @ of.output), W[rows, rows]
    return None


def balancing(K: Real, W: Real) -> Real | None:
    """T with T^-1 K T^-T = T^T W T = diag(sigma); None where a state is not controllable or not observable."""
    size, vectors = np.linalg.eigh(K)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    square, turned = np.linalg.eigh(root.T @ W @ root)
    is_minimal = size[0] > LEAST_SHARE * size[-1] and square[0] > LEAST_SHARE**2 * square[-1]
    return root @ turned / square**0.25 if is_minimal else None


def sections(A: Real, K: Real, W: Real) -> Real | None:
    """T of second-order sections, a pair of poles each, and first-order ones, each balanced; None of multiple poles."""
    poles, vectors = np.linalg.eig(A)
    upper = np.flatnonzero(poles.imag >= 0)
    blocks = [np.c_[vectors[:, n].real, vectors[:, n].imag][:, : 1 + (poles[n].imag > 0)] for n in upper]
    modal = np.hstack(blocks)
    if modal.shape != A.shape or np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > WORST_CONDITION:
        return None
    duals = np.split(np.linalg.inv(modal), np.cumsum([block.shape[1] for block in blocks])[:-1])
    own = [balancing(dual @ K @ dual.T, block.T @ W @ block) for block, dual in zip(blocks, duals, strict=True)]
    known = [each for each in own if each is not None]
    return modal @ block_diag(*known) if len(known) == len(own) else None


def candidates(law: Law, loop: Sampled) -> list[tuple[NoiseGain, Matrices]]:
    """The realisations of a law in z of one state space, each with its noise gain; the law as given comes first."""
    A, B, C, D = matrices_of(law)
    found = gramians(around(law, loop)) if law.order else None
    if found is None:
        return [(NoiseGain(GIVEN, None if law.order else 0.0), (A, B, C, D))]
    K, W = found
    changes = {GIVEN: np.eye(law.order), SECTIONS: sections(A, K, W), BALANCED: balancing(K, W)}
    known = [(name, T, np.linalg.inv(T)) for name, T in changes.items() if T is not None]
    gains = [abs(float(np.diag(inverse @ K @ inverse.T) @ np.diag(T.T @ W @ T))) for _, T, inverse in known]
    return [
        (NoiseGain(name, gain), (inverse @ A @ T, inverse @ B, C @ T, D))
        for gain, (name, T, inverse) in zip(gains, known, strict=True)
    ]


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """The law in the realisation of least noise, as given if that has hardly more; its name, and all noise gains."""
    (given, own), *_ = found = candidates(law, loop)
    best, matrices = min(found, key=lambda each: each[0].gain or 0.0)
    if not NEXT_TO * (best.gain or 0.0) < (given.gain or 0.0):
        best, matrices = given, own
    return with_matrices(law, matrices), best.realisation, [gain for gain, _ in found]
