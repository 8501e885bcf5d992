"""Studies of uncertain arms: many arms and loops, each by the exact solution, on one machine or a cluster.

space        distributions, grids, lists and posteriors of the varied numbers
quantities   columns that a study asks of each arm, and their values
running      parts of a study, computed by processes or a cluster, and completed by a later run
findings     stable shares, distributions with their drivers, failures, bands of responses
sobol        Sobol' indices of the quantities
worst        the worst arm of those drawn, and of a search from there
declaration  the file of a study
study        the study and its record
candidates   sections and hubs that the paper leaves open; learning curves of the tuner
"""
