"""Judgement of an arm and its controller, continuous-time and sampled: card, responses, comparison and stability map.

card            result card: stability, damping, margins and their grades; loop function of a loop
signal_figures  figures of signals over time: peak, settling time, overshoot and others
step            time responses of both loops with these figures
comparison      two arms or two controllers
arm_check       an arm's file: derived numbers, warnings, tables left out
"""

from tfarm.assessment.card import LoopCard, ResultCard, loop_function, result_card
from tfarm.assessment.comparison import ComparedSide, Comparison, compare

__all__ = ["ComparedSide", "Comparison", "LoopCard", "ResultCard", "compare", "loop_function", "result_card"]
