"""Discretisation of a law in s: Tustin's rule (with prewarping), zero-order hold, or matched poles and zeros.

    tustin   s = c (z - 1)/(z + 1),  c = 2/T, or w0/tan(w0 T/2) with the exact values at w0
    zoh      the response of the law to signals that are held between the samples
    matched  every pole and zero s becomes e^{sT}, with the same value at rest

A law in z is not changed, nor is a delay.  (Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998,
ch. 6.)

For the characteristic function a law is kept as factors in delta = z - 1, from the numbers that were given:

    p_i = g prod(delta - zeros),  q = prod(delta - poles)

The coefficients of a law of high order are products of roots next to z = 1, and rounding loses those.  So the roots are
those of the given numbers (`tfarm.exact.rationals`), and an integrator has the root 0.  The filtered difference of the
encoder, where a chain estimates the hub rate, is (1 - a)/T (z - 1)/(z - a) times the angle, a part of the law.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from tfarm.arm import MOMENT_GAIN, must_not_be_algebraic
from tfarm.arm.blocks import LawBlock, Matrices, Rational, StateSpace
from tfarm.arm.chain import MOST_DELAY, Chain
from tfarm.arm.law import Law, Part, is_measured
from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.case import Case
from tfarm.errors import ParameterError, require
from tfarm.exact.rationals import block_factors
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import check_gains

RULE = Quantity("discretisation", help="rule by which the continuous-time controller is made discrete")


def discretise_law(law: Law, period: float) -> Law:
    """Return the law in z with this period [s].

    Raises ParameterError for a law in z with another period, and for a law that its rule is not defined for.
    """
    if law.period is not None:
        remedy = f"the period of the law is {law.period:g} s, that of the chain {period:g} s; make them equal"
        # 1/100 s in two files may differ in its last digits
        require(math.isclose(law.period, period, rel_tol=1e-9), "period", law.period, remedy)
        return law
    remedy = (
        f"tustin keeps the values at a frequency below half the sample rate, {math.pi / period:.4g} rad/s"
    )
    is_kept = not law.prewarp or (law.rule == "tustin" and law.prewarp * period < math.pi)
    require(is_kept, "prewarp", law.prewarp, remedy)
    parts = tuple(Part(part.signals, _in_z(part, law, period)) for part in law.parts)
    return replace(law, parts=parts, period=period, prewarp=0.0)


def rule_in_words(law: Law) -> str:
    """Return the discretisation of a law, in words."""
    if law.is_discrete:
        return "in z, as given"
    names = {"tustin": "Tustin's rule", "zoh": "zero-order hold", "matched": "matched poles and zeros"}
    return f"discretised by {names[law.rule]}{f', exact at {law.prewarp:g} rad/s' if law.prewarp else ''}"


def _in_z(part: Part, law: Law, period: float) -> LawBlock:
    """Return a block of the law in z."""
    block = part.block
    rule = law.rule
    remedy = f"the rule {rule} is not for a law that differentiates: add a pole to den, or take tustin"
    require(block.excess <= 0 or rule == "tustin", f"law.{part.signals[0]}.num", law.name, remedy)
    if not block.order and block.excess <= 0:
        return block
    if rule == "tustin":
        return tustin(block, period, law.prewarp)
    if rule == "zoh":
        return by_scipy(block, period, "zoh")
    if isinstance(block, Rational):
        return by_factors(block, "matched", period, prewarp_speed(period, 0.0))
    remedy = "matched is for zeros and poles of one signal; take tustin or zoh for matrices"
    raise ParameterError(key="rule", value=rule, remedy=remedy)


def tustin(block: LawBlock, period: float, prewarp: float = 0.0) -> LawBlock:
    """Return the block with s = c (z - 1)/(z + 1).  Raises ParameterError where it has a pole at s = c."""
    c = prewarp_speed(period, prewarp)
    remedy = f"the law has a pole at {c:g} 1/s, which this rule maps to infinity; take another rule or period"
    if isinstance(block, Rational) and block.excess > 0:
        least = MACHINE_EPS * np.polyval(np.abs(block.den), c)
        require(abs(np.polyval(block.den, c)) > least, "rule", "tustin", remedy)
        return by_factors(block, "tustin", period, c)
    A = block.matrices()[0]
    require(np.linalg.cond(np.eye(len(A)) - A / c) <= 1 / MACHINE_EPS, "rule", "tustin", remedy)
    return by_scipy(block, 2 / c, "bilinear")


def prewarp_speed(period: float, prewarp: float) -> float:
    """Return c [1/s] of s = c (z - 1)/(z + 1)."""
    return prewarp / math.tan(prewarp * period / 2) if prewarp else 2 / period


def by_scipy(block: LawBlock, period: float, rule: Literal["zoh", "bilinear"]) -> StateSpace:
    """Return the block in z by a rule of `scipy.signal.cont2discrete`."""
    # here, because it takes a while to load
    from scipy.signal import cont2discrete

    return StateSpace(*cont2discrete(block.matrices(), period, rule)[:4])


def by_factors(block: Rational, rule: Literal["tustin", "matched"], period: float, c: float) -> Rational:
    """Return the ratio in z of its exact factors; `matched` has at rest the same power of s and of (z - 1)/T."""
    poles, ((gain, zeros),) = block_factors(block, rule, period, c)
    return Rational.of_roots(1 + zeros, 1 + poles, gain)


# ------------------------------------------------------------ the law in the computer


def system_matrix(law: Law) -> Real:
    """Return [A B; C D] of a law of all its columns, signals first."""
    A, B, C, D = law.matrices((*law.signals, *law.wanted))
    return np.block([[A, B], [C, D]])


def back_calculation(law: Law, limits: Any) -> Real:
    """Return lowest and highest output, and the gains of back-calculation to each state of a law in z.

    To the states x_{k+1} of `system_matrix` they add w (u within its limits - u), w being the direction of the
    integrator, A w = w, with C w = T/Tt: so I_{k+1} of its output has T/Tt times that more.  There are no gains, and no
    limits, where the law has no anti-windup or u no limit.  Raises ParameterError for several integrators.
    """
    low, high = limits
    if not (law.anti_windup and math.isfinite(high - low)):
        return np.array([-np.inf, np.inf])
    assert law.period is not None
    n = law.order
    table = system_matrix(law)
    *_, small = np.linalg.svd(table[:n, :n] - np.eye(n))
    direction = small[-1]
    through = float(table[n, :n] @ direction)
    # of a pole from 1: more than the rounding of a law to float32
    near = 1e-4
    is_single = (abs(law.poles - 1.0) <= near).sum() == 1 and through != 0.0
    remedy = "back-calculation is to one integrator, a pole at z = 1, that acts on the output"
    require(is_single, "anti_windup", law.anti_windup, remedy)
    return np.r_[low, high, law.period / law.anti_windup / through * direction]


def acting_law(case: Case, law: Law | None = None) -> tuple[Law, Chain]:
    """Return the controller of a case in z in the numbers of its chain's arithmetic, and the chain with its delay.

    `law` is its form, by default that of a computer.

    Raises ParameterError for a delay that is too long, for a gain that is too large, for a massless hub whose moment is
    fed back (an algebraic loop), and as `discretise_law` and `in_single` do.
    """
    law = case.in_computer if law is None else law
    gains = case.gains
    sampling = case.chain.sampling
    if law.part_gains.get("root_moment", (0, 1.0))[1] and "root_moment" in law.signals:
        key, value = ("signals", "root_moment") if gains is None else (MOMENT_GAIN, gains.K2)
        must_not_be_algebraic(case.arm, key, value)
    if gains is not None:
        check_gains(case.arm, gains)
    samples = sampling.delay_samples + law.delay / sampling.period
    remedy = f"with the delay of the chain it is {samples:.4g} samples; at most {MOST_DELAY:g}"
    require(samples <= MOST_DELAY, "delay", law.delay, remedy)
    acting = discretise_law(law, sampling.period)
    late = replace(case.chain, sampling=replace(sampling, delay_samples=samples))
    return in_single(acting) if late.converters.is_single else acting, late


def in_single(law: Law) -> Law:
    """Return a law in z with the numbers of `kernel.run_samples` in float32: of its states as realised there.

    Raises ParameterError for two parts on one signal, whose sum is rounded, and for a number beyond float32.
    """
    names: list[str] = []
    for part in law.parts:
        names += filter(None, part.signals)
    remedy = "in float32 a signal has one part: add them up first"
    require(len(set(names)) == len(names), "converters.arithmetic", "float32", remedy)
    return replace(law, parts=tuple(Part(part.signals, _single_block(part.block)) for part in law.parts))


def _single_block(block: LawBlock) -> LawBlock:
    """Return a block in the numbers of float32; a constant gain remains one."""
    with np.errstate(over="ignore"):
        matrices = [each.astype(np.float32).astype(float) for each in block.matrices()]
    remedy = (
        f"a number of the law is beyond {np.finfo(np.float32).max:.1e}: scale its states, or take float64"
    )
    require(all(np.isfinite(each).all() for each in matrices), "converters.arithmetic", "float32", remedy)
    is_gain = isinstance(block, Rational) and not block.order
    if is_gain:
        return Rational((float(matrices[3][0, 0]),))
    return StateSpace(*matrices)


def with_estimate(law: Law, chain: Chain) -> Law:
    """Return the law in z, with the filtered difference of the encoder where the chain estimates the hub rate by it."""
    if chain.converters.hub_rate != "difference" or "hub_rate" not in law.signals:
        return law
    T = chain.sampling.period
    a = float(np.exp(-chain.converters.rate_filter * T))
    return replace(law, parts=tuple(_from_angle(part, a, T) for part in law.parts), references=())


def _from_angle(part: Part, a: float, T: float) -> Part:
    """Return a part of a law with its columns of the hub rate replaced by columns of the hub angle.

    x_{k+1} = a x_k + angle,  rate = (1 - a)/T (angle + (a - 1) x_k)
    """
    if "hub_rate" not in part.signals:
        return part
    is_rate = np.array([name == "hub_rate" for name in part.signals], dtype=float)
    through = (1 - a) / T
    by_state = through * (a - 1) * is_rate[:, None]
    by_angle = np.diag(1 + (through - 1) * is_rate)
    A, B, C, D = part.block.matrices()
    block = StateSpace(
        np.block([[A, B @ by_state], [np.zeros((1, len(A))), np.array([[a]])]]),
        np.vstack([B @ by_angle, is_rate]),
        np.hstack([C, D @ by_state]),
        D @ by_angle,
    )
    return Part(tuple("hub_angle" if name == "hub_rate" else name for name in part.signals), block)


# ------------------------------------------------------------ factors


# part, row of the signal, and g and zeros of g prod(delta - zeros)
PartColumn = tuple[int, int, float, Complex]


@frozen
class LawInZ:
    """The parts of a law in z, with the sign of u = -sum, over `signals`: factors, and states.

    `part_poles`: the poles of each part, as delta; `columns`: the entry of a part for each signal that it feeds back,
    times the part's denominator.
    `matrices`: A, B of x_{k+1} = A x_k + B y_k, and a row of C and of D for each part.
    """

    signals: tuple[str, ...]
    part_poles: tuple[Complex, ...]
    columns: tuple[PartColumn, ...]
    matrices: Matrices

    @cached_property
    def poles(self) -> Complex:
        """Its poles, as delta."""
        return np.concatenate(self.part_poles)

    @cached_property
    def terms(self) -> list[PartColumn]:
        """The columns as p_i: the poles of other parts are zeros too."""
        poles = [np.empty(0, complex), *self.part_poles]
        others = [np.concatenate(poles[: n + 1] + poles[n + 2 :]) for n in range(len(self.part_poles))]
        return [(part, row, gain, np.r_[zeros, others[part]]) for part, row, gain, zeros in self.columns]

    def ignores(self, turned: Real, weights: Sequence[float]) -> bool:
        """Return whether its output tends to 0 where its signals stay at these values (signals,)."""
        out = []
        for part, (poles, weight) in enumerate(zip(self.part_poles, weights, strict=True)):
            held, below = lowest_power(poles)
            # by the power of delta that they are multiplied by
            terms = defaultdict[int, list[float]](list)
            pushes = []
            for n, row, g, zeros in self.columns:
                if n == part:
                    power, lowest = lowest_power(zeros)
                    pushes.append(weight * g * turned[row])
                    terms[power].append(lowest * pushes[-1])
            # an integrator of the only signal, cancelled or not
            is_reached = held and len(pushes) == 1 and pushes[0]
            if is_reached or not all(_cancel(terms[power]) for power in range(held)):
                return False
            out += [each / below for each in terms[held]]
        return _cancel(out)


def _cancel(terms: Sequence[float]) -> bool:
    """Return whether a sum over several signals is 0, to 1e-12 of its terms."""
    return abs(sum(terms)) <= 1e-12 * sum(map(abs, terms))


def lowest_power(roots: Complex) -> tuple[int, float]:
    """Return n and c of prod(delta - roots) = c delta^n + ..."""
    left = roots[roots != 0]
    return roots.size - left.size, float(np.prod(-left).real)


def law_in_z(law: Law, acting: Law, chain: Chain) -> LawInZ:
    """Return the parts of a law, and of the same in z (`acting`), at the period of a chain.

    The chain may estimate the hub rate.  The factors are those of the law itself; in float32 those of `acting`, whose
    numbers are rounded.
    """
    law = acting if chain.converters.is_single else law
    acting = with_estimate(acting, chain)
    alone = [acting.with_factors(row).matrices() for row in np.eye(len(acting.parts)).tolist()]
    A, B, _, _ = alone[0]
    C = np.vstack([each[2] for each in alone])
    D = np.vstack([each[3] for each in alone])
    poles = []
    columns: list[PartColumn] = []
    for n, part in enumerate(law.parts):
        own, found = _factors(part, law, chain)
        poles.append(own)
        columns += [(n, acting.signals.index(name), g, zeros) for name, g, zeros in found]
    return LawInZ(acting.signals, tuple(poles), tuple(columns), (A, B, C, D))


def _factors(part: Part, law: Law, chain: Chain) -> tuple[Complex, list[tuple[str, float, Complex]]]:
    """Return the poles of one part in z, and signal, gain and zeros of each column."""
    T = chain.sampling.period
    rule = "none" if law.is_discrete else law.rule
    poles, found = block_factors(part.block, rule, T, prewarp_speed(T, law.prewarp))
    columns: list[tuple[str, float, Complex]] = []
    for name, (g, zeros) in zip(part.signals, found, strict=True):
        if is_measured(name):
            columns.append((name, -law.sign * g, zeros))
    if chain.converters.hub_rate != "difference" or "hub_rate" not in part.signals:
        return poles, columns
    # -lag/T delta/(delta - lag) times the angle
    lag = float(np.expm1(-chain.converters.rate_filter * T))
    through = []
    for name, g, zeros in columns:
        if name == "hub_rate":
            through.append(("hub_angle", -g * lag / T, np.r_[zeros, 0.0]))
        else:
            through.append((name, g, np.r_[zeros, lag]))
    return np.r_[poles, lag], through


def root_product(start: Complex, roots: Complex, more: Any = 0.0) -> Complex:
    """Return prod(delta - roots) at delta = start + more (n,), without loss where a root is the start."""
    return ((start[:, None] - roots) + np.reshape(more, (-1, 1))).prod(axis=1)


def root_product_error(start: Complex, roots: Complex, more: Any) -> Real:
    """Return a bound on the rounding error of that product; a root that is the start is exact."""
    # of each term of F: of its product of n factors they add up as the root of n
    roundings = 8
    away = start[:, None] - roots
    sizes = abs(away + np.reshape(more, (-1, 1)))
    blur = np.where(away == 0, 0.0, MACHINE_EPS * (abs(start)[:, None] + abs(roots)))
    most = (sizes + blur).prod(axis=1)
    return most - sizes.prod(axis=1) + MACHINE_EPS * roundings * most
