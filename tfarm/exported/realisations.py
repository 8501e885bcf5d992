"""Realisations of a sampled law, and that of the least round-off noise in the closed loop.

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
from scipy.linalg import block_diag, cdf2rdf

from tfarm.arm import Law
from tfarm.arm.blocks import StateSpace
from tfarm.arm.law import Part
from tfarm.arrays import Real
from tfarm.dsp.discretise import system_matrix, with_estimate
from tfarm.exact.rationals import exact_matrix
from tfarm.loop.sampled import Sampled
from tfarm.schema import Quantity

# the name of a realisation
GIVEN = "law as given"


class NoiseGain(NamedTuple):
    """A realisation and its noise gain."""

    realisation: Annotated[str, Quantity("realisation", help="structure of the states of the controller")]
    gain: Annotated[
        float | None,
        Quantity(
            "noise gain",
            "",
            5,
            help="variance of the output by roundings, for states of unit variance, in the closed loop",
        ),
    ]


class StateSpaceLoop(NamedTuple):
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


def with_system_matrix(law: Law, S: Real) -> Law:
    """Return the law with another state space of all its columns, and the sign of v = -sum."""
    columns = (*law.signals, *law.wanted)
    n = S.shape[1] - len(columns)
    part = Part(columns, StateSpace(S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:]))
    return replace(law, parts=(part,), sign=-1)


def close_state_space(
    A: Real, B: Real, C: Real, a: Real, b: Real, c: Real, d: Real
) -> tuple[Real, Real, Real]:
    """Return matrix, rows of y and of u of the loop of x' = A x + B u, y = C x and k' = a k + b y, u = c k + d y."""
    y = np.pad(C, ((0, 0), (0, len(a))))
    u = np.c_[d @ C, c]
    return block_diag(A, a) + np.r_[B @ u, b @ y], y, u


def close_around_law(law: Law, loop: Sampled) -> StateSpaceLoop:
    """Return the closed loop of `Sampled.matrix`, around a law of one state space."""
    A, B, C = loop.pulse.matrices()
    own, Bk, Ck, Dk = with_estimate(law, loop.chain).matrices(loop.in_z.signals)
    matrix, reads, output = close_state_space(A, B[:, None], C, own, Bk, -Ck, -Dk)
    states = slice(len(A), len(A) + law.order)
    push = np.r_[B, np.zeros(len(own))]
    return StateSpaceLoop(
        matrix=matrix,
        of_signals=np.r_[np.outer(B, -Dk[0]), Bk],
        of_rounding=np.c_[np.eye(len(matrix))[:, states], push],
        output=output[0],
        reads=reads,
        states=states,
    )


def gramian_sum(M: Real, Q: Real, rows: slice) -> Real | None:
    """Return Q + M Q M^T + M^2 Q M^2^T + ...; None where the sum of these rows does not converge."""
    with np.errstate(over="ignore", invalid="ignore"):
        # doublings of the samples that a sum has: 1e12 of them
        for _ in range(40):
            more = M @ Q @ M.T
            Q = Q + more
            M = M @ M
            # of a sum of squares: its last terms
            if abs(more[rows, rows]).max() <= 1e-9 * abs(Q[rows, rows]).max() < np.inf:
                return Q
    return None


def gramians(of: StateSpaceLoop) -> tuple[Real, Real] | None:
    """Return K over the variance of u, and W, of the states of the law; None where their sums do not converge."""
    rows = of.states
    K = gramian_sum(of.matrix, of.of_signals @ of.of_signals.T, rows)
    W = gramian_sum(of.matrix.T, np.outer(of.output, of.output), rows)
    if K is None or W is None:
        return None
    return (K[rows, rows] / (of.output @ K @ of.output), W[rows, rows])


def balancing_transform(K: Real, W: Real) -> Real | None:
    """Return T with T^-1 K T^-T = T^T W T = diag(sigma); None where a state is not controllable or not observable."""
    size, vectors = np.linalg.eigh(K)
    root = vectors * np.sqrt(np.maximum(size, 0.0))
    square, turned = np.linalg.eigh(root.T @ W @ root)
    # of the largest singular value: below it a state is not controllable, or not observable
    least_share = 1e-12
    is_controllable = size[0] > least_share * size[-1]
    is_observable = square[0] > least_share**2 * square[-1]
    if not (is_controllable and is_observable):
        return None
    return root @ turned / square**0.25


def second_order_sections(A: Real, K: Real, W: Real) -> Real | None:
    """Return T of balanced sections of second order, a pair of poles each, and of first; None of multiple poles."""
    poles, vectors = np.linalg.eig(A)
    _, modal = cdf2rdf(poles, vectors)
    # poles are not separated
    if np.linalg.cond(modal / np.linalg.norm(modal, axis=0)) > 1e8:
        return None
    # of a section, after the first
    begins = np.flatnonzero(poles.imag >= 0)[1:]
    blocks = np.split(modal, begins, axis=1)
    duals = np.split(np.linalg.inv(modal), begins)
    own = []
    for block, dual in zip(blocks, duals, strict=True):
        transform = balancing_transform(dual @ K @ dual.T, block.T @ W @ block)
        if transform is None:
            return None
        own.append(transform)
    return modal @ block_diag(*own)


def candidates(law: Law, loop: Sampled) -> list[tuple[NoiseGain, Real]]:
    """Return the realisations [A B; C D] of a law in z of one state space, that of the law as given first."""
    S = system_matrix(law)
    n = law.order
    found = gramians(close_around_law(law, loop)) if n else None
    if found is None:
        return [(NoiseGain(GIVEN, None if n else 0.0), S)]
    K, W = found
    changes = {
        GIVEN: np.eye(n),
        "second-order sections": second_order_sections(S[:n, :n], K, W),
        "balanced state space": balancing_transform(K, W),
    }
    rows = []
    for name, T in changes.items():
        if T is not None:
            inverse = np.linalg.inv(T)
            gain = np.diag(inverse @ K @ inverse.T) @ np.diag(T.T @ W @ T)
            rows.append((NoiseGain(name, abs(float(gain))), similar(S, T)))
    return rows


def similar(S: Real, T: Real) -> Real:
    """Return [A B; C D] of the states T^-1 x, each coefficient rounded once: rational numbers."""
    change = exact_matrix(block_diag(T, np.eye(S.shape[1] - len(T))))
    back = exact_matrix(block_diag(T, np.eye(1))).inv()
    exact = back * exact_matrix(S) * change
    return np.array([[int(each.p) / int(each.q) for each in row] for row in exact.tolist()])


def least_noise(law: Law, loop: Sampled) -> tuple[Law, str, list[NoiseGain]]:
    """Return the law in the realisation of least noise, as given if that has hardly more.

    Its name, and all noise gains.
    """

    def cost(row: tuple[NoiseGain, Real]) -> float:
        of, _ = row
        # for a hundredth less a law keeps its states, and an integral its pole z = 1
        return (of.gain or 0.0) * (1.0 if of.realisation == GIVEN else 1.01)

    rows = candidates(law, loop)
    best, S = min(rows, key=cost)
    return with_system_matrix(law, S), best.realisation, [gain for gain, _ in rows]
