"""The live page of a loop: what it holds is the library's, and arithmetic on that alone gives the library's margins."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import sys
from dataclasses import replace

import control
import numpy as np
import pytest

import tfarm
from tests.report.written import Unmakeable
from tests.shared import remember, remembered, thinned
from tfarm.arm import AT_HUB, HubFeedback, Law
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, load_chain
from tfarm.exported.live_loop import live_data, sensor_numbers, slew_numbers
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.panels import loop_panels
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.report import page as report_page
from tfarm.report.live import has_sliders, save_live
from tfarm.report.page import ArmReport, GivenLaw
from tfarm.response.signals import Signals

SIGNALS = ("hub_angle", "hub_rate", "root_moment", "tip_displacement")
ARMS = ("sasaki2012-lab", "stocky-steel", "quanser-flexlink")
ODD = " & 'co'"  # of a name
data_of = remembered(live_data)


@pytest.fixture(scope="module", params=thinned(ARMS, 2))
def case(request):
    arm = replace(tfarm.load(request.param), name=request.param + ODD)
    data = json.loads(
        json.dumps(data_of(Case(arm, tfarm.default_gains(arm), load_chain(request.param))), allow_nan=False)
    )
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
        drive, fed_back = ContinuousLoop(Case(arm, law)).parts(1j * omega)
        D, N = page.parts(omega, law)
        size = (abs(drive) * abs(D) + abs(fed_back) * abs(N) + abs(drive) * abs(N) + abs(fed_back) * abs(D)) / 2
        assert np.max(abs(drive * N - fed_back * D) / size) < 1e-9


def test_the_error_that_the_page_states_is_not_exceeded(case):
    """Each part between the samples, at places that were not looked at when the page was written."""
    arm, data, page = case
    for low, high in zip(data["low"], data["high"], strict=True):
        omega = np.linspace(max(low, 1e-3 * high), high, 23)[1:-1]
        drive, (theta, _, gauge), scale = Signals(arm, AT_HUB).parts(1j * omega)
        s = 1j * omega
        exact = np.stack([drive / s ** data["order"], theta, gauge / s**2]) * np.exp(scale - scale.real.max())
        held = page.at(omega)
        factor = (held * exact.conj()).sum() / (abs(exact) ** 2).sum()
        missed = abs(held - factor * exact).max(axis=1) / abs(held).max(axis=1)
        assert missed.max() < 1e-9
    assert data["error"] <= 1e-11


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
        known = sampled_verdict(Case(arm, law, chain))
        assert math.log(abs(z).max()) == pytest.approx(known.log_radius, rel=1e-6, abs=error), law
        assert (abs(z).max() < 1) == known.is_stable or abs(known.log_radius) < error, law


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


def test_zeros_of_sensors_that_are_not_determined_have_their_reason(monkeypatch, tmp_path):
    error = tfarm.ConvergenceError("no polynomial follows", 0.0, 1.0)
    monkeypatch.setattr("tfarm.exported.live_loop.positions", Unmakeable(error))
    save_live(ArmReport(tfarm.load("sasaki2012-lab"), Chain()), tmp_path)
    page = (tmp_path / "live.html").read_text(encoding="utf-8")
    assert "as its zeros are not determined: no polynomial follows." in page


def test_a_slew_of_too_many_samples_is_left_to_the_command():
    arm, fast = tfarm.load("sasaki2012"), Chain(sampling=Sampling(period=1e-4))
    assert slew_numbers(Case(arm, HubFeedback(K1=0.3), fast)) is None


def policy_of(page):
    """The directives of the page's Content-Security-Policy, and a source for each of its styles and inline scripts."""
    (policy,) = re.findall('<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    named = {name: values for name, *values in map(str.split, policy.split(";"))}
    texts = {tag: [part.split(f"</{tag}>")[0] for part in page.split(f"<{tag}>")[1:]] for tag in ("style", "script")}
    digests = {tag: [hashlib.sha256(text.encode()).digest() for text in of] for tag, of in texts.items()}
    return named, {tag: [f"'sha256-{base64.b64encode(each).decode()}'" for each in of] for tag, of in digests.items()}


def test_the_page_stays_small_and_has_its_text_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("tfarm.report.page.live_data", data_of)
    odd = replace(tfarm.load(ARMS[0]), name=ARMS[0] + ODD)
    save_live(ArmReport(odd, chain_of(odd)), tmp_path)
    page = (tmp_path / "live.html").read_text(encoding="utf-8")
    assert len(page) < 3e6
    assert "<h1>sasaki2012-lab &amp; &#39;co&#39;: live loop</h1>" in page
    assert page.count("</script>") == 2
    (text,) = re.findall(r'<script type="application/json" id="live-data">(.*?)</script>', page, re.S)
    assert json.loads(text)["name"] == odd.name
    policy, sources = policy_of(page)
    assert policy == {
        "default-src": ["'none'"], "base-uri": ["'none'"], "form-action": ["'none'"], "script-src": ["'self'"],
        "style-src": sources["style"],
    }  # fmt: skip
    assert page.index("Content-Security-Policy") < page.index("<style>")
    assert (len(sources["style"]), sources["script"]) == (2, [])


def test_explore_writes_the_page_that_a_report_has_and_opens_it(tmp_path, monkeypatch):
    """In a notebook no browser is opened: the page is in a frame, with its script."""
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    remember(monkeypatch, report_page, "live_data")
    arm, law, chain = tfarm.load(ARMS[0]), HubFeedback(K1=0.25, K2=0.4), Chain(sampling=Sampling(period=0.005))
    found = tfarm.explore(arm, law, chain)
    (tmp_path / "report").mkdir()
    save_live(ArmReport(arm, chain, (GivenLaw(law),)), tmp_path / "report")
    assert found.path.read_bytes() == (tmp_path / "report" / "live.html").read_bytes()
    assert opened == [found.path.as_uri()]
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    shown = tfarm.explore(arm, law, chain)
    assert len(opened) == 1
    assert shown.path != found.path
    (text,) = re.findall(r'<iframe src="data:text/html;charset=utf-8;base64,([^"]*)"', shown._repr_html_())
    page = base64.b64decode(text).decode()
    assert (found.path.parents[1] / "assets" / "live.js").read_text(encoding="utf-8") in page
    assert "<script src=" not in page
    policy, sources = policy_of(page)
    assert policy["script-src"] == sources["script"]
    with pytest.raises(tfarm.ParameterError, match="hub turns freely"):
        tfarm.explore(arm.with_numbers(hub_inertia=math.inf))
    with pytest.raises(tfarm.ParameterError, match="is no Arm"):
        tfarm.explore(arm.name)


def test_an_arm_that_cannot_turn_freely_has_no_samples():
    arm = tfarm.load("sasaki2012")
    with pytest.raises(tfarm.ParameterError, match="turns freely"):
        loop_panels(arm.with_numbers(payload_mass=math.inf), 1000.0)


# ------------------------------------------------------------ the page of a law


LAW = Law({"hub_angle": ([0.4, 3.0], [0.02, 1.0]), "tip_displacement": ([-0.2], [0.01, 1.0]), "root_moment": 0.2})


@pytest.fixture(scope="module", params=["sasaki2012-lab", "quanser-flexlink"])
def law_page(request):
    arm, chain = tfarm.load(request.param), load_chain(request.param)
    return arm, chain, json.loads(json.dumps(live_data(Case(arm, LAW, chain)), allow_nan=False))


def test_only_few_rational_parts_in_s_have_sliders():
    five = ("hub_angle", "hub_rate", "root_moment", "tip_displacement", "strain@0.05")
    assert has_sliders(LAW)
    assert not has_sliders(Law(dict.fromkeys(five, 1.0)))
    assert not has_sliders(Law({"hub_rate": ([0.3], [1.0, -0.5])}, period=0.01))
    assert not has_sliders(Law.of_matrices([[-5.0]], [[1.0]], [[1.0]], [[0.3]], ["hub_rate"]))


def test_samples_of_a_law_are_each_part_times_the_response_to_its_signal(law_page):
    """Against `tfarm.transfer` and the entries of the law, up to the smallest of both at resonances."""
    arm, _, data = law_page
    page, omega = Page(data), np.random.default_rng(3).uniform(1e-3, 1.0, 100) * data["band"]
    drive, *rows = page.at(omega)
    assert data["rows"] == [[1, 0], [2, 0], [3, 0]]
    for name, row, entry, signal in zip(data["names"], rows, LAW.values(1j * omega), LAW.signals, strict=True):
        exact = entry * tfarm.transfer(arm, signal)(1j * omega)
        here = data["start"][name] * row / ((1j * omega) ** data["order"] * drive)
        assert (abs(here - exact) < 1e-6 * abs(exact) + 1e-9 * abs(exact).max()).all(), name


def test_sampled_loop_of_a_law_has_the_poles_of_its_state_space(law_page):
    """Plant and blocks of the page closed by python-control, against the library's spectral radius."""
    arm, chain, data = law_page
    held = data["sampled_loop"]
    plant, T = Plant(held, 2.0), held["period"]
    columns = sorted(held["columns"], key=lambda column: column["row"])
    assert [column["row"] for column in columns] == [0, 1, 2]
    for factor in (1.0, 0.3):
        blocks = []
        for each in columns:
            zeros, poles = (1.0 + np.array([complex(*pair) for pair in each[key]]) for key in ("zeros", "poles"))
            gain = factor * each["g"] * data["start"][each["name"]]
            blocks.append(control.ss(control.zpk(zeros, poles, gain, dt=T)))
        outputs = control.ss(plant.A, plant.B[:, None], plant.C[:3], 0, T)
        L = control.ss([], [], [], np.ones((1, 3)), T) * control.append(*blocks) * outputs
        known = sampled_verdict(Case(arm, LAW.times(factor), chain))
        assert held["delay"] == held["fraction"] == 0
        z = control.feedback(L, 1).poles()
        if not any(twice for twice, _ in held["rigid"]):
            z = np.delete(z, abs(z - 1).argmin())  # an integral that none of the signals feels
        assert math.log(abs(z).max()) == pytest.approx(known.log_radius, rel=1e-5, abs=1e-11)


# ------------------------------------------------------------ the page's arithmetic, from its numbers alone


POINTS = 24
X = np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
TO_SERIES = np.cos(np.outer(np.arange(POINTS), np.arccos(X))) * 2 / POINTS


class Page:
    """What live_loop.js does, with Chebyshev series where that has the barycentric formula."""

    def __init__(self, data):
        self.data = data
        self.low, self.high = np.array(data["low"]), np.array(data["high"])
        values = (
            np.frombuffer(base64.b64decode(data["samples"]), "<f8").view(complex).reshape(self.low.size, -1, POINTS)
        )
        self.series = values @ TO_SERIES.T
        self.series[..., 0] /= 2

    def at(self, omega):
        """d, theta and m (3, n), or d and the parts of a law."""
        omega = np.atleast_1d(omega)
        panel = np.minimum(np.searchsorted(self.high, omega), self.high.size - 1)
        x = (2 * omega - self.low[panel] - self.high[panel]) / (self.high[panel] - self.low[panel])
        basis = np.cos(np.outer(np.arange(POINTS), np.arccos(np.clip(x, -1, 1))))
        return np.einsum("npk,kn->pn", self.series[panel], basis)

    def parts(self, omega, law):
        """D and N, up to one positive factor for each panel."""
        (d, theta, m), s = self.at(omega), 1j * np.atleast_1d(omega)
        return s ** self.data["order"] * d, (law.Kp + law.K1 * s) * theta + law.K2 * s**2 * m


def complex_rows(text, rows):
    """The complex numbers of packed doubles, in `rows` rows."""
    return np.frombuffer(base64.b64decode(text), "<f8").view(complex).reshape(rows, -1)


class Plant:
    """The modal plant in the page as a real state space, discretised by python-control: the page has closed forms.

    States: real and imaginary part of the amplitude of each pole above the axis, each real one, the integrals of the
    torque, and the torque before, which static parts and nothing else see.
    """

    def __init__(self, data, weight):
        """`weight`: what a pole above the axis counts in the residues of the page, whose conjugate is not there."""
        poles, rows = complex_rows(data["eigenvalues"], 1)[0], complex_rows(data["residues"], len(data["static"]))
        upper, real = poles.imag > 0, poles.imag == 0
        n = 2 * int(upper.sum()) + int(real.sum()) + 2
        A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((len(rows), n))
        for i, (p, r) in enumerate(zip(poles[upper], rows[:, upper].T * weight, strict=True)):
            pair = slice(2 * i, 2 * i + 2)
            A[pair, pair], B[2 * i, 0] = [[p.real, -p.imag], [p.imag, p.real]], 1.0
            C[:, pair] = np.c_[r.real, -r.imag]
        for i, (p, r) in enumerate(zip(poles[real], rows[:, real].T, strict=True), 2 * int(upper.sum())):
            A[i, i], B[i, 0], C[:, i] = p.real, 1.0, r.real
        A[n - 2, n - 1], B[n - 1, 0], C[:, n - 2 :] = 1.0, 1.0, data["rigid"]
        held = control.sample_system(control.StateSpace(A, B, C, 0), data["period"], "zoh")
        zero, static = np.zeros((1, n)), np.array(data["static"])[:, None]
        self.A = np.block([[held.A, np.zeros((n, 1))], [zero, np.zeros((1, 1))]])
        self.B = np.r_[held.B[:, 0], 1.0]
        self.C = np.c_[held.C, static]

    def poles(self, law):
        """Closed-loop poles."""
        return np.linalg.eigvals(self.A - np.outer(self.B, np.array(law.row) @ self.C[:3]))
