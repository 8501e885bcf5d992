"""Ensembles of uncertain arms: drawn by their numbers, declared by a file, with the confidence of what holds on them.

space        distributions, grids, lists and posteriors of the varied numbers
declaration  the file of a study
confidence   the share that is exceeded with 95 % confidence
"""
