"""Sectors of gains in which K may vary arbitrarily: the discrete circle criterion on the exact sampled loop.

With H the pulse transfer function from torque to moment, rate feedback closed, and H_m = H/(1 + m H) the same with the
middle gain m = (lo + hi)/2 closed too,

    min over frequency of 1 + (lo + hi) Re H + lo hi |H|^2 > 0  and  H_lo stable
        <=>  H_m stable and (hi - lo)/2 max |H_m| < 1

so around m the widest sector has the radius 1/max|H_m|.  The peak is searched on a grid that is dense around every
pole and then refined.  A grid is no proof: the sector is then certified by one quadratic Lyapunov function for both
ends, in whole numbers, which exists exactly where the criterion holds at all frequencies.

If P > 0 and P - A^T P A > 0 for both ends A_lo, A_hi of a segment, then V = s^T P s falls at every sample for *any*
sequence of matrices of that segment, for A -> A^T P A is convex.  Where the ends differ by a matrix of rank one such a
P exists exactly where the circle criterion holds (Kalman-Yakubovich-Popov lemma); P is found in float64 by a Riccati
equation, and its inequalities are then checked without any rounding: matrices of doubles are whole numbers over a power
of two, and Bareiss' elimination (1968) keeps them whole.

The guard: the interval of the gain, and its certificate.

    time-varying   a sector [lo, hi] in which K may vary arbitrarily from sample to sample: certified
    frozen         the interval of constant gains with a stable loop.  Not certified for a K that varies:
                   switching between two such gains can destabilise the loop
    none           the plain softplus, K >= 0

A certified sector gives a contraction, so that signals are bounded under bounded references, and under rounding by
converters, for any K(t) in it; saturation is not covered.  The proof is for one arm, servo, sampling and delay, with
the modes that it names.  A hub angle with feedback is one of the states that contract: it follows its reference.

The network's gain kappa = ln(1 + e^z) is mapped to the interval by K = lo + (hi - lo)(1 - e^-kappa), which is
lo + (hi - lo)/(1 + e^-z): smooth, with a gradient.

The larger the middle gain, the wider is the sector.  The default is the widest that contains the best constant gain at
least a tenth of its width away from its ends, or the one nearest to it.
"""

import math
from contextlib import suppress
from functools import cached_property
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_discrete_are, solve_triangular

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN
from tfarm.arrays import Real
from tfarm.dsp.plant import first_distinct
from tfarm.dsp.pulse import held_amplitude
from tfarm.dsp.stages import not_covered
from tfarm.errors import CertificationError, ConvergenceError, must_be_known
from tfarm.exact.rationals import exact_matrix, falls, is_positive_definite
from tfarm.loop.circle_crossings import interval_around, stable_windows
from tfarm.loop.loop_margins import lowest
from tfarm.loop.sampled import Sampled
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.tuner.kernel import CONSUMER, Limits

# of the radius that the criterion allows: room for the modes left out, and for a strict proof
RADIUS_SHARE = 0.99


@frozen
class CommonLyapunov:
    """V = s^T P s falls with both matrices `low` and `high` (n, n), and with all between them.

    `contraction` rho < 1: factor on |s| in the norm of P at every sample, or less (float64).
    """

    low: Real
    high: Real
    P: Real
    contraction: float

    def is_proven(self) -> bool:
        """Return whether P > 0 and both inequalities hold in exact arithmetic.

        In the states 2^k s, k whole and such that P has diagonal entries near 1: P has all its digits in any units, and
        nothing is rounded by the change of units, as powers of two are exact.
        """
        diagonal = np.diag(self.P)
        if not (np.isfinite(self.P).all() and (diagonal > 0).all()):
            return False
        units = 2.0 ** np.round(-np.log2(diagonal) / 2)
        scaled = self.P * units * units[:, None]
        # P is rounded to 60 bits before the proof
        P, _ = exact_matrix(np.round(np.ldexp(scaled / abs(scaled).max(), 60))).numer_denom()
        ends = (A * units / units[:, None] for A in (self.low, self.high))
        return is_positive_definite(P) and all(falls(P, A) for A in ends)


