"""Every number on an arm's page is a rounding of one in a command's JSON, or in a file of the page.

Cells are held against the file of their table by the key of the column and the row; sentences, captions, cards
and descriptions of pictures against what the commands of that section answer, in process.  What is derived from these
is derived here, once more.  PROSE is what is no result: signs, limits and settings that sentences name.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.hostile import NAME
from tests.report.full import ARM
from tests.report.walked import Walk, columns_of, numbers_of, read, read_arm, shown_in, told, untraced, untraced_cells
from tfarm.report.locus_section import RANGE_OF_K2
from tfarm.spectrum.table import default_gains, rate_unit

PROSE = {  # phrases with numbers that are no results, and what they are
    r"around −1|−1 lies on the ring 1|encirclements of −1": "the critical point of Nyquist's criterion",
    r"[CK]\d? ?[=<>] ?[01]\b|K2 [<>] 1|K2 = 1 and beyond|K2 above 1|0 ≤ Im s|Im s ≥ 0|r = 0|K2 = 0\b": "signs, limits",
    r"through 0\b|[Bb]elow 0|above 0|at s = 0|lie below 0|from 0 to|Row 0|Band 0|one at 0|angle at 0|always 0": "zero",
    r"r/\(1 \+ r\)|\(2 \+ αδ\)/\(2 − αδ\), \|δ\| < 1|\|L\| [=<] 1|A depth²/12|margins are 0|\(1 \+ C s\)": "formulas",
    r"−?100 % (?:one|is a real)": "what a damping ratio of a real root is",
    r"band of 180 degrees": "what a phase beside the motor keeps to",
    r"bounds of 20 digits": "digits of the proof's bounds",
    r"less than 10⁻¹² of": "a tolerance of the Nyquist count",
    r"A slender arm has 0\.5": "the slope of a slender beam",
    r"^mode \d+": "headings of columns",
    r"SHA-256|tfarm \d+\.\d+\.\d+": "names",
    r"0\.00642 J": "the share of the default gain, in the paper's letters",
    r"first \d+ modes|First natural frequencies|first two modes": "how many are drawn",
}
COMMANDS = {  # what the sections' numbers are held against
    "margins": ("margins", "sampled"),
    "margins-map": ("margins", "sampled"),
    "arm": ("modes",),
    "bode-root-moment": ("bode root_moment",),
    "bode-tip-displacement": ("bode tip_displacement",),
    "modes": ("modes",),
    "locus": ("margins", "poles", "locus K1", "locus K2"),
    "margins-nyquist": ("nyquist", "modes"),
    "sampled": ("sampled", "margins", "simulate K2", "simulate"),
    "tune": (),
    "assumptions": (),
    "words": ("margins",),
    "": (),
}


FEW = ("--points", "40")  # of a locus: what its sentences say is the same on any grid


@pytest.fixture(scope="module")
def answers(pages):
    """The commands' JSON, by the words of COMMANDS."""
    file = str(pages / NAME / "arm.toml")
    low, high = map(str, RANGE_OF_K2)
    asked = {
        "modes": ("modes", file, "--certify"),
        "margins": ("margins", file),
        "poles": ("poles", file),
        "sampled": ("sampled", file),
        "bode root_moment": ("bode", file, "--output", "root_moment"),
        "bode tip_displacement": ("bode", file, "--output", "tip_displacement"),
        "locus K1": ("locus", file, "--vary", "K1", "--from", "0", "--to", str(2 * rate_unit(ARM)), *FEW),
        "locus K2": ("locus", file, "--vary", "K2", "--from", low, "--to", high, *FEW),
        "nyquist": ("nyquist", file),
        "simulate": ("simulate", file),
        "simulate K2": ("simulate", file, "--K2", "0"),
    }
    return {words: told(*arguments) for words, arguments in asked.items()}


@pytest.fixture(scope="module")
def walk(pages):
    return Walk((pages / NAME / "index.html").read_text(encoding="utf-8"))


def files_of(part, folder):
    """The rows of a section's tables, by their stems."""
    return {stem: read(folder / "data" / f"{stem}.json")["rows"] for stem in part.tables}


def curves_of(part, folder):
    """The files of a section's pictures, each as a list of columns."""
    names = [name for name in part.files if name.endswith("-data.csv")]
    return [columns_of(folder / "data" / name) for name in names]


