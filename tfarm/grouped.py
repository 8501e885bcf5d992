"""Puts the process that workers are forked from in a process group of its own, which can be killed at once.

It is the first module that this process imports.  Ctrl-C in a terminal does not reach the group.
"""

import os

os.setpgid(0, 0)
