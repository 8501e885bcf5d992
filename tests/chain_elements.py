"""Finite elements of high degree for rigs, written for the tests only: they share nothing with tfarm but the energies.

On each element psi is a polynomial of degree p and w one of degree p + 1, so that w' - psi can vanish everywhere and
thin elements do not lock; everything is integrated exactly.  Stiffness, damping and mass stay factors, K = B' B and so
on, a row for the energy at each Gauss point: the frequencies are singular values, which lose the root of the condition
number of K only (as least squares without normal equations: Higham 2002, chapter 20).  Timoshenko's theory only.
"""

import math
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigvals, qr, solve_triangular, svdvals
from scipy.optimize import brentq

from tests.transition import ALIASES

DEGREE = 8  # p; with at most `ARC` radians of a wave on an element it leaves some 1e-11 of a frequency
ARC = 2.5
FINER = 4  # times the frequency for which a response has its elements, since it is read from derivatives too
HUB, LINK_SIDE = 0, 1  # the angles before and behind the joint; then w at every node, then psi


def natural_frequencies(arm, count):
    """The first flexible frequencies [rad/s] of the rig without its damping."""
    held = _is_held(arm)
    rigid = arm.has_rigid_mode and not held
    shift, up_to, found = _slowest(arm), reached(arm, count + 2), np.empty(0)
    for _ in range(8):
        model = assemble(arm, up_to, held=held)
        basis = _basis(model.stiffness, shift * model.mass)
        share = svdvals(_over(shift * model.mass, basis))[rigid:]  # shift/sqrt(w^2 + shift^2)
        share = share[share > 0]  # a hub without inertia behind a joint moves at no finite frequency
        found = shift * np.sqrt((1 - share) * (1 + share)) / share
        if found[count - 1] <= up_to:
            break
        shift, up_to = found[0], 1.2 * found[count - 1]
    return found[:count]


def eigenvalues(arm, up_to):
    """All eigenvalues [1/s] of the damped rig with |s| < up_to and Im s >= 0, its input held at zero.

    With s = a + 1/z the pencil s^2 M + s D + K has at z^2 its matrix at s = a, which the basis makes the identity.
    """
    a = _slowest(arm)
    system = System(assemble(arm, up_to, held=_is_held(arm)), a)
    K, D, M = system.with_current()
    n = len(K)
    upper = -np.linalg.solve(a * a * M + a * D + K, np.hstack([2 * a * M + D, M]))
    z = eigvals(np.vstack([upper, np.eye(n, 2 * n)]))
    s = a + 1 / z[abs(z) > 0.5 / (up_to + a)]
    return np.sort_complex(s[(abs(s) < up_to) & (s.imag >= 0)])


def frequency_response(arm, s, outputs, input=None):
    """The outputs (n,) per unit of the input at one s [1/s], both named as in `tests.transition.response`."""
    loads = input[1:] if isinstance(input, tuple) else ()
    system = System(assemble(arm, FINER * abs(s), held=_is_held(arm, input), loads=loads), max(_slowest(arm), abs(s)))
    return system.response(s, outputs, input)


