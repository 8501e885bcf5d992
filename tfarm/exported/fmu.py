"""Functional mock-up units (FMI 2.0, co-simulation) of plant, controller and closed loop: C, and its binary.

The plant is that of the simulation: exact between the samples, the torque through DAC, delay and hold, the sensors
through filters and converters.  At a communication point its outputs are those just before the sample, which uses the
inputs that the next step begins with.  A unit needs neither Python nor the mathematical library.
"""

import hashlib
import io
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple
from xml.etree import ElementTree as XML

import numpy as np

from tfarm.arm import tracked
from tfarm.arm.law import REFERENCE
from tfarm.arrays import Complex, Real
from tfarm.dsp import Simulator, scenario
from tfarm.dsp.plant import MODES_USED, RECORDED
from tfarm.dsp.results import simulated
from tfarm.dsp.scenarios import TRIAL_DURATION
from tfarm.dsp.simulate import first_mode
from tfarm.errors import ParameterError, one_line
from tfarm.exact.outputs import signal_words
from tfarm.exported.result import Export, ExportTask, What
from tfarm.exported.texts import identifiers, render
from tfarm.files import temporary_folder
from tfarm.records import record
from tfarm.schema import Quantity

COMPILERS = ("cc", "gcc", "clang")
OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")  # no fused operation: the simulation's digits
LONGEST_COMPILATION = 60.0  # s
PLATFORMS = {"linux": ("linux64", ".so"), "darwin": ("darwin64", ".dylib"), "win32": ("win64", ".dll")}
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # of every file: same inputs, same bytes
LARGEST = sys.float_info.max  # of a range without limit
LONGEST_NAME = 200  # characters of a text
MEASURED, TIP_OFFSET = "measured:", "tip_offset"
AT, STATE, SELF = ("const fmi2ValueReference *", "size_t"), "fmi2FMUstate", "((model *)c)"
ABSENT = "report(c, fmi2Error, __func__)"
FUNCTIONS: tuple[tuple[str, tuple[str, ...], str], ...] = (  # of FMI in one statement: name, types of arguments, status
    ("SetDebugLogging", ("fmi2Boolean", "size_t", "const fmi2String *"), "fmi2OK"),
    ("SetupExperiment", ("fmi2Boolean", "fmi2Real", "fmi2Real", "fmi2Boolean", "fmi2Real"), "begin(c, a3)"),
    ("EnterInitializationMode", (), "fmi2OK"),
    ("ExitInitializationMode", (), f"{SELF}->at.is_running = 1, fmi2OK"),
    ("Terminate", (), "fmi2OK"),
    ("Reset", (), f"memset({SELF}->given, 0, sizeof {SELF}->given), begin(c, 0.0)"),
    *(
        (f"{act}{kind}", (*AT, f"{const}fmi2{kind} *"), f"a2 ? {ABSENT} : fmi2OK")
        for kind in ("Integer", "Boolean", "String")
        for act, const in (("Get", ""), ("Set", "const "))
    ),
    *((f"{act}FMUstate", (f"{STATE}{star}",), ABSENT) for act, star in (("Get", " *"), ("Set", ""), ("Free", " *"))),
    ("SerializedFMUstateSize", (STATE, "size_t *"), ABSENT),
    ("SerializeFMUstate", (STATE, "fmi2Byte *", "size_t"), ABSENT),
    ("DeSerializeFMUstate", ("const fmi2Byte *", "size_t", f"{STATE} *"), ABSENT),
    ("GetDirectionalDerivative", (*AT, *AT, "const fmi2Real *", "fmi2Real *"), ABSENT),
    ("SetRealInputDerivatives", (*AT, "const fmi2Integer *", "const fmi2Real *"), ABSENT),
    ("GetRealOutputDerivatives", (*AT, "const fmi2Integer *", "fmi2Real *"), ABSENT),
    ("CancelStep", (), ABSENT),
    *(
        (f"Get{kind}Status", ("fmi2StatusKind", f"fmi2{kind or 'Status'} *"), "fmi2Discard")
        for kind in ("", "Integer", "String")
    ),
    *(
        (f"Get{kind}Status", ("fmi2StatusKind", f"fmi2{kind} *"), f"*a2 = {SELF}->at.{of}, a1 == {wanted} ? fmi2OK : fmi2Discard")
        for kind, of, wanted in (("Real", "time", "fmi2LastSuccessfulTime"), ("Boolean", "is_stopped", "fmi2Terminated"))
    ),
)


class Variable(NamedTuple):
    """A real variable of a unit."""

    name: Annotated[str, Quantity("variable", help="name of a variable of the functional mock-up unit")]
    causality: Annotated[str, Quantity("causality", help="input, parameter or output")]
    unit: Annotated[str, Quantity("unit", help="SI unit")]
    description: Annotated[str, Quantity("description", help="meaning of the variable")]


