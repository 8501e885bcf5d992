"""A sampled controller as C99: header, source, self-test and an example of a main loop.

    e = reference - signal,  u = feedforward + C x + D e,  x = A x + B e

in double, float or Q31, in the realisation with the least round-off noise, with the DAC, the limit of the actuator and
the delay of the law as the simulation has them.  The loop is judged with the coefficients as they are exported.  A step
refuses inputs that are not finite, and results that are not: it holds the output and keeps the states.  Its status
names a clipped output and, in fixed point, a clipped state.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Law
from tfarm.arm.checks import positive
from tfarm.arm.law import REFERENCE
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real, Whole
from tfarm.case import Case
from tfarm.dsp.discretise import discretise_law, system_matrix
from tfarm.dsp.kernel import DAC, estimate, law_step, quantise, to_precision
from tfarm.dsp.simulate import quantisers
from tfarm.errors import must_be_known, require
from tfarm.exact.compiled import compiled, inlined
from tfarm.exact.outputs import OUTPUTS
from tfarm.exported.result import Export, ExportTask, Name, names_of
from tfarm.exported.texts import facts_of, identifiers, literal, name_in_c, render_source
from tfarm.exported.word_length import (
    ANGLE,
    FEEDFORWARD,
    FIXED,
    FLOATS,
    MOST_SUMMED,
    OUTPUT,
    RATE,
    NoiseGain,
    Word,
    least_noise,
    with_system_matrix,
    word_of,
)
from tfarm.records import frozen
from tfarm.schema import Quantity

CONSUMER = Consumer(
    "export c",
    acts=(
        "anti-alias filter",
        "hub rate",
        "law",
        "DAC steps",
        "DAC range",
        "torque limit",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    named=("encoder", "amplifier steps", "arithmetic"),
    partly=("amplifier range",),
    none=("reference", "volts"),
)

FILES = ("controller.h", "controller.c", "self_test.c", "example.c")
# in C
REAL = {"double": ("double", "", "DBL_MAX"), "float": ("float", "f", "FLT_MAX"), FIXED: ("int32_t", "", "")}
# status of a step, 0 of one without an event
INPUT_ERROR, OVERFLOW, SATURATED, STATE_SATURATED = range(1, 5)
# columns of a plan
MINUEND, SUBTRAHEND = range(2)
# of 32 bits
LARGEST = 2147483647


@frozen(kw_only=True)
class WordLength:
    """Arithmetic of an exported controller: realisation, noise gains, bounds on states, errors and limit cycles."""

    precision: Annotated[str, Quantity("arithmetic", help="double, float or q31 (fixed point of 32 bits)")]
    realisation: Annotated[
        str, Quantity("realisation", help="structure of the states, of least round-off noise")
    ]
    noise_gains: Annotated[list[NoiseGain], Quantity("noise gains", help="of each realisation")]
    largest_states: Annotated[
        tuple[float, ...],
        Quantity(
            "largest values of the states",
            "",
            3,
            help="bounds for inputs within their ranges; in fixed point over the range of each state",
        ),
    ]
    overflow: Annotated[
        str, Quantity("overflow", help="whether a state can overflow, for inputs within their ranges")
    ]
    largest_output: Annotated[
        float | None,
        Quantity(
            "largest output of the law",
            "",
            6,
            help="bound for inputs within their ranges, before the limits of the output",
        ),
    ]
    saturation: Annotated[
        str, Quantity("saturation", help="limits of the output, and whether inputs reach them")
    ]
    error: Annotated[
        float | None,
        Quantity(
            "bound on the error of the output",
            "",
            4,
            help="for inputs within their ranges, 1 SI unit by default, against exact arithmetic",
        ),
    ]
    samples: Annotated[
        int | None, Quantity("samples of these bounds", help="null where they hold for all samples")
    ]
    limit_cycle: Annotated[
        float | None,
        Quantity(
            "bound on a limit cycle of the output by round-off",
            "",
            4,
            help="that roundings and a DAC in the code sustain at rest; null where not determined",
        ),
    ]


class Port(NamedTuple):
    """One input of the C function: its identifier, text of a comment, and size in the self-test."""

    identifier: str
    text: str
    size: float


@dataclass(frozen=True)
class Controller:
    """A realised law in the numbers of a target, its inputs, and what acts on its output.

    `signals` and `references` are the names of its inputs, before the feedforward; `ranges` are largest absolute values
    by name, where known; `dac` is the step (0: none), the lowest and the highest output; `hub` is the pole and the
    period [s] of an estimated hub rate.
    """

    word: Word
    signals: tuple[str, ...]
    references: tuple[str, ...]
    ranges: Mapping[str, float]
    dac: Real
    delay: int
    hub: tuple[float, float] | None

    @cached_property
    def plan(self) -> Whole:
        """The two inputs whose difference is e of each column, as `run_real` has them: references less signals."""
        law = self.word.law
        rate = self.inputs
        zero = rate + 1
        signals = {name: n for n, name in enumerate(self.signals)} | ({RATE: rate} if self.hub else {})
        wanted = {name: len(self.signals) + n for n, name in enumerate(self.references)}
        rows = [(wanted[name] if name in law.references else zero, signals[name]) for name in law.signals]
        return np.array([*rows, *((zero, wanted[name.removeprefix(REFERENCE)]) for name in law.wanted)])

    @property
    def inputs(self) -> int:
        """The number of inputs, the last of which is the feedforward."""
        return len(self.signals) + len(self.references) + 1

    @property
    def whole_dac(self) -> Whole:
        """The converter in fixed point: shift of its step, 0 for none, lowest and highest output."""
        step, low, high = self.dac / self.word.output * 2.0**31
        limits = np.clip([np.ceil(low), np.floor(high)], -LARGEST - 1, LARGEST)
        return np.array([round(math.log2(step)) if step > 1 else 0, *limits], dtype=np.int64)

    @property
    def limits(self) -> list[float]:
        """The lowest and the highest output that the code returns, in SI units."""
        if self.word.precision == FIXED:
            return [each * self.word.output / 2.0**31 for each in self.whole_dac[1:].tolist()]
        return [float(each) for each in self.dac[1:].astype(FLOATS[self.word.precision][0])]

    def run(self, inputs: NDArray[Any]) -> tuple[NDArray[Any], Whole]:
        """Outputs and status (n,) of inputs (n, k), those of the C code bit for bit; whole numbers in fixed point."""
        word = self.word
        kind = np.int64 if word.precision == FIXED else np.float64
        outputs = np.zeros(len(inputs), kind)
        status = np.zeros(len(inputs), int)
        table, inputs = (np.ascontiguousarray(each, dtype=kind) for each in (word.table, inputs))
        if word.precision == FIXED:
            run_fixed(table, word.shifts, self.plan, inputs, self.whole_dac, outputs, status)
        else:
            hub = np.array([self.signals.index(ANGLE), *self.hub] if self.hub else [-1.0, 0.0, 1.0])
            run_real(table, self.plan, inputs, self.dac, hub, word.precision == "float", outputs, status)
        # a refused sample moves no delay line: the output is held
        is_good = ~np.isin(status, (INPUT_ERROR, OVERFLOW))
        return np.r_[np.zeros(1 + self.delay, kind), outputs[is_good]][np.cumsum(is_good)], status


def c_controller(task: ExportTask) -> Export:
    """The files of a controller in C99, and its finite word length.

    Raises ParameterError where the loop with the coefficients as exported is not certified stable, unless `anyway`.
    """
    law = in_z(task.case)
    law, name, gains = least_noise(law, task.analysis(task.case).verdict.loop)
    controller = controller_of(law, task)
    word = controller.word
    case = task.case.under(word.rounded)
    found = task.judged(
        case, "precision", task.precision, f"rounded to {task.precision} the loop", "take more digits"
    )
    details = word_length(controller, name, gains, word.limit_cycle(found.verdict.loop))
    bounds = dict(facts_of(details)) | ({} if details.samples else {"samples of these bounds": "all"})
    contents, names = source_files(task, controller, [*task.facts(case, found).items()], [*bounds.items()])
    return task.exported(contents, names, found.verdict.sentence, details)


def word_length(
    controller: Controller, name: str, gains: list[NoiseGain], limit_cycle: float | None
) -> WordLength:
    """The record of a controller's arithmetic, in the realisation of this name."""
    word = controller.word
    low, high = controller.limits
    bounds = word.bounds
    samples = None if bounds.is_whole else MOST_SUMMED
    excluded = f"excluded for inputs within their ranges{f', for {samples} samples' if samples else ''}"
    # in fixed point the scale of a state
    largest = 1.0 if word.precision == FIXED else float(np.finfo(FLOATS[word.precision][0]).max)
    overflow = "not excluded: a state may saturate, and the bounds hold until it does"
    if bounds.output == math.inf:
        overflow = "not determined: the law is unstable or ill-conditioned in z"
    elif max(bounds.states, default=0.0) < largest:
        overflow = excluded
    saturation = "no limit" if high == math.inf else f"saturates from {low!r} down and from {high!r} up"
    if bounds.output + bounds.error <= min(-low, high) < math.inf:
        saturation = f"{excluded} (limits {low!r} and {high!r})"
    output, error = (each if each < math.inf else None for each in (bounds.output, bounds.error))
    return WordLength(
        precision=word.precision,
        realisation=name,
        noise_gains=gains,
        largest_states=tuple(bounds.states.tolist()),
        overflow=overflow,
        largest_output=output,
        saturation=saturation,
        error=error,
        samples=samples,
        limit_cycle=limit_cycle,
    )


