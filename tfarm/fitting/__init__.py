"""Measured data against the exact arm: what was measured, and the numbers of the arm that explain it.

`data`: a measured frequency response, its noise, and its files.
`recording`: records over time, runs under a controller, and the frequency response of a record.
`resonances`: poles fitted to the peaks of a response.
`decays`: frequencies and damping ratios of a decay.
`ratio`: the exact response of one signal over another.
`runs`: records of a rig in motion, in open or closed loop.
`run_model`: a run as the exact sampled plant has it, and what it leaves.
`prediction`: a run that no fit has used, predicted, with null models.
`null_models`: an arm as a run is predicted with, and models that have to be worse.
`residual_causes`: what a prediction leaves, and the single changes that would remove it.
`overlay`: a measured response compared with the exact one, mode by mode.
`model`: free numbers of an arm, and the residuals that they leave.
`run_numbers`: free numbers of the chain of runs.
`whiteness`: whether what a model leaves of a record is noise.
`solve`: the search for the least sum of squares.
`intervals`: intervals of the numbers, and the directions that the data leave open.
`fit`: the fitted arm, and arms drawn from its posterior.
`result_rows`: rows of a fit, of its responses and of its runs.
`together`: one fit of several arms with numbers that they share.
`assumptions`: what the file of a fitted arm has on its numbers.
`misses`: responses that the fitted curve misses, and the changes that would help.
`posterior`: the distribution of the fitted numbers, and their scatter between records.
"""
