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
from tfarm.reduced.partial_fractions import PartialFractions, sum_at_rest
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.response.signals import Signals
from tfarm.spectrum import Modes, modes
from tfarm.spectrum.damped import damped_modes, missing_real_eigenvalues
from tfarm.spectrum.naming import single_zeros

# slow real poles in the place of all omitted modes, two a pair
SLOW_PAIRS = 7
# C w of the last mode, at least: below, the omitted modes are not overdamped
SLOW_POLES_FROM = 1.2


def slow_remainder(C: float, missing: Callable[[Complex], Complex]) -> tuple[Real, Real]:
    """Return the corners c_j (m,) [1/s] and the shares D_j (outputs, m) of a remainder, C being the damping [s].

    `missing` is the remainder of the modal sum of each output (outputs, n) at s (n,).
    """
    # c_j C, and s C at which they are fitted: tuned by hand on the lab arm
    corners = 1 + np.geomspace(0.02, 30.0, 2 * SLOW_PAIRS)
    at = np.geomspace(0.02, 5.0, 60)
    basis = 1 / (1 + at[:, None] / corners) - 1
    left = missing((at / C).astype(complex)).real
    # 1e-12 of the largest singular value
    shares: Real = np.linalg.lstsq(basis, left.T, rcond=1e-12)[0].T.astype(float)
    return corners / C, shares


def powers_of(wanted: Sequence[Output]) -> NDArray[np.int64]:
    """Return the powers of s of the outputs (outputs, 1)."""
    return np.array([[each.power] for each in wanted])


def end_residues(
    k: System, wanted: Sequence[Output], p: Complex, x: float = 0.0
) -> tuple[Complex, NDArray[np.bool_]]:
    """Return residues N(p)/D'(p) (outputs, p) at eigenvalues p, and where they are doubtful.

    There A theta = B M on the hub (see `tfarm.exact.system`); the one with the larger factor has lost digits.
    """
    root_moment = Output(quantity="M", place="root", label="moment at the root")
    at_hub = (root_moment, OUTPUTS["root_shear"], OUTPUTS["hub_angle"])
    with np.errstate(all="ignore"):
        here, slopes = free_slopes(k, [*wanted, *at_hub], p, x)
        residues: Complex = here.outputs[:-3] / slopes.drive
        units = np.array([float(unit_scale(each, k)) for each in at_hub])
        moment, shear, theta = here.outputs[-3:] / units[:, None]
        A, B = k.drive.at(p)
        heavy = abs(A) > abs(B)
        balanced = {
            "theta": np.where(heavy, (moment + float(k.radius) * shear) * B / A, theta),
            "M": np.where(heavy | (B == 0), moment, theta * A / B),
        }
        for row, each in enumerate(wanted):
            is_at_place = each.place == "x" or not each.gauge or k.gauge.share == 0
            is_moment_at_hub = each.share(x) == 0 and is_at_place and k.reads_hub_moment
            if each.quantity == "theta" or (each.quantity == "M" and is_moment_at_hub):
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
    circle = (p[:, None] + arrow).ravel()
    values = evaluate_outputs(k, wanted, circle, x).reshape(-1, *arrow.shape)
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
    residues = r[:-1]
    # of the output at the hub
    of_input = r[-1]
    single_residues = alone[:-1]
    expansion, kept = _expansion(G, single, table)
    of_pairs = sum_at_rest(residues, p)
    of_single = (single_residues / single)[:, kept].sum(axis=1)
    return ModalModel(
        arm=arm,
        rows=G.rows,
        x=G.x,
        index=index,
        natural_frequency=np.where(index > 0, table.flexible[index - 1], abs(p[:, 0])),
        eigenvalues=p,
        residues=residues,
        rigid=expansion[:, :2],
        static=expansion[:, 2] + of_pairs + of_single,
        single=single,
        single_residues=single_residues,
        participation=np.sqrt(abs((of_input * p[:, ::-1]).real.sum(axis=-1))),
    )


