"""How many seeds beat what, with every guard: `python -m tests.tuner.seeds 20`."""

import math
import sys

import numpy as np

import tfarm
from tfarm.tuner import Plan, residual_rms, slew_trial
from tfarm.tuner.studies import plans_of, run_study


def main(seeds):
    """A line a guard: final costs, those below the best constant gain and below 0.90, worst residual ratio."""
    lab = tfarm.load("sasaki2012-lab")
    trial = slew_trial(lab)
    without = residual_rms(trial.with_constant(0.0), trial.task)
    print(f"no moment feedback: {trial.with_constant(0.0).cost:.4f}; residual {without:.4f} N m")
    for guard in ("time-varying", "frozen", "none"):
        results = run_study(lab, plans_of("curves", Plan(guard=guard), seeds))
        costs, best = np.array([each.cost for each in results]), results[0].best_constant_cost
        worst = max(math.inf if each.residual is None else each.residual for each in results) / without
        print(
            f"{guard:13s} median {np.median(costs):.4f}  {costs.min():.4f} to {costs.max():.4f}  "
            f"{(costs < best).sum()} of {seeds} below {best:.4f}, {(costs <= 0.9).sum()} at 0.90 or less, "
            f"worst residual {worst:.3f} of that without"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
