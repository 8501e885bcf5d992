"""The export of a controller, a tuner, the plant or the closed loop to another program."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import get_args

from tfarm.arm import AnyLaw, Arm, arm_and_law, must_be_arm
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual
from tfarm.errors import ParameterError, must_be_known, require
from tfarm.exported.result import Export, ExportTask, Form, Precision, What, write_into

WRITERS = {  # module and function of `tfarm.exported` that make an `Export` of a task
    ("controller", "c"): "controller:c_controller",
    ("tuner", "c"): "tuner_code:c_tuner",
    ("plant", "fmu"): "fmu:fmu",
    ("controller", "fmu"): "fmu:fmu",
    ("loop", "fmu"): "fmu:fmu",
    ("plant", "mat"): "matlab:mat",
    ("controller", "mat"): "matlab:mat",
    ("loop", "mat"): "matlab:mat",
    ("plant", "py"): "script:py",
    ("controller", "py"): "script:py",
    ("loop", "py"): "script:py",
}


def export(
    arm: Arm,
    law: AnyLaw | None = None,
    *,
    what: What,
    form: Form,
    folder: str | Path,
    chain: Chain | None = None,
    tuned: str | Path | None = None,
    precision: Precision = "double",
    ranges: Mapping[str, float] | None = None,
    name: str = "",
    anyway: bool = False,
    outputs: Sequence[str] = (),
    modes: int | None = None,
) -> Export:
    """Write a controller, a tuner, the plant or the closed loop as files for another program.

    Parameters
    ----------
    arm, law
        The arm and its controller, by default the default gains.
    what
        "controller", "tuner", "plant" or "loop".
    form
        "c" (C99), "fmu" (FMI co-simulation), "mat" (MATLAB, Octave) or "py" (python-control).
    folder
        Folder of the files.
    chain
        Sampling, converters and delay, every 10 ms and ideal by default.
    tuned
        File of a trained tuner.
    precision
        Arithmetic of a controller in C: "double", "float" or "q31" (fixed point).
    ranges
        Largest absolute value of each input in fixed point, in SI units.
    name
        Beginning of the identifiers of a file in C.
    anyway
        Export a loop that is not certified stable.
    outputs, modes
        Of a functional mock-up unit with a plant: outputs beyond those of a simulation, as "strain@0.05", and the
        number of flexible modes, by default that of the simulation of a slew.

    Returns
    -------
    Export
        Names of the files, identifiers, and the stability of the loop with the numbers as exported.

    Raises
    ------
    ParameterError
        For a loop that is not certified stable (unless `anyway`), and where the target does not have what it needs.
    """
    must_be_arm(arm)
    for key, value, known in (("what", what, What), ("as", form, Form), ("precision", precision, Precision)):
        must_be_known(key, value, get_args(known))
    if (what, form) not in WRITERS:
        forms = ", ".join(each for of, each in WRITERS if of == what)
        raise ParameterError(key="as", value=form, remedy=f"a {what} is exported as: {forms}")
    is_simulated = form == "fmu" and what != "controller"
    remedy = "only a plant or a loop as fmu has outputs and modes of its own; leave them out"
    require(is_simulated or not (outputs or modes), "outputs" if outputs else "modes", outputs or modes, remedy)
    task = ExportTask(
        arm=arm if law is None else arm_and_law(arm, law)[0], given=law, chain=chain_or_usual(chain),
        what=what, form=form, tuned=None if tuned is None else Path(tuned), precision=precision,
        ranges=dict(ranges or {}), name=name, anyway=anyway, outputs=tuple(outputs), modes=modes,
    )  # fmt: skip
    module, _, function = WRITERS[what, form].partition(":")
    found: Export = getattr(import_module(f"tfarm.exported.{module}"), function)(task)
    write_into(Path(folder), found.contents)
    return found
