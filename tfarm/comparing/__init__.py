"""Two arms, or two laws on one arm, beside each other: modes, poles, verdicts, margins; differences in per cent."""

from tfarm.comparing.comparison import Comparison, Side, compare

__all__ = ["Comparison", "Side", "compare"]
