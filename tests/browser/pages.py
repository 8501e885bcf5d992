"""Pages in a real browser, from the disk: `make test-browser` (Playwright with the system's Chromium).

Not collected by `make test`.  It prints how soon a live page answers and how long a move takes.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import shutil
import statistics
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, sync_playwright

import tfarm
from tfarm.arm import Arm, HubFeedback, Law
from tfarm.arm.law_tables import load_law
from tfarm.assessment.card import LoopCard, reference_damping
from tfarm.case import Case
from tfarm.dsp import Chain, load_chain
from tfarm.dsp.results import simulate_scenario
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.margins import margins
from tfarm.loop.plane import gain_map
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import stability
from tfarm.report.live import ASSETS, SCRIPT, LivePage, save_live, write_assets
from tfarm.report.page import ArmReport, GivenLaw
from tfarm.schema import to_dict
from tfarm.synthesis.design import recommended_gains

Real = NDArray[np.float64]

ARMS = ("sasaki2012-lab", "stocky-steel", "quanser-flexlink")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")
GAINS, MOVES = 10, 60
LARGEST_PAGE = 1_000_000  # bytes of a page and its script
INTERACTIVE, MOVE = 0.5, 0.016  # s: what they should take; printed, and asserted with room for a busy machine
BUSY = 5.0
LARGEST_TURN = 5.0  # deg, of the line of a locus at a point of it
SEEN = 1.5  # pixels: a piece of a line whose ends are seen
NAMES = ("phase", "phase_lag", "phase_lead", "delay", "disk", "peak_sensitivity", "peak_complementary")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("pages")
    for name in ARMS:
        (out / name).mkdir()
        save_live(ArmReport(tfarm.load(name), load_chain(name)), out / name)
    write_assets(out / ASSETS)
    return out


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.fail("no Chromium on this machine: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(FLAGS))
        yield browser
        browser.close()


def live_page(browser: Browser, folder: Path, name: str = ARMS[0], width: int = 1400, height: int = 900) -> Opened:
    """Open the live page of an arm on a screen of that size."""
    opened = Opened(browser, folder / name / "live.html", width)
    opened.page.set_viewport_size({"width": width, "height": height})
    return opened


def wait_until(page: Page, expression: str, arg: Any = None, timeout: float = 30_000) -> None:
    """Wait until an expression, or a function of `arg`, is true in the page."""
    deadline = time.monotonic() + timeout / 1e3
    while not page.evaluate(expression, arg):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(5)


class Opened:
    """A page with its requests; any message is an error."""

    def __init__(
        self, browser: Browser, file: Path, width: int = 1400, scheme: Any = "light", motion: Any = "no-preference"
    ):
        self.context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, reduced_motion=motion
        )
        self.page: Page = self.context.new_page()
        self.page.wait_for_function = partial(wait_until, self.page)  # Playwright's own is refused by the page's policy
        self.messages: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.messages.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("requestfailed", lambda request: self.messages.append(f"not there: {request.url}"))
        self.page.goto(file.as_uri())
        if file.name == "live.html":
            self.page.wait_for_selector("body[data-ready]", timeout=20_000)

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, failed: object, *_: object) -> None:
        """Close it; a page with any message fails."""
        self.context.close()
        assert failed or not self.messages, self.requests[0]


def set_gains(page: Page, law: HubFeedback) -> None:
    """Typed into the fields, with the tables open; waits until the page has drawn the last of them."""
    page.evaluate("document.getElementById('more').open = true")
    before = page.evaluate("window.live.moves.length")
    for name in ("K1", "K2", "Kp"):
        page.locator(f"#{name}").fill(repr(law[name]))
        page.locator(f"#{name}").dispatch_event("change")
    page.wait_for_function(
        "([n, gains]) => live.moves.length > n && Object.keys(gains).every(k => live.now.law[k] === gains[k])",
        arg=[before, {name: law[name] for name in ("K1", "K2", "Kp")}],
    )
    page.wait_for_function("() => live.delayed === live.now.law")


def slew_words(arm: Arm, law: HubFeedback, chain: Chain, modes: int) -> dict[str, str]:
    """What the page shows of a slew, from the answer of `tfarm simulate`."""
    answer = to_dict(simulate_scenario(Case(arm, law, chain), "slew", 3 * chain.slew.rise_time, count=modes))
    settled = answer["settling_time_s"]
    largest = {name: max(map(abs, answer[key])) for name, key in (("torque", "torque"), ("moment", "root_moment"))}
    figures = largest | {"residual": answer["residual_moment_rms"]}  # none of a run that stopped
    shown = {name: "not computed" if value is None else f"{value:.5g}" for name, value in figures.items()}
    words = f"not settled within {answer['t'][-1]:.5g} s" if settled is None else f"{settled:.5g}"
    is_unstable = sampled_verdict(Case(arm, law, chain)).word == "unstable"
    return {f"slew-{name}": value for name, value in shown.items()} | {
        "slew-settled": "unstable" if is_unstable else words
    }


CARD = {"up": "gain_margin", "down": "gain_reduction", "phase": "phase_margin", "delay": "delay_margin",
        "peak": "peak_sensitivity"}  # fmt: skip


def card_words(card: LoopCard, of: str) -> dict[str, str]:
    """What the page's card has of one loop, from the library's."""
    wanted = {}
    for key, name in CARD.items():
        found = getattr(card, name)
        size = "-" if found.value is None else "no limit" if math.isinf(found.value) else f"{found.value:.4g}"
        wanted |= {f"{of}-{key}": size, f"{of}-{key}-grade": found.grade.strip("-")}
    least, constant = card.least_damping, card.time_constant
    return wanted | {
        f"{of}-ratio": "-" if least is None else f"{100 * least.ratio:.4g}",
        f"{of}-constant": "-" if constant is None else f"{constant:.4g}",
    }


def live_data(page: Page) -> dict[str, Any]:
    return page.evaluate("JSON.parse(document.getElementById('live-data').textContent)")


def texts(page: Page, ids: list[str]) -> dict[str, str]:
    return page.evaluate("ids => Object.fromEntries(ids.map(id => [id, document.getElementById(id).textContent]))", ids)


def show_chart(page: Page, name: str) -> Any:
    """The box of a chart, which is chosen and in view."""
    if page.locator(f"button[value={name}]").count():
        page.locator(f"button[value={name}]").click()
    page.locator(f"#{name} canvas").scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    box = page.locator(f"#{name} canvas").bounding_box()
    assert box is not None
    return box


def random_gains(data: dict[str, Any], number: int) -> Iterator[HubFeedback]:
    rng = np.random.default_rng(15)
    K1, K2, Kp = (data["axes"][name] for name in ("K1", "K2", "Kp"))
    for i in range(number):
        rate = math.exp(rng.uniform(math.log(K1["linear"]), math.log(K1["high"])))
        angle = rng.uniform(0.0, 0.1 * Kp["high"]) if i % 3 == 2 else 0.0
        yield HubFeedback(K1=rate, K2=rng.uniform(max(K2["low"], -K2["high"]), 0.7 * K2["high"]), Kp=angle)


@pytest.mark.parametrize("name", ARMS)
def test_what_is_shown_at_random_gains_is_what_tfarm_prints(browser, folder, name):
    """Every digit and grade of the card, the margins, the poles, the sampled loop and the slew."""
    arm, chain = tfarm.load(name), load_chain(name)
    with live_page(browser, folder, name) as opened:
        page, stable = opened.page, [0, 0]
        data = live_data(page)
        start = HubFeedback(**data["start"])
        slow = start.with_number("K1", 0.1 * data["axes"]["K1"]["linear"])  # rounding in its margins
        for law in (slow, start, *random_gains(data, GAINS)):
            set_gains(page, law)
            found, verdict = margins(arm, law, data["band"]), sampled_verdict(Case(arm, law, chain))
            wanted = {"sampled": verdict.word} | slew_words(arm, law, chain, data["slew"]["modes"])
            if found.in_band is not None and law is not slow:
                low, high = found.in_band.gain
                wanted |= {f"m-{key}": f"{getattr(found.in_band, key):.6g}" for key in NAMES}
                wanted["m-gain"] = f"{low:.8g} to {high:.8g}"
            card = tfarm.result_card(arm, law, chain)
            for of, each in (("s", card.continuous), ("z", card.sampled)) if law is not slow else ():
                assert each is not None
                own = card_words(each, of) | {f"{of}-limits": each.finding.removeprefix(each.stability)[2:]}
                if each.stability == "unstable":  # of other modes where the page has a fixed number of them
                    own = {key: words for key, words in own.items() if not key.startswith("z-ratio")}
                wanted |= own
                look = page.locator("#verdict" if of == "s" else "#sampled").get_attribute("class")
                assert look == f"pill {each.stability if each.grade == '-' else each.grade}", (law, of)
            here = {key: words.removeprefix("≥ ") for key, words in texts(page, list(wanted)).items()}
            assert here == wanted, law
            assert texts(page, ["verdict"])["verdict"].startswith("stable") == found.stability.is_stable, law
            poles = found.stability.poles.values
            for re, im in page.evaluate("() => window.live.loop.poles(window.live.law)"):
                assert abs(poles - complex(re, im)).min() < 5e-4 * abs(complex(re, im)), law
            radius = f"spectral radius {math.exp(verdict.log_radius):.12g},"
            assert radius in (page.locator("#sampled-note").text_content() or ""), law
            stable[0] += found.in_band is not None
            stable[1] += verdict.is_stable
        assert stable[0] >= 2
        assert stable[1] > 0


def stable_gains(data: dict[str, Any], number: int) -> Iterator[HubFeedback]:
    """In stable intervals of the sampled map, half of them near an end."""
    rng = np.random.default_rng(56)
    of, K2 = data["sampled_map"], data["axes"]["K2"]
    columns = [(K1, each) for K1, found in zip(of["K1"], of["intervals"], strict=True) for each in found]
    for i, place in enumerate(rng.integers(len(columns), size=number)):
        K1, (low, high) = columns[place]
        share = (rng.uniform(), rng.uniform() ** 4, 1 - rng.uniform() ** 4)[i % 3]
        ends = np.clip((low, high), K2["low"], K2["high"])
        yield HubFeedback(K1=K1, K2=float(ends[0] + share * (ends[1] - ends[0])))


# of which the crossovers of L alone have another delay margin, near the border of the region
NEAR_THE_BORDER = (HubFeedback(K1=1.44164, K2=-0.10315), HubFeedback(K1=3.57159, K2=0.03269))


@pytest.mark.parametrize(("name", "more"), [(ARMS[0], NEAR_THE_BORDER), (ARMS[2], ())])
def test_the_delay_margin_of_the_sampled_loop_is_that_of_tfarm(browser, folder, name, more):
    """At rest within 1 %, near the border too; in a move a bound below it where it is more than is good."""
    arm, chain = tfarm.load(name), load_chain(name)
    with live_page(browser, folder, name) as opened:
        page, seen = opened.page, 0
        for law in (*more, *stable_gains(live_data(page), 32)):
            card = tfarm.result_card(arm, law, chain).sampled
            assert card is not None
            if card.stability != "stable":
                continue
            page.evaluate("gains => live.set(gains)", law.by_name)
            page.wait_for_function("gains => Object.keys(gains).every(k => live.now.law[k] === gains[k])", law.by_name)
            moving = texts(page, ["z-delay", "z-delay-grade"])
            page.wait_for_function("() => live.delayed === live.now.law")
            shown = texts(page, ["z-delay", "z-delay-grade"])
            delay = float(shown["z-delay"].removeprefix("≥ "))
            assert delay == pytest.approx(card.delay_margin.value, rel=0.01), law
            assert shown["z-delay"].startswith("≥") == (delay == 1e3 * 20 * chain.sampling.period), law
            assert moving["z-delay-grade"] == shown["z-delay-grade"] == card.delay_margin.grade, law
            assert float(moving["z-delay"].removeprefix("≥ ")) <= delay, law
            seen += 1
        assert seen >= 30


def seen_turns(rows: list[dict[str, float]], frame: dict[str, list[float]], chart: list[float]) -> Real:
    """How far [deg] the lines through these rows turn at each point in the frame, between pieces one of which is seen.

    `chart`: its width and height in pixels.  Left out is where a line meets the real axis: a true corner.
    """
    found: list[Real] = []
    (left, right), (low, high) = frame["x"], frame["y"]
    for number in {row["piece"] for row in rows}:
        line = sorted((row for row in rows if row["piece"] == number), key=lambda row: row["gain"])
        s = np.array([complex(row["re"], row["im"]) for row in line])
        x, y = (s.real - left) / (right - left), (s.imag - low) / (high - low)
        step = np.diff(chart[0] * x + 1j * chart[1] * y)
        is_real = abs(s.imag) < 1e-9 * (high - low)
        inside = (x > 0) & (x < 1) & (y >= 0) & (y < 1)
        compared = inside[1:-1] & ~is_real[1:-1] & ~is_real[:-2] & ~is_real[2:]
        seen = np.maximum(abs(step[1:]), abs(step[:-1])) > SEEN
        found.append(abs(np.degrees(np.angle(step[1:] * step[:-1].conj())))[compared & seen])
    return np.concatenate(found)


@pytest.mark.parametrize("name", ARMS)
def test_loci_have_the_poles_of_their_gains(browser, folder, name):
    """Points along both loci against the exact poles there, round lines; what is pointed at reads as one of them."""
    arm, chain = tfarm.load(name), load_chain(name)
    with live_page(browser, folder, name) as opened:
        page = opened.page
        page.wait_for_function("live.now.locus?.length", timeout=60_000)
        turned = {"poles": page.evaluate("[live.now.locus, live.now.frame, live.room('poles')]")}
        show_chart(page, "zplane")
        page.wait_for_function("live.now.discs?.length", timeout=60_000)
        law = HubFeedback(**page.evaluate("live.now.law"))
        band = page.evaluate("live.loop.band")
        rows, discs = turned["poles"][0], page.evaluate("live.now.discs")
        disc = {"x": [-1.25, 1.25], "y": [-1.25, 1.25]}
        turned["zplane"] = [discs, disc, page.evaluate("live.room('zplane')")]
        for each, frame, chart in turned.values():
            turns = seen_turns(each, frame, chart)
            assert turns.size > 5
            assert turns.max() <= LARGEST_TURN
        for row in rows[:: len(rows) // 6]:
            exact = stability(Case(arm, law.with_number("K2", row["gain"])), band).poles.values
            s = complex(row["re"], row["im"])
            assert abs(exact - s).min() < 5e-4 * abs(s), row
        loop = sampled_verdict(Case(arm, law, chain)).full
        for row in discs[:: len(discs) // 12]:
            z = complex(row["re"], row["im"])
            assert abs(loop.with_number("K2", row["gain"]).poles.z - z).min() < 1e-6, row
        box = show_chart(page, "poles")
        page.wait_for_function("live.now.locus?.length", timeout=60_000)
        pole = page.evaluate("[live.now.near[1][0], live.now.near[1][1], live.now.frame]")
        x, y = ((pole[i] - pole[2][k][0]) / (pole[2][k][1] - pole[2][k][0]) for i, k in enumerate("xy"))
        wide, high = page.evaluate("live.room('poles')")  # right of 58 pixels and below 8 of letters
        page.mouse.move(box["x"] + 58 + wide * x, box["y"] + 8 + high * (1 - y))
        page.wait_for_function("document.getElementById('poles-reading').textContent.includes('K2 = ')")


@pytest.mark.parametrize("name", ARMS)
def test_the_region_of_a_hub_that_is_held_is_the_librarys(browser, folder, name):
    """Its ends at a few of the page's K1 against `tfarm.map` there; the sampled region is shown as that of Kp = 0."""
    arm = tfarm.load(name)
    with live_page(browser, folder, name) as opened:
        page = opened.page
        axes = page.evaluate("live.loop.axes")
        set_gains(page, HubFeedback(**page.evaluate("live.loop.start")).with_number("Kp", 0.02 * axes["Kp"]["high"]))
        page.wait_for_function("live.now.areas", timeout=60_000)
        areas, Kp = page.evaluate("[live.now.areas, live.now.law.Kp]")
        columns = sorted({row["K1"] for row in areas})[3 :: len(areas) // 5]
        known = gain_map(arm, np.array(columns), np.array([axes["K2"]["low"], axes["K2"]["high"]]), Kp=Kp)
        for gain, intervals in zip(columns, known.stable_intervals, strict=True):
            here = [(row["low"], row["high"]) for row in areas if row["K1"] == gain]
            cut = [(max(row[0], axes["K2"]["low"]), row[1]) for row in here]
            np.testing.assert_allclose(cut, intervals, rtol=1e-6)
        assert "The sampled region is known at Kp = 0 and not shown" in page.locator("#map-note").inner_text()


@pytest.mark.parametrize("kind", ["displacement", "moment"])
def test_a_sensor_has_the_modes_and_zeros_of_its_place(browser, folder, kind):
    arm = tfarm.load(ARMS[0])
    with live_page(browser, folder) as opened:
        page = opened.page
        page.locator("#more summary").click()
        show_chart(page, "sensor")
        page.locator("#sensor-kind").select_option(kind)
        page.locator("#sensor-at").fill("9")
        held = live_data(page)["sensor"][kind]
        x = held["x"][9]
        rows = page.evaluate(
            "['modes', 'zeros'].map(n => [...document.querySelectorAll(`#sensor-${n} tr`)]"
            ".map(row => [...row.cells].map(cell => cell.textContent)))"
        )
        places = np.linspace(0.0, arm.length, 17)
        modes = tfarm.modes(arm, count=len(rows[0]))
        field = modes.shape if kind == "displacement" else modes.moment
        seen = field(np.array([x]))[1:, 0] / abs(field(places)[1:]).max(axis=1)
        assert [row[3] for row in rows[0]] == [f"{each:.3f}".replace("-0.000", "0.000") for each in seen]
        zeros = tfarm.transfer(arm, kind, x=x).zeros(up_to=held["band"]).values
        for re, im, *_ in rows[1][:3]:
            s = complex(float(re), float(im))
            assert abs(zeros - s).min() < 1e-4 * abs(s)


@pytest.mark.parametrize("name", ARMS)
def test_a_chord_of_the_loop_function_is_within_a_pixel_of_it(browser, folder, name):
    """Exact L of both loops at two places between any two points of the page, in pixels of the Nyquist plot."""
    arm, chain = tfarm.load(name), load_chain(name)
    with live_page(browser, folder, name) as opened:
        page = opened.page
        start = HubFeedback(**page.evaluate("live.loop.start"))
        law = start.with_number("K1", 0.5 * start.K1)
        set_gains(page, law)
        pixels = page.evaluate("live.room('nyquist')[0]") / 5.0  # of 1, where that is the shorter side
        graded = arm.with_numbers(damping=reference_damping(arm)) if arm.has_elastic_link else arm
        of = arm if sampled_verdict(Case(arm, law, chain)).word == "unstable" else graded
        exact = (ContinuousLoop(Case(graded, law)).parts, sampled_verdict(Case(of, law, chain)).full.parts)
        for key, parts in zip(("curve", "zcurve"), exact, strict=True):
            rows = page.evaluate(f"live.now.{key}(live.now.from).map(row => [row.w, row.x, row.y])")
            w, x, y = np.array(rows).T
            chords = x + 1j * y
            for share in (0.3, 0.6):
                drive, fed_back = parts(1j * (w[:-1] + share * np.diff(w)))
                own, drawn = fed_back / drive, chords[:-1]
                along = np.clip(((own - drawn) / np.diff(chords)).real, 0, 1)
                off = abs(own - drawn - along * np.diff(chords))[abs(own) < 2.5]
                assert off.size > 100
                assert pixels * off.max() < 1.0, key


def test_the_whole_arm_is_in_the_frame_of_the_player_at_all_times(browser, folder):
    """Nothing meets the border of the canvas, and the hub is drawn whole; also under gains that swing far."""
    margin = """() => {
        const c = document.getElementById('arm'), found = [];
        const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', { willReadFrequently: true });
        copy.drawImage(c, 0, 0);
        const d = copy.getImageData(0, 0, c.width, c.height).data;
        let hub = 0;
        for (let i = 0; i < d.length; i += 4) {
            const x = i / 4 % c.width, y = Math.floor(i / 4 / c.width);
            if (d[i + 3] > 40) found.push(Math.min(x, y, c.height - 1 - y));
            hub += x < c.width - 124 && d[i] === d[i + 2] && d[i + 3] === 255;
        }
        return [found.reduce((a, b) => Math.min(a, b)), hub, c.height - c.clientHeight];
    }"""
    for name, width in itertools.product(ARMS, (1280, 400)):
        with live_page(browser, folder, name, width, 800) as opened:
            page = opened.page
            for K2 in (0.3, -0.9):
                page.evaluate("K2 => live.set({ K2 })", K2)
                page.wait_for_function("K2 => live.now.law.K2 === K2", arg=K2)
                for share in np.linspace(0.0, 1.0, 9):
                    page.locator("#scrub").fill(f"{share:g}")
                    edge, hub, taller = page.evaluate(margin)
                    assert edge > 1
                    assert hub > 0.8 * math.pi * 14**2
                    assert taller == 0


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_the_player_starts_on_request_and_respects_reduced_motion(browser, folder, motion):
    with Opened(browser, folder / ARMS[0] / "live.html", motion=motion) as opened:
        page = opened.page
        began = page.evaluate("live.player.time")
        page.locator("#arm").scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        assert page.evaluate("live.player.time") == began  # nothing moves by itself
        picture = page.evaluate("document.getElementById('arm').toDataURL()")
        if motion == "reduce":
            assert not page.locator("#play").is_visible()
            assert page.locator("#still").is_visible()
        else:
            page.locator("#play").click()
            page.wait_for_function("t => live.player.time > t + 0.05", arg=began)
            page.locator("#play").click()
            assert not page.evaluate("live.player.playing")
        page.locator("#scrub").fill("0.75")
        end = page.evaluate("(live.slew.n - 1) * live.slew.period")
        assert page.evaluate("live.player.time") == pytest.approx(0.75 * end, abs=1e-9)
        assert f"t = {0.75 * end:.3f} s" in (page.locator("#frame").text_content() or "")
        assert page.evaluate("document.getElementById('arm').toDataURL()") != picture


@pytest.mark.parametrize("name", ARMS)
def test_it_answers_soon(browser, folder, name, capsys):
    with live_page(browser, folder, name) as opened:
        page = opened.page
        box = page.locator("#map canvas").bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.6 * box["height"])
        page.mouse.down()
        for step in range(MOVES):
            x = box["x"] + (0.3 + 0.5 * step / MOVES) * box["width"]
            count = page.evaluate("window.live.moves.length")
            page.mouse.move(x, box["y"] + 0.6 * box["height"])
            page.wait_for_function("n => window.live.moves.length > n", arg=count)
        page.mouse.up()
        ready, moves = page.evaluate("[window.live.ready, window.live.moves.slice(3)]")
        slowest, median = sorted(moves)[int(0.95 * len(moves))], statistics.median(moves)
        with capsys.disabled():
            print(
                f"\n{name}: interactive after {ready:.0f} ms, a move {median:.0f} ms (median), "
                f"{slowest:.0f} ms (95th percentile of {len(moves)} dragged)"
            )
        assert page.locator("#K1").input_value() != str(page.evaluate("window.live.loop.start.K1"))
        assert ready < 1e3 * INTERACTIVE * BUSY
        assert slowest < 1e3 * MOVE * BUSY
    size = sum(file.stat().st_size for file in (folder / name / "live.html", folder / ASSETS / SCRIPT))
    assert size <= LARGEST_PAGE


