"""The sketch of an arm: each part of the record is drawn at its place and to scale, and no other; no words overlap."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

import tfarm
from tests.plots.labels import complaints
from tests.rigs import rig, some_rig
from tests.shared import thinned
from tests.shell import refused, run
from tfarm.arm import Gauge, RotarySpring
from tfarm.plots import files, sketch, style

mpl.use("Agg")

ROOT = Path(__file__).parents[2]
PRESETS = sorted(path.stem for path in (ROOT / "tfarm" / "arm" / "presets").glob("*.toml"))
FILES = [ROOT / "tests" / "data" / "quanser-2dsfl" / "rig.toml", ROOT / "tests" / "rigs" / "bench-rig.toml"]
FULL = rig(gauge=Gauge(x=0.1))
ARMS = {
    "full": FULL,
    **{name: tfarm.load(name) for name in PRESETS},
    **{path.stem: tfarm.load(path) for path in FILES},
    **{f"rig {seed}": some_rig(np.random.default_rng(seed)) for seed in range(20)},
}
# signs that are turns, around the axis or the gauge
TURNS = ("theta", "u", "root_moment")


def expected_places(arm):
    """Place [m] from the axis of each part of a record: its gid, and where the picture has it."""
    root = arm.hub.radius
    places = {"hub": 0.0, "axis": 0.0, "gauge": root + arm.gauge.x}
    places |= {} if arm.motor is None else {"motor": 0.0}
    places |= {} if not arm.hub.radius else {"hub.radius": root / 2}
    places |= {} if not arm.hub.stiffness else {"hub.stiffness": 0.0}
    places |= {} if math.isinf(arm.clamp.stiffness) else {"clamp": root}
    places |= {} if math.isinf(arm.joint.stiffness) else {"joint": 0.0}
    start = root
    for number, link in enumerate(arm.links, 1):
        places[f"link.{number}"] = start + link.length / 2
        start += link.length
        if number < len(arm.links):
            places[f"segment.joint.{number}"] = start
    for number, each in enumerate(arm.attachments, 1):
        there = {"body": each.mass + each.inertia, "stiffness": each.stiffness}
        there["rotational_stiffness"] = each.rotational_stiffness
        places |= {f"attachment.{number}.{name}": root + each.x for name, size in there.items() if size}
    if arm.payload.mass or arm.payload.inertia:
        places["payload"] = start + arm.payload.offset
        places |= {"payload.offset": start + arm.payload.offset / 2} if arm.payload.offset else {}
    return places


def parts_of(ax):
    """Each artist of a part by its gid, but for the arrows of the signs and their letters."""
    artists = [*ax.patches, *ax.lines]
    return {each.get_gid(): each for each in artists if each.get_gid() and not isinstance(each, FancyArrowPatch)}


def middle(artist):
    if isinstance(artist, Circle):
        return artist.center[0]
    if isinstance(artist, Rectangle):
        return artist.get_x() + artist.get_width() / 2
    return float(np.mean(artist.get_xdata()))


@pytest.fixture(scope="module", params=ARMS)
def drawn(request):
    return ARMS[request.param], sketch.figure(ARMS[request.param]).axes[0]


def test_every_part_is_at_its_place_and_no_other_part_is_drawn(drawn):
    arm, ax = drawn
    parts = parts_of(ax)
    expected = expected_places(arm)
    assert parts.keys() == expected.keys()
    low, high = ax.get_xlim()
    assert all(low < place < high for place in expected.values())
    for gid, place in expected.items():
        assert middle(parts[gid]) == pytest.approx(place, rel=1e-12, abs=1e-12 * arm.reach), gid


def test_lengths_are_to_scale_and_depths_as_the_key_says(drawn):
    arm, ax = drawn
    parts = parts_of(ax)
    ax.get_figure().draw_without_rendering()
    boxes = [parts[f"link.{number}"] for number, _ in enumerate(arm.links, 1)]
    assert ax.get_aspect() == 1.0
    assert [box.get_width() for box in boxes] == pytest.approx([link.length for link in arm.links])
    pixels = [box.get_window_extent().width for box in boxes]
    per_metre = ax.bbox.width / np.ptp(ax.get_xlim())
    assert pixels == pytest.approx([per_metre * link.length for link in arm.links])
    sections = [link.section for link in arm.links]
    depths = [2 * (of.half_depth or math.sqrt(3) * of.radius_of_gyration) for of in sections]
    ratios = [box.get_height() / depth for box, depth in zip(boxes, depths, strict=True)]
    (words,) = [label for label in ax.get_legend_handles_labels()[1] if label.startswith("link")]
    _, is_enlarged, factor = words.partition("depth drawn × ")
    if "not to scale" in words:
        assert max(ratios) > 1.01 * min(ratios)
    else:
        assert ratios == pytest.approx([float(factor) if is_enlarged else 1.0] * len(ratios))
    # a point of print at the width of a column
    assert min(box.get_height() for box in boxes) > np.ptp(ax.get_xlim()) / (3.5 * 72)


@pytest.mark.parametrize(("side", "number"), [("inner", 1), ("outer", 2)])
def test_a_gauge_at_a_joint_is_on_the_surface_of_its_own_segment(side, number):
    arm = replace(FULL, gauge=Gauge(x=FULL.link.length, side=side), outer=FULL.outer[1:])
    parts = parts_of(sketch.figure(arm).axes[0])
    assert parts["gauge"].get_ydata() == pytest.approx(parts[f"link.{number}"].get_height() / 2)
    assert parts["link.1"].get_height() != parts["link.2"].get_height()


def test_signs_turn_anticlockwise_and_the_tip_goes_up(drawn):
    arm, ax = drawn
    arrows = {each.get_gid(): each for each in ax.patches if isinstance(each, FancyArrowPatch)}
    assert arrows.keys() == {"theta", "root_moment", "tip_displacement"} | (set() if arm.is_locked else {"u"})
    for gid in TURNS:
        if gid in arrows:
            centre = arm.hub.radius + arm.gauge.x if gid == "root_moment" else 0.0
            arc = arrows[gid]._path_original.vertices - [centre, 0.0]
            angles = np.unwrap(np.arctan2(arc[:, 1], arc[:, 0]))
            assert np.all(np.diff(angles) > 0), gid
    (x0, y0), (x1, y1) = arrows["tip_displacement"]._posA_posB
    assert x0 == x1 == pytest.approx(arm.reach)
    assert 0 < y0 < y1


@pytest.mark.parametrize(("place", "name"), thinned(product(["", "column", "page", "phone"], ARMS), 3))
def test_no_two_texts_overlap(place, name):
    with style.drawn_for(place):
        assert complaints(sketch.figure(ARMS[name])) == []


@pytest.mark.parametrize(
    ("gid", "changes"),
    [
        ("clamp", {"clamp": RotarySpring()}),
        ("joint", {"joint": RotarySpring()}),
        ("motor", {"motor": None}),
        ("hub.radius", {"hub": replace(FULL.hub, radius=0.0)}),
        ("payload", {"payload": tfarm.Payload()}),
        ("attachment.1.body", {"attachments": ()}),
        ("segment.joint.1", {"outer": (), "attachments": (), "gauge": Gauge()}),
    ],
)
def test_a_part_that_is_absent_is_not_drawn(gid, changes):
    assert gid in parts_of(sketch.figure(FULL).axes[0])
    assert gid not in parts_of(sketch.figure(replace(FULL, **changes)).axes[0])


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_check_draws_the_arm_and_prints_what_it_printed_without(kind, tmp_path, capsys):
    file = tmp_path / f"arm.{kind}"
    _, plain, _ = run(capsys, "check", "quanser-2dsfl")
    code, out, err = run(capsys, "check", "quanser-2dsfl", "--figure", str(file))
    assert (code, out) == (0, plain)
    # after lines of progress on a slow machine
    assert err.endswith(f"written: {file}\n")
    again = tmp_path / f"again.{kind}"
    files.save_picture(sketch.figure, tfarm.load("quanser-2dsfl"), again)
    assert file.read_bytes() == again.read_bytes()
    assert "give a name that ends in .png, .svg or .pdf" in refused(capsys, "check", "quanser-2dsfl", "--figure", "a.b")
