"""State spaces of a task with the names of their signals: controller, plant, closed loop, reduced model.

With the references w and a feedforward r the sampled loop of the plant x and the controller k is

    u = r + c k + d [y; w],   k_next = a k + b [y; w],   x_next = A x + B u,   y = C x

A quantity of the loop acts as in `tfarm.loop.sampled`: delay, hold and analog filters are states of the plant, the
estimate of a hub rate is one of the controller.  A shaper is a system of its own: references and feedforward are those
behind it, so that each of them passes it before.  Quantisation and saturation are not linear and not in it.

They are written as a MATLAB file with its script, whose variables are the entries of the first system, a structure for
each other one, and the exact frequency response of the arm; or as a script of python-control.
"""

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, StateSpace
from tfarm.arm.law import REFERENCE, Part, of_common_blocks
from tfarm.arm.stages import Consumer
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.dsp.discretise import acting_law, with_estimate
from tfarm.dsp.plant import USUAL_MODES, arm_under_chain
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.stages import not_covered
from tfarm.errors import require
from tfarm.exported.realisations import close_state_space
from tfarm.exported.result import Export, ExportTask, names_of
from tfarm.exported.texts import comment, matlab_text, render_source
from tfarm.files import is_standard_output, mat_content, write_file
from tfarm.records import frozen
from tfarm.reduced import BAND, ReducedModel, modal_model, reduce
from tfarm.reduced.partial_fractions import frequencies_around, is_clear_of
from tfarm.reduced.reduction import NORM
from tfarm.response import transfer
from tfarm.response.signals import Signals

CONSUMER = Consumer(
    "export mat, py",
    acts=("anti-alias filter", "hub rate", "shaper", "law", "hold", "delay", "hub damping", "plant"),
    named=("encoder", "amplifier steps", "amplifier range", "DAC steps", "DAC range", "torque limit"),
    partly=("arithmetic",),
    none=("reference", "volts"),
)


