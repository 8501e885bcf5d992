"""An exported controller in C: equal to Python bit for bit, equal to the simulation, refused where it cannot run."""

import math
import re
import subprocess
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.exported.cases import CASES, GAINS, IDEAL, LAB, readings, realised, task_of
from tests.exported.compilers import build, needed, random_inputs, run, stepped
from tests.shared import thinned
from tfarm.case import Case
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.simulate import Simulator
from tfarm.errors import ParameterError
from tfarm.exported.controller import c_controller
from tfarm.exported.kernel import Status
from tfarm.exported.result import write_into

PRECISIONS = ("double", "float", "q31")
NOT_FIXED = ("estimate", "windup")
RUNS = [each for each in product(CASES, PRECISIONS) if each[1] != "q31" or each[0] not in NOT_FIXED]
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
@pytest.mark.parametrize("case", CASES)
def test_the_code_is_the_simulation(case, precision):
    """Fed with the signals of a simulated slew it has that simulation's torque, in the last bit; shaped ones are
    references before the shaper, whose sums NumPy rounds in another order."""
    arm, law, chain = CASES[case]
    arithmetic = {"double": "float64", "float": "float32"}[precision]
    chain = replace(chain, converters=replace(chain.converters, arithmetic=arithmetic))
    task = task_of((arm, law, chain), precision)
    controller, _ = realised(task)
    slew = slew_scenario(arm, chain, 1.5)
    own = Simulator(Case(arm, controller.word.rounded_law, chain), slew.through(task.impulses), count=6)
    done = own.run()
    signals = readings(done)
    columns = [signals[name] for name in controller.signals]
    columns += [slew.references[name] for name in controller.references]
    kind = np.float64 if precision == "double" else np.float32
    if case == "estimate" and precision == "float":
        kind = np.float64  # the simulation estimates the rate from the angle in float64
    inputs = np.stack([*columns, slew.feedforward], axis=1).astype(kind).astype(float)
    outputs, _ = controller.run(inputs)
    late = round(law.delay / chain.sampling.period) if isinstance(law, tfarm.Law) else 0
    off = abs(outputs[late:] - done.torque[: len(outputs) - late]).max()
    assert off <= (case == "shaped") * 64 * np.finfo(kind).eps * abs(done.torque).max()
    assert abs(done.torque).max() > 0.1


def test_the_status_names_a_clipped_output_and_the_header_its_limits(tmp_path):
    """Inputs within their ranges ask for K1 20 = 6 N m and for 5 + K1 5 = 6.5 N m of an output of 5 N m."""
    ranges = {"hub_rate": 10.0, "root_moment": 2.0, "output": 5.0}
    task = task_of((LAB, GAINS, IDEAL), "q31", ranges=ranges)
    found = c_controller(task)
    write_into(tmp_path, found.contents)
    low, high = -(2**31), 2**31 - 1
    # hub rate, root moment, their references, feedforward
    inputs = np.array([[low, 0, high, 0, 0], [-(2**30), 0, 0, 0, high], [low, 0, 0, 0, 0]])
    out, status = stepped(tmp_path, realised(task)[0], inputs, "gcc", "-O2")
    assert status.tolist() == [3, 3, 0]
    assert (out / 2.0**31 * 5).tolist() == pytest.approx([5.0, 5.0, 3.0], abs=2 * found.details.error)
    assert found.details.largest_output == pytest.approx(5.0 + 0.3 * 20.0 + 0.3 * 4.0)
    header = found.contents["controller.h"].decode()
    assert f" *   saturation: saturates from -5.0 down and from {high / 2.0**31 * 5!r} up\n" in header
    assert "controller_SATURATED where it clipped the output.\n" in header
    for line in ("y_hub_rate: hub_rate [rad/s], over 10.0, within +-10.0", "samples of these bounds: all",
                 "r_root_moment: reference of root_moment [N m], over 2.0, within +-2.0",
                 "feedforward: feedforward [N m], over 5.0, within +-5.0"):  # fmt: skip
        assert f" *   {line}\n" in header


