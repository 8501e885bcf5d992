"""The exact solution of the arm at one s, or at many, by three methods.

`appendix` is the paper's determinant in mpmath, `sweep` the solution of a chain of segments in float64, `balls` the
same with error bounds.  The last two share the dimensionless numbers (`system`) and the algebra (`waves`).
"""
