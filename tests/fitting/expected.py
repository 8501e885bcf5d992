"""The scatter of fits of simulated records, against the intervals that an experiment expects.

    python -m tests.fitting.expected SIZE SEED

The records of an excitation have noise of the size that the experiment was given, and a bias.  For the best and for
others of the family the scatter of each number is compared with that expected, by chi-squared: wrong is one beyond
99.9 %.  Figures are z = (fitted - true)/deviation, squared, and the gap of ln det of the scatter to that of the row, of
which few draws leave an error of about sqrt(2 numbers/SIZE).
"""

import numpy as np
from scipy.special import chdtr

import tfarm
from tests import survey
from tests.survey import Finding
from tfarm.arm.chain import Chain, Sampling
from tfarm.case import Case
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.fitting.experiment import excitations
from tfarm.fitting.runs import RigRun

LAB = tfarm.load("sasaki2012-lab")
CHAIN = Chain(sampling=Sampling(delay_samples=0.6))
FREE = ("hub.inertia", "link.damping", "drive.delay")
NOISE = {"hub_angle": 2e-3, "root_moment": 0.02}
DURATION = 3.0


def expected():
    """The experiment."""
    return tfarm.experiment(LAB, FREE, DURATION, limit=1.0, angle=0.5, noise=NOISE, chain=CHAIN)


def simulated(u, chain=CHAIN, bias=0.02):
    """The signals at the samples, from rest under a held input and a bias, by the simulator of a loop."""
    none = np.zeros(u.size)
    task = Scenario("record", chain.sampling.period, u, none, none, none, none + bias)
    return Simulator(Case(LAB, tfarm.HubFeedback(), chain), task, count=20).run().at_samples


def fitted(u, clean, rng):
    """The fit of one record of these signals with noise of its own."""
    outputs = {name: clean.signal(name) + size * rng.standard_normal(u.size) for name, size in NOISE.items()}
    run = RigRun(period=CHAIN.sampling.period, outputs=outputs, input=u, sigma=NOISE)
    return tfarm.fit(LAB, [], FREE, runs=[run], chain=CHAIN, profile=False)


def deviations(fit):
    """Shares by which fitted numbers are off, of the dead time samples."""
    truth = [LAB.hub.inertia, LAB.damping, CHAIN.sampling.delay_samples * CHAIN.sampling.period]
    sizes = [*truth[:2], CHAIN.sampling.period]
    pairs = zip(fit.parameters, truth, sizes, strict=True)
    return [(each.value - true) / size for each, true, size in pairs]


def scatter(size, seed):
    """A finding for the best excitation, the first of another kind, and the last that determines all numbers."""
    known = [row for row in expected().ranked if None not in row.intervals.values()]
    kinds = [row.excitation.split(",")[0] for row in known]
    other = next(n for n, kind in enumerate(kinds) if kind != kinds[0])
    rng = np.random.default_rng(seed)
    for row in (known[0], known[other], known[-1]):
        shape = excitations(LAB, DURATION, CHAIN.sampling.period)[row.excitation]
        u = row.peak / abs(shape).max() * shape
        clean = simulated(u)
        off = np.array([deviations(fitted(u, clean, rng)) for _ in range(size)])
        shares = (off / np.array([*row.intervals.values()]) * 1.959964) ** 2
        chance = chdtr(size, shares.sum(axis=0))
        gap = -np.linalg.slogdet(off.T @ off / size)[1] - row.information
        words = f"z^2 {shares.mean(axis=0).round(3)}, chance {chance.round(4)}, gap of ln det {gap:.3f}"
        is_wrong = bool((abs(chance - 0.5) > 0.4995).any())
        yield Finding(row.excitation, words, is_wrong, {"z^2": float(shares.mean()), "gap of ln det": float(gap)})


if __name__ == "__main__":
    survey.main(scatter, size=40)
