"""The task of an export, the facts that its files begin with, and the record of the files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, field, replace
from functools import cached_property
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import file_text
from tfarm.arrays import Real
from tfarm.assessment.card import loop_card
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.stages import admit
from tfarm.errors import ConvergenceError, must_be_known, require
from tfarm.exported.texts import facts_of
from tfarm.files import move_into, place_in
from tfarm.loop.sampled_analysis import Analysis, sampled
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import default_gains

What = Literal["controller", "tuner", "plant", "loop"]
Form = Literal["c", "fmu", "mat", "py"]
Precision = Literal["double", "float", "q31"]
ANYWAY = "NOT CERTIFIED STABLE; exported by --anyway"


class Name(NamedTuple):
    """A name of the user, and the identifier that it has in the files."""

    name: Annotated[str, Quantity("name", help="signal, reference or name of the user")]
    identifier: Annotated[str, Quantity("identifier", help="its identifier in the exported files")]


@frozen(kw_only=True)
class ExportTask:
    """What to export, and how: an arm, a controller, by default the default gains, and the chain of its sampled loop.

    `ranges` are the largest absolute values of signals, feedforward and output by name, in SI units.  `tuned` is the
    file of a trained tuner.  `anyway`: also a loop that is not certified stable.
    """

    case: Case
    what: What
    form: Form
    tuned: Path | None = None
    precision: Precision = "double"
    ranges: Mapping[str, float] = field(default_factory=dict)
    name: str = ""
    anyway: bool = False
    is_default: bool = False

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of arm, chain, law (none of default gains) and tuner."""
        law = None if self.is_default else asdict(self.case.law)
        # so that laws without have the sum that they always had
        if law is not None and not law["anti_windup"]:
            del law["anti_windup"]
        tuned = "" if self.tuned is None else self.tuned.read_text(encoding="utf-8")
        inputs = [file_text(self.case.arm, self.case.chain), law, tuned]
        text = json.dumps(inputs, sort_keys=True, default=lambda a: a.tolist())
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def impulses(self) -> Real:
        """The impulses of the shaper, for the law as given, as `simulate` has them."""
        return impulses_of(self.case.arm, self.case.chain, self.case.law)

    def analysis(self, case: Case) -> Analysis:
        """Return the sampled loop of a case, mostly that of the task with its numbers as rounded in the files.

        Code in C has a realisation of its own, whose rounded numbers are judged once it is chosen: here the law is in
        float64.  Raises ParameterError for a loop that is not certified stable, unless `anyway`.
        """
        if self.form == "c":
            converters = replace(case.chain.converters, arithmetic="float64")
            case = case.through(replace(case.chain, converters=converters))
        return self.judge(case, "law", self.case.law.name, "the sampled loop", "--anyway exports it")

    def judge(self, case: Case, key: str, value: str, loop: str, remedy: str) -> Analysis:
        """Return the sampled loop of a case.

        Raises ParameterError where it is not certified stable, unless `anyway`.
        """
        found = sampled(case.arm, case.law, case.chain)
        words = f"{loop} is not certified stable: {found.verdict.sentence}; {remedy}"
        require(self.anyway or is_certified(found), key, value, words)
        return found

    def export_of(
        self, contents: Mapping[str, bytes], names: list[Name], verdict: str, details: object = None
    ) -> Export:
        """Return the record of the files of this task."""
        own = {"what": self.what, "form": self.form, "sha256": self.sha256}
        return Export(contents=contents, names=names, verdict=verdict, details=details, **own)

    def facts(self, case: Case, found: Analysis) -> dict[str, str]:
        """Return the facts that a file begins with, by label: arm, law, stability and margins of the loop, version."""
        sampling = self.case.chain.sampling
        reference = self.case.chain.reference
        shaper = {}
        if reference.shaper != "none":
            end = (self.impulses.size - 1) * sampling.period
            shaper = {
                "shaper": f"{reference.shaper}, modes: {reference.modes}, last impulse after {end:.6g} s"
            }
        shown = {}
        with suppress(ConvergenceError):
            shown = dict(facts_of(loop_card("sampled", case, found)))
        return {
            "arm": self.case.arm.name,
            "controller": self.case.law.name,
            **({} if is_certified(found) else {"warning": ANYWAY}),
            "sampling period [s]": repr(sampling.period),
            "delay beyond this code [samples]": repr(sampling.delay_samples),
            **shaper,
            **shown,
            "SHA-256 of the inputs": self.sha256,
            "tfarm": version("tfarm"),
        }


