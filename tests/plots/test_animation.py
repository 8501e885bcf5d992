"""The film of a slew: where the tip is drawn, and how many frames there are, against the run itself."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import tfarm
from tfarm.dsp import Chain, Sampling, load_chain
from tfarm.dsp.traces import Motion, exaggeration, motion_of
from tfarm.plots.animation import draw_motion, film
from tfarm.plots.files import fix_layout
from tfarm.plots.style import style

LAB = tfarm.load("sasaki2012-lab")
GAINS = tfarm.default_gains(LAB)


@pytest.fixture(scope="module")
def run():
    """As many modes and records as the film has, so that both are equal to rounding."""
    chain = Chain(sampling=Sampling(period=0.01, delay_samples=0.5))
    return tfarm.simulate(LAB, GAINS, chain, duration=0.5, count=20, between=4, outputs=["deflection@0.5"])


@pytest.fixture(scope="module")
def motion(run):
    return motion_of(LAB, run)


def at(run, name, t):
    """A signal at the time of a frame, between two records."""
    both = [(of.t, of.signal(name)) for of in (run.at_samples, run.between)]
    times, values = (np.concatenate(each) for each in zip(*both, strict=True))
    order = np.argsort(times)
    return np.interp(t, times[order], values[order])


@pytest.mark.parametrize("share", [0.0, 0.31, 0.5, 1.0])
def test_the_drawn_tip_is_at_hub_angle_times_reach_plus_deflection(run, motion, share):
    frame = round(share * (motion.t.size - 1))
    figure = draw_motion.figure(motion._replace(still=frame))
    x, y = figure.axes[0].lines[1].get_data()
    theta, tip = (at(run, name, motion.t[frame]) for name in ("hub_angle", "tip_displacement"))
    turned = (x + 1j * y) * np.exp(-1j * theta)
    scale = abs(run.at_samples.tip_displacement).max()
    assert turned[-1].real == pytest.approx(LAB.reach, rel=1e-12)
    assert turned[-1].imag == pytest.approx(motion.factor * (tip - theta * LAB.reach), abs=1e-9 * scale)
    middle = motion.factor * at(run, "deflection@0.5", motion.t[frame])
    assert turned[x.size // 2].imag == pytest.approx(middle, abs=1e-9 * scale)
    torque = run.torque[min(int(motion.t[frame] / 0.01 + 1e-9), run.torque.size - 1)]
    assert figure.axes[0].get_title(loc="left") == f"t = {motion.t[frame]:.2f} s,  u = {torque:.3g} N m"


@pytest.mark.parametrize(
    ("name", "kind"), [("quanser-flexlink", "slew"), ("sasaki2012", "decay"), ("sasaki2012", "pulse")]
)
def test_the_motion_is_the_runs_own_through_converters_and_from_rest_or_not(name, kind):
    """The tip of every frame, whatever drives the hub."""
    arm = tfarm.load(name)
    run = tfarm.simulate(arm, tfarm.default_gains(arm), load_chain(name), kind, 0.5, count=20, between=4)
    found = motion_of(arm, run)
    theta, tip = (at(run, signal, found.t) for signal in ("hub_angle", "tip_displacement"))
    places = np.exp(1j * theta) * (arm.reach + 1j * found.factor * (tip - arm.reach * theta))
    assert abs(places - found.link[:, -1]).max() < 1e-9 * arm.reach


def test_the_reference_is_the_slew_of_the_rigid_arm(run, motion):
    x, y = draw_motion.figure(motion._replace(still=motion.t.size - 1)).axes[0].lines[0].get_data()
    assert np.arctan2(y[-1], x[-1]) == pytest.approx(run.scenario.hub_angle[-1], rel=1e-6)


def test_a_film_has_a_frame_for_each_twentieth_of_its_own_second_and_the_same_bytes_twice(run, motion):
    shown = tfarm.plots.animate(LAB, run)
    gif = Image.open(io.BytesIO(shown.gif))
    lasts = float(run.t[-1]) / motion.speed
    assert shown.frames == gif.n_frames == 1 + round(20 * lasts) <= 240 + 1
    assert gif.info["duration"] == 50
    assert 20 / motion.speed >= 8 * tfarm.modes(LAB, 1).natural_frequency_hz[-1]
    assert len(shown.gif) < 1_000_000
    assert film(motion_of(LAB, run)).gif == shown.gif
    heights = []
    for frame in (1, gif.n_frames // 2, gif.n_frames - 1):  # the mark at the tip rises with the hub's angle
        gif.seek(frame)
        red, _, blue = np.moveaxis(np.array(gif.convert("RGB")).astype(int), -1, 0)
        heights.append(gif.height - np.argwhere(blue - red > 120)[:, 0].min())
    angles = motion.link[[1, motion.t.size // 2, -1], -1].imag
    assert gif.convert("RGB").getpixel((3, 3)) == (255, 255, 255)
    assert np.corrcoef(heights, angles)[0, 1] > 0.999
    assert shown._repr_html_().startswith('<img src="data:image/gif;base64,R0lGOD')


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_frame_is_the_picture_drawn_anew(motion, share):
    """By a figure of its own, of which nothing was drawn before."""
    frame, drawn = round(share * (motion.t.size - 1)), io.BytesIO()
    gif = Image.open(io.BytesIO(film(motion, dpi=90).gif))
    gif.seek(frame)
    with style():
        figure = draw_motion.figure(motion._replace(still=frame))
        fix_layout(figure)
        figure.savefig(drawn, format="png", dpi=90)
    shown, whole = (np.asarray(each.convert("RGB")).astype(int) for each in (gif, Image.open(drawn)))
    assert shown.shape == whole.shape
    assert abs(shown - whole).max() < 100  # of 255: edges in 48 colours; a frame away it is 229
    assert abs(shown - whole).mean() < 0.2


def test_the_still_has_the_largest_deflection_to_scale_where_it_is_seen_and_else_named(run, motion):
    assert [exaggeration(share) for share in (0.0, 0.3, 0.02, 0.019, 0.004, 0.0011)] == [1, 1, 1, 5, 20, 50]
    words = draw_motion.figure(motion).axes[0].get_xlabel()
    assert words == f"hub to tip 1 m, thin: reference,\ndeflection × {motion.factor}, speed × 0.2"
    tip = run.between.tip_displacement - LAB.reach * run.between.hub_angle
    assert abs(motion.t[motion.still] - run.between.t[np.argmax(abs(tip))]) < 0.02
    assert 0.04 < motion.factor * abs(tip).max() / LAB.reach <= 0.1
    plain: Motion = motion._replace(factor=1, speed=1)
    assert draw_motion.figure(plain).axes[0].get_xlabel().endswith(",\ndeflection to scale")


def test_an_unstable_loop_that_was_stopped_and_another_radius_have_a_film():
    arm = replace(LAB, hub=replace(LAB.hub, radius=0.1))
    run = tfarm.simulate(arm, tfarm.HubFeedback(K1=0.3, K2=3.0), duration=1.0)
    assert run.stopped is not None
    found = motion_of(arm, run)
    assert abs(found.link[:, 0]) == pytest.approx(0.1)
    assert found.t[-1] <= run.t[-1] * (1 + 1e-9)
    assert np.isfinite(found.link).all()


def test_other_records_and_a_run_of_one_sample_have_no_film():
    with pytest.raises(tfarm.ParameterError, match=r"tfarm\.simulate returns"):
        tfarm.plots.animate(LAB, tfarm.modes(LAB, 2))
    run = tfarm.simulate(LAB, GAINS, Chain(sampling=Sampling(period=0.5)), duration=1.0, count=4)
    short = replace(run, at_samples=replace(run.at_samples, t=run.t[:1]))
    with pytest.raises(tfarm.ParameterError, match="more than one sample"):
        tfarm.plots.animate(LAB, short)
