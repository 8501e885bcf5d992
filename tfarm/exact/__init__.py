"""The exact solution of the arm at one s, or at many: three ways, one truth.

`appendix` is the paper's own determinant in mpmath, `waves` the closed form in float64, `balls` the same solution with
error bounds.  They share the arm's dimensionless numbers (`coefficients`) and the algebra (`closed_form`).
"""
