"""Speed and accuracy, compared with other packages: `make bench`, kept in reports/bench.json.

Nothing here is a test: times depend on the machine, so they are medians of processor time in one process, in which what
is compared takes turns, on one thread of BLAS.  Times of tfarm are those of a first call, its caches empty, but for
what is marked as warm: calls of what is made already.
"""

import json
import math
import platform
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

import control
import mpmath
import numpy as np

import tfarm
from tests import caches
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, Simulator, sampled_verdict, scenario
from tfarm.dsp.crossings import sampled_map
from tfarm.exact.appendix import Appendix
from tfarm.exact.outputs import output
from tfarm.loop.loci import open_loop, reduced_locus
from tfarm.loop.locus import locus
from tfarm.loop.loop import Loop
from tfarm.loop.margins import margins
from tfarm.loop.plane import gain_map
from tfarm.spectrum.proofs import enclosed
from tfarm.studies.quantities import column_names, values_of
from tfarm.studies.running import Plan, chunk
from tfarm.studies.space import space_of
from tfarm.tuner import Guard, Learning, initial_network, slew_trial, train

PACKAGES = ("tfarm", "numpy", "numba", "scipy", "mpmath", "python-flint", "control")
TURN = 2e-3  # seconds of a turn: as many calls as fill it
OUTPUTS = ("hub_angle", "root_moment", "tip_displacement")
LAW, DIGITS = HubFeedback(K1=0.3, K2=0.3), 40
BARE, LAB = tfarm.load("sasaki2012"), tfarm.load("sasaki2012-lab")


@dataclass(frozen=True)
class Row:
    """Median `seconds` for each of n points or modes, its ratio to `to`, and the largest error."""

    what: str
    n: int
    seconds: float
    ratio: float | None = None
    to: str = ""
    error: float | None = None


def timed(calls, rounds, *, warm=False):
    """Seconds a call (calls, rounds)."""

    def seconds(call):
        if not warm:
            caches.empty()
        start = time.process_time()
        call()
        return time.process_time() - start

    number = [math.ceil(TURN / max(min(seconds(call), seconds(call)), 1e-9)) for call in calls]
    turns = list(zip(calls, number, strict=True))
    return np.array([[sum(seconds(call) for _ in range(many)) / many for call, many in turns] for _ in range(rounds)]).T


def alone(what, call, n, rounds, *, warm=False):
    """The row of a call that is compared with nothing."""
    return Row(what, n, float(np.median(timed([call], rounds, warm=warm))) / n)


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


def responses():
    """Three outputs in one pass, against two exponentials a point and the paper's 4x4 system in mpmath."""
    for arm in (BARE, LAB):
        G = tfarm.transfer(arm, list(OUTPUTS))
        for n, rounds in ((1000, 100), (1_000_000, 11)):
            s = 1j * np.geomspace(0.1, 1e4, n)
            exponents, room = [-np.sqrt(s) * each for each in (1.0, 1j)], np.empty_like(s)

            def floor(exponents=exponents, room=room):
                return [np.exp(each, out=room) for each in exponents]

            floors, ours = timed([floor, lambda G=G, s=s: G(s)], rounds, warm=True)
            some = s[np.linspace(0, n - 1, 100).astype(int)]
            ratio, error = np.median(ours / floors), response_error(arm, some, G(some))
            yield Row(f"response, warm: {arm.name}", n, np.median(ours) / n, ratio, "two exponentials", error)
    s = 1j * np.geomspace(0.1, 1e4, 100)
    wanted = [output(name) for name in OUTPUTS]

    def appendix():
        with mpmath.workdps(30):
            return [
                [at.value(each, mpmath.mpf(LAB.length)) for each in wanted]
                for at in (Appendix(LAB, each) for each in s)
            ]

    ours, (theirs,) = timed([lambda: G(s)], 50, warm=True), timed([appendix], 1, warm=True)[0]
    yield Row(f"response by mpmath, 30 digits: {LAB.name}", s.size, theirs / s.size, theirs / np.median(ours), "tfarm")


def spectra():
    """A hundred natural frequencies, their errors against proven brackets, and that proof to 30 digits."""
    for arm in (BARE, tfarm.load("stocky-steel")):
        row = alone(f"natural frequencies: {arm.name}", lambda arm=arm: tfarm.modes(arm, 100), 100, 50)
        table = tfarm.modes(arm, 100)
        exact = np.array([float(low) for low, _ in table.certify(30).brackets])
        yield Row(row.what, 100, row.seconds, error=abs(table.natural_frequency[1:] / exact - 1).max())
    yield alone("natural frequencies proven to 30 digits", lambda: tfarm.modes(BARE, 100).certify(30), 100, 7)


