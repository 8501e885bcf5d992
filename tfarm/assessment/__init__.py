"""What joins the continuous-time and the sampled loop of an arm and a controller: its card, and two cases compared."""

from tfarm.assessment.card import LoopCard, ResultCard, loop_function, result_card
from tfarm.assessment.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "LoopCard", "ResultCard", "compare", "loop_function", "result_card"]
