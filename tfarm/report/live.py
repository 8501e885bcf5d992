"""The live page of an arm's loop, live.html, and the scripts that all such pages share, in assets/."""

from __future__ import annotations

import json
from pathlib import Path

import vl_convert

from tfarm.arm import HubFeedback
from tfarm.digits import scientific
from tfarm.errors import TfarmError
from tfarm.loop.panels import PANEL_SAMPLES
from tfarm.report.given_laws import Subject
from tfarm.report.live_data import LIVE_COLUMNS, live_data
from tfarm.report.loop_laws import has_loop, sign_words
from tfarm.report.page import TEMPLATES, argument, is_preset, render

LIVE_PAGE, ASSETS = "live.html", "assets"
RUNTIME, SCRIPT = f"vega-{vl_convert.get_vega_version()}.js", "live.js"
BUNDLED = "window.vegaEmbed = vegaEmbed;"
SCRIPT_PARTS = tuple(f"live_{name}.js" for name in ("loop", "sampled", "locus", "sets", "player", "sensor", "page"))


def is_live(subject: Subject) -> bool:
    """Whether the arm has such a page: its hub turns freely and has inertia."""
    return has_loop(subject.arm) and subject.arm.has_rigid_mode


def save_live(subject: Subject, folder: Path) -> None:
    """live.html in the arm's folder.  It begins at the gains that the arm's pages are about.

    Where its numbers cannot be made the page says why.
    """
    arm, chain, laws = subject.arm, subject.chain, subject.laws
    title, out = f"{arm.name}: live loop", folder / LIVE_PAGE
    given = [each.law for each in laws if isinstance(each.law, HubFeedback)]
    try:
        data = live_data(arm, chain, given[0] if given else None)
    except TfarmError as error:
        out.write_text(render("live_failed.html", title=title, why=str(error)), encoding="utf-8", newline="")
        return
    data["command_name"] = argument(arm.name, is_preset(arm, chain))
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False).replace("<", "\\u003c")
    page = render("live.html", title=title, data=data, text=text, sign=sign_words(arm), columns=LIVE_COLUMNS,
                  samples=PANEL_SAMPLES * len(data["low"]), error=scientific(data["error"], 1),
                  assets=f"../{ASSETS}", runtime=RUNTIME, script=SCRIPT)  # fmt: skip
    out.write_text(page, encoding="utf-8", newline="")


def write_assets(folder: Path) -> None:
    """Vega's runtime, as vl-convert carries it, and this page's own script with its charts."""
    folder.mkdir(exist_ok=True)
    (folder / RUNTIME).write_text(vl_convert.javascript_bundle(BUNDLED), encoding="utf-8", newline="")
    from tfarm.report.live_charts import charts  # and Altair, which the processes that make pages do not need

    named = json.dumps(charts(), separators=(",", ":"), sort_keys=True)
    scripts = "".join((TEMPLATES / name).read_text(encoding="utf-8") for name in SCRIPT_PARTS)
    own = f"(() => {{\nconst LIVE_CHARTS = {named};\n{scripts}}})();\n"  # the runtime has names of its own
    (folder / SCRIPT).write_text(own, encoding="utf-8", newline="")
