import math
import os
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.shared import refusal
from tfarm.arm import Arm, Hub, Link, Payload, Section, load, presets
from tfarm.arm.schema import arm_of_table
from tfarm.errors import ParameterError

# The example of the documentation, letter by letter
EXAMPLE = """\
name = "sasaki2012"
assumptions = ["density read as 2766.7 kg/m^3 (Table 1 prints 2.7667)", "..."]
[link]
length = 1.0               # m
density = 2766.7           # kg/m^3
youngs_modulus = 6.8944e10 # Pa
shear_modulus = 2.6517e10  # Pa; or poissons_ratio
damping = 0.0              # C [s], Kelvin-Voigt on bending
[link.section]             # shape = "rectangle": width, depth (in the plane of bending); "round", "tube"
shape = "general"
area = 6.0e-4              # m^2
second_moment = 1.8e-9     # m^4
shear_factor = 0.8333333333333334   # optional for the named shapes
[hub]
inertia = 0.1              # kg m^2; inf = locked, 0 = free pin
[payload]                  # optional
mass = 0.0                 # kg; inf = tip pinned
inertia = 0.0              # kg m^2; inf = tip cannot rotate
"""


@pytest.fixture
def refused(tmp_path):
    """Loads a file with this content, and gives the one line with which it is refused."""

    def refuse(content):
        path = tmp_path / "arm.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
        text = str(refusal(load, path))
        assert text.startswith(f"{path}: ")
        assert text.isprintable()
        assert len(text) < 1000
        return text.removeprefix(f"{path}: ")

    return refuse


def accepted(content):
    """The arm of a file with this content."""
    return arm_of_table(tomllib.loads(content))


def edited(old, new):
    assert EXAMPLE.count(old) == 1
    return EXAMPLE.replace(old, new)


def test_the_documented_file():
    arm = accepted(EXAMPLE)
    section = Section.general(area=6e-4, second_moment=1.8e-9, shear_factor=0.8333333333333334)
    assert arm == Arm(
        name="sasaki2012",
        assumptions=("density read as 2766.7 kg/m^3 (Table 1 prints 2.7667)", "..."),
        link=Link(
            length=1.0, density=2766.7, youngs_modulus=6.8944e10, shear_modulus=2.6517e10, section=section, damping=0.0
        ),
        hub=Hub(inertia=0.1),
        payload=Payload(mass=0.0, inertia=0.0),
    )


def test_what_is_optional():
    short = EXAMPLE[: EXAMPLE.index("[payload]")].replace("damping = 0.0 ", "# ")
    short = short.replace(short[short.index("assumptions") : short.index("[link]")], "")
    assert accepted(short).payload == Payload()
    assert accepted(short).assumptions == ()
    assert accepted(short + "[payload]\nmass = 2\n").payload == Payload(mass=2.0)


def test_whole_numbers_infinities_and_foreign_line_ends(tmp_path):
    assert accepted(edited("length = 1.0 ", "length = 1 ")).link.length == 1.0
    assert accepted(edited("inertia = 0.1", "inertia = inf")).is_locked
    assert accepted(edited("mass = 0.0", "mass = inf")).payload.mass == math.inf
    (tmp_path / "arm.toml").write_bytes(b"\xef\xbb\xbf" + EXAMPLE.replace("\n", "\r\n").encode())
    assert load(str(tmp_path / "arm.toml")) == accepted(EXAMPLE)


BAD_EDITS = {
    # what: (in the example, instead, part of the message)
    "missing key": ("length = 1.0 ", "# ", "link.length is missing: give a number without quotes"),
    "missing table": ("[hub]\ninertia = 0.1", "", "hub is missing: give a table, headed [hub]"),
    "missing name": ('name = "sasaki2012"', "", "name is missing: give a text in double quotes"),
    "missing shape": ('shape = "general"', "", "link.section.shape is missing: give one of rectangle, round"),
    "no shear modulus": ("shear_modulus = 2.6517e10", "", "link.shear_modulus is missing: give it in Pa, or"),
    "unknown key": ("density =", "densty =", 'link.densty = 2766.7: unknown key; did you mean "density"?'),
    "unknown table": ("[payload]", "[payloads]", 'unknown key; did you mean "payload"?'),
    "text for a number": ("length = 1.0 ", 'length = "1.0" ', "link.length = '1.0': wrong type; give a number"),
    "number for a text": ('name = "sasaki2012"', "name = 1", "name = 1: wrong type; give a text"),
    "number for an assumption": ('"..."', "3", "assumptions.1 = 3: wrong type; give a list of texts in double quotes"),
    "negative length": ("length = 1.0 ", "length = -1.0 ", "link.length = -1.0: a length is a positive, finite"),
    "both": ("damping", "poissons_ratio = 0.3\ndamping", "link.poissons_ratio = 0.3: shear_modulus is given too"),
    "long number": ("length = 1.0 ", f"length = 1{'0' * 5000} ", "TOML = "),
    "path as name": ('"sasaki2012"', '"../../x"', "name = '../../x': a name has 1 to 80 characters"),
    "control character": ('"..."', '"\\u001b[31m"', "assumptions = '\\x1b[31m': assumptions are a list of"),
    "twice": ("[hub]", "[link]", "is not TOML: Cannot declare ('link',) twice"),
    "no TOML": ("[hub]", "hub]", "line 14, column 4 = 'hub]': is not TOML: Expected '='"),
    "open text": ('name = "sasaki2012"', 'name = "sasaki', "is not TOML"),
}


