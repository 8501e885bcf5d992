"""What the C function returns under its worst inputs, against the law in whole numbers of 400 binary digits.

    python -m tests.exported.worst SIZE SEED

Laws in s and z, ill-conditioned ones among them, with and without a DAC, limits, delays and an estimated hub rate, in
double, float and Q31.  Inputs are at the ends of their ranges with the signs of the responses of the error and of the
output, random, and constant; the feedforward is at its ends, random, or halfway between two steps of the DAC.  No error
may be above the bound of the header, and the status has to name each clipped output.
"""

import warnings
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np

import tfarm
from tests import survey
from tests.exported.cases import IDEAL, LAB, realised
from tests.exported.laws import some_law
from tests.survey import Finding
from tfarm.arm.law import REFERENCE
from tfarm.case import Case
from tfarm.dsp import Actuator, Converters, ReferenceShaping
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.exported.controller import in_z, word_length
from tfarm.exported.kernel import Status
from tfarm.exported.result import ExportTask

DIGITS = 400  # binary, after the point
KINDS = {"double": np.float64, "float": np.float32}
WHOLE = np.vectorize(lambda value: round(Fraction(value) * 2**DIGITS), otypes=[object])


def some_chain(rng):
    """A chain with, at times, a DAC, a range or a limit of the output, an estimated hub rate, and a shaper."""
    bits = int(rng.integers(6, 17)) if rng.random() < 0.5 else None
    span = float(rng.uniform(0.3, 5.0)) if bits or rng.random() < 0.3 else None
    limit = float(rng.uniform(0.2, 4.0)) if rng.random() < 0.3 else np.inf
    rate = {"encoder_counts": 8192, "hub_rate": "difference", "rate_filter": float(rng.choice([20.0, 200.0, np.inf]))}
    converters = Converters(torque_bits=bits, torque_range=span, **(rate if rng.random() < 0.3 else {}))
    shaping = ReferenceShaping(shaper=str(rng.choice(["none", "none", "ZV", "EI"])), modes=int(rng.integers(1, 3)))
    return replace(IDEAL, converters=converters, actuator=Actuator(torque_limit=limit), reference=shaping)


def some_task(rng):
    """The task of a law, one in five in z with a multiple pole, without its arithmetic."""
    law = some_law(rng)
    if rng.random() < 0.2:
        pole, order = rng.uniform(0.3, 0.95), int(rng.integers(2, 7))
        den = np.poly(np.full(order, pole)).tolist()
        law = tfarm.Law({law.signals[0]: ([0.1 * (1 - pole) ** order], den)}, period=IDEAL.sampling.period)
    elif rng.random() < 0.2:
        # a part of its own for the reference of the hub angle
        A, B, C = np.diag(rng.uniform(-0.5, 0.98, 3)), rng.normal(size=(3, 2)), 0.1 * rng.normal(size=(1, 3))
        names = ["root_moment", f"{REFERENCE}hub_angle"]
        law = tfarm.Law.of_matrices(A, B, C, [[0.2, 0.1]], names, period=IDEAL.sampling.period)
    law = replace(law, delay=IDEAL.sampling.period * int(rng.integers(0, 3)))
    chain, names = some_chain(rng), [*law.signals]
    if chain.converters.hub_rate == "difference" and "hub_rate" in names and rng.random() < 0.5:
        names.remove("hub_rate")  # only the angle has a range
        names.append("hub_angle")
    ranges = {name: float(rng.uniform(0.1, 10.0)) for name in dict.fromkeys(names)}
    ranges["output"] = chain.converters.torque_range or float(rng.uniform(0.5, 5.0))
    ranges["feedforward"] = ranges["output"] * float(rng.choice([1.0, 0.3]))
    return ExportTask(case=Case(LAB, law, chain), what="controller", form="c", ranges=ranges, anyway=True)


def shaped(task, controller, inputs):
    """Whole inputs (n, k), references and feedforward through the impulses of their shaper."""
    found, impulses = inputs.copy(), WHOLE(task.impulses)
    for j in range(len(controller.signals), controller.inputs):
        found[:, j] = np.convolve(inputs[:, j], impulses)[: len(inputs)] >> DIGITS
    return found