@dataclass(frozen=True)
class Model:
    """Rows of stiffness, damping and mass over the unknowns; `by_angle` over the hub's angle where that is held."""

    arm: object
    stiffness: np.ndarray
    damping: np.ndarray
    mass: np.ndarray
    full: np.ndarray  # all motions from the unknowns
    by_angle: dict  # of each of the four the column of a held angle, else of zeros
    pieces: tuple  # (link, left, right) from the clamp to the tip

    @cached_property
    def reading(self):
        """`_reading`, each worked out once: it is the same at every s."""
        return cache(self._reading)

    def _reading(self, x, kind):
        """The row over all motions of "w", "w'", "psi" or "psi'" at x [m] from the clamp (on the outer element)."""
        n = max(i for i, (_, left, _) in enumerate(self.pieces) if left <= x or i == 0)
        _, left, right = self.pieces[n]
        degree = DEGREE + kind.startswith("w")
        shape, slope = _shapes(degree, np.array([2 * (x - left) / (right - left) - 1]), right - left)
        row = np.zeros(len(self.full))
        first = _first(kind[0], len(self.pieces)) + n * degree
        row[first : first + degree + 1] = (slope if kind.endswith("'") else shape)[0]
        return row, self.pieces[n][0]

    def output(self, wanted, s):
        """The row over all motions of an output."""
        end, radius = self.arm.length, self.arm.hub.radius
        hub, link_side = np.eye(2, len(self.full))
        named = {"hub_angle": hub, "hub_rate": s * hub, "link_angle": link_side}
        if wanted in named:
            return named[wanted]
        if wanted == "payload_displacement":
            return self.reading(end, "w")[0] + self.arm.payload.offset * self.reading(end, "psi")[0]
        quantity, x, *_ = ALIASES.get(wanted, wanted)
        x = min(x, end)
        (w, link), (psi, _) = self.reading(x, "w"), self.reading(x, "psi")
        bent = self.reading(x, "psi'")[0]
        return {
            "displacement": w,
            "velocity": s * w,
            "acceleration": s * s * w,
            "rotation": psi,
            "deflection": w - (radius + x) * hub,
            "twist": psi - hub,
            "curvature": bent,
            "gauge": link.EI * bent,
            "moment": link.EI * (1 + link.damping * s) * bent,
            "shear": link.kGA * (self.reading(x, "w'")[0] - psi),
        }[quantity]


class System:
    """K, D, M of a model in the basis that makes K + a D + a^2 M the identity, with its inputs and outputs."""

    def __init__(self, model, a):
        self.model, self.arm = model, model.arm
        rows = (model.stiffness, math.sqrt(a) * model.damping, a * model.mass)
        self.basis = _basis(*rows)
        self.rows = [_over(each, self.basis) for each in (model.stiffness, model.damping, model.mass)]
        self.K, self.D, self.M = (each.T @ each for each in self.rows)
        self.full = _over(model.full, self.basis)

    def with_current(self):
        """K, D, M with the back-EMF where the voltage is the input: bordered by the current if there is inductance."""
        motor, hub, n = self.arm.motor, self.full[HUB], len(self.K)
        if self.arm.input != "motor_voltage" or _is_held(self.arm):
            return self.K, self.D, self.M
        emf = motor.gear_ratio * motor.back_emf_constant
        if motor.inductance == 0:
            return self.K, self.D + _gain(motor) * emf / motor.resistance * np.outer(hub, hub), self.M
        K, D, M = (np.pad(each, (0, 1)) for each in (self.K, self.D, self.M))
        K[:n, n], K[n, n] = -_gain(motor) * hub, motor.resistance
        D[n, :n], D[n, n] = emf * hub, motor.inductance
        return K, D, M

    def response(self, s, outputs, input):
        """The outputs per unit of the input at s."""
        loaded = isinstance(input, tuple)
        held = _is_held(self.arm, input)
        drive = self.arm.input if input is None or loaded else input
        Z, hub = s * s * self.M + s * self.D + self.K, self.full[HUB]
        force, angle, own = self._force(input), float(held and not loaded), float(not held and not loaded)
        if drive in ("motor_voltage", "motor_current") and not held:
            motor = self.arm.motor
            volts = motor.inductance * s + motor.resistance if drive == "motor_voltage" else 1.0
            own *= _gain(motor) / volts
            if drive == "motor_voltage":
                Z = Z + _gain(motor) * motor.gear_ratio * motor.back_emf_constant * s / volts * np.outer(hub, hub)
        by_angle = self.model.by_angle
        stiffness, damping, mass = (
            rows.T @ by_angle[name] for rows, name in zip(self.rows, ("stiffness", "damping", "mass"), strict=True)
        )
        y = np.linalg.solve(Z, force + own * hub - angle * (stiffness + s * damping + s * s * mass))
        motions = self.full @ y + angle * by_angle["full"]
        return np.array([self.model.output(each, s) @ motions for each in outputs])

    def _force(self, input):
        """The load of a force, positive with w, or of a pair of moments, +1 with psi at the second place."""
        row = np.zeros(len(self.full))
        if isinstance(input, tuple):
            kind, *places = input
            if kind == "force":
                row = self.model.reading(places[0], "w")[0]
            else:
                row = self.model.reading(places[1], "psi")[0] - self.model.reading(places[0], "psi")[0]
        return row @ self.full