def test_pointing_at_a_curve_reads_both_units(browser, folder):
    with live_page(browser, folder) as opened:
        page = opened.page
        box = show_chart(page, "bode")
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.2 * box["height"])
        page.wait_for_function("document.getElementById('reading').textContent.includes('Hz')")
        words = page.locator("#reading").text_content() or ""
        rad, hertz = words.split(" rad/s = ")[0], words.split(" rad/s = ")[1].split(" Hz")[0]
        assert float(rad) == pytest.approx(2 * math.pi * float(hertz), rel=1e-4)
        at = f"window.live.loop.parts(window.live.loop.at({rad}), window.live.law)"
        size = page.evaluate(f"(() => {{ const [D, N] = {at}; return Math.hypot(...N) / Math.hypot(...D); }})()")
        assert f"L {20 * math.log10(size):.2f}"[:5] in words


@pytest.mark.parametrize(("name", "typed"), [("Kp", "-1"), ("K1", "1e9"), ("K2", "-1e4"), ("K1", "")])
def test_a_typed_gain_that_is_not_run_is_named_and_its_field_has_what_runs(browser, folder, name, typed):
    """By a field and by a link; the message goes with the next gain that runs."""
    for by_link in (False, True) if typed else (False,):
        address = folder / ARMS[0] / "live.html"
        with Opened(browser, address) as opened:
            page = opened.page
            assert not page.locator("#range").is_visible()
            if by_link:
                page.evaluate("hash => { location.hash = hash; }", f"{name}={typed}")
            else:
                page.locator(f"#{name}").fill(typed)
                page.locator(f"#{name}").dispatch_event("change")
            page.locator("#range").wait_for(state="visible")
            law, words = page.evaluate("({...live.law})"), page.locator("#range").inner_text()
            assert float(page.locator(f"#{name}").input_value()) == law[name]
            low, high = (live_data(page)["axes"][name][end] for end in ("low", "high"))
            assert low <= law[name] <= high
            assert words.startswith(f"{name} = {f'{float(typed):.0f}' if typed else 'no number'} is not run")
            assert f"this page has {low:.4g} to {high:.4g}" in words
            set_gains(page, HubFeedback(K1=0.3, K2=0.2))
            assert not page.locator("#range").is_visible()


