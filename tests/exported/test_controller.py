"""An exported controller in C: equal to Python bit for bit, equal to the simulation, refused where it cannot run."""

import math
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.exported.cases import CASES, realised, task_of
from tests.exported.compilers import build, needed, random_inputs, run, stepped
from tests.shared import thinned
from tfarm.dsp.scenarios import scenario
from tfarm.dsp.simulate import Simulator
from tfarm.exported.controller import c_controller
from tfarm.exported.result import write_into

PRECISIONS = ("double", "float", "q31")
RUNS = [(case, precision) for case in CASES for precision in PRECISIONS if (case, precision) != ("estimate", "q31")]
GCC, CLANG = ([(*each, compiler) for each in RUNS] for compiler in ("gcc", "clang"))


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The folder of each case in each arithmetic, and its controller, made once."""
    made = {}

    def of(case, precision):
        if (case, precision) not in made:
            task, folder = task_of(case, precision), tmp_path_factory.mktemp(f"{case}-{precision}")
            write_into(folder, c_controller(task).contents)
            made[case, precision] = folder, realised(task)[0]
        return made[case, precision]

    return of


@pytest.mark.parametrize(("case", "precision", "compiler"), [*thinned(GCC, 3), *thinned(CLANG, 6)])
def test_c_equals_python_bit_for_bit(exported, case, precision, compiler):
    """Saturated, quantised and refused samples too, with and without optimisation; the self-test agrees."""
    folder, controller = exported(case, precision)
    rng = np.random.default_rng(7)
    inputs = random_inputs(rng, controller, 20_000)
    if precision != "q31":
        for bad in (math.nan, math.inf, -math.inf):
            rows = rng.integers(0, len(inputs), 20)
            inputs[rows, rng.integers(0, controller.inputs, 20)] = bad
    outputs, status = controller.run(inputs)
    assert np.ptp(outputs) > 0
    for level in ("-O0", "-O2"):
        out, wrong = stepped(folder, controller, inputs, compiler, level)
        assert out.astype(outputs.dtype).tobytes() == outputs.tobytes()
        assert (wrong == status).all()
    assert run(build(folder, compiler, "-O2")).startswith(b"0 of 1000")
    assert run(build(folder, compiler, sources=("controller.c", "example.c"), out="example")).count(b"\n") == 10


def test_a_refused_sample_holds_the_output_and_keeps_the_state(exported):
    _, controller = exported("integral", "double")
    inputs = random_inputs(np.random.default_rng(1), controller, 60)
    with_nan = np.insert(inputs, 30, math.nan, axis=0)
    outputs, status = controller.run(with_nan)
    plain, _ = controller.run(inputs)
    assert status.tolist() == [0] * 30 + [1] + [0] * 30
    assert outputs[30] == outputs[29]
    assert (np.delete(outputs, 30) == plain).all()


@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("case", ["gains", "integral", "notch", "estimate"])
def test_the_code_is_the_simulation(case, precision):
    """Fed with the signals of a simulated slew it has that simulation's torque, in the last bit."""
    arm, law, chain = CASES[case]
    arithmetic = {"double": "float64", "float": "float32"}[precision]
    chain = replace(chain, converters=replace(chain.converters, arithmetic=arithmetic))
    controller, _ = realised(task_of((arm, law, chain), precision))
    slew = scenario("slew", arm, chain, 1.5)
    own = Simulator(arm, chain, slew, controller.word.rounded, count=6)
    done = own.run()
    angle, rate, moment = done.measured.T
    if chain.converters.encoder_counts:
        step = 2 * math.pi / chain.converters.encoder_counts
        angle = np.rint(angle / step) * step
        step = 2 * chain.converters.moment_range / 2**chain.converters.moment_bits
        moment = np.clip(np.rint(moment / step) * step, -2.0, 2.0 - step)
    signals = {"hub_angle": angle, "hub_rate": rate, "root_moment": moment}
    columns = [signals[name] for name in controller.signals]
    columns += [slew.references[name] for name in controller.references]
    kind = np.float64 if precision == "double" else np.float32
    if case == "estimate" and precision == "float":
        kind = np.float64  # the simulation estimates the rate from the angle in float64
    inputs = np.stack([*columns, slew.feedforward], axis=1).astype(kind).astype(float)
    outputs, _ = controller.run(inputs)
    late = round(law.delay / chain.sampling.period) if isinstance(law, tfarm.Law) else 0
    assert abs(outputs[late:] - done.torque[: len(outputs) - late]).max() == 0
    assert abs(done.torque).max() > 0.1


def test_the_source_has_no_allocation_and_no_function_of_another_library(exported):
    source = (exported("integral", "float")[0] / "controller.c").read_text(encoding="ascii")
    assert not re.search(r"\b(malloc|calloc|free|math\.h|goto|while|sin|cos|exp|fabs|rint|fma)\b", source)
    assert re.findall(r"#include [<\"](.*)[>\"]", source) == ["controller.h"]


@pytest.mark.parametrize(("case", "precision"), thinned(RUNS, 4))
def test_sanitizers_find_nothing_on_fuzzed_inputs(exported, case, precision):
    folder, controller = exported(case, precision)
    inputs = random_inputs(np.random.default_rng(3), controller, 20_000)
    if precision != "q31":
        inputs = inputs * 10.0 ** np.random.default_rng(4).integers(-320, 300, size=inputs.shape)
        with np.errstate(over="ignore"):
            inputs = inputs.astype(np.float32 if precision == "float" else float).astype(float)
    out, status = stepped(
        folder, controller, inputs, "gcc", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"
    )
    outputs, own = controller.run(inputs)
    assert out.astype(outputs.dtype).tobytes() == outputs.tobytes()
    assert (status == own).all()


@pytest.mark.parametrize(("case", "precision"), thinned(RUNS, 4))
def test_cppcheck_finds_nothing(exported, case, precision):
    folder, _ = exported(case, precision)
    words = [
        needed("cppcheck"),
        "--enable=warning,performance,portability",
        "--error-exitcode=1",
        "--std=c99",
        "--quiet",
    ]
    for file in ("controller.c", "self_test.c", "example.c"):
        done = subprocess.run([*words, str(folder / file)], capture_output=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