def relaxed_model(arm: Arm, outputs: Wanted, count: int, x: float | None = None) -> ModalModel:
    """Return the modal model of a damped arm with one more state, exact to first order at s -> 0.

    At C > 0 the omitted bending modes are overdamped with slow poles near -1/C: c b/w^2/(1 + C s), no static gain.  So
    the remainder is D + E/(1 + C s), from G and G' at 0.  Raises ParameterError at C = 0.
    """
    C = arm.damping
    require(C, "link.damping", C, "without damping nothing relaxes; take modal_model")
    model = modal_model(arm, outputs, count, x)
    exact, kept = _expansion(transfer(arm, model.rows, x=x), model.single, modes(arm, 1))
    slope = exact[:, 3] + sum_at_rest(model.residues, model.eigenvalues**2)
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
    residues = (shares * corners).reshape(-1, SLOW_PAIRS, 2)
    static = model.static - shares.sum(axis=1)
    return model.with_pairs(-corners.reshape(-1, 2), residues, static, np.zeros(SLOW_PAIRS))


def _expansion(G: TransferFunction, single: Real, table: Modes) -> tuple[Real, NDArray[np.bool_]]:
    """Return the expansion at s = 0 (outputs, 4), and which single poles (m,) still have to be subtracted from it.

    The slow pole of a hub with hardly any friction is left out of the coefficients of 1 and s.
    """
    distances = abs(single)
    slowest = distances.min(initial=math.inf)
    # of the first frequency: a pole nearer to 0 leaves 1e-15 of itself five terms on
    if G.arm.has_rigid_mode and slowest < 1e-3 * table.flexible[0]:
        expansion = np.c_[G.expansion[:, :2], without_slow_pole(G.system, G.rows, G.share)]
        return expansion, distances > slowest
    return G.expansion, np.ones(single.size, np.bool_)


def _eigenvalues(arm: Arm, table: Modes, reach: float) -> tuple[NDArray[np.int64], Complex, Real]:
    """Return the mode of each pair (n,), 0 of one assigned to none, the pairs (n, 2), and single real ones (m,)."""
    flexible = table.index > 0
    index = table.index[flexible]
    if arm.is_undamped:
        return index, 1j * np.outer(table.flexible, [1, -1]), np.array(single_zeros(table))
    # a large model has no need of all names: a limit of time alone
    steps = 1_000 if len(table) > 40 else math.inf
    damped = damped_modes(table, steps=steps, reach=reach)
    pairs = damped.eigenvalues[flexible]
    is_known = np.isfinite(pairs)
    is_pair = is_known.all(axis=1)
    halves = pairs[~is_pair & is_known[:, 0], 0].real
    others = damped.unassigned_pairs
    rings = others[:, 0].imag > 0
    unassigned = others[rings]
    single = np.r_[damped.single, halves, others[~rings, 0].real, missing_real_eigenvalues(damped)]
    numbers = np.r_[index[is_pair], np.zeros(len(unassigned), np.int64)]
    return numbers, np.r_[pairs[is_pair], unassigned], single


def _residues(
    table: Modes, k: System, wanted: list[Output], share: float, p: Complex, single: Real
) -> tuple[Complex, Real]:
    """Return residues (outputs, n, 2) at pairs of eigenvalues (n, 2), and at single real ones (outputs, m)."""
    first = p[:, 0]
    is_real = first.imag <= 0
    s = np.r_[first, p[is_real, 1], single]
    found, doubtful = end_residues(k, wanted, s, share)
    if table.arm.is_undamped:
        close = np.diff(table.flexible) < 1e-8 * table.flexible[1:]
        _must_be_apart(first[1:][close])
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
    residues[:, is_real] = np.stack([upper[:, is_real], others], axis=2).real
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
        x = None
        if any(each.place == "x" for each in wanted):
            x = share * arm.length
        A, B, C, D = modal_model(arm, wanted, count, x).matrices()
        both |= zip(mine, np.c_[C, D][len(extra) :], strict=True)
    rows = np.array([both[n] for n in sorted(both)])
    return A, B, rows[:, :-1], rows[:, -1:]


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
