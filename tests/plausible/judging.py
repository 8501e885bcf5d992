"""Checks of an answer: each an error beside a tolerance, both of one size."""

import math
from dataclasses import dataclass, field

BLIND = 1e-2  # relative: a model whose own error is larger says nothing


@dataclass
class Judged:
    """What the model says of one answer: the checks that failed, the worst error, and how many checks it could make."""

    wrong: list = field(default_factory=list)
    worst: float = 0.0
    checks: int = 0
    blind: int = 0

    def number(self, what, printed, model, tolerance, blind=BLIND):
        """A printed number beside the model's; all relative to the size that the caller divided by, or absolute."""
        self.error(what, abs(printed - model), tolerance, blind, f"{printed!r} for {model!r}")

    def error(self, what, error, tolerance, blind=BLIND, text=""):
        """An error, and the model's own."""
        if not math.isfinite(tolerance) or tolerance > blind:
            self.blind += 1
            return
        self.checks += 1
        if not error <= tolerance:
            self.wrong.append(f"{what}: off by {error:.2g}, tolerance {tolerance:.2g} {text}")
        self.worst = max(self.worst, float(error))

    def truth(self, what, holds):
        """Something that is so or not."""
        self.checks += 1
        if not holds:
            self.wrong.append(what)
