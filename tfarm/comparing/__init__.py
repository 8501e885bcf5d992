"""Two arms, or two laws on one arm, beside each other, in per cent; one loop beside itself when it is sampled."""

from tfarm.comparing.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "compare"]