def source_files(
    task: ExportTask,
    controller: Controller,
    facts: Sequence[tuple[str, str]],
    bounds: Sequence[tuple[str, str]] = (),
) -> tuple[dict[str, bytes], list[Name]]:
    """The files that begin with these facts, by name, and the identifiers in them, that of the controller first.

    `bounds` are stated with the ranges of the inputs.
    """
    name = name_in_c(task.name or "controller")
    signals = identifiers(controller.signals, "y_")
    references = identifiers(controller.references, "r_")
    values = template_values(task, controller, ports_of(task, controller, signals, references))
    (own,) = name.values()
    values |= {"name": own, "facts": facts, "bounds": bounds}
    return {file: render_source(file, **values) for file in FILES}, names_of(name, signals, references)


def in_z(case: Case) -> Law:
    """The law of a case in z, of one state space.

    Raises ParameterError for a delay of its own that is no whole number of samples.
    """
    law = case.law
    period = case.chain.sampling.period
    samples = law.delay / period
    remedy = f"is {samples:.6g} samples: C code has a delay of whole samples; write another one into the law's states"
    # but for the rounding of a delay
    require(abs(samples - round(samples)) <= 1e-9, "law.delay", law.delay, remedy)
    law = discretise_law(law, period)
    return with_system_matrix(law, system_matrix(law))


