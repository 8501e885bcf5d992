"""The exact solution of the arm at one s, or at many: three ways, one truth.

`appendix` is the paper's own determinant in mpmath, `sweep` the solution of a chain of segments in float64, `balls` the
same with error bounds.  They share the arm's dimensionless numbers (`system`) and the algebra (`waves`, `compound`).
"""