def loops():
    """Margins and maps of gains, continuous and sampled, and a slew."""
    K1, K2 = np.linspace(0.01, 5.0, 200), np.linspace(-0.5, 1.5, 200)
    yield alone("verdict, windows, margins", lambda: margins(LAB, LAW), 1, 9)
    yield alone("map of gains", lambda: gain_map(LAB, K1, K2), 40_000, 1)
    yield alone("sampled map of gains", lambda: sampled_map(sampled_verdict(LAB, LAW).loop, K1, K2), 40_000, 1)

    def simulator():
        return Simulator(LAB, Chain(), scenario("slew", LAB, Chain(), 3.0), count=20)

    made = simulator()
    yield alone("slew of 3 s, 20 modes", lambda: simulator().linear(LAW), 1, 21)
    yield alone("slew of 3 s, another law, warm", lambda: made.linear(LAW), 1, 21, warm=True)


def loci(branches=20, points=500, order=20, stop=10.0):
    """The exact root locus and python-control's on a model of the same number of poles, against 50 digits."""
    gains, system = np.linspace(0.0, stop, points), open_loop(BARE, HubFeedback(), "K1", order // 2 - 1)

    def along(number):
        return locus(BARE, HubFeedback(), "K1", 0.0, stop, points, number)

    exact, upper = along(branches), along(order // 2 + 1)
    ours, theirs = timed([lambda: along(branches), lambda: control.root_locus_map(system, gains)], 20)
    n = branches * points

    def error(found, values):
        worst = 0.0
        for at in np.linspace(1, points - 1, 6).round().astype(int):
            loop = Loop(BARE, HubFeedback(K1=float(gains[at])))
            for near, value in zip(found.branches[:, at], values[:, at], strict=True):
                if near:
                    disc = enclosed(loop.k, complex(near), 50, loop.exact)
                    worst = max(worst, abs(value / complex(float(disc.re), float(disc.im)) - 1))
        return worst

    own, reduced = error(exact, exact.branches), error(upper, reduced_locus(upper, order).branches)
    yield Row("root locus", n, np.median(ours) / n, np.median(ours / theirs), "control.root_locus_map", own)
    yield Row("control.root_locus_map, order 20", n, np.median(theirs) / n, error=reduced)


def tuner():
    """Training over whole trials of 3 s, with the exact gradient of each."""
    trial, guard = slew_trial(LAB), Guard("frozen", 0.0, 1.1, 6, False)
    yield alone(
        "trial of the tuner", lambda: train(trial, initial_network(0), guard, Learning(rule="plain"), 200), 200, 5
    )


def studies():
    """An arm of a study, its chunk against a plain loop, and two processes against one, by the time that passes."""
    over = {"payload.mass": {"uniform": [0.0, 0.2]}, "law.K2": {"uniform": [0.0, 0.6]}}
    for ask, n in (("modes", 200), ("card", 5)):
        space = space_of(over, draws=n, seed=0, posterior=None)
        plan = Plan(LAB, LAW, Chain(), space, column_names([ask]))

        def plain(plan=plan, n=n):
            return [values_of(plan.subjects.at(row), plan.names) for row in plan.space.rows(0, n, None).tolist()]

        theirs, ours = timed([plain, partial(chunk, plan, 0, n)], 9, warm=True)
        yield Row(f"study, an arm of {ask}", n, np.median(ours) / n, np.median(ours / theirs), "a plain loop")
    taken, n = {}, 20_000
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            tfarm.study(LAB, over, ["modes"], LAW, out=folder, draws=n, part=n // 20, workers=workers)
            taken[workers] = time.perf_counter() - began
    yield Row("study of modes, two processes", n, taken[2] / n, taken[1] / taken[2], "as fast as one")


def main(path):
    """Measure, print, keep."""
    rows = [row for group in (responses, spectra, loops, loci, tuner, studies) for row in group()]
    for row in rows:
        ratio = "" if row.ratio is None else f", {row.ratio:.3g} x {row.to}"
        error = "" if row.error is None else f", largest error {row.error:.1e}"
        print(f"{row.what:45}{row.n:9} of {1e6 * row.seconds:9.3g} us{ratio}{error}")
    versions = {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
    path.parent.mkdir(exist_ok=True)
    kept = {"versions": versions, "rows": [asdict(row) for row in rows]}
    path.write_text(json.dumps(kept, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2] or ["reports/bench.json"]))