@dataclass(frozen=True)
@record
class Unit:
    """A functional mock-up unit: its variables in the order of their references, flexible modes, and binary."""

    variables: Annotated[list[Variable], Quantity("variables", help="variables of the functional mock-up unit")]
    modes: Annotated[int | None, MODES_USED]
    binary: Annotated[str, Quantity("binary", help="platform and compiler of the binary, or the reason for none")]


class LawCode(NamedTuple):
    """Lines of C that have and run a controller, and its files; empty without one."""

    include: str = ""
    state: str = ""
    init: str = ""
    step: str = ""
    files: Mapping[str, bytes] = MappingProxyType({})


def fmu(task: ExportTask) -> Export:
    """Return the functional mock-up unit of a task, one file.

    Raises ParameterError for a loop that is not certified stable, and as `Simulator` does.
    """
    prepared, has_plant = prepared_simulator(task), task.what != "controller"
    variables = variables_of(task.what, prepared)
    count, modes = Counter(each.causality for each in variables), prepared.plant.count if has_plant else None
    law = LawCode()
    facts = {"arm": task.arm.name, "sampling period": f"{task.chain.sampling.period!r} s", "tfarm": version("tfarm")}
    guid = hashlib.sha256(repr((task.sha256, variables, modes, facts)).encode()).hexdigest()[:32]
    source = render(
        "fmu.c", what=f"{task.what} of an arm", facts=facts, law=law, plant=has_plant, guid=guid, functions=FUNCTIONS,
        period=repr(float(task.chain.sampling.period)), inputs=count["input"], parameters=count["parameter"],
        outputs=count["output"], **plant_code(prepared),
    )  # fmt: skip
    sources = {"fmi2.h": render("fmi2.h"), "fmu.c": source, **law.files}
    identifier = identifiers([task.name or task.what], "fmu_")[task.name or task.what]
    binary, words = compiled(sources, identifier)
    files = {f"sources/{name}": content for name, content in sources.items()} | binary
    files["modelDescription.xml"] = model_description(task, variables, guid, identifier, [*sources])
    return Export(
        what=task.what, form=task.form, contents={f"{task.what}.fmu": zipped(files)}, names=[],
        details=Unit(variables, modes, words), sha256=task.sha256,
    )  # fmt: skip


def prepared_simulator(task: ExportTask) -> Simulator:
    """The simulator of the loop, with the modes that the simulation of a slew has; of a step where there is no slew."""
    arm, law = tracked(task.arm, task.law)
    try:
        run = scenario("slew", arm, task.chain, TRIAL_DURATION)
    except ParameterError:  # an arm that cannot turn
        run = scenario("step", arm, task.chain, TRIAL_DURATION)
    return Simulator(arm, task.chain, run, law, count=simulated(arm, law, task.chain, run)[1].modes)


def variables_of(what: What, of: Simulator) -> list[Variable]:
    """The variables of a unit: inputs, parameters, outputs."""
    drive, law = of.plant.arm.input, of.law

    def variable(name: str, causality: str, prefix: str = "", words: str = "") -> Variable:
        label, unit = signal_words(name)
        return Variable(f"{prefix}{name}", causality, unit, f"{words}{label}")

    unit, side = signal_words(drive)[1], "input" if what == "controller" else "output"
    names = law.signals if what == "controller" else of.measured
    sensors = [variable(name, side, MEASURED, "reading of the ") for name in names]
    wanted = dict.fromkeys((*law.references, *(name.removeprefix(REFERENCE) for name in law.wanted)))
    references = [variable(name, "input", REFERENCE, "reference of the ") for name in wanted]
    references.append(Variable("feedforward", "input", unit, "part of the output of the controller"))
    if what == "controller":
        return [*sensors, *references, variable(drive, "output")]
    return [
        *([variable(drive, "input")] if what == "plant" else references),
        Variable("disturbance", "input", unit, "added to the output of the DAC, without delay"),
        Variable("impulse", "parameter", f"{unit} s", "on the hub, just after the first sample"),
        Variable(TIP_OFFSET, "parameter", "m", "tip displacement at the start, of the first mode at rest"),
        *sensors,
        *(variable(name, "output") for name in (*RECORDED, *of.others)),
        Variable("torque", "output", unit, "output of the DAC at the last sample"),
    ]


def plant_code(of: Simulator) -> dict[str, Any]:
    """The numbers of the plant in its template."""
    chain, model, p = of.electronics, of.model, of.plant.poles
    released = np.zeros(p.size, complex)
    with suppress(ParameterError):  # a pinned tip, or an overdamped first mode: there is no free decay
        place, amplitude = first_mode(of.plant, 1.0)
        released[place] = amplitude
    tables = {
        "turn[PIECES][POLES][2]": parts(model.turn),
        "push[PIECES][POLES][2]": parts(model.push),
        "piece[PIECES][2]": model.piece[:, :2],
        "weights[OUTPUTS - 1][POLES][2]": parts(model.weights),
        "rates[OUTPUTS - 1][2]": model.rates,
        "through[OUTPUTS - 1]": model.static,
        "converters[3][3]": np.clip(chain.quantisers, -LARGEST, LARGEST),
        "released[POLES][2]": parts(released[of.kept]),
    }
    return {
        "tables": {name: braces(values) for name, values in tables.items()},
        "poles": of.kept.size, "pieces": len(model.piece), "ring": chain.delay + 2, "bound": repr(chain.bound),
        "lag": repr(chain.pole), "is_differenced": chain.is_differenced,
    }  # fmt: skip


