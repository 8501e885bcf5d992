"""Controller design for the exact arm: best coefficients of a law, for its sampled or its continuous-time loop.

design      the best law of a structure by an objective, with its verdicts and the width of the optimum
structures  structures of laws: formula, coefficients with start and bounds, and law of each
judge       objectives, and scores of laws in a loop of few modes
models      loops of few modes under many laws at once, and slews in them
search      differential evolution from several starts, then a simplex
worst_case  designs for several arms and for the worst inside a box
"""
