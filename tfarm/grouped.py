"""Loaded first by the process that others are forked from: these are a group of their own, which can be ended at once.

A terminal's Ctrl-C does not reach them.
"""

import os

os.setpgid(0, 0)