def parts(values: Complex) -> Real:
    """Real and imaginary parts, in a further axis."""
    return np.stack([values.real, values.imag], axis=-1)


def braces(values: Any) -> str:
    """An array of C, every number with all of its digits."""
    return f"{{{', '.join(map(braces, values))}}}" if np.ndim(values) else repr(float(values))


# ------------------------------------------------------------ the file


def model_description(
    task: ExportTask, variables: Sequence[Variable], guid: str, identifier: str, sources: Iterable[str]
) -> bytes:
    """The file modelDescription.xml: outputs of a plant are known at the start, that of a controller is 0 there."""
    has_plant, period = task.what != "controller", repr(float(task.chain.sampling.period))
    place = {each.name: str(n) for n, each in enumerate(variables, 1)}
    outputs = [each.name for each in variables if each.causality == "output"]
    kinds = {
        "input": ({"variability": "discrete"}, {"start": "0"}),
        "parameter": ({"variability": "fixed"}, {"start": "0"}),
        "output": ({"variability": "discrete", "initial": "calculated"}, {}) if has_plant else
                  ({"variability": "discrete", "initial": "exact"}, {"start": "0"}),
    }  # fmt: skip
    slave = element(
        "CoSimulation",
        element("SourceFiles", *(element("File", name=name) for name in sources if name.endswith(".c"))),
        modelIdentifier=identifier, canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
    )  # fmt: skip
    listed = [
        element(
            "ScalarVariable", element("Real", unit=each.unit, **kinds[each.causality][1]), name=each.name,
            valueReference=str(n), description=each.description, causality=each.causality, **kinds[each.causality][0],
        )
        for n, each in enumerate(variables)
    ]  # fmt: skip
    structure = [element("Outputs", *(element("Unknown", index=place[name], dependencies="") for name in outputs))]
    if has_plant:
        known = {"dependencies": place[TIP_OFFSET]}
        structure.append(
            element("InitialUnknowns", *(element("Unknown", index=place[name], **known) for name in outputs))
        )
    root = element(
        "fmiModelDescription", slave,
        element("UnitDefinitions", *(element("Unit", name=unit) for unit in sorted({of.unit for of in variables}))),
        element("LogCategories", element("Category", name="logStatusError")),
        element("DefaultExperiment", startTime="0", stopTime=repr(TRIAL_DURATION), stepSize=period),
        element("ModelVariables", *listed), element("ModelStructure", *structure),
        fmiVersion="2.0", modelName=one_line(f"{task.arm.name}: {task.what}", LONGEST_NAME), guid=guid,
        generationTool=f"tfarm {version('tfarm')}", variableNamingConvention="flat", numberOfEventIndicators="0",
    )  # fmt: skip
    XML.indent(root)
    return XML.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def element(tag: str, *children: XML.Element, **attributes: str) -> XML.Element:
    """An element of XML with its children."""
    made = XML.Element(tag, attributes)
    made.extend(children)
    return made


def compiled(sources: Mapping[str, bytes], identifier: str) -> tuple[dict[str, bytes], str]:
    """The binary for this machine by its path in a unit, none without a compiler; and platform and compiler."""
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None or sys.platform not in PLATFORMS:
        return {}, f"none: no compiler found ({', '.join(COMPILERS)})"
    platform, suffix = PLATFORMS[sys.platform]
    with temporary_folder(Path(tempfile.gettempdir())) as folder:
        for name, content in sources.items():
            (folder / name).write_bytes(content)
        command = [compiler, *OPTIONS, "-o", f"unit{suffix}", *(name for name in sources if name.endswith(".c"))]
        try:
            subprocess.run(
                command, cwd=folder, check=True, timeout=LONGEST_COMPILATION, capture_output=True,
                stdin=subprocess.DEVNULL,
            )  # fmt: skip
            binary = (folder / f"unit{suffix}").read_bytes()
        except (OSError, subprocess.SubprocessError) as error:
            return {}, f"none: {one_line(f'{compiler}: {error}', LONGEST_NAME)}"
    return {f"binaries/{platform}/{identifier}{suffix}": binary}, f"{platform}, by {Path(compiler).name}"


def zipped(files: Mapping[str, bytes]) -> bytes:
    """An archive of files, the same for the same content."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name, ZIP_DATE), files[name], zipfile.ZIP_DEFLATED)
    return content.getvalue()