def controller_of(law: Law, task: ExportTask) -> Controller:
    """A realised law in the numbers of a task.  Raises ParameterError as `word_of` does."""
    chain = task.case.chain
    of = chain.converters
    T = chain.sampling.period
    dac = quantisers(chain)[DAC]
    is_estimated = of.hub_rate == "difference" and RATE in law.signals
    remedy = (
        'with q31 the hub rate is an input, or the law reads hub_angle: set converters.hub_rate = "ideal"'
    )
    require(not (is_estimated and task.precision == FIXED), "converters.hub_rate", of.hub_rate, remedy)
    signals = tuple(dict.fromkeys(ANGLE if is_estimated and name == RATE else name for name in law.signals))
    references = tuple(
        dict.fromkeys((*law.references, *(name.removeprefix(REFERENCE) for name in law.wanted)))
    )
    known = (*dict.fromkeys((*signals, *law.signals, *references)), FEEDFORWARD, OUTPUT)
    for name, value in task.ranges.items():
        must_be_known("range", name, known)
        positive(
            f"range.{name}", value, "the largest absolute value of a signal is a positive, finite number"
        )
    limit = float(max(abs(dac[1:]))) if of.torque_range is None else of.torque_range
    usual = {"root_moment": of.moment_range, OUTPUT: limit if math.isfinite(limit) else None}
    ranges = {name: size for name, size in usual.items() if size} | dict(task.ranges)
    hub = (math.exp(-of.rate_filter * T), T) if is_estimated else None
    word = word_of(law, task.precision, ranges, float(dac[0]), hub)
    # in fixed point a step of the DAC is a power of 2 of those of the output
    steps = math.log2(max(1.0, float(dac[0]) / word.output * 2.0**31))
    remedy = f"q31 has steps of a DAC that are a power of 2 of its own: output={limit!r}, or this times a power of 2"
    require(task.precision != FIXED or steps.is_integer(), "range.output", word.output, remedy)
    return Controller(word, signals, references, ranges, dac, round(law.delay / T), hub)


