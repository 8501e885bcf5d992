"""Frequencies of random rigs against two other models:  python -m tests.spectrum.chains SIZE SEED

Rigs of 1 to 6 segments with whatever a rig can have (`tests.rigs`).  The first twenty frequencies of each are compared
with finite elements of high degree, one by one, so that none can be missing; every tenth is certified in balls.
"""

import numpy as np

import tfarm
from tests import survey
from tests.chain_elements import natural_frequencies
from tests.rigs import some_rig
from tests.survey import Finding
from tests.transition import determinant
from tfarm.errors import CertificationError
from tfarm.spectrum.frequencies import count_below

MODES = 20
AGREED = 1e-7  # of the elements with a frequency: it is a matter of which, not of digits
SPLIT = 1e-10  # of a frequency, between both signs of the determinant where the elements are in doubt


def judge(arm, *, certify=False, count=MODES):
    """The finding on the first frequencies of one undamped rig."""
    table, wrong = tfarm.modes(arm, count), []
    if certify:
        try:
            proof = table.certify()
        except CertificationError as error:
            return Finding("refused", f"{str(error).partition(' near ')[0]} {arm}")
        if proof.count != len(table):
            wrong.append(f"{proof.count} proven, {len(table)} listed")
    omega = table.natural_frequency[table.index > 0]
    gap = np.append(np.diff(omega), omega[-1] * 1e-9)
    below = [
        count_below(table.system.with_damping(0.0), float(w + 1e-3 * step)) for w, step in zip(omega, gap, strict=True)
    ]
    if below != list(range(1 + arm.has_rigid_mode, len(table) + 1)):
        wrong.append(f"the count is {below}")
    distance = abs(natural_frequencies(arm, count) / omega - 1)
    off = [
        float(w) for w, away in zip(omega, distance, strict=True) if away > AGREED and not changes_sign(arm, float(w))
    ]
    wrong += [f"no frequency at {w:.10g}" for w in off]
    words = f"{', '.join(wrong)} {arm}" if wrong else ""
    figures = {"distance from the other model": float(distance.max())}
    return Finding("wrong" if wrong else "right", words, bool(wrong), figures)


def changes_sign(arm, omega):
    """Whether the determinant of transition matrices does, across omega."""
    low, high = (determinant(arm, 1j * omega * (1 + shift), 30).real for shift in (-SPLIT, SPLIT))
    return low * high < 0


def frequencies(size, seed):
    """Rigs without damping; every tenth is certified."""
    for n in range(size):
        arm = some_rig(np.random.default_rng([seed, n]), damped=False)
        yield judge(arm, certify=n % 10 == 0)


if __name__ == "__main__":
    survey.main(frequencies)
