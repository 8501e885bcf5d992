"""The modal model: exact residues, the rigid body, and a static remainder for the omitted modes.

    G(s) ~ R2/s^2 + R1/s + static + sum over modes of r1/(s - p1) + r2/(s - p2)

A truncated Mittag-Leffler series, exact at s -> 0.  At C = 0 the poles are exactly imaginary and the model is lossless.
At C > 0 the undamped modes do not diagonalise the damping, so the residues are those of the damped eigenvalues.

An output is G = N/D with N and the drive D analytic, so its residue at a simple zero p of D is N(p)/D'(p).  Where hub
angle or moment is a small difference there, it is computed from the balance of the hub.  Where both are 0 it is
Cauchy's integral around p.  Two frequencies of an undamped arm that are equal to eight digits have none.

State spaces from the input to the signals of a controller, in series and in a loop with it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.exact.layout import unit_scale
from tfarm.exact.outputs import OUTPUTS, Output
from tfarm.exact.series import constant_of, without_slow_pole
from tfarm.exact.system import System
from tfarm.exact.values import evaluate_outputs, free_slopes
from tfarm.reduced.partial_fractions import PartialFractions
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.response.signals import Signals
from tfarm.spectrum import Modes, modes
from tfarm.spectrum.damped import damped_modes, missing_real_eigenvalues
from tfarm.spectrum.naming import single_zeros

# c_j C, and below s C of the fit: tuned by hand on the lab arm
CORNER_RATIOS = 1 + np.geomspace(0.02, 30.0, 14)
# the corners, two a pair
SLOW_PAIRS = CORNER_RATIOS.size // 2
# s C at which they are fitted: tuned with CORNER_RATIOS
FITTED_AT = np.geomspace(0.02, 5.0, 60)
# C w of the last mode, at least: below, the omitted modes are not overdamped
SLOW_POLES_FROM = 1.2


def slow_remainder(C: float, missing: Callable[[Complex], Complex]) -> tuple[Real, Real]:
    """Return the corners c_j (m,) [1/s] and the shares D_j (outputs, m) of a remainder, C being the damping [s].

    `missing` is the remainder of the modal sum of each output (outputs, n) at s (n,).
    """
    basis = 1 / (1 + FITTED_AT[:, None] / CORNER_RATIOS) - 1
    left = missing((FITTED_AT / C).astype(complex)).real
    # 1e-12 of the largest singular value
    shares: Real = np.linalg.lstsq(basis, left.T, rcond=1e-12)[0].T.astype(float)
    return CORNER_RATIOS / C, shares


AT_HUB = (  # moment and shear force of the link at the hub, and the hub's angle
    Output(quantity="M", place="root", label="moment at the root"),
    OUTPUTS["root_shear"],
    OUTPUTS["hub_angle"],
)


def powers_of(wanted: Sequence[Output]) -> NDArray[np.int64]:
    """Return the powers of s of the outputs (outputs, 1)."""
    return np.array([[each.power] for each in wanted])


def end_residues(
    k: System, wanted: Sequence[Output], p: Complex, x: float = 0.0
) -> tuple[Complex, NDArray[np.bool_]]:
    """Return residues N(p)/D'(p) (outputs, p) at eigenvalues p, and where they are doubtful.

    There A theta = B M on the hub (see `tfarm.exact.system`); the one with the larger factor has lost digits.
    """
    with np.errstate(all="ignore"):
        here, slopes = free_slopes(k, [*wanted, *AT_HUB], p, x)
        residues: Complex = here.outputs[: len(wanted)] / slopes.drive
        moment, shear, theta = (
            row / float(unit_scale(each, k)) for row, each in zip(here.outputs[-3:], AT_HUB, strict=True)
        )
        A, B = k.drive.at(p)
        heavy = abs(A) > abs(B)
        balanced = {
            "theta": np.where(heavy, (moment + float(k.radius) * shear) * B / A, theta),
            "M": np.where(heavy | (B == 0), moment, theta * A / B),
        }
        for row, each in enumerate(wanted):
            at_root = each.share(x) == 0 and (each.place == "x" or not each.gauge or k.gauge.share == 0)
            if each.quantity == "theta" or (each.quantity == "M" and at_root and k.reads_hub_moment):
                damper = (1.0 + k.segments[-1].damping * p) ** each.gauge
                value = balanced[each.quantity] * float(unit_scale(each, k)) * p**each.power
                residues[row] = value / (slopes.drive * damper)
    return residues, np.asarray(~np.isfinite(residues).all(axis=0))


def contour_residues(k: System, wanted: Sequence[Output], p: Complex, known: Complex, x: float) -> Complex:
    """Return residues (outputs, p) by the trapezoid rule on a circle around p, which converges geometrically.

    Every other one of the `known` eigenvalues is at least 4 radii away.
    Raises ConvergenceError where one is too close.
    """
    away = abs(p[:, None] - np.r_[known, known.conj(), 0.0, k.singular])
    radius = np.where(away > 0, away, np.inf).min(axis=1) / 4
    _must_be_apart(p[radius < 1e-9 * abs(p)])
    # a pole 4 radii away adds 4^-32 of its residue
    arrow = np.outer(radius, np.exp(2j * np.pi * np.arange(32) / 32))
    values = evaluate_outputs(k, wanted, (p[:, None] + arrow).ravel(), x).reshape(len(wanted), *arrow.shape)
    return np.asarray((values * arrow).mean(axis=-1))


def _must_be_apart(p: Complex) -> None:
    """Raise ConvergenceError for the first of some eigenvalues."""
    for worst in p.tolist():
        raise ConvergenceError(
            f"no residue at the eigenvalue {worst:.10g} 1/s: another one is too close", worst, 0.0
        )


# of a model: its matrices of 2000 states take 32 MB
MOST_MODELLED = 1000


# pairs assigned to no mode come last, with the index 0 and |s| for a frequency
ModalModel = PartialFractions


def modal_model(
    arm: Arm, outputs: Wanted, count: int, x: float | None = None, *, reach: float = math.inf
) -> ModalModel:
    """Return the modal model of an arm with its first `count` flexible modes (0 to 1000), for one output or several.

    `x` [m] is the place of outputs along the arm.  With a locked hub the hub angle is the input, and there is no rigid
    body.  At C > 0 eigenvalues and residues are those of the damped arm, two real poles of an overdamped mode; `reach`
    is that of `damped_modes`.
    Raises ParameterError for an unknown or improper output and a count out of range.
    """
    G = transfer(arm, outputs, x=x)
    count = whole("count", count, 0, MOST_MODELLED, f"a whole number of flexible modes, 0 to {MOST_MODELLED}")
    k = G.system
    share = G.share
    wanted = list(G.rows)
    for each in wanted:
        remedy = "a power of s times the input, which no state space has; choose another output"
        require(not (each.power and constant_of(k, each, share)), "outputs", each.name, remedy)
        remedy = f"s^{each.power} makes it improper, which no state space is; choose a lower derivative"
        # r s^2/(s^2 + w^2) of a mode is bounded, and with s^3 it is not
        require(each.power <= 2, "outputs", each.name, remedy)
    table = modes(arm, max(1, count))
    collocated = OUTPUTS["root_moment" if arm.is_locked else "hub_angle"]
    index, p, single = _eigenvalues(arm, table, reach)
    r, alone = _residues(table, k, [*wanted, collocated], share, p, single)
    if count == 0:
        index = index[:0]
        p = p[:0]
        r = r[:, :0]
    expansion, kept = _at_rest(G, single, table)
    return ModalModel(
        arm=arm,
        rows=G.rows,
        x=G.x,
        index=index,
        natural_frequency=np.where(index > 0, table.flexible[index - 1], abs(p[:, 0])),
        eigenvalues=p,
        residues=r[:-1],
        rigid=expansion[:, :2],
        static=expansion[:, 2] + (r[:-1] / p).real.sum(axis=(1, 2)) + (alone / single)[:-1, kept].sum(axis=1),
        single=single,
        single_residues=alone[:-1],
        participation=np.sqrt(abs((r[-1] * p[:, ::-1]).real.sum(axis=-1))),
    )


def relaxed_model(arm: Arm, outputs: Wanted, count: int, x: float | None = None) -> ModalModel:
    """Return the modal model of a damped arm with one more state, exact to first order at s -> 0.

    At C > 0 the omitted bending modes are overdamped with slow poles near -1/C: c b/w^2/(1 + C s), no static gain.  So
    the remainder is D + E/(1 + C s), from G and G' at 0.  Raises ParameterError at C = 0.
    """
    C = arm.damping
    require(C, "link.damping", C, "without damping nothing relaxes; take modal_model")
    model = modal_model(arm, outputs, count, x)
    exact, kept = _at_rest(transfer(arm, model.rows, x=x), model.single, modes(arm, 1))
    slope = exact[:, 3] + (model.residues / model.eigenvalues**2).real.sum(axis=(1, 2))
    slope += (model.single_residues / model.single**2)[:, kept].sum(axis=1)
    return replace(
        model,
        static=model.static + slope / C,
        single=np.r_[model.single, -1 / C],
        single_residues=np.c_[model.single_residues, -slope / C**2],
        relaxes=True,
    )


def slow_model(arm: Arm, outputs: Wanted, count: int, x: float | None = None) -> ModalModel:
    """Return the modal model of a damped arm with slow real poles in the place of all omitted modes.

    They are in pairs, with the index 0.  Raises ParameterError at C = 0.
    """
    C = arm.damping
    require(C, "link.damping", C, "without damping nothing is slow; take modal_model")
    model = modal_model(arm, outputs, count, x)
    exact = transfer(arm, outputs, x=x)
    corners, shares = slow_remainder(C, lambda s: exact(s).reshape(-1, s.size) - model(s))
    residues = (shares * corners).reshape(len(shares), -1, 2)
    return model.with_pairs(
        -corners.reshape(-1, 2), residues, model.static - shares.sum(axis=1), np.zeros(SLOW_PAIRS)
    )


def _at_rest(G: TransferFunction, single: Real, table: Modes) -> tuple[Real, NDArray[np.bool_]]:
    """Return the expansion at s = 0 (outputs, 4), and which single poles (m,) still have to be subtracted from it.

    The slow pole of a hub with hardly any friction is left out of the coefficients of 1 and s.
    """
    slowest = abs(single).min(initial=math.inf)
    # of the first frequency: a pole nearer to 0 leaves 1e-15 of itself five terms on
    if G.arm.has_rigid_mode and slowest < 1e-3 * table.flexible[0]:
        expansion = np.c_[G.expansion[:, :2], without_slow_pole(G.system, G.rows, G.share)]
        return expansion, abs(single) > slowest
    return G.expansion, np.ones(single.size, np.bool_)


def _eigenvalues(arm: Arm, table: Modes, reach: float) -> tuple[NDArray[np.int64], Complex, Real]:
    """Return the mode of each pair (n,), 0 of one assigned to none, the pairs (n, 2), and single real ones (m,)."""
    flexible = table.index > 0
    index = table.index[flexible]
    if arm.is_undamped:
        return index, 1j * np.outer(table.flexible, [1, -1]), np.array(single_zeros(table))
    # a large model has no need of all names: a limit of time alone
    damped = damped_modes(table, steps=1_000 if len(table) > 40 else math.inf, reach=reach)
    pairs = damped.eigenvalues[flexible]
    more = damped.unassigned_pairs
    whole = np.isfinite(pairs).all(axis=1)
    rings = more[:, 0].imag > 0
    halves = pairs[~whole & np.isfinite(pairs[:, 0]), 0].real
    single = np.r_[damped.single, halves, more[~rings, 0].real, missing_real_eigenvalues(damped)]
    return np.r_[index[whole], np.zeros(rings.sum(), np.int64)], np.r_[pairs[whole], more[rings]], single


def _residues(
    table: Modes, k: System, wanted: list[Output], share: float, p: Complex, single: Real
) -> tuple[Complex, Real]:
    """Return residues (outputs, n, 2) at pairs of eigenvalues (n, 2), and at single real ones (outputs, m)."""
    rings = p[:, 0].imag > 0
    s = np.r_[p[:, 0], p[~rings, 1], single]
    found, doubtful = end_residues(k, wanted, s, share)
    if table.arm.is_undamped:
        close = np.diff(table.flexible) < 1e-8 * table.flexible[1:]
        _must_be_apart(p[1:, 0][close])
        # the pole of the circuit, where the current is 0 over 0
        doubtful[len(p) :] = True
    if doubtful.any():
        found[:, doubtful] = contour_residues(k, wanted, s[doubtful], s, share)
    if table.arm.is_undamped and not single.size:
        # exactly lossless: a power of s times a real function of s^2
        power = s ** powers_of(wanted)
        found = (found * 2 * s / power).real * power / (2 * s)
    upper, others, alone = np.split(found, [len(p), s.size - single.size], axis=1)
    residues = np.stack([upper, upper.conj()], axis=2)
    residues[:, ~rings] = np.stack([upper[:, ~rings], others], axis=2).real
    return residues, alone.real.astype(float)


# distance from -1 of a feedthrough of the loop that leaves its input undetermined
ALGEBRAIC = 1e-9


def sensed_model(arm: Arm, signals: Sequence[str], count: int) -> Matrices:
    """Return A, B, C, D from the input to the named signals, with `count` flexible modes and a static remainder.

    Raises ParameterError for an unknown or improper signal and a count out of range.
    """
    read = Signals(arm, tuple(signals))
    # so that every model has the states of the rigid body
    extra = [] if arm.is_locked else [OUTPUTS["hub_angle"]]
    # C and D side by side
    both: dict[int, Real] = {}
    for share in dict.fromkeys(read.places):
        mine = [n for n, place in enumerate(read.places) if place == share]
        wanted = [*extra, *(read.outputs[n] for n in mine)]
        x = share * arm.length if any(each.place == "x" for each in wanted) else None
        A, B, C, D = modal_model(arm, wanted, count, x).matrices()
        both |= zip(mine, np.c_[C, D][len(extra) :], strict=True)
    C, D = np.split(np.array([both[n] for n in sorted(both)]), [-1], axis=1)
    return A, B, C, D


def closed_loop_matrix(plant: Matrices, law: Matrices) -> Real:
    """Return the matrix of the loop v = -(law of y), the plant's states first.

    Raises ParameterError for an algebraic loop.
    """
    A, B, C, D = plant
    Ak, Bk, Ck, Dk = law
    whole = 1.0 + (Dk @ D)[0, 0]
    remedy = "the feedthroughs of the law and the model have the product -1: an algebraic loop"
    require(abs(whole) >= ALGEBRAIC, "law", whole - 1.0, remedy)
    # of plant and law states
    v = np.c_[-Dk @ C, -Ck] / whole
    y = np.c_[C, np.zeros((len(C), len(Ak)))] + D @ v
    return block_diag(A, Ak) + np.r_[B @ v, Bk @ y]


def pade(delay: float, order: int) -> Rational:
    """Return the Pade approximation of e^{-s delay}, numerator and denominator of that order."""
    powers = np.arange(order, -1, -1)
    sizes = np.array([math.comb(order, k) / math.perm(2 * order, k) for k in powers])
    terms = sizes * delay**powers
    return Rational(tuple(terms * (-1.0) ** powers), tuple(terms))


def in_series(first: Matrices, second: Matrices) -> Matrices:
    """Return the series connection of two state spaces, the second of one signal."""
    A, B, C, D = first
    a, b, c, d = second
    whole = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
    return whole, np.r_[B, b @ D], np.c_[d @ C, c], d @ D
