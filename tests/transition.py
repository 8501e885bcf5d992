"""Rigs solved by the plain product of 4x4 transition matrices, for the tests only: it shares nothing with tfarm.

z = (W, Psi, M, Q), with W and Psi the total displacement and rotation, runs along the chain from the clamp to the tip:

    W' = Psi + Q/kGA    Psi' = M/(EI (1 + C s))    M' = rhoI s^2 Psi - Q    Q' = rhoA s^2 W

and jumps where something is attached.  The root's own numbers, hub angle, angle behind the joint, Psi, M and Q at the
clamp and the torque, are the six unknowns of hub, joint, clamp, drive and the two conditions of the tip.  The growing
waves make the columns of the product parallel: that costs digits, so as many are added as they take (Pestel and Leckie
1963, chapter 3, say what happens without).
"""

import math

import mpmath
from mpmath import mpf

HUB, LINK_SIDE, PSI, M, Q, TORQUE, LOAD = range(7)  # the unknowns at the root, and what does not depend on them
EPS = 2.0**-52
GUARD = 30  # digits: contrasts of 1e4 between segments in stiffness, mass and length, and units
ALIASES = {
    "root_moment": ("gauge", 0.0),
    "root_shear": ("shear", 0.0),
    "tip_displacement": ("displacement", math.inf),
    "tip_acceleration": ("acceleration", math.inf),
    "tip_deflection": ("deflection", math.inf),
    "tip_rotation": ("twist", math.inf),
    "tip_angle": ("rotation", math.inf),
}


def response(arm, s, outputs, digits=60, input=None):
    """The outputs (dict of mpc) per unit of an input at one s [1/s], right to about `digits` digits.

    An output is a name of `ALIASES` (x = inf is the tip), hub_angle, hub_rate, link_angle (behind the joint),
    hub_torque, motor_current or payload_displacement (its centre), or (quantity, x) or (quantity, x, side) with x [m]
    from the clamp and side "outer" (default) or "inner" of a joint or attachment there.  Quantities: displacement,
    velocity, acceleration (absolute), rotation (Psi), deflection W - (r + x) theta and twist Psi - theta (from the
    hub's own line), gauge E I Psi' and moment E I (1 + C s) Psi', curvature, shear.
    An input is hub_torque, motor_voltage, motor_current or hub_angle (by default the arm's own; the angle where the hub
    is locked), ("force", x), positive with W, or ("moment_pair", x1, x2), +1 with Psi at x2 and -1 at x1; under these
    two the arm's own input is held at zero.
    """
    with mpmath.workdps(digits + _growth(arm, s)):
        chain = _Chain(arm, mpmath.mpc(s), outputs, input)
        root = list(mpmath.lu_solve(*map(mpmath.matrix, chain.equations())))
        return {wanted: chain.value(wanted, root) for wanted in outputs}


def determinant(arm, s, digits=60, input=None):
    """Zero at the eigenvalues of the arm whose input is held at zero; real on both axes where nothing is damped."""
    with mpmath.workdps(digits + _growth(arm, s)):
        matrix, _ = _Chain(arm, mpmath.mpc(s), (), input).equations()
        return mpmath.det(mpmath.matrix(matrix))


def transition(link, s, length, theory="timoshenko"):
    """exp(A length), 4x4 lists, in mpmath's working precision.

    A^4 = p A^2 - q for A of the four equations, so the series is one in I, A, A^2, A^3; it is summed on a piece so
    short that no term exceeds its sum by much, and the piece is doubled.
    """
    A = _generator(link, s, theory)
    A2 = _product(A, A)
    A3 = _product(A2, A)
    p, q = _biquadratic(link, s, theory)
    halvings = max(0, math.ceil(math.log2(float(mpmath.sqrt(abs(p) + mpmath.sqrt(abs(q))) * length) / 4 + 1e-300)))
    c = _series(p, q, length / mpf(2) ** halvings)
    one = [[mpf(i == j) for j in range(4)] for i in range(4)]
    powers = (one, A, A2, A3)
    T = [[sum(a * P[i][j] for a, P in zip(c, powers, strict=True)) for j in range(4)] for i in range(4)]
    for _ in range(halvings):
        T = _product(T, T)
    return T