@pytest.mark.parametrize("width", [1280, 400])
def test_captions_are_whole_and_every_axis_of_the_slew_has_two_ticks(browser, folder, width):
    for arm in ARMS:
        with Opened(browser, folder / arm / "live.html", width) as opened:
            page = opened.page
            cut = """[...document.querySelectorAll('figcaption')].filter(e => e.scrollHeight > e.clientHeight + 1
                || e.scrollWidth > e.clientWidth + 1).map(e => e.textContent)"""
            for K2 in (0.3, -0.9):
                page.evaluate("K2 => live.set({ K2 })", K2)
                page.wait_for_function("K2 => live.now.law.K2 === K2", arg=K2)
                page.wait_for_timeout(400)
                assert page.evaluate(cut) == []
                drawn = page.evaluate("""() => {
                    const found = [], draw = CanvasRenderingContext2D.prototype.fillText;
                    CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
                        if (this.canvas.closest('#slew') && this.textAlign === 'right') found.push([text, y]);
                        return draw.apply(this, arguments);
                    };
                    live.player.go(0.1);
                    live.set({});
                    return new Promise(done => setTimeout(() => {
                        CanvasRenderingContext2D.prototype.fillText = draw;
                        done([found, document.getElementById('slew').clientHeight]);
                    }, 150));
                }""")
                heights, high = np.array([y for _, y in drawn[0]]), drawn[1]
                assert heights.size
                share = (high - 8 - 34 - 3 * 12) / 4  # of each of four plots, less what is around them
                for plot in range(4):
                    low = 8 + plot * (share + 12)
                    assert np.unique(heights[(heights >= low - 2) & (heights <= low + share + 2)]).size >= 2