def common_lyapunov(middle: Real, drive: Real, sense: Real, low: Real, high: Real) -> CommonLyapunov | None:
    """Return the Lyapunov function of the segment from `low` to `high`; None where none is found.

    `middle` lies between them, and drive sense^T is half of low - high.  The best of several slacks is taken.  There is
    none where `middle` is unstable.
    """
    if not abs(np.linalg.eigvals(middle)).max() < 1.0:
        return None
    # the size of each state after one push: a sum of squares over 2^40 samples, after which any mode has decayed
    total = np.outer(drive, drive)
    power = middle
    for _ in range(40):
        total = total + power @ total @ power.T
        power = power @ power
    size = np.sqrt(np.diag(total))
    scale = np.where(size > 0, size, 1.0)
    A = middle * scale / scale[:, None]
    b = (drive / scale)[:, None]
    c = (sense * scale)[None]
    found: list[CommonLyapunov] = []
    # slacks of the inequality, in states of size 1
    for slack in (1e-3, 1e-5, 1e-7, 1e-9):
        with suppress(LinAlgError, ValueError):
            P = solve_discrete_are(A, b, c.T @ c + slack * (c @ c.T).item() * np.eye(len(A)), -np.eye(1))
            P = (P + P.T) / 2 / scale / scale[:, None]
            L = np.linalg.cholesky(P)
            rho = max(
                np.linalg.norm(solve_triangular(L, (L.T @ each).T, lower=True), 2) for each in (low, high)
            )
            found.append(CommonLyapunov(low, high, P, float(rho)))
    best = min(found, key=lambda each: each.contraction, default=None)
    return best if best and best.contraction < 1 else None


@frozen
class MovingGain:
    """A sampled loop with a varying moment gain K: A(K) = open - K drive sense^T, without the free hub angle."""

    loop: Sampled

    @cached_property
    def open(self) -> Real:
        """The matrix with rate feedback alone."""
        return self.loop.with_number(MOMENT_GAIN, 0.0).reduced_matrix()

    @cached_property
    def _feedback(self) -> Real:
        """drive sense^T: the change of the matrix by a gain of -1."""
        return self.open - self.loop.with_number(MOMENT_GAIN, 1.0).reduced_matrix()

    @cached_property
    def sense(self) -> Real:
        """(n,): the row of the moment."""
        # of the torque: its drive is 1
        return np.asarray(
            self._feedback[self.loop.pulse.integrals_at + 2 - len(self.loop.matrix()) + len(self.open)]
        )

    @cached_property
    def drive(self) -> Real:
        """(n,): the column of the torque."""
        return np.asarray(self._feedback @ self.sense / (self.sense @ self.sense))

    def at(self, K: float) -> Real:
        """Return the closed-loop matrix at a gain."""
        return self.open - K * self._feedback

    def radius(self, m: float) -> float:
        """Return half the width of the widest sector around m; 0 where m itself is unstable."""
        w, V = np.linalg.eig(self.at(m))
        if not abs(w).max() < 1.0:
            return 0.0
        r = (self.sense @ V) * np.linalg.solve(V, self.drive.astype(complex))
        return float(1.0 / _peak(r, w))

    def proof(self, lo: float, hi: float) -> CommonLyapunov | None:
        """Return the Lyapunov function of [lo, hi], proven in exact arithmetic; None where there is none."""
        half = (hi - lo) / 2
        found = common_lyapunov(
            self.at((lo + hi) / 2),
            np.sqrt(half) * self.drive,
            np.sqrt(half) * self.sense,
            self.at(lo),
            self.at(hi),
        )
        return found if found is not None and found.is_proven() else None


def _peak(residues: NDArray[np.complexfloating], poles: NDArray[np.complexfloating]) -> float:
    """Return max over the unit circle of |sum of residues/(z - poles)|."""
    # points around the angle of each pole, whose distance from the circle is known to 1e-12
    away = np.geomspace(0.01, 100.0, 30)
    width = np.maximum(1 - abs(poles), 1e-12)[:, None] * np.r_[-away, 0.0, away]
    dense = (abs(np.angle(poles))[:, None] + width).ravel()
    theta = np.unique(np.clip(np.r_[np.linspace(0, np.pi, 1001), dense], 0, np.pi))

    def negative(theta: Real) -> Real:
        return -np.asarray(abs((residues / (np.exp(1j * theta)[:, None] - poles)).sum(axis=1)))

    return -lowest(negative, theta)[0]


GuardKind = Literal["time-varying", "frozen", "none"]
# a sector this narrow is none
NARROWEST_SECTOR = 1e-4