class _Chain:
    """The state along the chain as 4 rows over the unknowns and the load, at each stop and on both of its sides."""

    def __init__(self, arm, s, outputs, input):
        self.arm, self.s, self.load = arm, s, input
        self.locked = math.isinf(arm.hub.inertia)
        self.held = arm.input if input is None or isinstance(input, tuple) else input
        self.joints = [mpf(0)]
        for link in arm.links:
            self.joints.append(self.joints[-1] + mpf(link.length))
        places = {self._place(x) for name in outputs for x in self._point(name)}
        loads = input[1:] if isinstance(input, tuple) else ()
        places |= {self._place(x) for x in loads} | {self._place(each.x) for each in arm.attachments}
        self.stops = sorted(places | set(self.joints))
        self.states = self._march()

    def _point(self, name):
        where = ALIASES.get(name, name)
        return (where[1],) if isinstance(where, tuple) else ()

    def _place(self, x):
        """x, or the joint that it means: the sum of the lengths is rounded in the arm and not here."""
        if math.isinf(x):
            return self.joints[-1]
        nearest = min(self.joints, key=lambda joint: abs(joint - x))
        return nearest if abs(nearest - x) <= 8 * EPS * self.joints[-1] else mpf(x)

    def _march(self):
        """{(x, side): (state, segment)}, the segment being the one on that side."""
        rows = [[mpf(0)] * 7 for _ in range(4)]
        rows[0][LINK_SIDE] = mpf(self.arm.hub.radius)
        for row, unknown in zip(rows[1:], (PSI, M, Q), strict=True):
            row[unknown] = mpf(1)
        states, links, inner = {}, self.arm.links, self.arm.link
        for x, after in zip(self.stops, [*self.stops[1:], None], strict=True):
            n = sum(joint <= x for joint in self.joints[1:-1])
            states[x, "inner"] = rows, inner
            rows, inner = self._jumped(rows, x), links[n]
            states[x, "outer"] = rows, inner
            if after is not None:
                rows = _product(transition(inner, self.s, after - x, self.arm.theory), rows)
        return states

    def _jumped(self, rows, x):
        """Past what is attached at x, and past the loads there."""
        W, Psi, moment, shear = ([*row] for row in rows)
        s2 = _squared(self.s)
        for each in self.arm.attachments:
            if self._place(each.x) == x:
                k, kr = each.stiffness + each.mass * s2, each.rotational_stiffness + each.inertia * s2
                shear = [a + k * b for a, b in zip(shear, W, strict=True)]
                moment = [a + kr * b for a, b in zip(moment, Psi, strict=True)]
        if isinstance(self.load, tuple):
            kind, *points = self.load
            for sign, point in zip((-1, 1) if kind == "moment_pair" else (1,), points, strict=True):
                if self._place(point) == x:
                    (shear if kind == "force" else moment)[LOAD] -= sign
        return [W, Psi, moment, shear]

    def equations(self):
        """Matrix and right side of the six conditions, rows in the order hub, joint, clamp, drive, tip, tip."""
        arm, s = self.arm, self.s
        at_axis = {M: mpf(1), Q: mpf(arm.hub.radius)}  # the moment M + r Q of the chain on the axis
        rows = [
            self._hub(at_axis),
            _spring(arm.joint, s, HUB, LINK_SIDE, at_axis),
            _spring(arm.clamp, s, LINK_SIDE, PSI, {M: mpf(1)}),
            self._drive(),
        ]
        matrix = [[row.get(unknown, mpf(0)) for unknown in range(6)] for row, _ in rows]
        right = [value for _, value in rows]
        for row in self._tip():
            matrix.append(row[:LOAD])
            right.append(-row[LOAD])
        return matrix, right

    def _hub(self, at_axis):
        """Z_h theta = u + M + r Q, Z_h with the rotor's N^2 (J_m s^2 + b_m s); where it is locked u takes all of it."""
        arm, s = self.arm, self.s
        Z = mpf(0)
        if not self.locked:
            Z = arm.hub.inertia * s**2 + arm.hub.friction * s + arm.hub.stiffness
            if arm.motor is not None:
                motor = arm.motor
                Z += mpf(motor.gear_ratio) ** 2 * (motor.rotor_inertia * s**2 + motor.rotor_friction * s)
        return {HUB: -Z, TORQUE: mpf(1), **at_axis}, mpf(0)

    def _drive(self):
        """The input's condition on the torque or the angle; its right side is 1, or 0 where the load is elsewhere."""
        own = mpf(0 if isinstance(self.load, tuple) else 1)
        if self.locked or self.held == "hub_angle":
            return {HUB: mpf(1)}, own
        if self.held == "hub_torque":
            return {TORQUE: mpf(1)}, own
        motor = self.arm.motor
        N, gain = mpf(motor.gear_ratio), self._gain()
        if self.held == "motor_current":
            return {TORQUE: mpf(1)}, gain * own
        emf = motor.back_emf_constant
        emf = mpf(motor.torque_constant if emf is None else emf)
        return {TORQUE: self.s * motor.inductance + motor.resistance, HUB: gain * N * emf * self.s}, gain * own

    def _gain(self):
        """Torque on the hub per ampere, eta N Kt [N m/A]."""
        motor = self.arm.motor
        return mpf(motor.gear_efficiency) * motor.gear_ratio * motor.torque_constant

    def _tip(self):
        """Q = -m s^2 (W + e Psi) and M = e Q - I_c s^2 Psi; an infinite m or I_c holds W + e Psi or Psi."""
        payload, s2 = self.arm.payload, _squared(self.s)
        W, Psi, moment, shear = self.states[self.joints[-1], "outer"][0]
        e = mpf(payload.offset)
        centre = [a + e * b for a, b in zip(W, Psi, strict=True)]
        if not math.isinf(payload.mass):
            first = [a + payload.mass * s2 * b for a, b in zip(shear, centre, strict=True)]
        else:
            first = centre
        if not math.isinf(payload.inertia):
            lever = zip(moment, shear, Psi, strict=True)
            second = [a - e * b + payload.inertia * s2 * c for a, b, c in lever]
        else:
            second = Psi
        return first, second

    def value(self, wanted, root):
        """One output from the solved unknowns at the root."""
        s, theta = self.s, root[HUB]
        at_root = {"hub_angle": theta, "hub_rate": s * theta, "link_angle": root[LINK_SIDE], "hub_torque": root[TORQUE]}
        if wanted in at_root:
            return at_root[wanted]
        if wanted == "motor_current":
            return root[TORQUE] / self._gain()
        quantity, x, *side = ALIASES.get(wanted, ("centre", math.inf) if wanted == "payload_displacement" else wanted)
        place = self._place(x)
        rows, link = self.states[place, side[0] if side else "outer"]
        known = [*root, mpf(1)]
        W, Psi, moment, shear = (mpmath.fdot(zip(row, known, strict=True)) for row in rows)
        undamped = moment / (1 + link.damping * s)
        return {
            "displacement": W,
            "velocity": s * W,
            "acceleration": s**2 * W,
            "rotation": Psi,
            "deflection": W - (self.arm.hub.radius + place) * theta,
            "twist": Psi - theta,
            "gauge": undamped,
            "curvature": undamped / _EI(link),
            "moment": moment,
            "shear": shear,
            "centre": W + mpf(self.arm.payload.offset) * Psi,
        }[quantity]