def test_an_unstable_loop_has_no_settled_slew_and_its_real_pole_no_damping_ratio(browser, folder):
    """Least damping of the sampled loop as on the library's card, at rates that drive the hub away."""
    arm, chain = tfarm.load(ARMS[0]), load_chain(ARMS[0])
    with live_page(browser, folder) as opened:
        for K1 in (-0.02, -0.05, -0.08):
            law = HubFeedback(K1=K1, K2=0.3)
            set_gains(opened.page, law)
            here = texts(opened.page, ["slew-settled", "sampled", "z-ratio"])
            card = tfarm.result_card(arm, law, chain).sampled
            wanted = {"slew-settled": "unstable", "sampled": "unstable"}
            assert here == wanted | {"z-ratio": f"{100 * card.least_damping.ratio:.4g}"}


SHADE = """([name, x, y]) => {
  const canvas = document.querySelector(`#${name} canvas`), ratio = canvas.width / canvas.clientWidth;
  const [wide, high] = live.room(name), dot = document.createElement("canvas");
  const at = [58 + x * wide, 8 + y * high].map(each => Math.round(each * ratio));
  dot.width = dot.height = 1;
  const on = dot.getContext("2d", { willReadFrequently: true });
  on.drawImage(canvas, ...at, 1, 1, 0, 0, 1, 1);
  return on.getImageData(0, 0, 1, 1).data[3];
}"""


