"""A real flexible arm under a sine swept again and again: tests/data/daisy-robot-arm, without units or sample time.

A black box: no arm of ours is laid over it, and a hertz here is one turn a sample.
"""

from pathlib import Path

import numpy as np
import pytest

from tfarm.fitting.recording import read_recording
from tfarm.fitting.spectra import frequency_response

RECORD = read_recording(Path(__file__).parent.parent / "data" / "daisy-robot-arm" / "robot_arm.csv")
SWEEP = 512  # samples


def estimate(**how):
    names = "tip_acceleration", "hub_torque"
    return frequency_response(RECORD, *names, columns=("acceleration", "torque"), **how).measured


def test_the_second_sweep_is_the_first_with_the_other_sign():
    for signal in RECORD.signals.values():
        assert np.std(signal[SWEEP:] + signal[:SWEEP]) < 0.1 * np.std(signal)


def test_segments_of_a_sweep_are_coherent_and_tapered_ones_are_not():
    """What repeats leaks from no period; a window that tapers a sweep weighs its frequencies by when they come."""
    whole, tapered = estimate(segment=SWEEP, window="boxcar"), estimate()
    assert np.median(whole.coherence) > 0.999
    assert np.median(tapered.coherence) < 0.9


def test_the_estimators_agree_where_the_sweep_is_coherent():
    H1, H2 = (estimate(segment=SWEEP, window="boxcar", estimator=kind) for kind in ("H1", "H2"))
    good = H1.coherence > 0.999
    assert good.mean() > 0.5
    assert H2.values[good] == pytest.approx(H1.values[good], rel=1.1e-3)
    assert np.all(abs(H1.values) <= abs(H2.values) * (1 + 1e-12))