@pytest.mark.parametrize("case", BAD_EDITS)
def test_a_bad_file_is_refused_in_one_line_with_its_key_value_and_remedy(refused, case):
    old, new, message = BAD_EDITS[case]
    content = EXAMPLE.replace(old, new, 1)
    assert content != EXAMPLE
    assert message in refused(content)


CHOKING = {
    "nothing": (b"", "name is missing"),
    "more than 64 KiB": (b"#" * 65_537, "size in bytes = 65537: a .toml file of at most 65536 is read"),
    "not UTF-8": (b'name = "\xff"', "byte 8 = b'\\xff': is not UTF-8; save the file as UTF-8"),
    "brackets in lines": (b"a = " + b"[\n" * 30_000, "brackets nested too deep"),
    "braces": (b"a = " + b"{a = " * 1000 + b"}" * 1000, "brackets nested too deep"),
    "many tables": ("".join(f"[a.b{i}]\nc.d = 1\n" for i in range(3500)).encode(), "unknown key"),
}


@pytest.mark.parametrize("case", CHOKING)
def test_a_file_that_chokes_a_parser_is_refused_at_once(refused, case):
    content, message = CHOKING[case]
    assert message in refused(content)


def test_a_misspelt_preset():
    text = str(refusal(load, "saski2012"))
    assert text.startswith("arm = 'saski2012': no such preset: did you mean \"sasaki2012\"?")
    assert all(name in text for name in presets())
    for name in ("", "  ", "a\0b.toml", None, 3):
        assert "give a preset (quanser-2dsfl, " in str(refusal(load, name))


def test_what_is_no_regular_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    os.symlink("loop.toml", tmp_path / "loop.toml")
    assert "is a folder; give a .toml file" in str(refusal(load, tmp_path))
    assert "is no regular file" in str(refusal(load, tmp_path / "pipe.toml"))
    assert "is no regular file" in str(refusal(load, "/dev/zero"))
    assert "cannot be read (Too many levels of symbolic links)" in str(refusal(load, tmp_path / "loop.toml"))
    assert "cannot be read (No such file or directory)" in str(refusal(load, tmp_path / "none.toml"))
    assert "cannot be read (No such file or directory)" in str(refusal(load, "two\nlines.toml"))
    assert "cannot be read (File name too long)" in str(refusal(load, "x" * 5000 + ".toml"))


def test_a_file_needs_no_ending_and_a_preset_precedes_a_file_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    other = EXAMPLE.replace("sasaki2012", "other")
    Path("my-arm").write_text(other)
    Path("sasaki2012").write_text(other)
    assert load("my-arm").name == "other"
    assert load("sasaki2012").name == "sasaki2012"
    assert load("./sasaki2012").name == "other"
    assert load(Path("sasaki2012")).name == "other"


positive = st.floats(0.1, 10)
inertias = st.one_of(st.just(0.0), st.just(math.inf), st.floats(1e-9, 1e9))
factors = st.one_of(st.none(), st.floats(0.1, 1.0))
sections = st.one_of(
    st.builds(Section.rectangle, width=positive, depth=positive, shear_factor=factors),
    st.builds(Section.round, diameter=positive, shear_factor=factors),
    st.builds(
        lambda outer, ratio, factor: Section.tube(
            outer_diameter=outer, inner_diameter=outer * ratio, shear_factor=factor
        ),
        positive,
        st.floats(0.1, 0.99),
        factors,
    ),
    st.builds(Section.general, area=positive, second_moment=positive, shear_factor=st.floats(0.1, 1.0)),
)
arms = st.builds(
    Arm,
    name=st.from_regex(r"[A-Za-z0-9][A-Za-z0-9 _.-]{0,20}[a-z]", fullmatch=True),
    assumptions=st.lists(st.text(st.characters(categories=("L", "N", "P", "S"))), max_size=3).map(tuple),
    link=st.builds(
        Link.isotropic,
        length=positive,
        density=positive,
        youngs_modulus=positive,
        poissons_ratio=st.floats(-0.9, 0.5),
        damping=st.one_of(st.just(0.0), positive),
        section=sections,
    ),
    hub=st.builds(Hub, inertia=inertias),
    payload=st.builds(Payload, mass=inertias, inertia=inertias),
)


@given(place=st.integers(0, len(EXAMPLE)), cut=st.integers(0, 12), noise=st.binary(max_size=12))
def test_a_damaged_file_is_read_or_refused_and_nothing_else(tmp_path_factory, place, cut, noise):
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    good = EXAMPLE.encode()
    path.write_bytes(good[:place] + noise + good[place + cut :])
    with suppress(ParameterError):
        assert isinstance(load(path), Arm)
