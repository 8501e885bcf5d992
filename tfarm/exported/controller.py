"""A sampled controller as C99: header, source, self-test and an example of a main loop.

    e = reference - signal,  u = feedforward + C x + D e,  x = A x + B e

in double, float or Q31, in the realisation with the least round-off noise, with the DAC, the limit of the actuator, the
delay of the law, and the shaper of references and feedforward as the simulation has them.  The loop is judged with the
coefficients as they are exported.  A step refuses inputs that are not finite, and results that are not: it holds the
output and keeps the states.  Its status names a clipped output and, in fixed point, a clipped state.
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
from tfarm.dsp.discretise import back_calculation, discretise_law, system_matrix
from tfarm.dsp.kernel import DAC
from tfarm.dsp.simulate import quantisers
from tfarm.errors import must_be_known, require
from tfarm.exact.outputs import OUTPUTS
from tfarm.exported.kernel import Status, numbers_of, run_fixed, run_real
from tfarm.exported.realisations import NoiseGain, least_noise, with_system_matrix
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
    ShaperCode,
    Word,
    shaper_code,
    word_of,
)
from tfarm.records import frozen
from tfarm.schema import Quantity

CONSUMER = Consumer(
    "export c",
    acts=(
        "anti-alias filter",
        "hub rate",
        "shaper",
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

# in C
REAL = {"double": ("double", "", "DBL_MAX"), "float": ("float", "f", "FLT_MAX"), FIXED: ("int32_t", "", "")}


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
    period [s] of an estimated hub rate.  `back` is that of `back_calculation`, in the numbers of the target.
    """

    word: Word
    signals: tuple[str, ...]
    references: tuple[str, ...]
    ranges: Mapping[str, float]
    dac: Real
    delay: int
    hub: tuple[float, float] | None
    back: Real
    shaper: ShaperCode

    @cached_property
    def plan(self) -> Whole:
        """The two inputs whose difference is e of each column, as `run_real` has them: references less signals."""
        law = self.word.law
        signals = {name: n for n, name in enumerate(self.signals)}
        wanted = {name: n for n, name in enumerate(self.references, start=len(signals))}
        if self.hub:
            signals[RATE] = self.inputs
        zero = self.inputs + 1
        rows = [(wanted[name] if name in law.references else zero, signals[name]) for name in law.signals]
        rows += [(zero, wanted[name.removeprefix(REFERENCE)]) for name in law.wanted]
        return np.array(rows)

    @property
    def inputs(self) -> int:
        """The number of inputs, the last of which is the feedforward."""
        return len(self.signals) + len(self.references) + 1

    @property
    def shaped(self) -> int:
        """The number of inputs through the shaper, the last ones: references and feedforward."""
        return len(self.references) + 1 if self.shaper.lags.size else 0

    @property
    def whole_dac(self) -> Whole:
        """The converter in fixed point: shift of its step, 0 for none, lowest and highest output."""
        step, low, high = self.dac / self.word.output * 2.0**31
        limits = np.clip([np.ceil(low), np.floor(high)], -(2**31), 2**31 - 1)
        shift = round(math.log2(max(step, 1.0)))
        return np.array([shift, *limits], dtype=np.int64)

    @property
    def limits(self) -> list[float]:
        """The lowest and the highest output that the code returns, in SI units."""
        if self.word.precision == FIXED:
            return [each * self.word.output / 2.0**31 for each in self.whole_dac[1:].tolist()]
        return [float(each) for each in self.dac[1:].astype(FLOATS[self.word.precision][0])]

    def run(self, inputs: NDArray[Any]) -> tuple[NDArray[Any], Whole]:
        """Return outputs and status (n,) of inputs (n, k), those of the C code bit for bit.

        Whole numbers in fixed point.
        """
        word = self.word
        is_fixed = word.precision == FIXED
        kind = np.int64 if is_fixed else np.float64
        outputs = np.zeros(len(inputs), kind)
        status = np.zeros(len(inputs), int)
        table = np.ascontiguousarray(word.table, dtype=kind)
        inputs = np.ascontiguousarray(inputs, dtype=kind)
        if is_fixed:
            through = (self.shaper.lags, self.shaper.sizes, self.shaped, self.shaper.shift)
            run_fixed(table, word.shifts, self.plan, inputs, self.whole_dac, *through, outputs, status)
        else:
            hub = np.array([self.signals.index(ANGLE), *self.hub] if self.hub else [-1.0, 0.0, 1.0])
            is_single = word.precision == "float"
            through = (self.shaper.lags, self.shaper.sizes, self.shaped, is_single)
            run_real(table, self.plan, inputs, self.dac, self.back, hub, *through, outputs, status)
        # a refused sample moves no delay line: the output is held
        is_good = ~np.isin(status, (Status.INPUT_ERROR, Status.OVERFLOW))
        line = np.r_[np.zeros(1 + self.delay, kind), outputs[is_good]]
        return line[np.cumsum(is_good)], status


