"""Speed and accuracy, compared with other packages: `make bench`, kept in reports/bench.json.

Nothing here is a test: times depend on the machine, so they are medians of processor time in one process, in which
what is compared takes turns, on one thread of BLAS; those of commands are of processes of their own. Every timed call
is on an arm and a law that this process has not seen, so that no cache has anything of them; what is made beforehand
is named as prepared. The same calls on plausible arms drawn at random have a median and a worst.
"""

import itertools
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import control
import mpmath
import numpy as np

import tfarm
from tests.plausible.arms import draw
from tfarm.arm import Arm, HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, Simulator, scenario
from tfarm.dsp.pulse import pulse_transfer
from tfarm.ensemble.space import space_of
from tfarm.exact.appendix import Appendix
from tfarm.exact.outputs import output
from tfarm.fitting.runs import RigRun
from tfarm.loop.circle_crossings import sampled_map
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.loci import open_loop, reduced_locus
from tfarm.loop.locus import locus
from tfarm.loop.plane import gain_map
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.schema import to_dict
from tfarm.spectrum.proofs import enclose_zero
from tfarm.studies.quantities import column_names, values_of
from tfarm.studies.running import StudyPlan, chunk
from tfarm.tuner import Guard, Learning, initial_network, slew_trial, train

PACKAGES = ("tfarm", "numpy", "numba", "scipy", "mpmath", "python-flint", "control")
TURN = 2e-3  # seconds of a turn: as many calls as fill it
OUTPUTS = ("hub_angle", "root_moment", "tip_displacement")
DIGITS = 40
DRAWN = 20  # random arms for each call
PER_MODE = 9  # samples a period of the first mode of such an arm, as those of 10 ms of the arm of the laboratory


class Subject(NamedTuple):
    """What a call is on."""

    arm: Arm
    law: HubFeedback = HubFeedback(K1=0.3, K2=0.3)
    chain: Chain = Chain()


BARE, LAB, STOCKY = (Subject(tfarm.load(name)) for name in ("sasaki2012", "sasaki2012-lab", "stocky-steel"))
_numbers = itertools.count(1)  # of the subjects


def unseen(subject):
    """The subject with numbers of arm and law that no other one of this process has; they differ by 1e-12 a subject."""
    near, (arm, law, chain) = 1 + 1e-12 * next(_numbers), subject
    arm = replace(
        arm,
        link=replace(arm.link, length=near * arm.link.length, damping=near * arm.link.damping),
        hub=replace(arm.hub, inertia=near * arm.hub.inertia),
        payload=replace(arm.payload, mass=near * arm.payload.mass, inertia=near * arm.payload.inertia),
    )
    return Subject(arm, replace(law, K1=near * law.K1, K2=near * law.K2), chain)


def plausible(number):
    """The arm of that number at random, with its law, sampled as finely as its first mode takes."""
    case = draw(number, 0)
    chain = Chain(sampling=Sampling(period=2 * math.pi / case.first / PER_MODE))
    return Subject(case.arm, case.law, chain)


@dataclass(frozen=True)
class Row:
    """Median `seconds` for each of n points or modes, its ratio to `to`, and the largest error.

    `median` and `worst` are those of random arms.
    """

    what: str
    n: int
    seconds: float
    ratio: float | None = None
    to: str = ""
    error: float | None = None
    median: float | None = None
    worst: float | None = None


def seconds(call, subject):
    """Processor time of what `call` prepares for a subject that is not seen yet."""
    prepared = call(unseen(subject))
    start = time.process_time()
    prepared()
    return time.process_time() - start


def timed(calls, rounds, subject):
    """Seconds a call (calls, rounds); each returns, for a subject, the function that is timed."""
    number = [math.ceil(TURN / max(min(seconds(call, subject), seconds(call, subject)), 1e-9)) for call in calls]
    turns = list(zip(calls, number, strict=True))
    return np.array(
        [[sum(seconds(call, subject) for _ in range(many)) / many for call, many in turns] for _ in range(rounds)]
    ).T


def drawn(call, n):
    """Median and worst seconds a point or mode, of random arms; the better of two, as the first may load kernels."""
    subjects = [plausible(number) for number in range(DRAWN)]
    each = [min(seconds(call, subject), seconds(call, subject)) / n for subject in subjects]
    return {"median": float(np.median(each)), "worst": max(each)}


