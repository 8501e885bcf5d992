"""What was designed, in the form of another program: C, a functional mock-up unit, MATLAB, python-control.

`export` writes the files of a task; a module here makes those of each form.
"""

from tfarm.exported.result import export

__all__ = ["export"]