# ------------------------------------------------------------ its arithmetic, that of C and of a simulation


@compiled
def run_real(
    table: Any, plan: Any, inputs: Any, dac: Any, hub: Any, single: bool, outputs: Any, status: Any
) -> None:
    """Fill outputs and status (n,) of inputs (n, k), the last of which is the feedforward; refused ones are left as 0.

    `table` is [A B; C D]; `plan` (columns, 2) has the two numbers whose difference is e of a column, by their places
    among the inputs, an estimated hub rate and 0; `dac` is a row of the quantisers; `hub` index of the hub angle (-1:
    no estimate), pole and period of the estimated rate.
    """
    n = table.shape[0] - 1
    forward = inputs.shape[1] - 1
    known = np.zeros(forward + 3)
    z = np.zeros(table.shape[1])
    following = np.zeros(n + 1)
    memory = np.zeros(3)
    clipped = np.zeros(3, np.bool_)
    for k in range(inputs.shape[0]):
        known[: forward + 1] = inputs[k]
        before = memory.copy()
        status[k] = INPUT_ERROR
        if np.isfinite(inputs[k]).all():
            if hub[0] >= 0.0:
                known[-2] = to_precision(
                    estimate(known[int(hub[0])], 0.0, memory, True, hub[1], hub[2]), single
                )
            for j in range(plan.shape[0]):
                z[n + j] = to_precision(known[plan[j, MINUEND]] - known[plan[j, SUBTRAHEND]], single)
            law_step(table, z, known[forward], single, following)
            if np.isfinite(following).all():
                z[:n] = following[:n]
                outputs[k] = to_precision(quantise(following[n], dac, clipped, DAC), single)
                status[k] = SATURATED if clipped[DAC] else 0
            else:
                memory[:] = before
                status[k] = OVERFLOW


@inlined
def shift_right(value: int, shift: int) -> int:
    """value/2^shift, to the nearest whole number, halves upwards."""
    return (value + (1 << (shift - 1))) >> shift


@compiled
def run_fixed(table: Any, shifts: Any, plan: Any, inputs: Any, dac: Any, outputs: Any, status: Any) -> None:
    """The same in fixed point; `dac` is the shift of the step of the DAC, 0 for none, lowest and highest output."""
    n = table.shape[0] - 1
    forward = inputs.shape[1] - 1
    known = np.zeros(forward + 3, np.int64)
    z = np.zeros(table.shape[1], np.int64)
    following = np.zeros(n + 1, np.int64)
    for k in range(inputs.shape[0]):
        known[: forward + 1] = inputs[k]
        for j in range(plan.shape[0]):
            z[n + j] = known[plan[j, MINUEND]] - known[plan[j, SUBTRAHEND]]
        for i in range(n + 1):
            total = known[forward] << shifts[n] if i == n else 0
            for j in range(z.size):
                total += table[i, j] * z[j]
            following[i] = shift_right(total, shifts[i])
        u = shift_right(following[n], dac[0]) << dac[0] if dac[0] > 0 else following[n]
        outputs[k] = min(max(u, dac[1]), dac[2])
        status[k] = SATURATED if outputs[k] != u else 0
        for i in range(n):
            z[i] = min(max(following[i], -LARGEST - 1), LARGEST)
            if z[i] != following[i]:
                status[k] = STATE_SATURATED


# ------------------------------------------------------------ values of the templates


