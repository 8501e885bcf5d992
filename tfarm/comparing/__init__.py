"""Two arms, or two laws on one arm, compared."""

from tfarm.comparing.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "compare"]
