"""A chain of segments without cancelling waves: the plane of states that the outer end allows, carried inwards.

The state along a chain is z = (W, Psi, M, Q).  The end of it leaves a plane of states; multiplying 4x4 matrices would
make the two vectors that span it parallel, as both follow the wave that grows fastest.  So the plane is carried by its
second compound (Ng and Reid 1979; Allen and Bridges 2002): p_ij = z_i y_j - z_j y_i for two states z, y of it.  Every
element is symplectic, for complex s and with damping too, which leaves p_WQ = -p_PsiM: five numbers,

    p = (p_WPsi, p_WM, p_WQ, p_PsiQ, p_MQ),

and a condition f z = 0 at the other end, a row f = (f_W, f_Psi, f_M, f_Q) carried outwards, leaves of the plane one
state, z_j = sum over i of f_i p_ij: the free response.  Of one segment with W = 0 at its root they are theta = p_WPsi,
M(0) = p_WM and Q(0) = p_WQ, the functions of `waves`.

A uniform segment has two pairs of waves, W = cosh(t_j x) and sinh(t_j x)/t_j with z_j = t_j^2, whose weights
(alpha_j, beta_j) turn into (c alpha - z s beta, c beta - s alpha) where the origin is moved inwards by the length.
This has the determinant 1, so alpha_1 beta_1 and alpha_2 beta_2 stay as they are, and what is left of p is a 2x2
matrix that the first wave turns from the left and the second from the right: no product of a wave with itself appears.

In these formulas lengths are in the segment's own length, moments in EI/l, forces in EI/l^2 (`waves`); numbers
are floats, arrays, balls or series alike.
"""

from __future__ import annotations

from typing import Any

from .compiled import inlined

Number = Any
Plane = tuple[Number, Number, Number, Number, Number]  # p_WPsi, p_WM, p_WQ = -p_PsiM, p_PsiQ, p_MQ
Row = tuple[Number, Number, Number, Number]  # f_W, f_Psi, f_M, f_Q


@inlined
def end_plane(mass: Number, shear: Number, inertia: Number, moment: Number) -> Plane:
    """The states that obey  mass W + shear Q = 0  and  inertia Psi + moment M = 0: those of a body at the end."""
    return shear * moment, -shear * inertia, 0.0 * shear, mass * moment, -mass * inertia


@inlined
def inside_offset(a: Number, p: Plane) -> Plane:
    """The plane on the inner side of a rigid massless offset: W + a Psi and M - a Q are its outer W and M."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return WPsi, WM + a * (2.0 * WQ - a * PsiQ), WQ - a * PsiQ, PsiQ, MQ


@inlined
def inside_spring(stiffness: Number, compliance: Number, p: Plane) -> Plane:
    """The plane inside a rotational spring, stiffness (Psi_outer - Psi_inner) = compliance M, times the stiffness."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        stiffness * WPsi - compliance * WM,
        stiffness * WM,
        stiffness * WQ,
        stiffness * PsiQ - compliance * MQ,
        stiffness * MQ,
    )


@inlined
def inside_body(translation: Number, rotation: Number, p: Plane) -> Plane:
    """The plane inside a body: Q + translation W and M + rotation Psi are its outer Q and M (inertia s^2 + spring)."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        WPsi,
        WM - rotation * WPsi,
        WQ,
        PsiQ + translation * WPsi,
        MQ + translation * WM - rotation * (PsiQ + translation * WPsi),
    )


@inlined
def across_waves(
    c1: Number,
    s1: Number,
    z1: Number,
    v1: Number,
    e1: Number,
    c2: Number,
    s2: Number,
    z2: Number,
    v2: Number,
    e2: Number,
    gS: Number,
    d: Number,
    v_sum: Number,
    p: Plane,
) -> Plane:
    """The plane at the inner end of a segment from that at its outer one, times g S d (z1 - z2)^2 e^{-(t1 + t2)}.

    c, s are scaled by e = e^{-t}, v_j = z_j - b S and v1 v2 = g S/d, v_sum = v1 + v2 (see `waves`).
    """  # fmt: skip
    WPsi, WM, WQ, PsiQ, MQ = p
    gap = z1 - z2
    turned = d * gS * WPsi
    A, D = -gS * gap * WM, d * gap * PsiQ  # alpha_1 ^ alpha_2 and beta_1 ^ beta_2
    B, C = v1 * MQ - 2.0 * gS * WQ + v2 * turned, 2.0 * gS * WQ - v1 * turned - v2 * MQ  # a1 ^ b2, b1 ^ a2
    kept = (d * WQ * v_sum - MQ - turned) * (e1 * e2)  # v1 alpha_1 ^ beta_1 d/(g S)
    A, C, B, D = c1 * A - z1 * s1 * C, c1 * C - s1 * A, c1 * B - z1 * s1 * D, c1 * D - s1 * B
    A, B, C, D = c2 * A - z2 * s2 * B, c2 * B - s2 * A, c2 * C - z2 * s2 * D, c2 * D - s2 * C
    kept2 = 2.0 * gS * kept
    return (
        kept2 / d + v2 * B - v1 * C,
        -d * gap * A,
        gS * (v_sum * kept + B - C),
        gS * gap * D,
        gS * (kept2 + d * (v1 * B - v2 * C)),
    )


@inlined
def transition_rows(
    F0: Number,
    F1: Number,
    F2: Number,
    F3: Number,
    S: Number,
    over_d: Number,
    a: Number,
    b: Number,
    g: Number,
    sigma: Number,
) -> tuple[Row, Row, Row, Row]:
    """The matrix that carries a state from the outer to the inner end of a segment, by its transition functions."""
    aS, bS, gS = a * S, b * S, g * S
    even, odd = F3 - aS * over_d * F1, F3 - bS * F1
    bend, lift = F2 - bS * F0, F2 - aS * over_d * F0
    return (
        (even, -F2, over_d * F1, over_d * F0 - sigma * lift),
        (gS * over_d * F0, odd, -over_d * bend, -over_d * F1),
        (-gS * F1, gS * F0 - aS * bend, odd, F2),
        (-gS * lift, gS * F1, -gS * over_d * F0, even),
    )


@inlined
def _minor(i: Row, j: Row, p: Plane) -> Number:
    """q_ij of the carried plane: the minors of rows i and j times p."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        (i[0] * j[1] - i[1] * j[0]) * WPsi
        + (i[0] * j[2] - i[2] * j[0]) * WM
        + (i[0] * j[3] - i[3] * j[0] - i[1] * j[2] + i[2] * j[1]) * WQ
        + (i[1] * j[3] - i[3] * j[1]) * PsiQ
        + (i[2] * j[3] - i[3] * j[2]) * MQ
    )


