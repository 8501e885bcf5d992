"""Does a self-tuning neural gain help?  A short training compared with the best constant gain and two input shapers."""

import tfarm
from tfarm.tuner import Plan

arm = tfarm.load("sasaki2012-lab")
found = tfarm.tune(arm, Plan(trials=20))  # the gain K(t) is kept where any K(t) is proven stable
cost = found.training.costs
gain, best = found.best_constant
print(f"cost of the first trial {cost[0]:.4g}, of the best of {len(cost)} {min(cost):.4g}")
print(f"best constant gain {gain:.4g}: {best:.4g}")
tfarm.plots.tuned_gain(found).figure.savefig("gain.png")