@frozen
class NamedSystem:
    """x' = A x + B u, y = C x + D u with named signals; x' is the next x where the period [s] is not 0.

    `facts` are further entries of it in a file, such as its worst error.
    """

    name: str
    matrices: Matrices
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    period: float = 0.0
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Name, kind and order of the system, with its worst error, if it is an approximation."""
        kind = f"sampled every {self.period:g} s" if self.period else "continuous-time"
        error = f"; worst {NORM} " + "{worst_error:.3g} from {band[0]:g} to {band[1]:g} rad/s"
        return f"{self.name}, {kind}, {len(self.states)} states{error.format(**self.facts) if self.facts else ''}"


# ------------------------------------------------------------ controller and sampled loop


def controller_system(case: Case) -> NamedSystem:
    """Return the controller in z, from its signals and then their references to its share of the input."""
    acting, _ = acting_law(case, of_common_blocks(case.in_computer))
    parts = tuple(_with_references(part, acting.references) for part in acting.parts)
    acting = with_estimate(replace(acting, parts=parts, references=()), case.chain)
    columns = (*acting.signals, *acting.wanted)
    a, b, c, d = acting.matrices(columns)
    states = tuple(f"controller{n + 1}" for n in range(len(a)))
    period = case.chain.sampling.period
    return NamedSystem(case.law.name, (a, b, 0.0 - c, 0.0 - d), columns, (case.arm.input,), states, period)


def _with_references(part: Part, references: tuple[str, ...]) -> Part:
    """Return a part of a law with the references of its signals as columns of their own."""
    at = [n for n, name in enumerate(part.signals) if name in references]
    A, B, C, D = part.block.matrices()
    names = tuple(REFERENCE + part.signals[n] for n in at)
    return Part((*part.signals, *names), StateSpace(A, np.c_[B, -B[:, at]], C, np.c_[D, -D[:, at]]))


def plant_system(case: Case) -> NamedSystem:
    """Return the sampled plant from its input to the signals of the law and the tip, exact for its modal model."""
    acting, late = acting_law(case, of_common_blocks(case.in_computer))
    signals = with_estimate(acting, late).signals
    sensed = sensed_plant(case.arm, late, list(dict.fromkeys((*signals, "tip_displacement"))), USUAL_MODES)
    A, B, C = PulseTransfer(sensed.together, late.sampling).without_fast_poles().matrices()
    matrices = A, B[:, None], C, np.zeros((len(C), 1))
    states = tuple(f"plant{n + 1}" for n in range(len(A)))
    name = f"{case.arm.name}, sampled"
    return NamedSystem(name, matrices, (case.arm.input,), sensed.read.names, states, late.sampling.period)


def loop_system(plant: NamedSystem, controller: NamedSystem) -> NamedSystem:
    """Return the closed loop from feedforward and references to the outputs of the plant and its input.

    The first outputs of the plant are the first inputs of the controller.
    """
    A, B, C, _ = plant.matrices
    a, b, c, d = controller.matrices
    n = sum(not name.startswith(REFERENCE) for name in controller.inputs)
    matrix, _, u = close_state_space(A, B, C[:n], a, b[:, :n], c, d[:, :n])
    # the input by feedforward and references
    through = np.c_[1.0, d[:, n:]]
    matrices = (
        matrix,
        np.r_[B @ through, np.pad(b[:, n:], ((0, 0), (1, 0)))],
        np.r_[np.pad(C, ((0, 0), (0, len(a)))), u],
        np.pad(through, ((len(C), 0), (0, 0))),
    )
    return NamedSystem(
        f"{plant.name}, {controller.name}",
        matrices,
        ("feedforward", *controller.inputs[n:]),
        (*plant.outputs, *controller.outputs),
        (*plant.states, *controller.states),
        plant.period,
    )


def shaper_system(impulses: Real, period: float) -> dict[str, NamedSystem]:
    """Return the shaper of a reference or feedforward by its name, with a state a sample; none of a single impulse."""
    first, *others = impulses.tolist()
    n = len(others)
    if n == 0:
        return {}
    matrices = np.eye(n, k=-1), np.eye(n, 1), np.array([others]), np.array([[first]])
    states = tuple(f"sample{k + 1}" for k in range(n))
    return {"shaper": NamedSystem("shaper", matrices, ("reference",), ("shaped_reference",), states, period)}


# ------------------------------------------------------------ the arm itself


def reduced_system(reduced: ReducedModel, outputs: tuple[str, ...]) -> NamedSystem:
    """Return the continuous-time reduced model under these names of its outputs, with its worst error."""
    facts = {"worst_error": reduced.worst_error, "band": np.array(reduced.band)}
    return NamedSystem(
        reduced.name, reduced.matrices(), (reduced.input,), outputs, reduced.states, facts=facts
    )


def reduced_systems(arm: Arm, names: tuple[str, ...]) -> dict[str, NamedSystem]:
    """Return modal models with the modes of the sampled plant, one for each place along the arm."""
    read = Signals(arm, names)
    found = {}
    own = list(zip(names, read.outputs, read.places, strict=True))
    along = [place for _, output, place in own if output.place == "x"]
    for n, share in enumerate(dict.fromkeys(along or [0.0])):
        # outputs at an end are with those of the first place
        here = [each for each in own if (each[2] == share if each[1].place == "x" else n == 0)]
        outputs = [output for _, output, _ in here]
        x = share * arm.length if along else None
        order = modal_model(arm, outputs, USUAL_MODES, x).order
        reduced = reduce(arm, outputs, order=order, method="modal", x=x)
        found[f"reduced_{n + 1}" if n else "reduced"] = reduced_system(
            reduced, tuple(name for name, _, _ in here)
        )
    return found


def response_data(
    arm: Arm, of: str, outputs: tuple[str, ...], band: tuple[float, float], G: Callable[[Complex], Complex]
) -> dict[str, Any]:
    """Return the exact frequency response (outputs, 1, n) over a range [rad/s], clear of the poles on the axis."""
    omega = np.geomspace(*band, 1000)
    omega = omega[is_clear_of(omega, frequencies_around(arm, band[1]))]
    return {
        "omega": omega,
        "response": G(1j * omega)[:, None, :],
        "exact_input": np.array([of], object),
        "exact_outputs": np.array(outputs, object),
    }


# ------------------------------------------------------------ those of a task


class Linear(NamedTuple):
    """The systems of a task by their names in its files, that of the file first, and the first lines of a script.

    `response` is the exact frequency response of the arm, if any; `verdict` that of the loop.
    """

    systems: Mapping[str, NamedSystem]
    head: Sequence[str]
    response: Mapping[str, Any]
    verdict: str = ""


def linear(task: ExportTask) -> Linear:
    """Return the systems of a task.  Raises ParameterError for a loop that is not certified stable."""
    case = task.case
    what = task.what
    facts = {
        "arm": case.arm.name,
        "sampled plant": f"linear{not_covered(CONSUMER, case.chain)}",
        "SHA-256 of the inputs": task.sha256,
        "tfarm": version("tfarm"),
    }
    verdict = ""
    if what != "plant":
        judged = task.analysis(case)
        facts = task.facts(case, judged)
        verdict = judged.verdict.sentence
    head = [f"{label}: {value}" for label, value in facts.items()]
    controller = controller_system(case)
    shaper = {} if what == "plant" else shaper_system(task.impulses, case.chain.sampling.period)
    if what == "controller":
        return Linear({what: controller, **shaper}, head, {}, verdict)
    plant = plant_system(case)
    read = Signals(arm_under_chain(case.arm, case.chain)[0], plant.outputs)
    systems = {"plant": plant, **reduced_systems(read.arm, read.names)}
    if what == "loop":
        systems = {what: loop_system(plant, controller), "controller": controller, **systems, **shaper}
    return Linear(
        systems, head, response_data(read.arm, case.arm.input, read.names, BAND, read.values), verdict
    )


def mat(task: ExportTask) -> Export:
    """Return the MATLAB file of a task and its script."""
    found = linear(task)
    return task.export_of(mat_files(f"{task.what}.mat", found), [], found.verdict)


def mat_files(name: str, of: Linear) -> dict[str, bytes]:
    """Return a MATLAB file of that name, and the script that builds its systems, by their names."""
    script = f"load_{re.sub(r'[^A-Za-z0-9_]', '_', Path(name).stem)}.m"
    first, *others = ((name, system_variables(system)) for name, system in of.systems.items())
    content = mat_content({**first[1], **dict(others), **of.response}, "row")
    return {name: content, script: render_source("load.m", file=matlab_text(name), of=of)}


def system_variables(system: NamedSystem) -> dict[str, Any]:
    """Return the variables of one system, with its names and facts."""
    return {
        **dict(zip("ABCD", system.matrices, strict=True)),
        "period": system.period,
        "input_name": np.array(system.inputs, dtype=object),
        "output_names": np.array(system.outputs, dtype=object),
        "state_names": np.array(system.states, dtype=object),
        "name": comment(system.name),
        **system.facts,
    }


def save_mat(reduced: ReducedModel, path: Path, *, key: str = "path") -> tuple[Path, ...]:
    """Write a MATLAB file of a reduced model and in its folder a script of `sys` and `exact`; return the paths.

    The file has A, B, C, D, all names, the exact response over the frequency range, and the worst error.  To standard
    output it is written alone.  Raises ParameterError, naming `key`, where they cannot be written, or a script of that
    name is another file's.
    """
    model = reduced.model
    G = transfer(model.arm, model.rows, x=model.x)
    exact = response_data(model.arm, reduced.input, reduced.outputs, reduced.band, G)
    of = Linear({"sys": reduced_system(reduced, reduced.outputs)}, [], exact)
    if is_standard_output(path):
        write_file(path, mat_files(path.name, of)[path.name], key=key)
        return (path,)
    is_file = os.path.isfile(path) or not os.path.exists(path)
    require(is_file, key, str(path), "is no regular file, and its script needs a folder")
    path = path if path.suffix == ".mat" else path.with_name(path.name + ".mat")
    require(
        comment(path.name) == path.name,
        key,
        path.name,
        "a name of printable ASCII, as its script contains it",
    )
    contents = {path.with_name(name): content for name, content in mat_files(path.name, of).items()}
    other = next(reversed(contents))
    text = ""
    # a file that cannot be read is not ours
    with suppress(OSError):
        text = other.read_text("utf-8", errors="replace")
    # as in the first line of every script, load.m
    is_ours = not os.path.exists(other) or ("written by tfarm" in text and matlab_text(path.name) in text)
    remedy = f"{other.name} in that folder is not its script and would be replaced; choose another name"
    require(is_ours, key, str(path), remedy)
    for place in reversed(contents):
        write_file(place, contents[place], key=key)
    return tuple(contents)


def py(task: ExportTask) -> Export:
    """Return the script of a task."""
    found = linear(task)
    every: list[str] = []
    for each in found.systems.values():
        every += (*each.inputs, *each.outputs)
    changed = {name: new for name, new in zip(every, without_dots(every), strict=True) if new != name}
    contents = {f"{task.what}.py": render_source("systems.txt", of=found, listed=list_literal)}
    return task.export_of(contents, names_of(changed), found.verdict)


def without_dots(names: Iterable[str]) -> list[str]:
    """Return names of signals without dots, which separate system and signal in python-control."""
    return [name.replace(".", "_") for name in names]


def list_literal(names: Iterable[str]) -> str:
    """Return a literal of these names."""
    return f"[{', '.join(map(ascii, without_dots(names)))}]"
