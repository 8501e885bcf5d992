"""Controllers chosen for the exact arm: the best coefficients of a law, for its sampled loop or the continuous one."""