@frozen
class Guard:
    """The interval [lo, hi] of K (inf: no upper end), from models of up to `modes_used` flexible modes.

    `is_settled`: more modes do not change it.  `proofs`, of the time-varying kind alone: a Lyapunov function of every
    model.  `omitted` names the keys of the chain that it does not cover.
    """

    kind: Annotated[
        GuardKind, Quantity("kind", help="time-varying (certified), frozen (constant gains) or none")
    ]
    lo: Annotated[float, Quantity("least moment gain", digits=4, help="lower end of the guard")]
    hi: Annotated[
        float, Quantity("largest moment gain", digits=4, help="upper end of the guard; infinite without one")
    ]
    modes_used: Annotated[
        int, Quantity("flexible modes", key="modes", help="modes of the largest model of the certificate")
    ]
    is_settled: Annotated[
        bool, Quantity("more modes change nothing", key="settled", help="converged in the number of modes")
    ]
    proofs: tuple[CommonLyapunov, ...] = ()
    omitted: str = ""

    @property
    def is_proven(
        self,
    ) -> Annotated[
        bool,
        Quantity(
            "certified for any K(t)",
            key="proven",
            help="one quadratic Lyapunov function decreases under every gain in it",
        ),
    ]:
        """Whether the loop is certified stable for every K(t) in it, and not that of its first modes alone."""
        return bool(self.proofs) and self.is_settled

    @property
    def limits(self) -> Limits:
        """The interval for `kernel.guard_gain`."""
        return Limits(self.lo, self.hi)

    @property
    def sentence(self) -> Annotated[str, Quantity("certainty", key="says", help="scope of the certificate")]:
        """The certificate, in words."""
        if self.kind == "none":
            return "no guard: K >= 0, not certified"
        modes = (
            f"{self.modes_used} modes, {'more change nothing' if self.is_settled else 'more may change it'}"
        )
        interval = f"[{self.lo:.4g}, {self.hi:.4g}]"
        if self.kind == "frozen":
            return f"{interval}: stable for every constant K, not certified for one that varies ({modes}){self.omitted}"
        rate = max(proof.contraction for proof in self.proofs)
        certified = "certified" if self.is_settled else f"certified for the first {self.modes_used} modes"
        return f"{interval}: {certified} for any K(t), contraction by {1 - rate:.2g} a sample ({modes}){self.omitted}"


def find_guard(loop: Sampled, kind: GuardKind, best_constant: float) -> Guard:
    """Return the guard of a loop (its servo, chain and modes), for any moment gain of the loop.

    Raises CertificationError where there is none, with the least damping that has one.
    """
    must_be_known("guard", kind, get_args(GuardKind))
    if kind == "none":
        return Guard("none", 0.0, math.inf, loop.plant.count, False)
    find = _find_interval if kind == "frozen" else _find_sector
    sector = "constant gain" if kind == "frozen" else "sector of time-varying gains"
    guard = find(_larger(loop), best_constant)
    if guard:
        return guard
    arm = loop.plant.arm
    gains = loop.gains
    at = f"{RATE_GAIN} = {gains[RATE_GAIN]:g}"
    if gains[ANGLE_GAIN]:
        at += f", {ANGLE_GAIN} = {gains[ANGLE_GAIN]:g}"
    start = f"{arm.name}: no {sector} is certified stable at {at}, C = {arm.damping:g} s"
    # the least damping with a guard, of a few [s]
    for C in filter(arm.damping.__lt__, np.geomspace(1e-12, 1e-2, 11).tolist()):
        with suppress(ConvergenceError):
            other = find(_larger(loop.on(arm.with_numbers(damping=C), loop.plant.count)), 0.0)
            if other and other.is_settled:
                raise CertificationError(f"{start}; with a damping of C = {C:.1e} s there is one")
    remedy = f"take another {RATE_GAIN}, or a shorter period or delay"
    raise CertificationError(f"{start}, nor with any damping up to 0.01 s; {remedy}")


def constant_windows(loop: Sampled) -> list[tuple[float, float]]:
    """Return the stability intervals of constant gains K >= 0, up to 10."""
    return [(max(low, 0.0), min(high, 10.0)) for low, high in stable_windows(loop, MOMENT_GAIN) if high > 0]


def _find_interval(loops: list[Sampled], best_constant: float) -> Guard | None:
    """Return the stability interval common to all models, without its outermost hundredth."""
    found = []
    for windows in map(constant_windows, loops):
        if not windows:
            return None
        found.append(
            interval_around(windows, best_constant)
            or min(windows, key=lambda w: abs(sum(w) / 2 - best_constant))
        )
    low = max(low for low, _ in found)
    high = min(high for _, high in found)
    width = high - low
    edge = (1 - RADIUS_SHARE) * width
    if width >= NARROWEST_SECTOR:
        return _guard("frozen", loops, found, low + edge * (low > 0), high - edge)
    return None