def test_what_the_requirements_forbid_is_shaded_and_the_recommended_gains_are_good(browser, folder):
    """Ms = 2 is a disc around -1 on the Nyquist plot; below the least damping chosen the plane of poles is shaded."""
    with live_page(browser, folder) as opened:
        page = opened.page
        page.click("#recommend")
        page.wait_for_function("() => live.rested === live.now.law")
        chosen = recommended_gains(tfarm.load(ARMS[0]), load_chain(ARMS[0]))[0].law
        assert page.evaluate("live.law") == chosen.by_name
        for grade in ("s-phase", "s-delay", "s-peak", "z-phase", "z-delay", "z-peak"):
            assert page.inner_text(f"#{grade}-grade") == "good"
        wide, high = page.evaluate("live.room('nyquist')")
        ends = [2.5 * max(1.0, wide / high), 2.5 * max(1.0, high / wide)]
        for real, imag, is_shaded in (
            (-1.22, 0.27, True),
            (-0.9, -0.3, True),
            (-1.62, 0.45, False),
            (-1.3, -0.6, False),
        ):
            place = [(real + ends[0]) / (2 * ends[0]), (ends[1] - imag) / (2 * ends[1])]
            assert (page.evaluate(SHADE, ["nyquist", *place]) > 0) is is_shaded
        left, right = page.evaluate("live.now.frame.x")
        # a damping ratio of 1.8 %, at nine tenths of the height
        top = page.evaluate("live.now.frame.y[1]")
        place = ["poles", (-0.018 * 0.9 * top - left) / (right - left), 0.1]
        for ratio, is_shaded in (("0", False), ("2", True), ("1", False)):
            page.select_option("#ratio", ratio)
            page.wait_for_function("() => live.rested === live.now.law")
            assert (page.evaluate(SHADE, place) > 0) is is_shaded


