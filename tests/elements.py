"""Timoshenko finite elements, written for the tests only: they share nothing with tfarm but the energy of the beam.

w and psi are both Lagrange polynomials of degree p on equal elements.  The shear energy is integrated with p Gauss
points, one fewer than it takes, or thin elements would lock (Hughes, Taylor and Kanoknukulchai 1977 for p = 1); all
else exactly.  Frequencies then converge as (1/n)^(2p) (Strang and Fix 1973, section 6.3).
"""

import math

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh


def natural_frequencies(arm, elements, degree, count):
    """The first flexible frequencies [rad/s] of an arm on equal elements, hub and payload as lumped inertias."""
    stiffness, mass = matrices(arm, elements, degree)
    square = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(square[arm.has_rigid_mode :][:count])


def matrices(arm, elements, degree):
    """Stiffness and mass with the held motions taken out; unknowns w at all nodes, then psi at all nodes."""
    link, payload = arm.link, arm.payload
    nodes, h = elements * degree + 1, link.length / elements
    stiffness, mass = np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, 2 * nodes))
    K, M = _element(link, h, degree)
    for first in range(0, elements * degree, degree):
        own = np.arange(first, first + degree + 1)
        entries = np.ix_(np.r_[own, own + nodes], np.r_[own, own + nodes])
        stiffness[entries] += K
        mass[entries] += M
    held = [0]
    for entry, body in ((nodes, arm.hub.inertia), (nodes - 1, payload.mass), (2 * nodes - 1, payload.inertia)):
        if math.isinf(body):
            held.append(entry)
        else:
            mass[entry, entry] += body
    free = np.setdiff1d(np.arange(2 * nodes), held)
    return stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]


def _element(link, h, degree):
    """Stiffness and mass of one element of length h; unknowns w_0..w_p, psi_0..psi_p."""
    zero = np.zeros((degree + 1, degree + 1))
    shape, slope, weight = _shapes(degree, degree + 1, h)
    bending = link.EI * (slope.T * weight) @ slope
    inertia = (shape.T * weight) @ shape
    shape, slope, weight = _shapes(degree, degree, h)
    shear = np.hstack([slope, -shape])
    stiffness = np.block([[zero, zero], [zero, bending]]) + link.kGA * (shear.T * weight) @ shear
    return stiffness, np.block([[link.rhoA * inertia, zero], [zero, link.rhoI * inertia]])


def _shapes(degree, points, h):
    """Lagrange polynomials of an element of length h, and their slopes, at so many Gauss points; the weights."""
    at, weight = legendre.leggauss(points)
    powers = np.linalg.inv(np.vander(np.linspace(-1.0, 1.0, degree + 1), increasing=True))
    shape = np.vander(at, degree + 1, increasing=True) @ powers
    steps = np.arange(1, degree + 1)[:, None] * powers[1:]
    slope = np.vander(at, degree, increasing=True) @ steps * (2 / h)
    return shape, slope, weight * h / 2