def _find_sector(loops: list[Sampled], best_constant: float) -> Guard | None:
    """Return the sector of the default rule, certified in every model."""
    models = [MovingGain(loop) for loop in loops]
    m = _middle(models[0], best_constant)
    if m is None:
        return None
    half = RADIUS_SHARE * min(model.radius(m) for model in models)
    if half >= NARROWEST_SECTOR:
        return _certify(models, max(0.0, m - half), m + half, m)
    return None


def sector_guard(loop: Sampled, lo: float, hi: float) -> Guard | None:
    """Return the guard of a given sector [lo, hi] of time-varying gains, such as that of a saved tuner.

    None where it is not certified in every model of the loop.
    """
    return _certify([MovingGain(each) for each in _larger(loop)], lo, hi, (lo + hi) / 2)


def _certify(models: list[MovingGain], lo: float, hi: float, middle: float) -> Guard | None:
    """Return the sector [lo, hi] with its proof in every model; settled where the widest around `middle` is."""
    proven = tuple(filter(None, (model.proof(lo, hi) for model in models)))
    if len(proven) < len(models):
        return None
    radii = [model.radius(middle) for model in models]
    widest = [(middle - radius, middle + radius) for radius in radii]
    return _guard("time-varying", [model.loop for model in models], widest, lo, hi, proven)


def _guard(
    kind: GuardKind,
    loops: list[Sampled],
    found: list[tuple[float, float]],
    lo: float,
    hi: float,
    proofs: tuple[CommonLyapunov, ...] = (),
) -> Guard:
    """Return the guard [lo, hi] of the intervals `found` of some loops, the largest last."""
    omitted = not_covered(CONSUMER, loops[0].chain)
    return Guard(kind, lo, hi, loops[-1].plant.count, _is_settled(loops, found), proofs, omitted)


def _middle(model: MovingGain, best_constant: float) -> float | None:
    """Return the middle gain of the default rule; None where no gain is stable."""
    # the best constant gain is within this share of half the width of the sector
    inside = 0.8
    middles: list[float] = []
    for low, high in constant_windows(model.loop):
        middles += np.linspace(low, high, 62)[1:-1].tolist()
    radii = np.array([model.radius(m) for m in middles])
    if not (radii > NARROWEST_SECTOR).any():
        return None
    beyond = abs(best_constant - np.array(middles)) - inside * radii
    if (beyond > 0).all():
        return middles[int(np.argmin(beyond))]
    best = int(np.argmax(np.where(beyond <= 0, radii, -1.0)))
    inner = middles[best]
    outer = middles[min(best + 1, len(middles) - 1)]
    # up to where the best constant gain just is inside
    for _ in range(12):
        m = (inner + outer) / 2
        radius = model.radius(m)
        is_inside = abs(best_constant - m) <= inside * radius and radius >= radii[best]
        inner, outer = (m, outer) if is_inside else (inner, m)
    return inner


def _is_settled(loops: list[Sampled], found: list[tuple[float, float]]) -> bool:
    """Return whether more modes changed nothing, and the modes left out stay stable by their own damping.

    Never at C = 0.
    """
    if loops[0].plant.arm.is_undamped or len(found) < 2:
        return False
    (before_low, before_high), (low, high) = found
    # of the width of the interval
    agree = max(abs(low - before_low), abs(high - before_high)) <= 1e-3 * (high - low)
    return agree and upper_modes_are_quiet(loops[-1], high)


def upper_modes_are_quiet(loop: Sampled, highest: float) -> bool:
    """Return whether the own decay of the upper half of the modes exceeds the bound on the push of the feedback."""
    plant = loop.plant
    T = loop.chain.sampling.period
    fed_back = loop.with_number(MOMENT_GAIN, highest).push
    push = 2 * fed_back * abs(held_amplitude(plant.poles, T))
    upper = (plant.mode > plant.count // 2) & (plant.poles.imag > 0)
    return bool((push[upper] < -plant.poles.real[upper] * T).all())


def _larger(loop: Sampled) -> list[Sampled]:
    """Return the loop, and the same with four times the modes, or three times or twice; at C = 0 with twenty.

    A number at which two of the damped modes are not distinguished is left out.
    """
    count = loop.plant.count
    wanted = [min(times * count, 48) for times in (4, 3, 2)] if loop.plant.arm.damping else [20]
    larger = first_distinct(loop.with_modes, [*(number for number in wanted if number > count), count])
    return [loop, larger] if larger.plant.count > count else [loop]