def c_controller(task: ExportTask) -> Export:
    """Return the files of a controller in C99, and its finite word length.

    Raises ParameterError where the loop with the coefficients as exported is not certified stable, unless `anyway`.
    """
    law = in_z(task.case)
    law, name, gains = least_noise(law, task.analysis(task.case).verdict.loop)
    controller = controller_of(law, task)
    word = controller.word
    case = task.case.under(word.rounded_law)
    found = task.judge(
        case, "precision", task.precision, f"rounded to {task.precision} the loop", "take more digits"
    )
    details = word_length(controller, name, gains, word.limit_cycle(found.verdict.loop))
    bounds = dict(facts_of(details)) | ({} if details.samples else {"samples of these bounds": "all"})
    contents, names = source_files(task, controller, [*task.facts(case, found).items()], [*bounds.items()])
    return task.export_of(contents, names, found.verdict.sentence, details)


def word_length(
    controller: Controller, name: str, gains: list[NoiseGain], limit_cycle: float | None
) -> WordLength:
    """Return the record of a controller's arithmetic, in the realisation of this name."""
    word = controller.word
    low, high = controller.limits
    bounds = word.bounds
    is_clipped = bounds.output + bounds.error > min(-low, high)
    unknown = "not determined: the law is unstable or ill-conditioned in z"
    if is_clipped and controller.back.size > 2:
        unknown = "not determined: back-calculation acts while the output is clipped"
        bounds = bounds._replace(states=np.inf + bounds.states, output=math.inf, error=math.inf)
    samples = None if bounds.is_whole else MOST_SUMMED
    excluded = "excluded for inputs within their ranges"
    if samples:
        excluded += f", for {samples} samples"
    # in fixed point the scale of a state
    largest = 1.0 if word.precision == FIXED else float(np.finfo(FLOATS[word.precision][0]).max)
    overflow = "not excluded: a state may saturate, and the bounds hold until it does"
    if bounds.output == math.inf:
        overflow = unknown
    elif max(bounds.states, default=0.0) < largest:
        overflow = excluded
    saturation = "no limit" if high == math.inf else f"saturates from {low!r} down and from {high!r} up"
    if bounds.output + bounds.error <= min(-low, high) < math.inf:
        saturation = f"{excluded} (limits {low!r} and {high!r})"
    return WordLength(
        precision=word.precision,
        realisation=name,
        noise_gains=gains,
        largest_states=tuple(bounds.states.tolist()),
        overflow=overflow,
        largest_output=finite_or_none(bounds.output),
        saturation=saturation,
        error=finite_or_none(bounds.error),
        samples=samples,
        limit_cycle=limit_cycle,
    )


def finite_or_none(bound: float) -> float | None:
    """Return a bound, None where there is none."""
    return bound if bound < math.inf else None


def source_files(
    task: ExportTask,
    controller: Controller,
    facts: Sequence[tuple[str, str]],
    bounds: Sequence[tuple[str, str]] = (),
) -> tuple[dict[str, bytes], list[Name]]:
    """Return the files that begin with these facts, by name, and the identifiers in them, that of the controller first.

    `bounds` are stated with the ranges of the inputs.
    """
    name = name_in_c(task.name or "controller")
    signals = identifiers(controller.signals, "y_")
    references = identifiers(controller.references, "r_")
    values = template_values(task, controller, ports_of(task, controller, signals, references))
    (own,) = name.values()
    values |= {"name": own, "facts": facts, "bounds": bounds}
    files = ("controller.h", "controller.c", "self_test.c", "example.c")
    return {file: render_source(file, **values) for file in files}, names_of(name, signals, references)


