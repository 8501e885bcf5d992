"""Two arms, or two laws on one arm, beside each other: modes, poles, verdicts, margins; differences in per cent."""

from tfarm.comparing.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "compare"]