@inlined
def across_rows(W: Row, Psi: Row, M: Row, Q: Row, p: Plane) -> Plane:
    """The plane carried by `transition_rows`: for slow waves, and wherever digits are no matter."""
    return _minor(W, Psi, p), _minor(W, M, p), _minor(W, Q, p), _minor(Psi, Q, p), _minor(M, Q, p)


@inlined
def met(f: Row, p: Plane) -> Row:
    """The state (W, Psi, M, Q) of the plane p with f z = 0, up to one factor."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        -f[1] * WPsi - f[2] * WM - f[3] * WQ,
        f[0] * WPsi + f[2] * WQ - f[3] * PsiQ,
        f[0] * WM - f[1] * WQ - f[3] * MQ,
        f[0] * WQ + f[1] * PsiQ + f[2] * MQ,
    )


@inlined
def beyond_offset(a: Number, f: Row) -> Row:
    """The condition f z = 0 at the outer side of an offset, from that at its inner one."""
    return f[0], f[1] - a * f[0], f[2], f[3] + a * f[2]


@inlined
def beyond_spring(stiffness: Number, compliance: Number, f: Row) -> Row:
    """The condition beyond a rotational spring, times its stiffness."""
    return stiffness * f[0], stiffness * f[1], stiffness * f[2] - compliance * f[1], stiffness * f[3]


@inlined
def beyond_body(translation: Number, rotation: Number, f: Row) -> Row:
    """The condition beyond a body."""
    return f[0] - translation * f[3], f[1] - rotation * f[2], f[2], f[3]


@inlined
def row_across_waves(
    c1: Number,
    s1: Number,
    z1: Number,
    v1: Number,
    c2: Number,
    s2: Number,
    z2: Number,
    v2: Number,
    gS: Number,
    d: Number,
    f: Row,
) -> Row:
    """The condition at the outer end of a segment from that at its inner one, times g S d (z1 - z2).

    c, s of both waves are scaled by the same factor.
    """  # fmt: skip
    even1, odd1 = f[0] + d * v1 * f[2], v1 * f[1] + gS * f[3]
    even2, odd2 = f[0] + d * v2 * f[2], v2 * f[1] + gS * f[3]
    even1, odd1 = c1 * even1 - s1 * odd1, c1 * odd1 - z1 * s1 * even1
    even2, odd2 = c2 * even2 - s2 * odd2, c2 * odd2 - z2 * s2 * even2
    return (
        d * gS * (v1 * even2 - v2 * even1),
        d * gS * (odd1 - odd2),
        gS * (even1 - even2),
        d * (v1 * odd2 - v2 * odd1),
    )


@inlined
def row_across(W: Row, Psi: Row, M: Row, Q: Row, f: Row) -> Row:
    """The condition carried outwards by `transition_rows`, f T^-1."""
    return (
        f[0] * W[0] + f[1] * Psi[0] + f[2] * M[0] + f[3] * Q[0],
        f[0] * W[1] + f[1] * Psi[1] + f[2] * M[1] + f[3] * Q[1],
        f[0] * W[2] + f[1] * Psi[2] + f[2] * M[2] + f[3] * Q[2],
        f[0] * W[3] + f[1] * Psi[3] + f[2] * M[3] + f[3] * Q[3],
    )