def assemble(arm, up_to, *, held, loads=()):
    """The rig's rows on elements short enough for frequencies up to `up_to`; `held` takes the hub's angle as given."""
    pieces = tuple(_pieces(arm, up_to, [*loads, *(each.x for each in arm.attachments)]))
    size = _first("p", len(pieces)) + len(pieces) * DEGREE + 1
    one = np.eye(size)
    full, angle = _allowed(arm, one, len(pieces), held)
    rows = {"stiffness": [], "damping": [], "mass": []}
    for n, (link, left, right) in enumerate(pieces):
        w, psi = (
            one[_first(kind, len(pieces)) + n * degree :][: degree + 1]
            for kind, degree in (("w", DEGREE + 1), ("p", DEGREE))
        )
        for name, row in _element(link, right - left, w, psi):
            rows[name].append(row)
    probe = Model(arm, one, one, one, one, {}, pieces)
    for name, row in _lumped(arm, probe):
        rows[name].append(row[None])
    every = {name: np.vstack([*each, np.zeros((1, size))]) for name, each in rows.items()}
    by_angle = {**{name: each @ angle for name, each in every.items()}, "full": angle}
    return Model(arm, *(every[name] @ full for name in rows), full, by_angle, pieces)


def _pieces(arm, up_to, places):
    """(link, left, right) of every element: cut at these places, and so that no wave turns by more than `ARC`."""
    left = 0.0
    for link in arm.links:
        right = left + link.length
        inside = (x for x in places if left + 1e-12 * right < x < right * (1 - 1e-12))
        for a, b in pairwise(sorted({left, right, *inside})):
            cuts = np.linspace(a, b, 1 + max(1, math.ceil(_wave(link, up_to) * (b - a) / ARC)))
            for low, high in pairwise(cuts.tolist()):
                yield link, low, high
        left = right


def _wave(link, omega):
    """The larger of the two wave numbers' magnitudes [1/m]."""
    half = omega**2 * (link.rhoA / link.kGA + link.rhoI / link.EI) / 2
    product = omega**2 * link.rhoA / link.EI * (1 - omega**2 * link.rhoI / link.kGA)
    return math.sqrt(half + math.sqrt(max(half**2 + product, 0.0)))


def _first(kind, pieces):
    """Index of the first w or psi among all motions."""
    return 2 if kind == "w" else 2 + pieces * (DEGREE + 1) + 1


def _allowed(arm, one, pieces, held):
    """All motions from the unknowns, and from a held hub's angle: what is rigid or infinite binds them."""
    root, turn = _first("w", pieces), _first("p", pieces)
    last_w, last_psi = turn - 1, len(one) - 1
    motions = one.copy()  # row i: motion i in terms of the independent ones
    motions[LINK_SIDE] = one[HUB] if math.isinf(arm.joint.stiffness) else one[LINK_SIDE]
    motions[root] = arm.hub.radius * motions[LINK_SIDE]
    if math.isinf(arm.clamp.stiffness):
        motions[turn] = motions[LINK_SIDE]
    if math.isinf(arm.payload.inertia):
        motions[last_psi] = 0.0
    if math.isinf(arm.payload.mass):
        motions[last_w] = -arm.payload.offset * motions[last_psi]
    angle = motions[:, HUB] if held else np.zeros(len(one))
    free = [i for i in range(len(one)) if motions[:, i].any() and not (held and i == HUB)]
    return motions[:, free], angle


def _element(link, h, w, psi):
    """Rows of one element of length h; w and psi pick its own motions."""
    at, weight = legendre.leggauss(DEGREE + 2)
    weight = np.sqrt(weight * h / 2)[:, None]
    deflection, slope = (each @ w for each in _shapes(DEGREE + 1, at, h))
    rotation, bent = (each @ psi for each in _shapes(DEGREE, at, h))
    bending = math.sqrt(link.EI) * weight * bent
    yield "stiffness", bending
    yield "stiffness", math.sqrt(link.kGA) * weight * (slope - rotation)
    yield "damping", math.sqrt(link.damping) * bending
    yield "mass", math.sqrt(link.rhoA) * weight * deflection
    yield "mass", math.sqrt(link.rhoI) * weight * rotation