def in_z(case: Case) -> Law:
    """Return the law of a case in z, of one state space.

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
    """Return a realised law in the numbers of a task.  Raises ParameterError as `word_of` does."""
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
    shaper = shaper_code(task.impulses, task.precision)
    word = word_of(law, task.precision, ranges, float(dac[0]), hub, shaper)
    # in fixed point a step of the DAC is a power of 2 of those of the output
    steps = math.log2(max(1.0, float(dac[0]) / word.output * 2.0**31))
    remedy = f"q31 has steps of a DAC that are a power of 2 of its own: output={limit!r}, or this times a power of 2"
    require(task.precision != FIXED or steps.is_integer(), "range.output", word.output, remedy)
    back = back_calculation(law, dac[1:])
    remedy = "back-calculation is in double or float; for q31 set it to 0"
    is_exported = back.size == 2 or task.precision != FIXED
    require(is_exported, "law.anti_windup", law.anti_windup, remedy)
    if task.precision != FIXED:
        back = back.astype(FLOATS[task.precision][0]).astype(float)
    return Controller(word, signals, references, ranges, dac, round(law.delay / T), hub, back, shaper)


# ------------------------------------------------------------ values of the templates


def template_values(task: ExportTask, controller: Controller, ports: Sequence[Port]) -> dict[str, Any]:
    """Return the values of the templates, but for name and facts."""
    word = controller.word
    is_fixed = task.precision == FIXED
    real, suffix, largest = REAL[task.precision]
    arm = task.case.arm
    dac = controller.whole_dac if is_fixed else controller.dac
    unit = arm.input_unit
    cast, zero = ("(int64_t)", "") if is_fixed else ("", f"0.0{suffix}")
    known = [f"{cast}input->{each.identifier}" for each in ports]
    shaper = controller.shaper
    first = len(ports) - controller.shaped
    known[first:] = [f"r[{n}]" for n in range(controller.shaped)]
    known += [f"({real})rate", zero]
    return {
        "fixed": is_fixed,
        "real": real,
        "wide": "int64_t" if is_fixed else real,
        "largest": largest,
        "suffix": suffix,
        "cast": cast,
        "fields": ports,
        "shaped": ports[first:],
        "length": max(shaper.lags.tolist(), default=0) + 1,
        "lags": shaper.lags.tolist(),
        "impulses": [literal(each, suffix) for each in shaper.sizes.tolist()],
        "shift": shaper.shift,
        "feedforward": known[len(ports) - 1],
        **self_test_values(controller.run, ports, task.precision),
        "header": "controller.h",
        "n": word.law.order,
        "m": len(controller.plan),
        "shifts": word.shifts,
        "table": [[literal(x, suffix) for x in row] for row in word.table.tolist()],
        "errors": [f"{known[of]} - {known[less]}".strip() for of, less in controller.plan.tolist()],
        "converter": bool(np.isfinite(dac).all()),
        "back": [literal(each, suffix) for each in controller.back.tolist()]
        if controller.back.size > 2
        else None,
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
    """Return the numbers that a step can return but 0, by their names in C."""
    if controller.word.precision == FIXED:
        found = [Status.SATURATED]
        if controller.word.law.order:
            found.append(Status.STATE_SATURATED)
        return numbers_of(*found)
    found = [Status.INPUT_ERROR, Status.OVERFLOW]
    if math.isfinite(controller.limits[1]):
        found.append(Status.SATURATED)
    return numbers_of(*found)


def ports_of(task: ExportTask, controller: Controller, *known: dict[str, str]) -> list[Port]:
    """Return the inputs of the C function: signals, references, and the feedforward."""
    word = controller.word
    ranges = controller.ranges
    steps = ""
    if controller.hub and RATE in ranges:
        steps = f", at most {ranges[RATE] * controller.hub[1]!r} a sample"
    over = ", over {!r}".format if word.precision == FIXED else lambda size: ""
    before = ", before the shaper" if controller.shaped else ""
    found = []
    for title, own_words, names in zip(("", "reference of "), ("", before), known, strict=True):
        for name, own in names.items():
            size = ranges.get(name, 1.0)
            unit = OUTPUTS[name.partition("@")[0]].unit
            step = steps if name == ANGLE else ""
            found.append(Port(own, f"{title}{name} [{unit}]{own_words}{step}{over(size)}", size))
    text = f"{FEEDFORWARD} [{task.case.arm.input_unit}]{before}{over(word.output)}"
    return [*found, Port(FEEDFORWARD, text, ranges.get(FEEDFORWARD, word.output))]


def self_test_values(
    run: Callable[[NDArray[Any]], tuple[NDArray[Any], Whole]], ports: Sequence[Port], precision: str
) -> dict[str, Any]:
    """Return values of the template of a self-test, whose inputs are those of a linear congruential generator."""
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
    _, suffix, _ = REAL[precision]
    return {
        "sizes": [literal(each.size, suffix) for each in ports],
        "refused": refused,
        "seed": seed,
        "recorded": [literal(each, suffix) for each in outputs.tolist()],
        "status": status.tolist(),
    }