PD_AND_NOTCH = Law(
    {"hub_angle": ([0.4, 3.0], [0.002, 1.0]), "moment@0.1": ([1e-4, 0.0, 0.2], [4e-4, 8e-3, 1.0])}, delay=0.002
)
OF_THREE = Law({"hub_rate": ([80.0], [1e-4, 1.0]), "root_moment": 0.3, "hub_angle": 40.0})
ONE_LEAD = Law({"hub_angle": ([0.05, 1.0], [0.005, 1.0])})
AGAINST_EACH_OTHER = Law({"hub_angle": ([0.4, 3.0], [0.002, 1.0]), "tip_displacement": ([-1.5], [0.01, 1.0])})
LAWS = [
    ("sasaki2012-lab", PD_AND_NOTCH),
    ("stocky-steel", OF_THREE),
    ("quanser-flexlink", ONE_LEAD),
    ("sasaki2012-lab", AGAINST_EACH_OTHER),
]


def place_of(page: Page, chart: str, x: float, y: float) -> tuple[float, float]:
    """Where a value is on the screen, on the uppermost plot of a chart."""
    at = page.evaluate("([c, x, y]) => [live.scales[c][0].x.at(x), live.scales[c][0].y.at(y)]", [chart, x, y])
    box = page.locator(f"#{chart} canvas").bounding_box()
    assert box is not None
    return box["x"] + at[0], box["y"] + at[1]


def poles_shown(page: Page, chart: str) -> list[complex]:
    """The poles that a chart draws."""
    found = page.evaluate("live.now.near" if chart == "poles" else "live.now.z.map(each => each.z)")
    return [complex(*each[:2]) for each in found]


def nearest_off(page: Page, chart: str, x: float, y: float) -> float:
    """Pixels from a place to the nearest pole that a chart draws."""
    return min(math.dist((x, y), place_of(page, chart, s.real, s.imag)) for s in poles_shown(page, chart))


def law_pages(folder: Path, name: str, law: Law) -> Path:
    """Write the live page of an arm under a law."""
    (folder / name).mkdir()
    save_live(ArmReport(tfarm.load(name), load_chain(name), (GivenLaw(law),)), folder / name)
    write_assets(folder / ASSETS)
    return folder


# the law's poles in z go less than a pixel at these factors, so that a pixel may need gains beyond their ranges
DRAGS = [
    *itertools.product(ARMS, [None], [(1.1, 0.8)], [0.2], ["poles", "zplane"]),
    (ARMS[0], PD_AND_NOTCH, (1.05, 0.95), 20.0, "poles"),
    (ARMS[0], PD_AND_NOTCH, (0.95, 1.05), 60.0, "poles"),
]


@pytest.mark.parametrize(("name", "law", "factors", "above", "chart"), DRAGS)
def test_a_pole_is_dragged_and_the_gains_follow(browser, folder, tmp_path, name, law, factors, above, chart):
    """To where tfarm has it at other gains: it is under the pointer at each step, and the gains become those."""
    arm, chain = tfarm.load(name), load_chain(name)
    if law is not None:
        folder = law_pages(tmp_path, name, law)
    with live_page(browser, folder, name) as opened:
        page = opened.page
        show_chart(page, chart)
        start, plane, band = page.evaluate("[{...live.law}, live.loop.plane, live.loop.band]")

        def exact(gains: dict[str, float]) -> Any:
            now = HubFeedback(**gains) if law is None else law.with_factors([gains[k] / start[k] for k in start])
            case = Case(arm, now, chain)
            return stability(case, band).poles.values if chart == "poles" else sampled_verdict(case).full.poles.z

        wanted = start | {gain: factor * start[gain] for gain, factor in zip(plane, factors, strict=True)}
        pole = next(s for s in poles_shown(page, chart) if s.imag > above)
        target = min(exact(wanted), key=lambda s: abs(s - pole))
        ends = np.array([place_of(page, chart, s.real, s.imag) for s in (pole, target)])
        assert math.dist(*ends) > 0.5
        page.mouse.move(*ends[0])
        page.mouse.down()
        for share in (0.25, 0.5, 0.75, 1.0):
            count = page.evaluate("live.moves.length")
            # the pointer has whole pixels
            to = np.round((1 - share) * ends[0] + share * ends[1])
            page.mouse.move(*to)
            page.wait_for_function("n => live.moves.length > n", arg=count)
            assert page.locator("#range").is_hidden()
            assert nearest_off(page, chart, *to) < 1.0
        page.mouse.up()
        found = page.evaluate("({...live.law})")
        for gain in plane:
            assert float(page.locator(f"[id='{gain}']").input_value()) == found[gain]
        dragged = min(poles_shown(page, chart), key=lambda s: math.dist(to, place_of(page, chart, s.real, s.imag)))
        assert abs(exact(found) - dragged).min() < 1e-3 * abs(dragged)
        # a pixel is little of the way
        if math.dist(*ends) > 20.0:
            assert found == pytest.approx(wanted, rel=0.05)


def test_a_real_pole_goes_along_the_locus(browser, folder):
    """The gain of the locus moves it alone."""
    with live_page(browser, folder) as opened:
        page = opened.page
        show_chart(page, "poles")
        pole = next(s for s in poles_shown(page, "poles") if s.imag == 0 and s.real < 0)
        start, vary = page.evaluate("[{...live.law}, document.getElementById('vary').value]")
        x, y = place_of(page, "poles", pole.real, pole.imag)
        page.mouse.move(x, y - 2)
        page.mouse.down()
        page.mouse.move(x - 5, y)
        page.wait_for_function("start => Object.keys(start).some(k => live.now.law[k] !== start[k])", arg=start)
        page.wait_for_timeout(200)
        assert nearest_off(page, "poles", x - 5, y) < 1.0
        page.mouse.up()
        assert {key for key, value in page.evaluate("live.law").items() if value != start[key]} == {vary}


def test_the_curve_of_the_gain_is_dragged_and_all_gains_follow(browser, folder):
    """It is under the pointer, by the loop of the library; beyond the range of one gain all of them stop."""
    with live_page(browser, folder) as opened:
        page = opened.page
        show_chart(page, "bode")
        w, size = page.evaluate("(() => { const r = live.now.curve().find(r => r.w > 3); return [r.w, r.dB]; })()")
        start = page.evaluate("({...live.law})")
        x, y = place_of(page, "bode", w, size)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 20)
        page.wait_for_function("K1 => live.now.law.K1 !== K1", arg=start["K1"])
        page.wait_for_timeout(100)
        law = HubFeedback(**page.evaluate("live.law"))
        assert law.K1 / start["K1"] == pytest.approx(law.K2 / start["K2"], rel=1e-6)
        drive, fed_back = ContinuousLoop(Case(tfarm.load(ARMS[0]), law)).parts(np.array([1j * w]))
        here = place_of(page, "bode", w, 20 * math.log10(abs(fed_back[0] / drive[0])))
        assert here == pytest.approx((x, y - 20), abs=1.0)
        page.mouse.move(x, y - 2000)
        page.wait_for_function("K1 => live.now.law.K1 > 1.01 * K1", arg=law.K1)
        stopped = page.evaluate("({...live.law})")
        assert stopped["K2"] == pytest.approx(live_data(page)["axes"]["K2"]["high"])
        assert stopped["K1"] / start["K1"] == pytest.approx(stopped["K2"] / start["K2"], rel=1e-6)
        page.mouse.up()