def _lumped(arm, model):
    """Rows of what is not a link: hub, rotor, motor, springs, attachments, payload."""
    hub, link_side = model.full[HUB], model.full[LINK_SIDE]
    tip = model.reading(arm.length, "w")[0], model.reading(arm.length, "psi")[0]
    inertia, friction = _hub(arm)
    yield "mass", math.sqrt(inertia) * hub
    yield "damping", math.sqrt(friction) * hub
    yield "stiffness", math.sqrt(arm.hub.stiffness) * hub
    turned = ((arm.joint, link_side - hub), (arm.clamp, model.reading(0.0, "psi")[0] - link_side))
    for spring, row in turned:
        if math.isfinite(spring.stiffness):
            yield "stiffness", math.sqrt(spring.stiffness) * row
            yield "damping", math.sqrt(spring.stiffness * spring.damping) * row
    for each in arm.attachments:
        w, psi = model.reading(each.x, "w")[0], model.reading(each.x, "psi")[0]
        yield "mass", math.sqrt(each.mass) * w
        yield "mass", math.sqrt(each.inertia) * psi
        yield "stiffness", math.sqrt(each.stiffness) * w
        yield "stiffness", math.sqrt(each.rotational_stiffness) * psi
    payload = arm.payload
    yield "mass", math.sqrt(payload.mass if math.isfinite(payload.mass) else 0.0) * (tip[0] + payload.offset * tip[1])
    yield "mass", math.sqrt(payload.inertia if math.isfinite(payload.inertia) else 0.0) * tip[1]


def _hub(arm):
    """Inertia and viscous friction that the hub's angle feels, but for back-EMF."""
    inertia = arm.hub.inertia if math.isfinite(arm.hub.inertia) else 0.0
    friction, motor = arm.hub.friction, arm.motor
    if motor is not None:
        inertia += motor.gear_ratio**2 * motor.rotor_inertia
        friction += motor.gear_ratio**2 * motor.rotor_friction
    return inertia, friction


def _gain(motor):
    """Torque on the hub per ampere, eta N Kt [N m/A]."""
    return motor.gear_efficiency * motor.gear_ratio * motor.torque_constant


def _is_held(arm, input=None):
    """Whether the hub's angle is given: that is the input, or the hub is locked."""
    own = arm.input if input is None or isinstance(input, tuple) else input
    return math.isinf(arm.hub.inertia) or own == "hub_angle"


def _slowest(arm):
    """A frequency [rad/s] below the flexible ones or near the first, to set the scale by."""
    length = arm.length
    mass = sum(link.rhoA * link.length for link in arm.links) + sum(each.mass for each in arm.attachments)
    return math.sqrt(min(link.EI for link in arm.links) / (mass * length**3))


def reached(arm, count):
    """The frequency [rad/s] below which about `count` lie: the waves turn by pi times that on their way."""

    def turns(omega):
        return sum(_wave(link, omega) * link.length for link in arm.links) / math.pi

    low = high = _slowest(arm)
    while turns(high) < count:
        low, high = high, 2 * high
    return brentq(lambda omega: turns(omega) - count, low, high) if low < high else high


def _basis(*rows):
    """R of the rows' QR: R' R is the sum of their squares."""
    return qr(np.vstack(rows), mode="r")[0][: rows[0].shape[1]]


def _over(rows, basis):
    """rows R^-1."""
    return solve_triangular(basis, rows.T, trans=1).T


def _shapes(degree, at, h):
    """Lagrange's polynomials on Chebyshev points of an element of length h, and their slopes, at points of -1..1."""
    nodes = -np.cos(np.pi * np.arange(degree + 1) / degree)
    inverse = np.linalg.inv(legendre.legvander(nodes, degree))
    slopes = legendre.legval(at, legendre.legder(inverse)).T
    return legendre.legvander(at, degree) @ inverse, slopes * (2 / h)
