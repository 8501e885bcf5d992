"""The live page of a loop: what it holds is the library's, and arithmetic on that alone gives the library's margins."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.report.live_arithmetic import Page, Plant, complex_rows
from tests.shared import remembered, thinned
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, Sampling, load_chain, sampled_verdict
from tfarm.exact.characteristic import float_units, loop_parts
from tfarm.exact.system import system_of
from tfarm.loop.loop import Loop
from tfarm.loop.panels import MOST_MISS, loop_panels
from tfarm.loop.stability import stability
from tfarm.report.cases import Case
from tfarm.report.live import live_data, save_live, sensor_numbers, slew_numbers

SIGNALS = ("hub_angle", "hub_rate", "root_moment", "tip_displacement")
ARMS = ("sasaki2012-lab", "stocky-steel", "quanser-flexlink")
ODD = " & 'co'"  # of a name
data_of = remembered(live_data)


@pytest.fixture(scope="module", params=thinned(ARMS, 2))
def case(request):
    arm = replace(tfarm.load(request.param), name=request.param + ODD)
    data = json.loads(json.dumps(data_of(arm, load_chain(request.param), None), allow_nan=False))
    return arm, data, Page(data)


def chain_of(arm):
    return load_chain(arm.name.removesuffix(ODD))


def some_gains(data, seed, number):
    """Gains over the whole of the page's axes, every second with Kp = 0."""
    rng = np.random.default_rng(seed)
    K1, K2, Kp = (data["axes"][name] for name in ("K1", "K2", "Kp"))
    for i in range(number):
        rate = math.exp(rng.uniform(math.log(0.2 * K1["linear"]), math.log(K1["high"])))
        angle = math.exp(rng.uniform(math.log(Kp["linear"]), math.log(Kp["high"]))) if i % 2 else 0.0
        yield HubFeedback(K1=rate, K2=rng.uniform(max(K2["low"], -K2["high"]), K2["high"]), Kp=angle)


def test_samples_are_the_parts_of_the_loop_function(case):
    """Not at the samples, and with gains of every kind: L of the page is of `Loop`, as closely as L is steep."""
    arm, data, page = case
    omega = np.random.default_rng(3).uniform(1e-3, 1.0, 200) * data["band"]
    for law in some_gains(data, 5, 3):
        drive, fed_back = Loop(arm, law).parts(1j * omega)
        D, N = page.parts(omega, law)
        size = (abs(drive) * abs(D) + abs(fed_back) * abs(N) + abs(drive) * abs(N) + abs(fed_back) * abs(D)) / 2
        assert np.max(abs(drive * N - fed_back * D) / size) < 1e-9


def test_the_error_that_the_page_states_is_not_exceeded(case):
    """Each part between the samples, at places that were not looked at when the page was written."""
    arm, data, page = case
    k = system_of(arm)
    for low, high in zip(data["low"], data["high"], strict=True):
        omega = np.linspace(max(low, 1e-3 * high), high, 23)[1:-1]
        drive, numerators, scale = loop_parts(k, 1j * omega)
        theta, _, gauge = float_units(k) * numerators
        s = 1j * omega
        exact = np.stack([drive / s ** data["order"], theta, gauge / s**2]) * np.exp(scale - scale.real.max())
        held = page.at(omega)
        factor = (held * exact.conj()).sum() / (abs(exact) ** 2).sum()
        missed = abs(held - factor * exact).max(axis=1) / abs(held).max(axis=1)
        assert missed.max() < 100 * MOST_MISS
    assert data["error"] <= MOST_MISS


def test_verdicts_are_the_librarys_counts(case):
    arm, data, page = case
    for law in some_gains(data, 9, 12):
        try:
            known = stability(arm, law, data["band"])
        except tfarm.ConvergenceError:
            continue
        assert page.verdict(law).startswith("stable") == known.is_stable, law
        if data["kind"] == "quiet":  # else poles may come from beyond the band
            assert page.count(law) == known.unstable_roots, law


def test_the_sampled_region_holds_at_its_columns(case):
    """Just inside and outside each end, by the verdict that counts no crossings."""
    arm, data, _ = case
    chain, plane = chain_of(arm), data["sampled_map"]
    for i in np.linspace(1, len(plane["K1"]) - 2, 3).astype(int):
        for low, high in plane["intervals"][i]:
            middle = HubFeedback(K1=plane["K1"][i], K2=(low + high) / 2)
            assert sampled_verdict(arm, middle, chain).is_stable


def test_sampled_poles_of_the_plant_in_the_page_are_the_librarys(case):
    """At three laws, the hub's angle fed back or not; an eigenvalue is right to eps times the size of the matrix."""
    arm, data, _ = case
    held, chain = data["sampled_loop"], chain_of(arm)
    plant, error = Plant(held, 2.0), 1e-11
    for law in some_gains(data, 3, 3):
        z = plant.poles(law)
        if law.Kp == 0 or held["states"] < 2:
            z = np.delete(z, abs(z - 1).argmin())  # the angle that nothing regulates, or an integral that none feels
        if law.Kp == 0 and held["states"] < 2:
            z = np.delete(z, abs(z - 1).argmin())
        known = sampled_verdict(arm, law, chain)
        assert math.log(abs(z).max()) == pytest.approx(known.log_radius, rel=1e-6, abs=error), law
        assert (abs(z).max() < 1) == known.is_stable or abs(known.log_radius) < error, law


