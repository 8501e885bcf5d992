"""The exact solution of the arm at one s [1/s] or at many, by three methods that check each other.

system          the arm as a chain of dimensionless elements, in exact fractions
outputs         the outputs of the arm, each a power of s times a quantity at a place (`outputs.toml`)
layout          a chain cut and marked at the places of outputs, as rows of the kernels
waves           the waves of a uniform segment, and the algebra that all sweeps share
pieces          one segment at a block of points, in float64
sweep           the free response of a chain in float64, many s at a time
balls           the same sweeps in ball arithmetic, with error bounds
appendix        the paper's determinant and Cramer's rule in mpmath
values          outputs at any s: float64 where it has all digits, balls elsewhere; the three methods compared
series          expansions at s = 0, and the order of each zero there
characteristic  the characteristic function of arm and closed loop, in float64 and enclosed over balls
count           the count of natural frequencies below a frequency
loads           the response to forces and moments on the link
rigid           the response of a rig with rigid links
rationals       matrices and controller blocks over the rationals
compiled        numba with its cache on disk
"""
