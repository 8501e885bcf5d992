"""Loaded last by the process that others are forked from: the collector leaves what is there alone from now on.

None of it is ever freed; the collector would look through it in each fork, copy its memory, and do so again at exit.
"""

import gc

gc.freeze()
