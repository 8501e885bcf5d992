"""Controller design for the exact arm: best coefficients of a law, for its sampled or its continuous-time loop.

design      the best law of a structure, by requirements or by an objective
result      the record of a design: law, verdicts, width of the optimum, requirements
observer    the law of an observer with state feedback
structures  structures of laws: formula, coefficients with start and bounds, and law of each
judge       objectives, and scores of laws in a loop of few modes
models      loops of few modes under many laws at once
search      differential evolution from several starts, then a simplex
worst_case  designs for several arms, for the worst inside a box and of a pool
drawn       arms of an ensemble, of which a law is found on few and verified on fresh ones

requirements    limits of quantities of card and slew, by name
measures        margins, damping and speed of many laws at once, on a model
slew_measures   figures of the slew of a law, simulated
slew_models     slews of loops of few modes under many laws at once
goals           the least value of a quantity under requirements, and their exact values
required        the search for a law that meets requirements, and conflicts where none does
trade_off       the front of speed against robustness
limits          the margin that limits a loop, and the costs of sampling
good_region     gains K1 and K2 that meet requirements
near_map        a search for the best gains that begins there
stability_map   stability regions of the gains K1 and K2, and their map
"""