def is_certified(found: Analysis) -> bool:
    """Return whether a sampled loop is certified stable."""
    return found.verdict.is_settled and found.verdict.is_stable


@frozen(kw_only=True)
class Export:
    """Exported files, with the verdict on the loop as its numbers are rounded there.

    `contents` are the bytes of each file by its name; `details` is the record of a target.
    """

    what: Annotated[str, Quantity("exported", help="controller, tuner, plant or loop")]
    form: Annotated[str, Quantity("form", help="c, fmu, mat or py")]
    contents: Mapping[str, bytes] = field(repr=False)
    names: Annotated[list[Name], Quantity("names", help="identifiers of names in the exported files")]
    verdict: Annotated[
        str, Quantity("stability", help="stability of the loop as exported, with its certainty")
    ]
    details: Annotated[Any, Quantity(flat=True, help="numbers of the form of the export")]
    sha256: Annotated[str, Quantity("SHA-256 of the inputs", help="hash of arm, chain, law and tuner")]

    @property
    def files(self) -> Annotated[tuple[str, ...], Quantity("files", help="names of the written files")]:
        """The names of the files."""
        return tuple(self.contents)


def names_of(*mappings: Mapping[str, str]) -> list[Name]:
    """Return the names of `identifiers` as rows."""
    return [Name(*pair) for mapping in mappings for pair in mapping.items()]


def write_into(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write all files into a folder, none of them before all are complete.

    Raises ParameterError where the folder cannot be written to.
    """
    with place_in(folder, "--out") as place:
        for name, content in contents.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(content)
        move_into(place, folder)


WRITERS = {  # module and function of `tfarm.exported` that make an `Export` of a task
    ("controller", "c"): "controller:c_controller",
    ("tuner", "c"): "tuner_code:c_tuner",
    **{
        (what, form): function
        for form, function in {"fmu": "fmu:fmu", "mat": "systems:mat", "py": "systems:py"}.items()
        for what in ("plant", "controller", "loop")
    },
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
        Largest absolute value of each input, of the feedforward and of the output, in SI units.
    name
        Beginning of the identifiers of a file in C.
    anyway
        Export a loop that is not certified stable.

    Returns
    -------
    Export
        Names of the files, identifiers, and the stability of the loop with the numbers as exported.

    Raises
    ------
    ParameterError
        For a loop that is not certified stable (unless `anyway`), and where the target does not have what it needs.
    """
    case = Case(arm, default_gains(arm) if law is None else law, chain)
    for key, value, known in (("what", what, What), ("as", form, Form), ("precision", precision, Precision)):
        must_be_known(key, value, get_args(known))
    forms = ", ".join(each for of, each in WRITERS if of == what)
    require((what, form) in WRITERS, "as", form, f"a {what} is exported as: {forms}")
    module, _, function = WRITERS[what, form].partition(":")
    writer = import_module(f"tfarm.exported.{module}")
    admit(writer.CONSUMER, case.arm, case.chain)
    remedy = f"the code is in {precision}: take precision float, or leave this key out"
    is_other = form == "c" and case.chain.converters.is_single and precision != "float"
    require(not is_other, "converters.arithmetic", "float32", remedy)
    task = ExportTask(
        case=case,
        what=what,
        form=form,
        tuned=None if tuned is None else Path(tuned),
        precision=precision,
        ranges=dict(ranges or {}),
        name=name,
        anyway=anyway,
        is_default=law is None,
    )
    found: Export = getattr(writer, function)(task)
    write_into(Path(folder), found.contents)
    return found