def alone(what, rounds, subject=LAB):
    """The row of a call that is compared with nothing."""
    call, n = CALLS[what]
    return Row(what, n, float(np.median(timed([call], rounds, subject))) / n, **drawn(call, n))


def response_error(arm, s, values):
    """The largest |error/G|/(1 + |s G'/G|), against 40 digits: the last factor forgives one rounding of s itself."""
    G = tfarm.transfer(arm, list(OUTPUTS))
    stiffness = abs(s * G.derivative(s) / G(s)).T
    with mpmath.workdps(DIGITS + 5):
        exact = [[mpmath.mpc(*pair) for pair in G.digits(complex(each), DIGITS)] for each in s]
        away = [
            [float(abs(a / b - 1)) for a, b in zip(*pair, strict=True)] for pair in zip(values.T, exact, strict=True)
        ]
    return float((np.array(away) / (1 + stiffness)).max())


# ------------------------------------------------------------------------------------- calls, each on a subject


def response(points):
    """Three outputs in one pass; prepared is the system of the arm."""
    s = axis(points)

    def prepared(subject):
        G = tfarm.transfer(subject.arm, list(OUTPUTS))
        G(s[:1])
        return lambda: G(s)

    return prepared


def axis(points):
    """Points on the imaginary axis."""
    return 1j * np.geomspace(0.1, 1e4, points)


def exponentials(points):
    """Two exponentials a point, less than which no exact response can take."""
    s = axis(points)
    exponents, room = [-np.sqrt(s) * each for each in (1.0, 1j)], np.empty_like(s)
    return lambda subject: lambda: [np.exp(each, out=room) for each in exponents]


def appendix(points):
    """The same by the paper's 4x4 system in mpmath."""
    wanted = [output(name) for name in OUTPUTS]

    def values(arm):
        with mpmath.workdps(30):
            systems = [Appendix(arm, each) for each in axis(points)]
            return [[at.value(each, mpmath.mpf(arm.length)) for each in wanted] for at in systems]

    return lambda subject: lambda: values(subject.arm)


def plane(law):
    """The gains of a map, about those of a law."""
    return abs(law.K1) * np.linspace(1 / 30, 50 / 3, 200), np.linspace(-0.5, 1.5, 200)


def simulator(subject):
    """A slew of 300 samples on a model of 20 modes."""
    _, chain = subject.arm, subject.chain
    return Simulator(
        Case(subject.arm, HubFeedback(), chain),
        scenario("slew", subject.arm, chain, 300 * chain.sampling.period),
        count=20,
    )


def another_law(subject):
    """The same slew under another law than the simulator has had."""
    made = simulator(subject)
    made.linear(subject.law)
    other = replace(subject.law, K2=subject.law.K2 / 2)
    return lambda: made.linear(other)


def along(subject, branches=20, points=500):
    """The root locus along K1."""
    return locus(subject.arm, HubFeedback(), "K1", 0.0, 100 / 3 * abs(subject.law.K1), points, branches)


def trial(subject):
    """Training over whole trials of 3 s, with the exact gradient of each; prepared is the trial."""
    made, guard = slew_trial(subject.arm), Guard("frozen", 0.0, 1.1, 6, False)
    return lambda: train(made, initial_network(0), guard, Learning(rule="plain"), 200)


def over(subject):
    """Payload and gain of a study."""
    return {
        "payload.mass": {"uniform": [0.0, 0.12 * subject.arm.own_mass]},
        "law.K2": {"uniform": sorted([0.0, 2 * subject.law.K2])},
    }


def study(ask, n, values):
    """The first rows of a study, by `values` of its plan; prepared is the plan."""

    def prepared(subject):
        plan = StudyPlan(Case(*subject), space_of(over(subject), draws=n, seed=0, posterior=None), column_names([ask]))
        return lambda: values(plan, n)

    return prepared


def rows_of(plan, n):
    """A study by the loop that anyone writes."""
    rows = plan.space.rows(0, n, None).tolist()
    return [values_of(plan.subjects.at(row), plan.sources) for row in rows]


def chunk_of(plan, n):
    """A study as tfarm computes it."""
    return chunk(plan, 0, n)


