"""What was designed, in the form of another program: C, a functional mock-up unit, MATLAB, python-control, a live page.

`export` writes the files of a task.

`result`: the task of an export, and the record of its files.
`controller`: a sampled controller in C.
`kernel`: the steps of that controller, compiled, as its C code takes them.
`realisations`: realisations of a law, and that of the least round-off noise.
`word_length`: a law in the numbers of a target, and bounds on its errors.
`tuner_code`: a trained tuner in C.
`fmu`: functional mock-up units of plant, controller and loop.
`systems`: state spaces for MATLAB and python-control.
`live_loop`: the numbers of a loop for its live page.
`texts`: the user's words in the languages of targets.
"""

from tfarm.exported.result import export

__all__ = ["export"]