def template_values(task: ExportTask, controller: Controller, ports: Sequence[Port]) -> dict[str, Any]:
    """The values of the templates, but for name and facts."""
    word = controller.word
    is_fixed = task.precision == FIXED
    real, suffix, largest = REAL[task.precision]
    arm = task.case.arm
    dac = controller.whole_dac if is_fixed else controller.dac
    unit = arm.input_unit
    cast, zero = ("(int64_t)", "") if is_fixed else ("", f"0.0{suffix}")
    known = [*(f"{cast}input->{each.identifier}" for each in ports), f"({real})rate", zero]
    return {
        "fixed": is_fixed,
        "real": real,
        "wide": "int64_t" if is_fixed else real,
        "largest": largest,
        "suffix": suffix,
        "cast": cast,
        "fields": ports,
        **self_test_values(controller.run, ports, task.precision),
        "header": FILES[0],
        "n": word.law.order,
        "m": len(controller.plan),
        "shifts": word.shifts,
        "table": [[literal(x, suffix) for x in row] for row in word.table.tolist()],
        "errors": [f"{known[of]} - {known[less]}".strip() for of, less in controller.plan.tolist()],
        "converter": bool(np.isfinite(dac).all()),
        "delay": controller.delay,
        "step": dac.tolist()[0],
        "dac": [literal(each, "") for each in dac.tolist()],
        "statuses": statuses(controller),
        "hub": controller.hub
        and (ports[controller.signals.index(ANGLE)].identifier, *map(float.hex, controller.hub)),
        "output": f"{arm.input} over {word.output!r} {unit}" if is_fixed else f"{arm.input} [{unit}]",
        "period": repr(task.case.chain.sampling.period),
    }


def statuses(controller: Controller) -> dict[str, int]:
    """What a step can return but 0, by the names in C."""
    if controller.word.precision == FIXED:
        return {"SATURATED": SATURATED} | (
            {"STATE_SATURATED": STATE_SATURATED} if controller.word.law.order else {}
        )
    refused = {"INPUT_ERROR": INPUT_ERROR, "OVERFLOW": OVERFLOW}
    return refused | ({"SATURATED": SATURATED} if math.isfinite(controller.limits[1]) else {})


def ports_of(task: ExportTask, controller: Controller, *known: dict[str, str]) -> list[Port]:
    """The inputs of the C function: signals, references, and the feedforward."""
    word = controller.word
    ranges = controller.ranges
    if controller.hub and RATE in ranges:
        steps = f", at most {ranges[RATE] * controller.hub[1]!r} a sample"
    else:
        steps = ""
    over = ", over {!r}".format if word.precision == FIXED else lambda size: ""
    found = []
    for title, names in zip(("", "reference of "), known, strict=True):
        for name, own in names.items():
            size = ranges.get(name, 1.0)
            text = (
                f"{title}{name} [{OUTPUTS[name.partition('@')[0]].unit}]{steps * (name == ANGLE)}{over(size)}"
            )
            found.append(Port(own, text, size))
    text = f"{FEEDFORWARD} [{task.case.arm.input_unit}]{over(word.output)}"
    return [*found, Port(FEEDFORWARD, text, word.feedforward)]


def self_test_values(
    run: Callable[[NDArray[Any]], tuple[NDArray[Any], Whole]], ports: Sequence[Port], precision: str
) -> dict[str, Any]:
    """Values of the template of a self-test, whose inputs are those of a linear congruential generator."""
    # a thousand samples, one of them refused for a NaN
    samples = 1000
    refused = 500
    seed = 1
    places = range(samples * len(ports))
    _, *numbers = accumulate(places, lambda last, _: (1664525 * last + 1013904223) % 2**32, initial=seed)
    inputs: NDArray[Any] = np.array(numbers, dtype=np.int64).reshape(samples, -1)
    if precision == FIXED:
        inputs = inputs - 2**31
    else:
        kind = FLOATS[precision][0]
        sizes = np.array([each.size for each in ports], kind)
        inputs = (sizes * ((inputs >> 8) / 2.0**23 - 1).astype(kind)).astype(float)
        inputs[refused, 0] = np.nan
    outputs, status = run(inputs)
    sizes_in_c, recorded_in_c = (
        [literal(each, REAL[precision][1]) for each in values]
        for values in ([each.size for each in ports], outputs.tolist())
    )
    return {
        "sizes": sizes_in_c,
        "refused": refused,
        "seed": seed,
        "recorded": recorded_in_c,
        "status": status.tolist(),
    }