STUDIED = {"card": 5, "modes": 200}  # arms of a study
CALLS = {  # what a call is, what it prepares for a subject, and how many points or modes it has
    "response, prepared": (response(1000), 1000),
    "natural frequencies": (lambda subject: lambda: tfarm.modes(subject.arm, 100).natural_frequency, 100),
    "verdict, windows, margins": (lambda subject: lambda: to_dict(tfarm.margins(subject.arm, subject.law)), 1),
    "result card": (lambda subject: lambda: to_dict(tfarm.result_card(*subject)), 1),
    "map of gains": (lambda subject: lambda: gain_map(subject.arm, *plane(subject.law)), 40_000),
    "sampled map of gains": (
        lambda subject: lambda: sampled_map(sampled_verdict(Case(*subject)).loop, *plane(subject.law)),
        40_000,
    ),
    "slew of 300 samples, 20 modes": (lambda subject: lambda: simulator(subject).linear(subject.law), 1),
    "slew of 300 samples, another law, prepared": (another_law, 1),
    "root locus": (lambda subject: lambda: along(subject), 20 * 500),
    "trial of the tuner, prepared": (trial, 200),
    **{f"study, an arm of {ask}": (study(ask, n, chunk_of), n) for ask, n in STUDIED.items()},
    "natural frequencies proven to 30 digits": (lambda subject: lambda: tfarm.modes(subject.arm, 100).certify(30), 100),
}


# ------------------------------------------------------------------------------------------------------------ rows


def compared(what, call, other, to, n, rounds, subject, **more):
    """The row of a call against another one that takes turns with it."""
    ours, theirs = timed([call, other], rounds, subject)
    return Row(what, n, np.median(ours) / n, np.median(ours / theirs), to, **more)


def responses():
    """Three outputs in one pass, against two exponentials a point and the paper's 4x4 system in mpmath."""
    for subject in (BARE, LAB):
        G = tfarm.transfer(subject.arm, list(OUTPUTS))
        for n, rounds in ((1000, 100), (1_000_000, 11)):
            some = axis(n)[np.linspace(0, n - 1, 100).astype(int)]
            error = response_error(subject.arm, some, G(some))
            at_random = drawn(response(n), n) if n == 1000 else {}
            yield compared(
                f"response, prepared: {subject.arm.name}", response(n), exponentials(n), "two exponentials", n, rounds,
                subject, error=error, **at_random,
            )  # fmt: skip
    ours, (theirs,) = timed([response(100)], 50, LAB), timed([appendix(100)], 1, LAB)[0]
    yield Row("response by mpmath, 30 digits", 100, theirs / 100, theirs / np.median(ours), "tfarm")


def spectra():
    """A hundred natural frequencies, their errors against proven brackets, and that proof to 30 digits."""
    for subject in (BARE, STOCKY):
        row, table = alone("natural frequencies", 50, subject), tfarm.modes(subject.arm, 100)
        exact = np.array([float(low) for low, _ in table.certify(30).brackets])
        error = abs(table.natural_frequency[1:] / exact - 1).max()
        yield replace(row, what=f"{row.what}: {subject.arm.name}", error=error)
    yield alone("natural frequencies proven to 30 digits", 7, BARE)


def loops():
    """Verdict, margins and card, maps of gains, continuous and sampled, a slew, and trials of the tuner."""
    for what, rounds in (
        ("verdict, windows, margins", 9), ("result card", 9), ("map of gains", 5), ("sampled map of gains", 5),
        ("slew of 300 samples, 20 modes", 21), ("slew of 300 samples, another law, prepared", 21),
        ("trial of the tuner, prepared", 5),
    ):  # fmt: skip
        yield alone(what, rounds)