def test_the_slew_of_the_plant_in_the_page_is_the_librarys(case):
    arm, data, _ = case
    held = data["slew"]
    gains = HubFeedback(**data["start"])
    for law in (gains, gains.having("K2", 0.0).having("Kp", 0.3 * gains.K1)):
        found = tfarm.simulate(arm, law, chain_of(arm), duration=3 * held["rise"], count=held["modes"])
        torque, outputs = Plant(held, 1.0).slew(held, law)
        pairs = [(torque, found.torque)]
        pairs += [(row, getattr(found.at_samples, name)) for row, name in zip(outputs[3:], SIGNALS, strict=True)]
        for here, there in pairs:
            assert abs(here - there).max() < 1e-9 * abs(there).max()


def test_the_arm_bends_in_its_own_shapes(case):
    """Displacement over that of the tip at each pole, against the shapes of the modes."""
    arm, data, _ = case
    held, modes = data["slew"], tfarm.modes(arm, count=3)
    shapes = complex_rows(held["shapes"], len(held["x"]))
    shape = tfarm.damped_modes(modes).shape if not arm.is_undamped else lambda x: modes.shape(x)[1:, None] + 0j
    wanted = shape(np.array(held["x"]))
    poles = complex_rows(held["eigenvalues"], 1)[0]
    for mode in (1, 2, 3):
        here = shapes[:, next(i for i, n in enumerate(held["mode"]) if n == mode and poles[i].imag > 0)]
        both = [w / w[-1] for w in wanted[mode - 1]]
        assert min(abs(here - each).max() for each in both) < 1e-6
    assert arm.reach == pytest.approx(held["offset"] + arm.length)


def test_a_sensor_is_offered_where_there_is_something_to_sense(case):
    """A clamp on the axis does not move, and a free tip without inertia does not bend: no place for those sensors."""
    arm, data, _ = case
    moves, bends = (data["sensor"][kind]["x"] for kind in ("displacement", "moment"))
    assert (0.0 in moves) == (arm.reach > arm.length)
    assert (arm.length in bends) == (arm.payload.inertia > 0)
    assert 0.0 in bends
    assert arm.length in moves


def test_a_zero_on_the_axis_has_no_real_part_of_rounding():
    """The rig's link loses nothing, so that zeros lie on the axis, in pairs across it, or are real."""
    found = sensor_numbers(tfarm.load("quanser-2dsfl"))["sensor"]
    zeros = [zero for kind in found.values() for place in kind["zeros"] for zero in place]
    assert sum(re == 0.0 for re, _ in zeros) > 20
    assert not [(re, im) for re, im in zeros if 0 < abs(re) < 1e-9 * abs(im)]


def test_zeros_of_sensors_that_are_not_determined_have_their_reason(case, monkeypatch, tmp_path):
    _, data, _ = case

    def fails(*_):
        raise tfarm.ConvergenceError("no polynomial follows", 0.0, 1.0)

    monkeypatch.setattr("tfarm.report.live.positions", fails)
    arm = tfarm.load("sasaki2012-lab")
    found = sensor_numbers(arm)
    assert found == {"sensor": None, "no_sensor": "no polynomial follows"}
    monkeypatch.setattr("tfarm.report.live.live_data", lambda *_: {**data, **found})
    save_live(Case(arm, Chain()), tmp_path)
    assert "as its zeros are not determined: no polynomial follows." in (tmp_path / "live.html").read_text(
        encoding="utf-8"
    )


def test_a_slew_of_too_many_samples_is_left_to_the_command():
    arm, fast = tfarm.load("sasaki2012"), Chain(sampling=Sampling(period=1e-4))
    assert slew_numbers(arm, fast, HubFeedback(K1=0.3)) is None


def test_the_page_stays_small_and_has_its_text_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("tfarm.report.live.live_data", data_of)
    odd = replace(tfarm.load(ARMS[0]), name=ARMS[0] + ODD)
    save_live(Case(odd, chain_of(odd)), tmp_path)
    page = (tmp_path / "live.html").read_text(encoding="utf-8")
    assert len(page) < 3e6
    assert "<h1>sasaki2012-lab &amp; &#39;co&#39;: live loop</h1>" in page
    assert page.count("</script>") == 3
    (text,) = re.findall(r'<script type="application/json" id="live-data">(.*?)</script>', page, re.S)
    assert json.loads(text)["name"] == odd.name


def test_an_arm_that_cannot_turn_freely_has_no_samples():
    arm = tfarm.load("sasaki2012")
    with pytest.raises(tfarm.ParameterError, match="turns freely"):
        loop_panels(arm.having(payload_mass=math.inf), 1000.0)