def columns_of(task, controller, inputs):
    """Whole numbers e (n, columns) of whole inputs (n, k) behind a shaper, by the definition of the law."""
    law, names = task.case.law, [*controller.signals, *controller.references]
    count, known = len(controller.signals), {}
    for j, name in enumerate(names):
        known[name, j >= count] = inputs[:, j]
    if controller.hub:
        T = Fraction(task.case.chain.sampling.period)
        with mpmath.workprec(2 * DIGITS):
            pole = int(
                mpmath.nint(mpmath.exp(-mpmath.mpf(task.case.chain.converters.rate_filter) * float(T)) * 2**DIGITS)
            )
        angle, rate, found = known["hub_angle", False], 0, []
        for now, before in zip(angle, [angle[0], *angle[:-1]], strict=True):
            step = (now - before) * T.denominator // T.numerator
            rate = (pole * rate + (2**DIGITS - pole) * step) >> DIGITS
            found.append(rate)
        known["hub_rate", False] = np.array(found, dtype=object)
    signals = [known.get((name, True), 0) * (name in law.references) - known[name, False] for name in law.signals]
    wanted = [-known[name.removeprefix(REFERENCE), True] for name in law.wanted]
    return np.stack([*signals, *wanted], axis=1)


def output_of(law, e):
    """C x + D e in whole numbers (n,)."""
    matrices = law.matrices((*law.signals, *law.wanted))
    A, B, C, D = (WHOLE(each) if each.size else each.astype(object) for each in matrices)
    x, found = np.zeros(len(A), dtype=object), []
    for row in e:
        found.append((((C @ x)[0] if len(x) else 0) + (D @ row)[0]) >> DIGITS)
        x = (A @ x + B @ row) >> DIGITS if len(x) else x
    return np.array(found, dtype=object)


def responses(task, controller, steps):
    """Responses (steps, inputs but the feedforward) of the output, and of its error by the rounded coefficients."""
    found = []
    for law in (controller.word.law, controller.word.rounded_law):
        A, B, C, D = law.matrices((*law.signals, *law.wanted))
        x, h = B, [D[0]]
        for _ in range(steps - 1):
            h.append((C @ x)[0])
            x = A @ x
        found.append(np.array(h))
    place = np.zeros((len(controller.plan), controller.inputs + 2))
    for column, (minuend, subtrahend) in enumerate(controller.plan.tolist()):
        place[column, minuend] += 1.0
        place[column, subtrahend] -= 1.0
    h = np.array(found) @ place
    if controller.hub:  # of the angle: that of differences, of the rate's size
        h[:, 1:, controller.signals.index("hub_angle")] += np.diff(h[:, :, controller.inputs], axis=1)
    return h[1, :, : controller.inputs - 1], (h[1] - h[0])[:, : controller.inputs - 1]


def worst_inputs(rng, task, controller, steps):
    """Shares of the ranges (n, inputs) of several runs, the feedforward last."""
    k = controller.inputs - 1
    of_output, of_error = responses(task, controller, steps)
    shares = [np.sign(of_error[::-1]), np.sign(of_output[::-1]), np.where(rng.random((steps, k)) < 0.5, -1.0, 1.0)]
    shares += [rng.uniform(-1, 1, (steps, k)), np.tile(rng.choice([-1.0, 1.0], k), (steps, 1))]
    for share in shares:
        ends = np.full(steps, rng.choice([-1.0, 1.0]))
        yield np.c_[share, ends if rng.random() < 0.5 else rng.uniform(-1, 1, steps)]


def in_kind(controller, values, sizes):
    """Inputs in the kind of the arithmetic, none beyond its range, and the same as fractions."""
    word = controller.word
    if word.precision == "q31":
        scales = [*(Fraction(size) for size in sizes[:-1]), Fraction(word.output)]
        share = np.array([Fraction(size) / scale for size, scale in zip(sizes, scales, strict=True)], dtype=float)
        most = np.floor(share * 2.0**31)
        whole = np.clip(np.rint(values / sizes * share * 2.0**31), -most, np.minimum(most, 2**31 - 1)).astype(np.int64)
        units = [scale / 2**31 for scale in scales]
        return whole, np.array([[int(x) * unit for x, unit in zip(row, units, strict=True)] for row in whole], object)
    kind = KINDS[word.precision]
    own = np.clip(values, -sizes, sizes).astype(kind)
    own = np.where(abs(own.astype(float)) > sizes, np.nextafter(own, kind(0)), own).astype(float)
    return own, own