def loci(order=20):
    """The exact root locus and python-control's on a model of the same number of poles, against 50 digits."""
    exact, upper, n = along(BARE), along(BARE, order // 2 + 1), 20 * 500
    gains, system = exact.gain, open_loop(Case(BARE.arm, HubFeedback()), "K1", order // 2 - 1)
    ours, theirs = timed(
        [CALLS["root locus"][0], lambda subject: lambda: control.root_locus_map(system, gains)], 20, BARE
    )

    def error(found, values):
        worst = 0.0
        for at in np.linspace(1, gains.size - 1, 6).round().astype(int):
            loop = ContinuousLoop(Case(BARE.arm, HubFeedback(K1=float(gains[at]))))
            for near, value in zip(found.branches[:, at], values[:, at], strict=True):
                if near:
                    disc = enclose_zero(loop.k, complex(near), 50, loop.exact)
                    worst = max(worst, abs(value / complex(float(disc.re), float(disc.im)) - 1))
        return worst

    own, reduced = error(exact, exact.branches), error(upper, reduced_locus(upper, order).branches)
    yield Row("root locus", n, np.median(ours) / n, np.median(ours / theirs), "control.root_locus_map", own,
              **drawn(*CALLS["root locus"]))  # fmt: skip
    yield Row("control.root_locus_map, order 20", n, np.median(theirs) / n, error=reduced)


def studies():
    """An arm of a study, its chunk against a plain loop, and two processes against one, by the time that passes."""
    for ask, n in STUDIED.items():
        what = f"study, an arm of {ask}"
        call, _ = CALLS[what]
        yield compared(what, call, study(ask, n, rows_of), "a plain loop", n, 9, LAB, **drawn(call, n))
    taken, n = {}, 20_000
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            subject = unseen(LAB)
            began = time.perf_counter()
            tfarm.study(
                subject.arm, over(subject), ["modes"], subject.law, out=folder, draws=n, part=n // 20, workers=workers
            )
            taken[workers] = time.perf_counter() - began
    yield Row("study of modes, two processes", n, taken[2] / n, taken[1] / taken[2], "as fast as one")


def fits(n=50_000, period=0.01):
    """A fit of five numbers to a record of an open loop, with profiles."""
    arm, rng = unseen(LAB).arm, np.random.default_rng(5)
    u = rng.choice([-0.5, 0.5], n // 10).repeat(10)
    sampling, sigma = Sampling(period=period, delay_samples=0.7), {"hub_angle": 2e-3, "root_moment": 0.02}
    exact = pulse_transfer(arm, tuple(sigma), sampling).held_response(u)
    noise = rng.standard_normal(exact.shape)
    outputs = {name: y + s * e for (name, s), y, e in zip(sigma.items(), exact, noise, strict=True)}
    free = ["link.youngs_modulus", "hub.inertia", "link.damping", "drive.delay", "gain:root_moment"]
    start = {"link.youngs_modulus": 1.2 * arm.link.youngs_modulus, "hub.inertia": 0.8 * arm.hub.inertia}
    run = RigRun(period=period, outputs=outputs, input=u)
    began = time.process_time()
    tfarm.fit(arm, [], free, runs=[run], chain=Chain(sampling=Sampling(period=period)), start=start)
    yield Row(f"fit of five numbers from a run of {n} samples", 1, time.process_time() - began)


def of_process(*words, **environment):
    """Processor time of a Python process with these arguments and environment."""

    def used():
        times = resource.getrusage(resource.RUSAGE_CHILDREN)
        return times.ru_utime + times.ru_stime

    before = used()
    subprocess.run([sys.executable, *words], env=os.environ | environment, capture_output=True, check=True)
    return used() - before


def commands():
    """Commands as a shell runs them: the first ones of a new machine, the shortest one, a report."""
    tfarm_of, arm = ("-m", "tfarm"), LAB.arm.name
    with tempfile.TemporaryDirectory() as folder:
        first = [
            of_process(*tfarm_of, ask, arm, NUMBA_CACHE_DIR=folder) for ask in ("modes", "margins", "simulate", "tune")
        ]
        yield Row("modes, margins, simulate, tune: nothing compiled", 4, sum(first) / 4)
        again = [(of_process(*tfarm_of, "modes", arm), of_process("-c", "import numba")) for _ in range(9)]
        ours, theirs = np.array(again).T
        yield Row("modes, compiled before", 1, np.median(ours), np.median(ours / theirs), "import numba")
        yield Row("report of an arm", 1, of_process(*tfarm_of, "report", arm, "--out", folder))


def main(path):
    """Measure, print, keep."""
    rows = []
    for row in itertools.chain(*(group() for group in (responses, spectra, loops, loci, studies, fits, commands))):
        rows.append(row)
        ratio = "" if row.ratio is None else f", {row.ratio:.3g} x {row.to}"
        error = "" if row.error is None else f", largest error {row.error:.1e}"
        both = "" if row.median is None else f", random arms {1e6 * row.median:.3g}, worst {1e6 * row.worst:.3g}"
        print(f"{row.what:45}{row.n:9} of {1e6 * row.seconds:9.3g} us{both}{ratio}{error}", flush=True)
    versions = {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
    path.parent.mkdir(exist_ok=True)
    kept = {"versions": versions, "rows": [asdict(row) for row in rows]}
    path.write_text(json.dumps(kept, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2] or ["reports/bench.json"]))