def test_an_output_that_no_input_clips_is_certified():
    ranges = {"hub_rate": 10.0, "root_moment": 2.0, "output": 16.0, "feedforward": 5.0}
    found = c_controller(task_of((LAB, GAINS, IDEAL), "q31", ranges=ranges)).details
    assert found.saturation.startswith("excluded for inputs within their ranges (limits -16.0 and 15.99")
    assert found.largest_output == pytest.approx(12.2)


def test_back_calculation_keeps_the_integral_near_its_limit(exported):
    """The output leaves its limit soon after a constant error turns, which the integral alone does 20 s later."""
    arm, law, chain = CASES["windup"]
    left = []
    for Tt in (law.anti_windup, 0.0):
        controller, _ = realised(task_of((arm, replace(law, anti_windup=Tt), chain)))
        inputs = np.zeros((4000, controller.inputs))
        inputs[:, len(controller.signals)] = np.where(np.arange(4000) < 2000, 2.0, -2.0)
        outputs, status = controller.run(inputs)
        assert (status[50:2000] == Status.SATURATED).all()
        left.append(int(np.argmax(outputs[2010:] < 0.5)))
    assert left[0] == 0
    details = c_controller(task_of("windup")).details
    assert details.overflow == "not determined: back-calculation acts while the output is clipped"
    assert (details.largest_output, details.error) == (None, None)
    with pytest.raises(ParameterError, match="anti_windup"):
        c_controller(task_of("windup", "q31"))


def test_a_state_that_saturates_is_named(exported):
    """The integral of a constant error, which ends at 4 to 8 times the range of the output, and no other state."""
    _, controller = exported("integral", "q31")
    inputs = np.zeros((4000, controller.inputs), np.int64)
    inputs[:, controller.signals.index("hub_angle")] = -(2**31)
    inputs[:, 3 + controller.references.index("hub_angle")] = 2**31 - 1
    _, status = controller.run(inputs)
    first = int(np.argmax(status == 4))
    # 0.2 s^-1 of 6 rad and an output of 2 N m
    assert 4 * 2.0 <= 0.2 * 6.0 * 0.01 * first <= 8.1 * 2.0
    assert (status[:first] != 4).all()
    assert (status[first:] == 4).all()


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


ADVISORY = (  # rules of MISRA C 2012
    "1.2 2.3 2.4 2.5 2.6 2.7 4.2 5.9 8.7 8.9 8.11 8.13 10.5 11.4 11.5 12.1 12.3 12.4 13.3 13.4 15.1 15.4 15.5 17.5 "
    "17.8 18.4 18.5 19.2 20.1 20.5 21.12"
)
TESTS_ONLY = {"self_test.c": {"21.6", "21.16"}, "example.c": {"21.6"}}  # they print, and compare bits


@pytest.mark.parametrize(("case", "precision"), thinned(RUNS, 4))
def test_the_source_keeps_the_required_rules_of_misra_c(exported, case, precision):
    """By cppcheck, which finds nothing else; and every branch and loop has braces."""
    folder, _ = exported(case, precision)
    checks = ("--std=c99", "--quiet", "--enable=warning,performance,portability")
    files = [folder / name for name in ("controller.c", "self_test.c", "example.c")]
    run(needed("cppcheck"), *checks, "--error-exitcode=1", *files)
    for file in files:
        heads = re.findall(r"^\s*(?:\} )?(?:if|else|for|while)\b.*$", file.read_text(encoding="ascii"), re.MULTILINE)
        assert heads
        assert all(line.endswith("{") for line in heads)
    for file in files if (case, precision) == RUNS[0] else files[:1]:
        words = ["cppcheck", "--addon=misra", "--std=c99", "--enable=style", "--quiet", str(file)]
        done = subprocess.run(words, capture_output=True, timeout=60, check=False)
        found = set(re.findall(r"misra-c2012-([\d.]+)\]", done.stderr.decode()))
        assert found & {"12.3", "8.9"}  # it ran
        assert found - {*ADVISORY.split()} - TESTS_ONLY.get(file.name, set()) == set()