def test_keys_move_a_pole_and_the_gain(browser, folder):
    with live_page(browser, folder) as opened:
        page = opened.page
        start = page.evaluate("({...live.law})")
        page.locator("#bode").focus()
        page.keyboard.press("ArrowUp")
        page.wait_for_function("K1 => live.now.law.K1 > K1", arg=start["K1"])
        raised = page.evaluate("({...live.law})")
        for gain in ("K1", "K2"):
            assert raised[gain] / start[gain] == pytest.approx(10 ** (0.5 / 20), rel=1e-6)
        page.locator("#poles").focus()
        before = poles_shown(page, "poles")[1]
        for key in ("n", "n", "ArrowLeft"):
            page.keyboard.press(key)
            page.wait_for_timeout(100)
        after = min(poles_shown(page, "poles"), key=lambda s: abs(s - before))
        place, moved = (np.array(place_of(page, "poles", s.real, s.imag)) for s in (before, after))
        assert moved - place == pytest.approx([-5.0, 0.0], abs=0.5)


def test_a_finger_drags_a_pole_and_does_not_scroll_there(browser, folder):
    with live_page(browser, folder, width=400, height=800) as opened:
        page = opened.page
        show_chart(page, "poles")
        pole = poles_shown(page, "poles")[1]
        x, y = place_of(page, "poles", pole.real, pole.imag)
        start, top = page.evaluate("[{...live.law}, scrollY]")
        touch = partial(page.context.new_cdp_session(page).send, "Input.dispatchTouchEvent")
        touch({"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        for step in range(1, 6):
            touch({"type": "touchMove", "touchPoints": [{"x": x - 2 * step, "y": y - 5 * step}]})
            page.wait_for_timeout(60)
        touch({"type": "touchEnd", "touchPoints": []})
        page.wait_for_timeout(100)
        # words of another length may move it, a finger by ten times that
        assert abs(page.evaluate("scrollY") - top) < 5
        assert nearest_off(page, "poles", x - 10, y - 25) < 1.0
        assert page.evaluate("live.law.K2") != start["K2"]


@pytest.mark.parametrize("name", ARMS)
def test_the_region_of_the_grade_good_ends_where_the_cards_do(browser, folder, name):
    """At 0.2 % of an interval inside each of its ends both exact loops are good, and as far outside one is not."""
    arm, chain = tfarm.load(name), load_chain(name)
    with live_page(browser, folder, name) as opened:
        page = opened.page
        page.wait_for_function("() => live.rested === live.now.law", timeout=90_000)
        rows, axis = page.evaluate("[live.now.good, live.loop.axes.K2]")
        assert len(rows) > 3
        for row in np.random.default_rng(7).permutation(rows)[:6]:
            step = 2e-3 * (row["high"] - row["low"])
            for end, way in (("low", 1.0), ("high", -1.0)):
                for is_good in (True, False) if axis["low"] < row[end] < axis["high"] else ():
                    law = HubFeedback(K1=row["K1"], K2=row[end] + way * (step if is_good else -step))
                    card = tfarm.result_card(arm, law, chain)
                    assert ({card.continuous.grade, card.sampled.grade} == {"good"}) is is_good, law


def test_keys_undo_and_link_reach_every_state_and_the_file_is_a_law(browser, folder, tmp_path):
    file = folder / ARMS[0] / "live.html"
    with Opened(browser, file, 1280) as opened:
        page = opened.page
        page.wait_for_function("live.past.length === 1")
        assert page.evaluate("document.documentElement.scrollHeight <= innerHeight + 100")
        page.locator("#map").focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_function("live.past.length === 2")
        page.locator("button[value=nichols]").click()
        page.locator("button[value=zplane]").click()
        page.wait_for_function("live.past.length === 3")
        law, address = page.evaluate("[{...live.law}, location.href]")
        assert law["K1"] > page.evaluate("live.loop.start.K1")
        with page.expect_download() as download:
            page.locator("#save").click()
        download.value.save_as(tmp_path / "law.toml")
        assert load_law(tmp_path / "law.toml") == Law.of_gains(HubFeedback(**law))
        page.locator("#map").focus()
        page.keyboard.press("z")
        page.wait_for_function("document.querySelector('button[value=nyquist]').ariaPressed === 'true'")
        page.keyboard.press("Control+z")
        page.wait_for_function("live.law.K1 === live.loop.start.K1 && live.past.length === 1")
        page.evaluate("address => { location.href = address; }", address)
        page.wait_for_function("K1 => live.law.K1 === K1", arg=law["K1"])
        page.locator("#zplane").wait_for(state="visible")
        page.locator("#reset").click()
        page.wait_for_function("live.law.K1 === live.loop.start.K1 && !live.link()")


@pytest.mark.parametrize("width", [1280, 400])
def test_the_dashboard_is_one_screen_and_one_column_on_a_phone(browser, folder, width):
    """At 1280 x 800 every chart in view without scrolling, none over another; on a phone below each other."""
    boxes = """[...document.querySelectorAll('.board > *')].map(e => {
        const b = e.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; })"""
    for name in ARMS:
        with live_page(browser, folder, name, width, 800) as opened:
            page = opened.page
            found = np.array(page.evaluate(boxes))
            assert found.shape == (8, 4)
            if width == 400:
                assert (np.diff(found[:, 1]) > 0).all()
                continue
            assert page.evaluate("document.documentElement.scrollHeight") <= 800, name
            assert page.evaluate("(e => e.scrollHeight - e.clientHeight)(document.querySelector('.side'))") <= 0, name
            assert len({round(left) for left in found[1:4, 0]} & {round(left) for left in found[4:7, 0]}) == 3
            area = ((found[:, 2] - found[:, 0]) * (found[:, 3] - found[:, 1])).sum()
            assert area > 0.9 * 1280 * 800  # no holes


def test_a_page_without_sampled_loop_slew_and_sensor_has_the_rest(browser, folder, tmp_path, monkeypatch):
    (text,) = re.findall(r'id="live-data">(.*?)</script>', (folder / ARMS[0] / "live.html").read_text("utf-8"), re.S)
    missing = dict.fromkeys(("sampled_map", "sampled_loop", "slew", "sensor"))
    data = json.loads(text) | missing | {"no_sensor": "no polynomial follows"}
    monkeypatch.setattr("tfarm.report.page.live_data", lambda *_: data)
    (tmp_path / "arm").mkdir()
    save_live(ArmReport(tfarm.load(ARMS[0]), load_chain(ARMS[0])), tmp_path / "arm")
    write_assets(tmp_path / ASSETS)
    with Opened(browser, tmp_path / "arm" / "live.html") as opened:
        page = opened.page
        set_gains(page, HubFeedback(**data["start"]))
        page.wait_for_function("live.now.locus?.length", timeout=60_000)
        assert texts(page, ["verdict", "sampled"]) == {"verdict": "stable", "sampled": "not computed"}
        assert page.evaluate("live.now.locus.length") > 50


def is_in(areas: list[dict[str, float]], across: str, point: tuple[float, float]) -> bool:
    """Whether a point is in one of the parts of a region, between two of its columns."""
    pairs = [
        (a, b) for a, b in itertools.pairwise(areas) if a["part"] == b["part"] and a[across] <= point[0] <= b[across]
    ]
    for a, b in pairs:
        share = (point[0] - a[across]) / (b[across] - a[across])
        low, high = (a[end] + share * (b[end] - a[end]) for end in ("low", "high"))
        if low < point[1] < high:
            return True
    return False


@pytest.mark.parametrize(("name", "law"), LAWS)
def test_a_law_of_rational_parts_has_a_slider_for_the_gain_of_each(browser, tmp_path, name, law):
    """At random gains the card, the file of the law and what the map has there are the library's."""
    arm, chain, rng = tfarm.load(name), load_chain(name), np.random.default_rng(4)
    verdicts = set()
    with Opened(browser, law_pages(tmp_path, name, law) / name / "live.html") as opened:
        page = opened.page
        start = page.evaluate("live.loop.start")
        assert start == {key: value for key, (_, value) in law.part_gains.items()}
        for factors in (np.ones(len(start)), *10.0 ** rng.uniform(-0.9, 0.9, (7, len(start)))):
            gains = {key: value * by for (key, value), by in zip(start.items(), factors.tolist(), strict=True)}
            for key, value in gains.items():
                page.locator(f"[id='{key}']").fill(repr(value))
                page.locator(f"[id='{key}']").dispatch_event("change")
            page.wait_for_function("gains => Object.keys(gains).every(k => live.now.law[k] === gains[k])", arg=gains)
            page.wait_for_function("() => live.delayed === live.now.law")
            now = law.with_factors(factors.tolist())
            both = tfarm.result_card(arm, now, chain)
            card, sampled = both.continuous, both.sampled
            assert card is not None
            assert sampled is not None
            wanted = card_words(card, "s") | {"verdict": card.stability, "sampled": sampled.stability}
            wanted |= {} if sampled.stability == "unstable" else card_words(sampled, "z")
            here = {key: words.removeprefix("≥ ") for key, words in texts(page, list(wanted)).items()}
            assert here == wanted, gains
            (tmp_path / "law.toml").write_text(page.evaluate("live.lawFile()"), encoding="utf-8")
            kept, s = load_law(tmp_path / "law.toml"), 1j * np.geomspace(0.1, 1e3, 9)
            assert np.allclose(kept.values(s), now.values(s), rtol=1e-12)
            assert kept.delay == now.delay
            verdicts.add(card.stability)
            if len(start) > 1:
                page.wait_for_function("live.now.areas", timeout=60_000)
                across, up = list(start)[:2]
                inside = is_in(page.evaluate("live.now.areas"), across, (gains[across], gains[up]))
                assert inside == (card.stability == "stable"), gains
        assert "stable" in verdicts


@pytest.mark.parametrize("words", ["toString=", "__proto__=x", "constructor=1&loop=nichols"])
def test_a_link_with_names_of_the_language_opens_the_page(browser, folder, words):
    with live_page(browser, folder) as opened:
        for _ in range(2):  # the address of an open page, then of one that is opened
            opened.page.evaluate("words => { location.hash = words; }", words)
            assert opened.page.evaluate("live.now.law") == live_data(opened.page)["start"]
            opened.page.reload()
            opened.page.wait_for_selector("body[data-ready]", timeout=20_000)


ELEMENTS = {
    "script": "Object.assign(document.createElement('script'), { textContent: 'window.evil = 1' })",
    "style": "Object.assign(document.createElement('style'), { textContent: 'main { display: none }' })",
    "image": "Object.assign(document.createElement('img'), { src: 'x.png' })",
}


@pytest.mark.parametrize("what", ELEMENTS)
def test_the_policy_allows_what_the_page_holds_alone(browser, folder, what):
    """Under it the page itself has no message, as in every other test here."""
    opened = Opened(browser, folder / ARMS[0] / "live.html")
    opened.page.evaluate(f"document.body.append({ELEMENTS[what]})")
    assert opened.page.evaluate("window.evil === undefined && getComputedStyle(document.querySelector('main')).display")
    assert "violates the following Content Security Policy directive" in " ".join(opened.messages)
    assert opened.page.evaluate("getComputedStyle(document.querySelector('main')).display") != "none"
    opened.context.close()


def test_a_notebook_shows_a_page_under_its_policy(browser, folder, tmp_path):
    (tmp_path / "cell.html").write_text(LivePage(folder / ARMS[0] / "live.html")._repr_html_())
    with Opened(browser, tmp_path / "cell.html") as opened:
        cell = opened.page.frames[1]
        cell.wait_for_selector("body[data-ready]", timeout=20_000)
        assert cell.evaluate("getComputedStyle(document.querySelector('main')).display") != "none"
        assert cell.locator("main svg, main canvas").count()
