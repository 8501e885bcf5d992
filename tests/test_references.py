"""Profiles by their closed forms, shapers by the textbook, and what both leave of a slew.

The truth of a shaped slew is the simulation; that of impulses are the formulas of Singer and Seering (1990) and of
Singhose, Seering and Singer (1994), which are of impulses at any time.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.shared import refusal, sized
from tfarm.arm.writing import KeyedArms, numbers_of
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, ReferenceShaping, Sampling, Simulator, Slew, scenario
from tfarm.dsp.plant import undelayed_plant
from tfarm.dsp.profiles import motion_of_slew
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.shaping import (
    BUILDERS,
    extra_insensitive,
    impulses_of,
    loop_modes,
    share_left,
    zero_vibration,
    zero_vibration_and_slope,
)
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.sampled import sampled_loop
from tfarm.references import reference
from tfarm.references.bounds import SlewBounds
from tfarm.references.shaped import certified_bound, with_frequencies
from tfarm.response.signals import Signals
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.enclosed import EnclosedArms

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.HubFeedback(K1=0.5, K2=0.1, Kp=2.0)
POLES = [0.999 * np.exp(0.3j), 0.97 * np.exp(0.71j), np.exp(1j * math.pi / 4), 0.9 * np.exp(2.04j)]


def shaped(shaper="none", profile="bang-bang", modes=2, period=0.01, **more):
    own = ReferenceShaping(shaper=shaper, profile=profile, modes=modes, **more)
    return Chain(sampling=Sampling(period=period), slew=Slew(travel=0.8, rise_time=0.7), reference=own)


# ------------------------------------------------------------ impulses


@pytest.mark.parametrize("z", POLES)
def test_zero_vibration_is_zero_at_the_pole(z):
    impulses = zero_vibration(z)
    assert impulses.sum() == pytest.approx(1, rel=1e-14)
    assert max(share_left(impulses, z), share_left(impulses, z.conjugate())) < 1e-14
    assert impulses.size == math.floor(math.pi / abs(np.angle(z)) * (1 + 1e-12)) + 2


def test_impulses_on_the_grid_are_those_of_the_textbook():
    """Half a period of 4 samples, k = e^{-zeta pi/sqrt(1 - zeta^2)}: ZV [1, k]/(1 + k), ZVD [1, 2k, k^2]/(1 + k)^2."""
    z = 0.98 * np.exp(1j * math.pi / 4)
    k = abs(z) ** 4
    np.testing.assert_allclose(zero_vibration(z), [1 / (1 + k), 0, 0, 0, k / (1 + k), 0], atol=1e-15)
    zvd = np.zeros(11)
    zvd[[0, 4, 8]] = np.array([1.0, 2 * k, k**2]) / (1 + k) ** 2
    np.testing.assert_allclose(zero_vibration_and_slope(z), zvd, atol=1e-15)


def test_extra_insensitive_tolerates_a_share_at_the_mode():
    """Undamped: [(1 + V)/4, (1 - V)/2, (1 + V)/4] at 0, half and whole the period, and at most V between its zeros."""
    w = math.pi / 40
    textbook = np.zeros(82)
    textbook[[0, 40, 80]] = [1.05 / 4, 0.95 / 2, 1.05 / 4]
    np.testing.assert_allclose(extra_insensitive(np.exp(1j * w)), textbook, atol=1e-12)
    impulses = extra_insensitive(np.exp(1j * w / 1.01))
    band = [share_left(impulses, np.exp(1j * w / 1.01 * f)) for f in np.linspace(0.81, 1.19, 51)]
    zv = [share_left(zero_vibration(np.exp(1j * w)), np.exp(1j * w * f)) for f in (0.81, 1.19)]
    assert max(band) < 0.055 < min(zv) / 4
    assert band[25] == pytest.approx(0.05, rel=0.02)
    for factor in (0.86, 1.14):
        assert share_left(extra_insensitive(np.exp(1j * w)), np.exp(1j * w * factor)) < 2e-3


@pytest.mark.parametrize("f", [0.1, 0.37, 0.5, 0.9])
def test_two_impulses_on_samples_stand_for_one_between_them(f):
    """Undamped, half a period n + f: sum 1/2 and mean n + f of the impulse of the textbook, both to O(1/n^2)."""
    n = 40
    impulses = zero_vibration(np.exp(1j * math.pi / (n + f)))
    late = impulses[n:]
    assert late.sum() == pytest.approx(0.5, abs=2 / n**2)
    assert late @ (n + np.arange(2)) / late.sum() == pytest.approx(n + f, abs=0.05)


# ------------------------------------------------------------ profiles


PEAKS = {"bang-bang": 4.0, "s-curve": 8.0, "polynomial": 10 / math.sqrt(3)}


@pytest.mark.parametrize("profile", PEAKS)
def test_a_profile_goes_from_rest_to_rest_with_its_peak_acceleration(profile):
    """The largest acceleration is 4, 8 and 10/sqrt(3) travels over the square of the rise time, the rate symmetric."""
    chain = shaped(profile=profile)
    t = np.linspace(0.0, 0.7, 7001)
    rate, mean = motion_of_slew(chain, 2.0, t)
    turn = 0.4
    assert mean @ np.diff(t) == pytest.approx(turn, rel=1e-12)
    assert abs(rate[[0, -1]]).max() < 1e-12
    np.testing.assert_allclose(rate, rate[::-1], atol=1e-12)
    np.testing.assert_allclose(np.r_[0.0, np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)][-1], turn, rtol=1e-6)
    assert abs(np.diff(rate) / np.diff(t)).max() == pytest.approx(PEAKS[profile] * turn / 0.49, rel=1e-3)


def test_a_file_of_the_polynomial_is_the_polynomial(tmp_path):
    """Of 201 points, in milliseconds and degrees, found from the folder of the TOML file."""
    x = np.linspace(0, 1, 201)
    rows = [f"{700 * a + 50!r},{33 * a**3 * (10 - 15 * a + 6 * a**2) - 4!r}" for a in x.tolist()]
    (tmp_path / "own.csv").write_text("\n".join(["t,angle", *rows]))
    file = tmp_path / "chain.toml"
    file.write_text('[slew]\ntravel = 0.8\nrise_time = 0.7\n[reference]\nprofile = "file"\nfile = "own.csv"\n')
    task = slew_scenario(LAB, tfarm.dsp.load_chain(file), 1.0)
    truth = slew_scenario(LAB, shaped(profile="polynomial"), 1.0)
    assert abs(task.hub_angle - truth.hub_angle).max() < 1e-7
    assert abs(task.feedforward - truth.feedforward).max() < 1e-3 * abs(truth.feedforward).max()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,a\n0,0\n1,x\n", "a comma between them"),
        ("t,a\n0,0\n1,1\n", "at least four"),
        ("t,a\n0,0\n1,1\n1,2\n2,3\n", "times that increase"),
        ("t,a\n0,0\n1,1\n2,2\n3,0\n", "another angle"),
        ("t,a\n0,0\n1,1e308\n2,-1e308\n3,1\n", "finite numbers"),
        ("", "a comma between them"),
    ],
)
def test_a_wrong_file_of_a_profile_has_its_line(tmp_path, text, words):
    (tmp_path / "own.csv").write_text(text)
    chain = shaped(profile="file", file=str(tmp_path / "own.csv"))
    assert words in str(refusal(slew_scenario, LAB, chain, 1.0))


@pytest.mark.parametrize("profile", ["s-curve", "polynomial"])
def test_under_the_inverse_at_the_hub_the_arm_follows_by_itself(profile):
    """Without feedback, by the simulation: its error is that of the hold, of second order in the period."""
    errors = {}
    for period, feedforward in [(0.01, "rigid"), (0.01, "inverse"), (0.002, "inverse")]:
        run = tfarm.simulate(LAB, tfarm.HubFeedback(), shaped(profile=profile, period=period, feedforward=feedforward))
        errors[period, feedforward] = abs(run.at_samples.hub_angle - run.scenario.hub_angle).max()
    assert errors[0.01, "inverse"] < errors[0.01, "rigid"] / 50
    assert errors[0.002, "inverse"] < errors[0.01, "inverse"] / 20


def test_the_torque_of_the_inverse_ends_as_the_arm_with_its_hub_held():
    """Its largest values over equal times decay with the first pole of that arm, by its modes."""
    task = slew_scenario(LAB, shaped(profile="s-curve", feedforward="inverse"), 9.0)
    held = replace(LAB, hub=replace(LAB.hub, inertia=math.inf))
    decay = -damped_modes(tfarm.modes(held, 1)).eigenvalues[0, 0].real
    early, late = (abs(task.feedforward[(begin <= task.t) & (task.t < begin + 3.0)]).max() for begin in (2.0, 6.0))
    assert early / late == pytest.approx(math.exp(4 * decay), rel=0.01)
    found = reference(LAB, LAW, shaped(profile="s-curve", feedforward="inverse"), error=0.02)
    assert found.torque_after == pytest.approx(abs(task.feedforward[task.is_after]).max(), rel=1e-4)
    assert found.torque_time == pytest.approx(
        math.log(100 * found.torque_after / abs(task.feedforward).max()) / decay, rel=1e-3
    )
    assert reference(LAB, LAW, shaped(profile="s-curve", feedforward="none"), error=0.02).torque_after == 0.0


def test_without_damping_the_torque_of_the_inverse_never_ends():
    arm = tfarm.load("sasaki2012")
    found = reference(arm, tfarm.HubFeedback(), shaped(profile="s-curve", feedforward="inverse"), error=0.02)
    assert found.torque_after > 0.1
    assert found.torque_time is None


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({"feedforward": "inverse"}, "reference.feedforward"),
        ({"feedforward": "exact", "profile": "s-curve"}, "reference.feedforward"),
        ({"profile": "cubic"}, "reference.profile"),
        ({"shaper": "zv"}, "reference.shaper"),
        ({"modes": 0}, "reference.modes"),
        ({"profile": "file"}, "reference.file"),
        ({"file": "own.csv"}, "reference.file"),
    ],
)
def test_a_wrong_reference_has_its_line(table, key):
    assert refusal(ReferenceShaping, **table).key == key


def test_a_shaper_without_a_law_is_refused():
    assert refusal(scenario, "slew", LAB, shaped("ZV"), 1.0).key == "reference.shaper"


# ------------------------------------------------------------ loops


def some_loop(rng):
    """A turning rig at a period of some 30 to 60 samples in that of its first mode, lightly fed back."""
    while True:
        arm = some_rig(rng, damped=True, segments=int(rng.integers(1, 3)), drive="hub_torque")
        if not arm.has_rigid_mode or not arm.hub.inertia or math.isinf(arm.payload.mass):
            continue
        try:
            w = float(tfarm.modes(arm, 1).natural_frequency[-1])
            usual = tfarm.default_gains(arm)
        except (ParameterError, ConvergenceError):
            continue
        law = tfarm.HubFeedback(K1=usual.K1 * 10 ** rng.uniform(-1, 1), K2=0.0, Kp=usual.K1 * w * rng.uniform(0, 0.02))
        period = float(f"{2 * math.pi / w / rng.uniform(30, 60):.3g}")
        chain = replace(
            shaped(period=period),
            slew=Slew(travel=1e-6 * arm.reach, rise_time=float(f"{2 * math.pi / w * rng.uniform(1, 4):.3g}")),
        )
        if sampled_loop(Case(arm, law, chain)).is_stable:
            return arm, law, chain


def test_the_poles_of_the_modes_are_those_of_the_sampled_loop():
    for law in (LAW, tfarm.HubFeedback(K1=3.0, K2=0.15), tfarm.HubFeedback(K1=0.3)):
        poles = sampled_loop(Case(LAB, law)).poles.z
        found = loop_modes(Case(LAB, law))
        assert sorted(found) == [1, 2]
        assert all(abs(poles - z).min() < 1e-12 for z in found.values())
    # a pair of damping ratio 0.97 next to where mode 1 is overdamped
    law = tfarm.HubFeedback(K1=9.7, K2=0.112)
    z = sampled_loop(Case(LAB, law)).poles.z
    assert ((np.angle(z) > 0) & (np.angle(z) < 0.2) & (abs(z) > 0.6)).any()
    assert sorted(loop_modes(Case(LAB, law))) == [2]


@pytest.mark.parametrize("kind", BUILDERS)
def test_a_one_mode_loop_is_left_at_rest_or_with_the_share_of_its_shaper(kind):
    """Without damping and controller the vibration of a model of one mode is the share of the impulses."""
    arm = tfarm.load("sasaki2012")
    case = Case(arm, tfarm.HubFeedback(), shaped(kind, modes=1))
    task = scenario("slew", arm, case.chain, 4.0, case.law)
    plain = slew_scenario(arm, case.chain, 4.0)
    rests = [Simulator(case, each, count=1).run().at_samples.root_moment[each.t > 1.2] for each in (task, plain)]
    (z,) = loop_modes(case, count=1).values()
    share = share_left(impulses_of(arm, case.chain, case.law), z)
    sizes = [np.sqrt(np.mean(each**2)) for each in rests]
    assert sizes[0] == pytest.approx(share * sizes[1], rel=0.02, abs=1e-10)
    assert (share < 1e-12) == (kind != "EI")


def test_the_frequencies_of_an_arm_with_an_error_are_scaled():
    own = tfarm.modes(LAB, 4).natural_frequency
    np.testing.assert_allclose(tfarm.modes(with_frequencies(LAB, 1.2), 4).natural_frequency, 1.2 * own, rtol=1e-9)


def largest_residual(case, task):
    """Of the root moment at the samples from the end of a task on, by the simulation of a model of 20 modes."""
    return abs(task.residual(Simulator(case, task, count=20).run().at_samples.root_moment)).max()


def uncertain_loop(rng):
    """The laboratory arm with numbers up to 30 % off, a payload, 1 to 10 ms and other gains, stable at the samples."""
    while True:
        off = dict(zip(("youngs_modulus", "density", "damping"), rng.uniform(0.7, 1.3, 3).tolist(), strict=True))
        link = replace(LAB.link, **{name: share * getattr(LAB.link, name) for name, share in off.items()})
        hub = replace(LAB.hub, inertia=LAB.hub.inertia * float(rng.uniform(0.7, 1.3)))
        payload = replace(LAB.payload, mass=float(rng.uniform(0, 0.5)), inertia=float(rng.uniform(0, 1e-3)))
        arm = replace(LAB, link=link, hub=hub, payload=payload)
        law = tfarm.HubFeedback(K1=rng.uniform(0.3, 3.0), K2=rng.uniform(0, 0.3), Kp=rng.choice([0.0, 2.0, 8.0]))
        chain = shaped(period=float(rng.choice([0.001, 0.002, 0.005, 0.01])))
        delay = float(rng.choice([0.0, 0.4, 1.0]))
        chain = replace(chain, sampling=replace(chain.sampling, delay_samples=delay))
        if sampled_loop(Case(arm, law, chain)).is_stable:
            return arm, law, chain


@pytest.mark.parametrize("number", sized(6, 200))
def test_the_residual_of_a_shaped_slew_is_below_its_certified_bound(number):
    """On uncertain arms; from 5 ms on it is the residual to 0.1 %: poles left out have decayed within a sample."""
    rng = np.random.default_rng(5)
    profiles = ("bang-bang", "s-curve", "polynomial")
    ratios = []
    for n in range(number):
        arm, law, chain = uncertain_loop(rng)
        shaping = ReferenceShaping(shaper=[*BUILDERS][n % 3], profile=profiles[n // 3 % 3])
        case = Case(arm, law, replace(chain, reference=shaping))
        task = scenario("slew", arm, case.chain, chain.slew.rise_time + 400 * chain.sampling.period, law)
        bound, certainty = certified_bound(case, task, {})
        if bound is None:
            # of 1 and 2 ms alone
            assert chain.sampling.period < 0.005, certainty
            continue
        left = largest_residual(case, task)
        assert left <= bound
        ratios.append(bound / left)
        assert chain.sampling.period < 0.005 or ratios[-1] < 1.001
    assert np.median(ratios) < 5
    assert len(ratios) >= 0.75 * number


def test_the_bound_has_the_poles_left_out_in_the_moment_and_in_what_the_controller_reads():
    """A larger tail of the moment adds it times the largest torque; one of a fed back signal moves the torque too."""
    law = replace(LAW, K2=0.0)
    case = Case(LAB, law, shaped("none"))
    task = scenario("slew", LAB, case.chain, 2.0, law)
    bounds = SlewBounds(case, task)
    keyed = KeyedArms(LAB, ())
    own = bounds.bound(keyed, {}, None)
    torque = abs(Simulator(case, task, count=20).run().torque).max()
    for name in bounds.names:
        tails = own.band.tails + 1e-7 * (np.array(bounds.names) == name)
        more = bounds.bound(keyed, {}, own.band._replace(tails=tails)).most - own.most
        # what the controller reads is off by that, the torque by its gain, and the moment by some of the torque
        gain = {"root_moment": 1.0, "hub_rate": law.K1, "hub_angle": law.Kp}[name]
        assert more > (1.0 if name == "root_moment" else 0.1) * 1e-7 * torque * gain


def test_the_tail_is_above_the_sum_of_the_poles_left_of_its_line():
    """Below the top: those of a model of 60 modes, under the input of size 1 that makes each signal largest."""
    T = 0.002
    names = ("hub_angle", "hub_rate", "root_moment")
    plant = undelayed_plant(LAB, names, 60)
    read = Signals(LAB, names)
    for line, top in ((200.0, 5000.0), (1500.0, 12000.0)):
        left = (plant.poles.real < -line) & (abs(plant.poles.imag) < top)
        assert left.sum() >= 4
        p = plant.poles[left]
        shares = plant.residues[:, left] / p
        # of the last input the share r/p is that at rest: the rest of it, and those before, at their worst signs
        past = np.exp(np.outer(p, T * np.arange(1, 400)))
        answers = np.c_[shares @ past[:, :1], (shares * np.expm1(p * T)) @ past].real
        tail = EnclosedArms(LAB, (LAB,), read.outputs, read.places).tail(line, top, T, T)
        assert (abs(answers).sum(axis=1) <= tail).all()


@pytest.mark.parametrize("key", ["payload.mass", "hub.inertia"])
def test_the_residual_of_every_arm_in_a_range_is_below_its_certified_bound(key):
    """The controller, references and impulses of one arm on others, at the ends and between them."""
    arm = replace(LAB, payload=replace(LAB.payload, mass=0.2))
    case = Case(arm, LAW, shaped("ZVD"))
    task = scenario("slew", arm, case.chain, 2.0, LAW)
    own = numbers_of(arm)[key]
    ends = (own * 0.9999, own * 1.0001)
    found, boxes = SlewBounds(case, task).over({key: ends}, most_boxes=4)
    assert boxes <= 4
    inside = np.r_[ends, np.random.default_rng(1).uniform(*ends, 4)]
    left = [largest_residual(case.on(KeyedArms(arm, (key,)).at({key: each})), task) for each in inside.tolist()]
    assert max(left) <= found.most < 1.5 * max(left)
    # far outside
    other = KeyedArms(arm, (key,)).at({key: 1.5 * own})
    assert largest_residual(case.on(other), task) > found.most


@pytest.mark.parametrize(
    ("arm", "chain", "words"),
    [
        (tfarm.load("sasaki2012"), shaped("ZV"), "without damping"),
        (LAB, Chain(sampling=Sampling(antialias_corner=300.0)), "anti-alias filter"),
        (LAB, replace(shaped("ZV"), converters=Converters(encoder_counts=4096)), "not linear"),
    ],
)
def test_a_bound_without_a_proof_is_not_certified(arm, chain, words):
    task = slew_scenario(arm, chain, 2.0)
    bound, certainty = certified_bound(Case(arm, LAW, chain), task, {})
    assert bound is None
    assert certainty.startswith("not certified: ")
    assert words in certainty


@pytest.mark.parametrize(
    ("ranges", "key"),
    [
        ({"link.length": (1.0, 1.1)}, "range link.length"),
        ({"payload.mass": (0.2, 0.1)}, "range payload.mass"),
    ],
)
def test_a_wrong_range_has_its_line(ranges, key):
    assert refusal(reference, LAB, LAW, shaped("ZV"), ranges=ranges).key == key


def test_a_shaper_leaves_less_over_the_error_of_the_frequency():
    """ZVD less than ZV, both less than none; the curve at 0 is the residual of `simulate` over as long a record."""
    found = {kind: reference(LAB, LAW, shaped(kind)) for kind in ("none", "ZV", "ZVD")}
    assert found["none"].worst_share == 1.0
    near = abs(found["ZV"].errors) < 0.11
    zv, zvd = (found[kind].residuals[near] / found[kind].unshaped_residuals[near] for kind in ("ZV", "ZVD"))
    assert (zvd < zv).all()
    assert zv.max() < 0.25
    each = found["ZV"]
    run = tfarm.simulate(LAB, LAW, shaped("ZV"), "slew", float(each.nominal.t[-1]))
    assert run.residual_moment == pytest.approx(each.residual, rel=1e-9)
    assert run.scenario.busy_until == pytest.approx(each.rise_time + each.added)


def test_a_step_of_a_shaped_slew_is_the_simulation_and_a_sum_of_late_responses():
    """In continuous time that to the profile, as many samples late as each impulse, times its size."""
    found, plain = (tfarm.step(LAB, LAW, shaped(kind), "slew", 2.0) for kind in ("ZV", "none"))
    run = tfarm.simulate(LAB, LAW, shaped("ZV"), "slew", 2.0)
    every = round(found.period / found.t[1])
    np.testing.assert_allclose(found.sampled.signals["root_moment"][::every], run.at_samples.root_moment, atol=1e-9)
    late = 0.0
    for n, size in enumerate(impulses_of(LAB, shaped("ZV"), LAW).tolist()):
        t = found.t - n * found.period
        late = late + size * plain.response.at(np.maximum(t, 0.0)) * (t >= -1e-12)
    for own, truth in zip(found.response.at(found.t), late, strict=True):
        np.testing.assert_allclose(own, truth, rtol=0, atol=1e-9 * abs(truth).max())


@pytest.mark.parametrize("own", [{"profile": "s-curve"}, {"shaper": "ZVD"}])
def test_the_continuous_time_response_to_a_slew_is_near_that_of_fast_samples(own):
    found = tfarm.step(LAB, LAW, shaped(**own, period=0.002), "slew", 1.5)
    for name in ("hub_angle", "tip_displacement", "root_moment"):
        y, held = found.continuous.signals[name], found.sampled.signals[name]
        assert abs(y - held[: y.size]).max() < 0.01 * abs(held).max()


def test_a_study_has_the_shaped_slew_of_each_arm(tmp_path):
    """That of `step`, with the impulses of the arm itself."""
    law, key = tfarm.HubFeedback(K1=3.0, K2=0.15), "step.sampled.tip.settling_time_s"
    over = {"payload.mass": {"values": [0.1]}}
    found = []
    for kind in ("none", "ZVD"):
        study = tfarm.study(LAB, over, [key], law, shaped(kind), out=tmp_path / kind, draws=1, workers=1)
        truth = tfarm.step(LAB.with_numbers(payload_mass=0.1), law, shaped(kind), "slew")
        assert study.table()[key].tolist() == [truth.sampled.tip.settling_time]
        found.append(truth.busy_until)
    assert found[1] > found[0]


def test_the_command_is_the_function(capsys):
    from tfarm.cli.running import run

    assert run(["reference", "sasaki2012-lab", "--K1", "0.5", "--shaper", "EI", "--modes", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    law = replace(tfarm.default_gains(LAB), K1=0.5)
    truth = reference(LAB, law, Chain(reference=ReferenceShaping(shaper="EI", modes=1)))
    assert found["residual_moment_rms"] == truth.residual
    assert [each["is_shaped"] for each in found["modes"]] == [True, False]
