"""Judges of one law."""

from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.synthesis import judge


def judge_of(arm, law, objective, chain=None, *, modes=2, count=8, continuous=False):
    """The judge of a law's signals with `modes` modes."""
    signals = Case(arm, law).law.signals
    return judge.judge_of(arm, arm, chain or Chain(), objective, signals, modes, count, continuous=continuous)
