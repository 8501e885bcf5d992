"""A sampled controller as C99: header, source, self-test and an example of a main loop.

    e = reference - signal,  u = feedforward + C x + D e,  x = A x + B e

in double, float or Q31, in the realisation with the least round-off noise, with the DAC, the limit of the actuator and
the delay of the law as the simulation has them.  The loop is judged with the coefficients as they are exported.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Law
from tfarm.arm.law import REFERENCE
from tfarm.arrays import Real, Whole
from tfarm.dsp.chain import Chain
from tfarm.dsp.discretise import discretised
from tfarm.dsp.kernel import DAC
from tfarm.dsp.sampled import Sampled
from tfarm.dsp.simulate import quantisers
from tfarm.dsp.verdict import sampled
from tfarm.errors import ParameterError, require
from tfarm.exact.outputs import OUTPUTS
from tfarm.exported import twin
from tfarm.exported.realisation import NoiseGain, around, as_one, least_noise, with_matrices
from tfarm.exported.result import Export, ExportTask, is_certified, names_of
from tfarm.exported.texts import facts_of, identifiers, render
from tfarm.exported.word_length import FIXED, FLOATS, MOST_SUMMED, OUTPUT, Word, matrices_of, word_of
from tfarm.records import record
from tfarm.schema import Quantity

NAME, LONGEST_NAME = "controller", 16  # of identifiers in C, before "_step" and the like
RECORDED, REFUSED, SEED = 1000, 500, 1  # samples of the self-test, the one with a NaN, its first random number
WHOLE_SAMPLE = 1e-9  # of a sample: rounding of a delay
RATE, ANGLE = "hub_rate", "hub_angle"
FEEDFORWARD = "feedforward"


class StateBound(NamedTuple):
    """The largest absolute value of one state, over its range."""

    state: Annotated[int, Quantity("state", help="number of the state in C, from 0")]
    bound: Annotated[float, Quantity("largest value", "", 5,
            help="bound on the state, over its range in fixed point, for inputs within their ranges")]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
@record
class WordLength:
    """Arithmetic of an exported controller: realisation, noise gains, bounds on states, errors and limit cycles."""

    precision: Annotated[str, Quantity("arithmetic", help="double, float or q31 (fixed point of 32 bits)")]
    realisation: Annotated[str, Quantity("realisation", help="structure of the states, of least round-off noise")]
    noise_gains: Annotated[list[NoiseGain], Quantity("noise gains", help="of each realisation")]
    states: Annotated[list[StateBound], Quantity("states", help="bounds on the states")]
    overflow: Annotated[str, Quantity("overflow", help="whether a state can overflow, for inputs within their ranges")]
    error: Annotated[float | None, Quantity("bound on the error of the output", "", 4,
            help="for inputs within their ranges, 1 SI unit by default, against exact arithmetic")]  # fmt: skip
    samples: Annotated[int | None, Quantity("samples of that bound", help="null where it holds for all samples")]
    limit_cycle: Annotated[float | None, Quantity("bound on a limit cycle of the output by round-off", "", 4,
            help="output that roundings sustain in the closed loop at rest; null where not determined")]  # fmt: skip


class Field(NamedTuple):
    """One input of the C function: its name, identifier, text of a comment and size in the self-test."""

    name: str
    identifier: str
    text: str
    size: float


@dataclass(frozen=True)
class Controller:
    """A realised law in the numbers of a target, its inputs, and what acts on its output.

    `signals` and `references` are the names of its inputs, before the feedforward; `dac` is the step (0: none), the
    lowest and the highest output; `hub` is the pole and the period [s] of an estimated hub rate.
    """

    word: Word
    signals: tuple[str, ...]
    references: tuple[str, ...]
    dac: Real
    delay: int
    hub: tuple[float, float] | None

    @cached_property
    def plan(self) -> Whole:
        """Index of signal and reference of each column, and the sign of the reference, as `twin` has them."""
        law, rows = self.word.law, []
        for name in law.signals:
            source = twin.ESTIMATE if self.hub and name == RATE else self.signals.index(name)
            rows.append([source, self._reference(name) if name in law.references else -1, 1])
        rows += [[twin.NO_SIGNAL, self._reference(name.removeprefix(REFERENCE)), -1] for name in law.wanted]
        return np.array(rows)

    def _reference(self, name: str) -> int:
        return len(self.signals) + self.references.index(name)

    @property
    def inputs(self) -> int:
        """The number of inputs, the last of which is the feedforward."""
        return len(self.signals) + len(self.references) + 1

    def run(self, inputs: NDArray[Any]) -> tuple[NDArray[Any], Whole]:
        """Outputs and status (n,) of inputs (n, k), those of the C code bit for bit; whole numbers in fixed point."""
        word, tables = self.word, tuple(np.ascontiguousarray(each, dtype=self._kind) for each in self.word.tables)
        outputs, status = np.zeros(len(inputs), self._kind), np.zeros(len(inputs), np.int64)
        line, inputs = np.zeros(self.delay, self._kind), np.ascontiguousarray(inputs, dtype=self._kind)
        if word.precision == FIXED:
            twin.run_fixed(tables, word.shifts, self.plan, inputs, self.whole_dac, line, outputs)
        else:
            angle = self.signals.index(ANGLE) if self.hub else -1
            hub, is_single = np.array([angle, *(self.hub or (0.0, 1.0))]), word.precision == "float"
            twin.run_real(tables, self.plan, inputs, self.dac, hub, line, is_single, outputs, status)
        return outputs, status

    @property
    def _kind(self) -> Any:
        return np.int64 if self.word.precision == FIXED else np.float64

    @property
    def whole_dac(self) -> Whole:
        """The converter in fixed point: shift of its step, 0 for none, lowest and highest output."""
        step, low, high = self.dac / self.word.output * 2.0**31
        limits = np.clip([np.ceil(low), np.floor(high)], -twin.LARGEST - 1, twin.LARGEST)
        return np.array([round(math.log2(step)) if step > 1 else 0, *limits], dtype=np.int64)


def c_controller(task: ExportTask) -> Export:
    """The files of a controller in C99, and its finite word length."""
    exact, chain = task.analysis(task.law), task.chain
    law, name, gains = least_noise(in_z(task.law, chain), exact.verdict.loop)
    controller = controller_of(law, task)
    word = controller.word
    found = task.analysis(word.rounded) if task.anyway else judged(task, word, exact.verdict.loop)
    bounds, is_whole, error = word.bounds
    is_bounded = math.isfinite(error) and (word.precision != FIXED or bool((bounds < 1).all()))
    details = WordLength(
        precision=task.precision, realisation=name, noise_gains=gains,
        states=[StateBound(n, each) for n, each in enumerate(bounds.tolist())],
        overflow="excluded for inputs within their ranges" if is_whole and is_bounded else "not excluded",
        error=error if is_bounded else None, samples=None if is_whole else MOST_SUMMED,
        limit_cycle=word.limit_cycle(found.verdict.loop),
    )  # fmt: skip
    facts = task.facts(word.rounded, found)
    contents, names = written(task, controller, facts, details)
    return Export(
        what=task.what, form=task.form, contents=contents, names=names, verdict=found.verdict.sentence,
        details=details, sha256=task.sha256,
    )  # fmt: skip


def in_z(law: Law, chain: Chain) -> Law:
    """The law in z of one state space.

    Raises ParameterError for a delay of its own that is no whole number of samples.
    """
    samples = law.delay / chain.sampling.period
    remedy = f"is {samples:.6g} samples: C code has a delay of whole samples; write another one into the law's states"
    require(abs(samples - round(samples)) <= WHOLE_SAMPLE, "law.delay", law.delay, remedy)
    return as_one(discretised(law, chain.sampling.period))


def controller_of(law: Law, task: ExportTask) -> Controller:
    """A realised law in the numbers of a task.  Raises ParameterError as `word_of` does."""
    of, T = task.chain.converters, task.chain.sampling.period
    dac, is_estimated = quantisers(task.chain)[DAC], of.hub_rate == "difference" and RATE in law.signals
    remedy = 'with q31 the hub rate is an input, or the law reads hub_angle: set converters.hub_rate = "ideal"'
    require(not (is_estimated and task.precision == FIXED), "converters.hub_rate", of.hub_rate, remedy)
    ranges = {"root_moment": of.moment_range} if of.moment_range else {}
    limit = float(max(abs(dac[1:]))) if of.torque_range is None else of.torque_range
    output = task.ranges.get(OUTPUT, limit if math.isfinite(limit) else None)
    signals = tuple(dict.fromkeys(ANGLE if is_estimated and name == RATE else name for name in law.signals))
    references = tuple(dict.fromkeys((*law.references, *(name.removeprefix(REFERENCE) for name in law.wanted))))
    known = {*signals, *references, OUTPUT}
    for name, value in task.ranges.items():
        require(name in known, "range", name, f"no signal of this controller: {', '.join(sorted(known))}")
        require(math.isfinite(value) and value > 0, f"range.{name}", value, "a positive, finite number in SI units")
    word = word_of(law, task.precision, ranges | dict(task.ranges), output)
    hub = (math.exp(-of.rate_filter * T), T) if is_estimated else None
    return Controller(word, signals, references, dac, round(law.delay / T), hub)


def judged(task: ExportTask, word: Word, loop: Sampled) -> Any:
    """The sampled loop with the coefficients as exported.

    Raises ParameterError where it is not certified stable, naming the coefficient whose rounding moves the poles most.
    """
    found = sampled(task.arm, word.rounded, task.chain)
    if is_certified(found):
        return found
    exact, rounded = matrices_of(word.law), matrices_of(word.rounded)
    radius: dict[str, float] = {}
    for key, before, after in zip("ABCD", exact, rounded, strict=True):
        for place in np.ndindex(before.shape):
            one = before.copy()
            one[place] = after[place]
            law = with_matrices(word.law, tuple(one if each is before else each for each in exact))  # type: ignore[arg-type]
            poles = np.linalg.eigvals(around(law, loop).matrix)
            radius[f"{key}[{', '.join(map(str, place))}]"] = float(abs(poles).max())
    worst = max(radius, key=lambda key: radius[key])
    remedy = f"rounded to {task.precision} the loop is not certified stable: {found.verdict.sentence}; take more digits"
    raise ParameterError(key=f"coefficient {worst}", value=task.precision, remedy=remedy)


# ------------------------------------------------------------ files


def written(
    task: ExportTask, controller: Controller, facts: dict[str, str], details: WordLength
) -> tuple[dict[str, bytes], list[Any]]:
    """The files by name, and the identifiers of names."""
    word, is_fixed = controller.word, task.precision == FIXED
    wanted = task.name or NAME
    prefix = "" if wanted[:1].isascii() and wanted[:1].isalpha() else "n_"
    name = identifiers([wanted], prefix, LONGEST_NAME)
    known = identifiers(controller.signals, "y_"), identifiers(controller.references, "r_")
    fields = fields_of(task, controller, *known)
    real = {"double": "double", "float": "float", FIXED: "int32_t"}[task.precision]
    e = [_error(row, fields, real) for row in controller.plan.tolist()]
    outputs, status = _recorded(controller, fields)
    suffix = "f" if task.precision == "float" else ""
    A, B, C, D = ([[_number(x, suffix) for x in row] for row in table.tolist()] for table in word.tables)
    dac = controller.whole_dac if is_fixed else controller.dac
    is_converter = bool(np.isfinite(dac).all())
    unit = task.arm.input_unit
    values: dict[str, Any] = {
        "name": name[wanted], "facts": [*facts.items(), *facts_of(details)], "fixed": is_fixed, "real": real,
        "fields": fields, "sizes": [_number(each.size, suffix) for each in fields], "n": word.law.order,
        "m": len(e), "errors": e, "A": A, "B": B, "C": C, "D": D, "shifts": word.shifts,
        "wide": "int64_t" if is_fixed else real, "cast": "(int64_t)" if is_fixed else "",
        "largest": "FLT_MAX" if suffix else "DBL_MAX", "converter": is_converter, "delay": controller.delay,
        "dac": [_number(each, "") if each else 0 for each in dac.tolist()] if is_converter else [0, 0, 0],
        "hub": controller.hub and (known[0][ANGLE], *(each.hex() for each in controller.hub)),
        "output": f"{task.arm.input} over {word.output!r} {unit}" if is_fixed else f"{task.arm.input} [{unit}]",
        "recorded": [_number(each, suffix) for each in outputs.tolist()], "status": status.tolist(),
        "refused": REFUSED, "seed": SEED, "zero": f"0.0{suffix}", "half": f"8388608.0{suffix}", "one": f"1.0{suffix}",
        "period": repr(task.chain.sampling.period),
    }  # fmt: skip
    files = ("controller.h", "controller.c", "self_test.c", "example.c")
    return {file: render(file, **values) for file in files}, names_of(name, *known)


def fields_of(
    task: ExportTask, controller: Controller, signals: dict[str, str], references: dict[str, str]
) -> list[Field]:
    """The inputs of the C function: signals, references, and the feedforward."""
    word, found = controller.word, []
    columns = dict(zip((*word.law.signals, *(name.removeprefix(REFERENCE) for name in word.law.wanted)),
                       word.ranges.tolist(), strict=True))  # fmt: skip
    for names, title in ((signals, ""), (references, "reference of ")):
        for name, identifier in names.items():
            size = columns.get(name, 1.0)
            over = f", over {size!r}" if word.precision == FIXED else ""
            found.append(Field(name, identifier, f"{title}{name} [{OUTPUTS[name.partition('@')[0]].unit}]{over}", size))
    text = f"feedforward [{task.arm.input_unit}]{f', over {word.output!r}' if word.precision == FIXED else ''}"
    return [*found, Field(FEEDFORWARD, FEEDFORWARD, text, word.output)]


def _error(row: list[int], fields: list[Field], real: str) -> str:
    """The C expression of e of one column of a plan."""
    source, reference, _ = row
    of, wide = [f"input->{each.identifier}" for each in fields], "(int64_t)" if real == "int32_t" else ""
    value = f"({real})rate" if source == twin.ESTIMATE else f"{wide}{of[source]}"
    if source == twin.NO_SIGNAL:
        return f"-{wide}{of[reference]}"
    return f"{'0' if reference < 0 else wide + of[reference]} - {value}"


def _recorded(controller: Controller, fields: Sequence[Field]) -> tuple[NDArray[Any], Whole]:
    """Outputs and status of the self-test, whose inputs are those of a linear congruential generator."""
    numbers, seed = [], SEED
    for _ in range(RECORDED * len(fields)):
        seed = (1664525 * seed + 1013904223) % 2**32
        numbers.append(seed)
    words = np.array(numbers, dtype=np.int64).reshape(RECORDED, -1)
    if controller.word.precision == FIXED:
        return controller.run(words - 2**31)
    kind = FLOATS[controller.word.precision][0]
    inputs = (np.array([each.size for each in fields], kind) * ((words >> 8) / 2.0**23 - 1).astype(kind)).astype(float)
    inputs[REFUSED, 0] = np.nan
    return controller.run(inputs)


def _number(value: float, suffix: str) -> str:
    """A literal of C: whole, or hexadecimal with all its bits."""
    return f"{value:d}" if isinstance(value, int) else f"{float(value).hex()}{suffix}"