def judged(rng, task, kind):
    """The finding of one law in one arithmetic."""
    task = replace(task, precision=kind)
    if kind == "q31" and task.case.chain.converters.hub_rate == "difference":
        converters = replace(task.case.chain.converters, hub_rate="ideal")
        task = replace(task, case=task.case.through(replace(task.case.chain, converters=converters)))
    task = replace(task, ranges={name: size for name, size in task.ranges.items() if is_known(task, name)})
    if kind == "q31":
        names = [*task.case.law.signals, *(name.removeprefix(REFERENCE) for name in task.case.law.wanted)]
        task = replace(task, ranges=dict.fromkeys(names, 1.0) | dict(task.ranges))
    try:
        controller, _ = realised(task)
    except ConvergenceError:
        return None
    except ParameterError as refusal:
        is_named = "ill-conditioned or unstable in z" in str(refusal)
        return Finding(f"{kind}, refused", "" if is_named else str(refusal), not is_named)
    found, bounds = word_length(controller, "", [], None), controller.word.bounds
    if found.error is None:
        return Finding(f"{kind}, not determined")
    names = [*controller.signals, *controller.references]
    word = controller.word
    sizes = np.array(
        [*(controller.ranges.get(name, 1.0) for name in names), controller.ranges.get("feedforward", word.output)]
    )
    share, reach, words = 0.0, 0.0, ""
    for shares in worst_inputs(rng, task, controller, 300):
        values = shares * sizes
        if controller.hub and "hub_rate" in controller.ranges:  # differences within that range
            at, most = controller.signals.index("hub_angle"), controller.ranges["hub_rate"] * controller.hub[1] / 2
            values[:, at] = np.clip(values[:, at], -most, most) * (1 - 1e-6)
        values[:, -1] = halfway(rng, task, controller, values, sizes)
        own, exact = in_kind(controller, values, sizes)
        law = in_z(task.case)
        whole = shaped(task, controller, WHOLE(exact))
        truth = output_of(law, columns_of(task, controller, whole)) + whole[:, -1]
        size, level, fault = compared(controller, own, truth, bounds.error)
        share, reach, words = max(share, size), max(reach, level / bounds.output), words or fault
    is_wrong = bool(words) or share > 1 or reach > 1
    words = (
        f"{kind} {task.case.law!r} {task.case.chain.converters!r}: {share:.4g} of the bound, {words}"
        if is_wrong
        else ""
    )
    outcome = f"{kind}{', DAC' if controller.dac[0] else ''}{', estimate' if controller.hub else ''}"
    outcome += ", shaper" * bool(controller.shaped)
    return Finding(outcome, words, is_wrong, {f"error over bound, {outcome}": share, "output over its bound": reach})


def is_known(task, name):
    """Whether a range is of this task: a hub angle is an input of an estimate too."""
    is_estimated = task.case.chain.converters.hub_rate == "difference" and "hub_rate" in task.case.law.signals
    return name in (*task.case.law.signals, "output", "feedforward") or (name == "hub_angle" and is_estimated)


def halfway(rng, task, controller, values, sizes):
    """The feedforward; every second time such that the output is next to the middle of two steps of the DAC."""
    step, r = float(controller.dac[0]), values[:, -1].copy()
    if not step or rng.random() < 0.5:
        return r
    _, exact = in_kind(controller, values, sizes)
    whole = shaped(task, controller, WHOLE(exact))
    u = output_of(in_z(task.case), columns_of(task, controller, whole))
    u = np.array([float(Fraction(int(each), 2**DIGITS)) for each in u])
    middle = (np.rint((u + r) / step - 0.5) + 0.5) * step * (1 + rng.choice([-1e-7, 0.0, 1e-7], r.size))
    return np.where(abs(middle - u) <= sizes[-1], middle - u, r)


def compared(controller, inputs, truth, bound):
    """The largest error over its bound, the largest output of the law, and a fault of the status in words."""
    outputs, status = controller.run(inputs)
    unit = Fraction(controller.word.output) / 2**31 if controller.word.precision == "q31" else 1
    low, high = (round(Fraction(each) * 2**DIGITS) if np.isfinite(each) else None for each in controller.limits)
    late, most, level, fault = controller.delay, 0.0, 0.0, ""
    for k, u in enumerate(truth.tolist()):
        inside = u if low is None else min(max(u, low), high)
        if k + late < len(outputs):
            own = round(Fraction(outputs[k + late].item()) * unit * 2**DIGITS)
            most = max(most, float(Fraction(abs(own - inside), 2**DIGITS)) / bound)
        beyond, level = float(Fraction(u - inside, 2**DIGITS)), max(level, abs(float(Fraction(u, 2**DIGITS))))
        margin = bound if low is None else float(Fraction(min(inside - low, high - inside), 2**DIGITS))
        if abs(beyond) > bound and status[k] not in (Status.SATURATED, Status.STATE_SATURATED):
            fault = fault or f"status {status[k]} of a clipped output at {k}"
        if status[k] not in (0, Status.STATE_SATURATED) and (status[k] != Status.SATURATED or margin > bound):
            fault = fault or f"status {status[k]} without a reason at {k}"
        if status[k] == Status.STATE_SATURATED:
            break
    return most, level, fault


def worst(size, seed):
    """`size` laws, each in the three arithmetics."""
    rng = np.random.default_rng(seed)
    for _ in range(size):
        task = some_task(rng)
        for kind in ("double", "float", "q31"):
            with warnings.catch_warnings(action="error", category=RuntimeWarning):
                found = judged(rng, task, kind)
            if found is not None:
                yield found


if __name__ == "__main__":
    survey.main(worst)
