"""What joins the continuous-time and the sampled loop of an arm and a controller; two such cases compared."""

from tfarm.case.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "compare"]