def _spring(spring, s, inner, outer, moment):
    """k (1 + c s) (outer - inner) = moment; an infinite k makes them one."""
    if math.isinf(spring.stiffness):
        return {outer: mpf(1), inner: mpf(-1)}, mpf(0)
    k = spring.stiffness * (1 + spring.damping * s)
    return {outer: k, inner: -k, **{unknown: -arm for unknown, arm in moment.items()}}, mpf(0)


def _EI(link):
    return mpf(link.youngs_modulus) * link.section.second_moment


def _compliances(link, s, theory):
    """1/kGA, 1/EI(1 + C s), rhoI s^2, rhoA s^2 of a segment under one of the four theories.

    The products are those of the float64 numbers as they are, not their rounded ones that a Link gives.
    """
    section, rho = link.section, mpf(link.density)
    kGA = mpf(link.shear_factor) * link.shear_modulus * section.area
    shear = mpf(0) if theory in ("rayleigh", "euler-bernoulli") else 1 / kGA
    rotary = mpf(0) if theory in ("shear", "euler-bernoulli") else rho * section.second_moment
    bending = 1 / (_EI(link) * (1 + link.damping * s if link.damping else 1))
    s2 = _squared(s)
    return shear, bending, rotary * s2, rho * section.area * s2


def _squared(s):
    """s^2, as a real number where it is one: real numbers are three times as fast."""
    s2 = s * s
    return s2.real if s2.imag == 0 else s2


def _generator(link, s, theory):
    shear, bending, rotary, mass = _compliances(link, s, theory)
    zero, one = mpf(0), mpf(1)
    return [[zero, one, zero, shear], [zero, zero, bending, zero], [zero, rotary, zero, -one], [mass, zero, zero, zero]]


def _biquadratic(link, s, theory):
    """p, q of l^4 = p l^2 - q, the squares of whose roots are the squares of the wave numbers."""
    shear, bending, rotary, mass = _compliances(link, s, theory)
    return mass * shear + rotary * bending, mass * bending * (1 + rotary * shear)


def _series(p, q, x):
    """c_0..c_3 of exp(A x) = c_0 + c_1 A + c_2 A^2 + c_3 A^3: A^n = a_n + b_n A^2, times A^(0 or 1)."""
    c = [mpf(0)] * 4
    a, b, even, odd, n = mpf(1), mpf(0), mpf(1), x, 0
    size = mpf(1)
    while size > mpmath.eps**2:
        c = [c[0] + a * even, c[1] + a * odd, c[2] + b * even, c[3] + b * odd]
        a, b = -q * b, a + p * b
        n += 2
        even *= x * x / (n * (n - 1))
        odd *= x * x / (n * (n + 1))
        size = abs(even) * (abs(a) + abs(b) / (x * x)) if n > 8 else mpf(1)
    return c


def _product(A, B):
    columns = list(zip(*B, strict=True))
    return [[mpmath.fdot(zip(row, column, strict=True)) for column in columns] for row in A]


def _growth(arm, s):
    """Digits that the growing waves take, there and back, and `GUARD`."""
    total = 0.0
    for link in arm.links:
        p, q = _biquadratic(link, mpmath.mpc(s), arm.theory)
        half_spread = mpmath.sqrt(p * p / 4 - q)
        waves = (mpmath.sqrt(p / 2 + half_spread), mpmath.sqrt(p / 2 - half_spread))
        total += link.length * float(sum(abs(wave.real) for wave in waves))
    return GUARD + math.ceil(2 * total / math.log(10))