def derived(answers):
    """What sentences say that follows from the commands' numbers, by the section that says it."""
    slopes = answers["modes"]["modes"][1]["sensitivity"]
    modes = [row["natural_frequency_rad_s"] for row in answers["modes"]["modes"]]
    moment, tip = (answers[f"bode {output}"] for output in ("root_moment", "tip_displacement"))
    J, hub = ARM.total_inertia, ARM.hub.inertia
    sampled, law = answers["sampled"], default_gains(ARM)
    runs = [tfarm.simulate(ARM, replace(law, K2=K2)) for K2 in (0.0, law.K2)]
    band = answers["nyquist"]["band_rad_s"]
    below = int((tfarm.modes(ARM, count=20).natural_frequency < band).sum())
    return {
        "arm": [math.sqrt(12 * ARM.link.section.second_moment / ARM.link.section.area) / ARM.length],
        "margins-map": [J * modes[1], (modes[2] + modes[3]) / 2],  # J w1; half way to the mode that is not looked at
        "bode-root-moment": [math.hypot(*moment["value"][0])],
        "bode-tip-displacement": [
            math.hypot(*tip["value"][0]),
            sum((1 if z["im"] == 0 else 2) for z in tip["zeros"] if z["re"] > 1e-9 * math.hypot(z["re"], z["im"])),
            max(tip["phase_deg"]) - min(tip["phase_deg"]),
        ],
        "locus": [J / (J - hub)],
        "margins-nyquist": [below],
        "sampled": [
            sampled["period_s"] / abs(sampled["log_spectral_radius"]),
            100 * sampled["required_damping_s"] * modes[1] / 2,
            *(math.degrees(run.at_samples.hub_angle[-1] - run.scenario.hub_angle[-1]) for run in runs),
        ],
        "assumptions": [
            ARM.link.section.area,
            2 * slopes["second_moment"],  # one per cent of depth counts twice
            slopes["hub_inertia"],
            answers["modes"]["modes"][1]["hub_locked_rad_s"],
            tfarm.modes(ARM.having(hub_inertia=0.0), count=1).natural_frequency[-1],
        ],
    }


@pytest.fixture(scope="module")
def values(pages, walk, answers):
    """Everything that each section may show, by its anchor."""
    law, folder, more = default_gains(ARM), pages / NAME, derived(answers)
    found = {}
    for part in walk.parts:
        own = [files_of(part, folder), curves_of(part, folder), [law.K1, law.K2], read_arm(folder)]
        asked = [answers[name] for name in COMMANDS.get(part.anchor, ())]
        found[part.anchor] = np.unique(numbers_of([own, asked]) + numbers_of(more.get(part.anchor, [])))
    return found


def test_every_cell_rounds_the_value_under_its_key(pages, walk):
    law, count = [default_gains(ARM).K1, default_gains(ARM).K2], 0
    for part in walk.parts:
        for stem, rows in files_of(part, pages / NAME).items():
            sheet = part.tables[stem]
            assert len(sheet.keys) == len(sheet.rows[0])
            assert untraced_cells(sheet, rows, law) == [], stem
            count += sum(len(shown_in(cell)) for row in sheet.rows for cell in row)
    assert count > 700


def test_every_number_in_words_is_one_of_the_commands(walk, values):
    """But for the answers at the top: these are sentences of the sections below, word for word."""
    said = {part.anchor: part for part in walk.parts}
    for text in said.pop("answers").texts[1:]:
        sentence = text.removesuffix(
            next((p.texts[0] for p in said.values() if p.texts and text.endswith(p.texts[0])), "")
        )
        assert any(sentence.strip() in each for part in said.values() for each in part.texts), text
    titles = tuple(part.texts[0] for part in said.values() if part.anchor)
    for part in walk.parts:
        if part.anchor != "answers":
            texts = [text for text in part.texts if part.anchor or not text.startswith(titles)]  # but for the contents
            left = untraced(texts, values[part.anchor], PROSE)
            assert [(part.anchor, each.value, each.where) for each in left] == []


def test_a_digit_that_is_changed_is_noticed(walk, values):
    """The walk is no formality: of the numbers of four digits nearly none can be off by three units of the last."""
    seen = [
        not replace(each, value=each.value + step * each.half).is_rounding_of(values[part.anchor])
        for part in walk.parts
        for text in part.texts
        for each in shown_in(text)
        for step in (-6, 6)  # halves of a unit
        if abs(each.value) >= 2000 * each.half and part.anchor in COMMANDS
    ]
    assert len(seen) > 100
    assert sum(seen) >= 0.95 * len(seen)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("5.7456 × 10⁶ N m and −0.26, 1.8e-9 or −3 × 10⁻² %", [5745600.0, -0.26, 1.8e-9, -0.03]),
        (
            "K1 = 77.7, a1/a2 = 0.7 of mode 2: 40 %, 141783 rad/s (1/s), lab2012-lab",
            [77.7, 0.7, 2, 40, 141783],
        ),
        ("[0.3035, 0.6428], 0 … 20.73; 12.8 ms.", [0.3035, 0.6428, 0, 20.73, 12.8]),
    ],
)
def test_numbers_are_read_as_they_stand(text, values):
    assert [each.value for each in shown_in(text)] == pytest.approx(values, rel=1e-14)
