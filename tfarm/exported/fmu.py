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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, NamedTuple
from xml.etree.ElementTree import Element, indent, tostring

import numpy as np

from tfarm.arm import Law
from tfarm.arm.law import REFERENCE
from tfarm.arm.stages import Consumer
from tfarm.arrays import Complex, Real
from tfarm.dsp import Simulator, scenario
from tfarm.dsp.plant import MODES_USED, RECORDED
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import TRIAL_DURATION, slew_scenario
from tfarm.errors import ParameterError, one_line, require
from tfarm.exact.outputs import signal_words
from tfarm.exported.controller import controller_of, in_z, source_files
from tfarm.exported.result import ANYWAY, Export, ExportTask, What, is_certified, names_of
from tfarm.exported.texts import identifiers, literal, render_source
from tfarm.exported.word_length import FEEDFORWARD, FIXED
from tfarm.files import temporary_folder
from tfarm.records import frozen
from tfarm.schema import Quantity

CONSUMER = Consumer(
    "export fmu",
    acts=(
        "anti-alias filter",
        "encoder",
        "hub rate",
        "shaper",
        "amplifier steps",
        "amplifier range",
        "law",
        "arithmetic",
        "DAC steps",
        "DAC range",
        "torque limit",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    none=("reference", "volts"),
)

MEASURED = "measured:"


class Variable(NamedTuple):
    """A real variable of a unit."""

    name: Annotated[str, Quantity("variable", help="name of a variable of the functional mock-up unit")]
    causality: Annotated[str, Quantity("causality", help="input, parameter or output")]
    unit: Annotated[str, Quantity("unit", help="SI unit")]
    description: Annotated[str, Quantity("description", help="meaning of the variable")]


@frozen
class Unit:
    """A functional mock-up unit: its variables in the order of their references, flexible modes, and binary."""

    variables: Annotated[
        list[Variable], Quantity("variables", help="variables of the functional mock-up unit")
    ]
    modes: Annotated[int | None, MODES_USED]
    binary: Annotated[
        str, Quantity("binary", help="platform and compiler of the binary, or the reason for none")
    ]


class LawCode(NamedTuple):
    """The controller of a unit: its identifier and inputs in C, its files, and the stability of its loop."""

    identifier: str
    inputs: Sequence[str]
    files: Mapping[str, bytes]
    verdict: str


def fmu(task: ExportTask) -> Export:
    """Return the functional mock-up unit of a task, one file.

    Raises ParameterError for a loop that is not certified stable, a controller in fixed point, and as `Simulator` does.
    """
    prepared = prepared_simulator(task)
    has_plant = task.what != "controller"
    name = task.name or task.what
    variables = variables_of(task.what, prepared)
    own = identifiers([name], "fmu_")
    law = None if task.what == "plant" else law_code(task, prepared.law, variables)
    verdict = law.verdict if law else ""
    period = repr(float(task.case.chain.sampling.period))
    about = f"{task.what} of {task.case.arm.name}, sampled every {period} s{verdict and f': {verdict}'}"
    modes = prepared.plant.count if has_plant else None
    guid = hashlib.sha256(
        repr((task.sha256, name, about, modes, variables, version("tfarm"))).encode()
    ).hexdigest()
    head: dict[str, Any] = {"variables": variables, "has_plant": has_plant, "period": period, "about": about}
    head["guid"] = guid[:32]
    plant = plant_code(prepared)
    source = render_source("fmu.c", law=law, sha256=task.sha256, **head, **plant)
    sources = {"fmi2.h": render_source("fmi2.h"), "fmu.c": source, **(law.files if law else {})}
    binary, compiler = binary_of(sources, own[name])
    files = {f"sources/{name}": content for name, content in sources.items()} | binary
    files["modelDescription.xml"] = model_description(sources, own[name], **head)
    content = {f"{task.what}.fmu": archive_of(files)}
    return task.export_of(content, names_of(own), verdict, Unit(variables, modes, compiler))


def law_code(task: ExportTask, law: Law, variables: Sequence[Variable]) -> LawCode:
    """Return the controller as simulated: its law as given.

    Its readings and its output are those of the converters of a plant, and in a closed loop its delay too.
    """
    remedy = "a functional mock-up unit has a controller in double or float; take c for fixed point"
    require(task.precision != FIXED, "precision", task.precision, remedy)
    task = replace(task, precision="float" if task.case.chain.converters.is_single else task.precision)
    own = task.case.under(replace(law, delay=0.0) if task.what == "loop" else law)
    controller = controller_of(in_z(own), task)
    controller = replace(controller, hub=None, signals=law.signals, dac=np.array([0.0, -np.inf, np.inf]))
    case = task.case.under(replace(controller.word.rounded_law, delay=task.case.law.delay))
    found = task.analysis(case)
    files, (first, *_) = source_files(task, controller, [*task.facts(case, found).items()])
    place: dict[str, str] = {}
    for of, array in (("output", "out"), ("input", "in")):
        names = [each.name for each in variables if each.causality == of]
        place |= {name: f"{array}[{n}]" for n, name in enumerate(names)}
    fields = [MEASURED + each for each in controller.signals]
    fields += [*(REFERENCE + each for each in controller.references), FEEDFORWARD]
    verdict = found.verdict.sentence if is_certified(found) else f"{ANYWAY}: {found.verdict.sentence}"
    code = {each: files[each] for each in ("controller.h", "controller.c")}
    return LawCode(first.identifier, [place[each] for each in fields], code, verdict)


def prepared_simulator(task: ExportTask) -> Simulator:
    """Return the simulator of the loop, with the modes that the simulation of a slew has.

    Of a step where there is no slew.

    A plant alone has no delay of the law.
    """
    case = task.case.under(replace(task.case.law, delay=0.0)) if task.what == "plant" else task.case
    try:
        run = slew_scenario(case.arm, case.chain, TRIAL_DURATION)
    except ParameterError:
        # an arm that cannot turn
        run = scenario("step", case.arm, case.chain, TRIAL_DURATION)
    modes = 1 if task.what == "controller" else simulate_modes(case, run)[1].modes
    return Simulator(case, run, count=modes)


def variables_of(what: What, of: Simulator) -> list[Variable]:
    """Return the variables of a unit: inputs, parameters, outputs."""
    drive = of.plant.arm.input
    law = of.law

    def variable(name: str, causality: str, prefix: str = "", words: str = "") -> Variable:
        label, unit = signal_words(name)
        return Variable(prefix + name, causality, unit, words + label)

    unit = signal_words(drive)[1]
    side = "input" if what == "controller" else "output"
    names = law.signals if what == "controller" else of.measured
    sensors = [variable(name, side, MEASURED, "reading of the ") for name in names]
    wanted = dict.fromkeys((*law.references, *(name.removeprefix(REFERENCE) for name in law.wanted)))
    references = [variable(name, "input", REFERENCE, "reference of the ") for name in wanted]
    references.append(Variable(FEEDFORWARD, "input", unit, "part of the output of the controller"))
    if what == "controller":
        return [*sensors, *references, variable(drive, "output")]
    return [
        *([variable(drive, "input")] if what == "plant" else references),
        Variable("disturbance", "input", unit, "added to the output of the DAC, without delay"),
        Variable("impulse", "parameter", f"{unit} s", "on the hub, just after the first sample"),
        *sensors,
        *(variable(name, "output") for name in RECORDED),
        Variable("torque", "output", unit, "output of the DAC at the last sample"),
    ]


def plant_code(of: Simulator) -> dict[str, Any]:
    """Return the numbers of the plant in its template."""
    # of a range without limit
    largest = sys.float_info.max
    chain = of.electronics
    model = of.model
    tables = {
        "turn[PIECES][POLES][2]": real_and_imaginary(model.turn),
        "push[PIECES][POLES][2]": real_and_imaginary(model.push),
        "piece[PIECES][2]": model.piece[:, :2],
        "weights[OUTPUTS - 1][POLES][2]": real_and_imaginary(model.weights),
        "rates[OUTPUTS - 1][2]": model.rates,
        "through[OUTPUTS - 1]": model.static,
        "converters[3][3]": np.clip(chain.quantisers, -largest, largest),
    }
    return {
        "tables": {name: braces(values) for name, values in tables.items()},
        "poles": of.kept.size,
        "pieces": len(model.piece),
        "ring": chain.delay + 2,
        "bound": repr(chain.bound),
        "lag": literal(chain.pole),
        "is_differenced": chain.is_differenced,
    }


def real_and_imaginary(values: Complex) -> Real:
    """Return real and imaginary parts, in a further axis."""
    return np.stack([values.real, values.imag], axis=-1)


def braces(values: Any) -> str:
    """Return an array of C, every number with all of its digits."""
    if np.ndim(values):
        return f"{{{', '.join(map(braces, values))}}}"
    return literal(values)


# ------------------------------------------------------------ the file


def model_description(
    sources: Iterable[str],
    identifier: str,
    *,
    variables: Sequence[Variable],
    has_plant: bool,
    period: str,
    about: str,
    guid: str,
) -> bytes:
    """Return the file modelDescription.xml: at a communication point outputs of a plant depend on no input there."""
    outputs = [str(n) for n, each in enumerate(variables, 1) if each.causality == "output"]
    known = {"dependencies": ""} if has_plant else {}
    structure = [
        element(tag, *(element("Unknown", index=n, **known) for n in outputs))
        for tag in ("Outputs", "InitialUnknowns")[: 1 + has_plant]
    ]
    files = [element("File", name=name) for name in sources if name.endswith(".c")]
    units = [element("Unit", name=unit) for unit in sorted({each.unit for each in variables})]
    root = element(
        "fmiModelDescription",
        element(
            "CoSimulation",
            element("SourceFiles", *files),
            modelIdentifier=identifier,
            canHandleVariableCommunicationStepSize="true",
            canNotUseMemoryManagementFunctions="true",
        ),
        element("UnitDefinitions", *units),
        element("LogCategories", element("Category", name="logStatusError")),
        element("DefaultExperiment", startTime="0", stopTime=repr(TRIAL_DURATION), stepSize=period),
        element(
            "ModelVariables", *(variable_element(n, each, has_plant) for n, each in enumerate(variables))
        ),
        element("ModelStructure", *structure),
        fmiVersion="2.0",
        modelName=identifier,
        guid=guid,
        description=one_line(about, 400),
        generationTool=f"tfarm {version('tfarm')}",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    indent(root)
    return tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def variable_element(reference: int, of: Variable, has_plant: bool) -> Element:
    """Return a variable in the description; those of a sampled system change at the samples."""
    is_computed = of.causality == "output" and has_plant
    initial = {"initial": "calculated" if has_plant else "exact"} if of.causality == "output" else {}
    return element(
        "ScalarVariable",
        element("Real", unit=of.unit, **({} if is_computed else {"start": "0"})),
        name=of.name,
        valueReference=str(reference),
        description=of.description,
        causality=of.causality,
        variability="fixed" if of.causality == "parameter" else "discrete",
        **initial,
    )


def element(tag: str, *children: Element, **attributes: str) -> Element:
    """Return an element of XML with its children."""
    parent = Element(tag, attributes)
    parent.extend(children)
    return parent


def binary_of(
    sources: Mapping[str, bytes], identifier: str, longest: float = 60.0
) -> tuple[dict[str, bytes], str]:
    """Return the binary for this machine by its path in a unit, none without a compiler; and platform and compiler.

    None too of one that compiles for longer than that [s].
    """
    compilers = ("cc", "gcc", "clang")
    # no fused operation
    options = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
    platforms = {"linux": ("linux64", ".so"), "darwin": ("darwin64", ".dylib"), "win32": ("win64", ".dll")}
    compiler = next(filter(None, map(shutil.which, compilers)), None)
    if compiler is None or sys.platform not in platforms:
        return {}, f"none: no compiler found ({', '.join(compilers)})"
    platform, suffix = platforms[sys.platform]
    with temporary_folder(Path(tempfile.gettempdir())) as folder:
        for name, content in sources.items():
            (folder / name).write_bytes(content)
        files = [name for name in sources if name.endswith(".c")]
        command = [compiler, *options, "-o", f"unit{suffix}", *files]
        how: dict[str, Any] = {"check": True, "capture_output": True, "stdin": subprocess.DEVNULL}
        try:
            subprocess.run(command, cwd=folder, timeout=longest, **how)
            binary = (folder / f"unit{suffix}").read_bytes()
        except (OSError, subprocess.SubprocessError) as error:
            return {}, f"none: {one_line(f'{compiler}: {error}', 400)}"
    return {f"binaries/{platform}/{identifier}{suffix}": binary}, f"{platform}, by {Path(compiler).name}"


def archive_of(files: Mapping[str, bytes]) -> bytes:
    """Return an archive of files, the same for the same content: without their dates."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            archive.writestr(zipfile.ZipInfo(name), files[name], zipfile.ZIP_DEFLATED)
    return content.getvalue()
