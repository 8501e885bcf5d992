"""The live page of an arm's loop, and the script that all such pages share."""

import base64
import hashlib
import json
import re
import sys
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp

from tfarm.arm import AnyLaw, Arm, Law
from tfarm.digits import scientific
from tfarm.dsp import Chain
from tfarm.dsp.stages import admit
from tfarm.errors import TfarmError, require
from tfarm.exported.live_loop import CONSUMER, LIVE_COLUMNS
from tfarm.loop.panels import PANEL_SAMPLES
from tfarm.plots.style import GOOD, LOW, MARGINAL, POOR, STABLE, UNSTABLE
from tfarm.report.blocks import TEMPLATES, render, write_text
from tfarm.report.page import ArmReport, GivenLaw, has_loop, sign_words

LIVE_PAGE = "live.html"
ASSETS = "assets"
SCRIPT = "live.js"
# in the policy of a page, from the folder of its script
SCRIPTS = "script-src 'self'"


def is_live(report: ArmReport) -> bool:
    """Whether the arm has such a page: its hub turns freely and has inertia."""
    return has_loop(report.arm) and report.arm.has_rigid_mode


def has_sliders(law: Law) -> bool:
    """Whether a page can have a slider for each part of a law: gains at the hub, or few rational parts in s."""
    # of a law: |L| beyond the frequency range is bounded at all 2^n corners of their ranges
    most_parts = 4
    return (
        not law.is_discrete
        and len(law.part_gains) == len(law.parts) <= most_parts
        and all(hasattr(part.block, "num") for part in law.parts)
    )


def save_live(report: ArmReport, folder: Path) -> None:
    """live.html in the arm's folder.  It begins at the first law of its pages that has sliders, else at default gains.

    Where its numbers cannot be made the page has the reason.
    """
    title = f"{report.arm.name}: live loop"
    out = folder / LIVE_PAGE
    each = next((each for each in report.cases if has_sliders(each.law)), report.default)
    arm = each.arm
    try:
        admit(CONSUMER, arm, report.chain)
        numbers = each.live
    except TfarmError as error:
        write_text(out, render("live_failed.html", title=title, why=str(error)))
        return
    data = {"name": arm.name, "command_name": report.command_name, **numbers}
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")
    colours = {
        "stable": STABLE,
        "marginal": MARGINAL,
        "unstable": UNSTABLE,
        "good": GOOD,
        "low": LOW,
        "poor": POOR,
    }
    page = render(
        "live.html",
        title=title,
        data=data,
        text=text,
        sign=sign_words(arm),
        columns=LIVE_COLUMNS,
        samples=PANEL_SAMPLES * len(data["low"]),
        error=scientific(data["error"], 1),
        assets=f"../{ASSETS}",
        script=SCRIPT,
        colours=colours,
    )
    styles = " ".join(_source(each) for each in re.findall("<style>(.*?)</style>", page, re.DOTALL))
    policy = f"default-src 'none'; base-uri 'none'; form-action 'none'; style-src {styles}; {SCRIPTS}"
    first = '<meta charset="utf-8">'
    write_text(
        out,
        page.replace(first, f'{first}\n<meta http-equiv="Content-Security-Policy" content="{policy}">', 1),
    )


def _source(text: str) -> str:
    """Return the source of a policy that allows an element with that text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def write_assets(folder: Path) -> None:
    """Write the script of the live pages."""
    folder.mkdir(exist_ok=True)
    scripts = "".join(
        (TEMPLATES / f"live_{name}.js").read_text(encoding="utf-8")
        for name in ("loop", "sampled", "good", "locus", "sets", "chart", "card", "player", "sensor", "page")
    )
    write_text(folder / SCRIPT, f"(() => {{\n{scripts}}})();\n")


# ------------------------------------------------------------ from Python


@dataclass(frozen=True)
class LivePage:
    """A live page on this computer, its `path`; a notebook shows it."""

    path: Path

    def _repr_html_(self) -> str:
        """Return the page in a frame, with its script in it: a notebook serves no other file."""
        script = (self.path.parents[1] / ASSETS / SCRIPT).read_text(encoding="utf-8")
        page = self.path.read_text(encoding="utf-8").replace(SCRIPTS, f"script-src {_source(script)}", 1)
        page = page.replace(f'<script src="../{ASSETS}/{SCRIPT}">', f"<script>{script}")
        # no srcdoc: its links lead into the notebook's own page
        text = base64.b64encode(page.encode()).decode("ascii")
        return (
            f'<iframe src="data:text/html;charset=utf-8;base64,{text}" title="live page" '
            'style="width:100%;height:780px;border:0"></iframe>'
        )


def explore(arm: Arm, law: AnyLaw | None = None, chain: Chain | None = None) -> LivePage:
    """Show the live page of an arm: in a notebook as the output of a cell, else in the browser.

    The page is a file of its own with its script, in a temporary folder that stays; nothing is served.

    Parameters
    ----------
    arm
        The arm.
    law
        The controller at which the page begins; the default gains unless given, and for one that has no sliders.
    chain
        Sampling; every 10 ms unless given.

    Returns
    -------
    LivePage
        With the `path` of the page.

    Raises
    ------
    ParameterError
        For what is no arm, and one whose hub does not turn freely or has no inertia.
    """
    report = ArmReport(*admit(CONSUMER, arm, chain), () if law is None else (GivenLaw(law),))
    require(is_live(report), "arm", arm.name, "give one whose hub turns freely and has inertia")
    place = Path(mkdtemp(prefix="tfarm-"))
    (folder := place / "arm").mkdir()
    save_live(report, folder)
    write_assets(place / ASSETS)
    if "ipykernel" not in sys.modules:
        webbrowser.open((folder / LIVE_PAGE).as_uri())
    return LivePage(folder / LIVE_PAGE)
