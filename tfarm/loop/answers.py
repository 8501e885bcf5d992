"""What the loop's commands print with --json: plain dictionaries."""

from __future__ import annotations

import math
from typing import Any

from tfarm.arm import HubFeedback
from tfarm.columns import Column
from tfarm.digits import general, singly, within

from .design import Design
from .lyapunov import lyapunov
from .margins import LoopMargins, Margins
from .poles import Poles
from .regions import INFINITE, Region
from .windows import Windows

SIGN = "u = -Kp theta - K1 theta_t - K2 E I phi'(0) + r; a static torque u gives the moment -(J - I_h)/J u"
PHASES = ("phase", "phase_lag", "phase_lead")


HELD = 2e-14  # of a pole's size: what its float64 may be off (tests: 1e-14 to 50 digits)
POLES = (  # of pairs Re s, Im s
    Column("re", "Re s", "1/s", of=lambda pole: within(pole[0], HELD * math.hypot(*pole), 12)),
    Column("im", "Im s", "rad/s", of=lambda pole: pole[1], digits=singly(general, 12)),
    Column("ratio", "damping ratio", of=lambda pole: within(-pole[0] / math.hypot(*pole), HELD, 6) if pole[1] else "-"),
)


def law_answer(law: HubFeedback) -> dict[str, Any]:
    """The gains, with the sign convention that K2 needs."""
    return {"K1": law.K1, "K2": law.K2, "Kp": law.Kp, "sign_convention": SIGN}


def poles_answer(poles: Poles, certify: bool) -> dict[str, Any]:
    """Poles with Im >= 0, how many are unstable, and the box in which they are complete; proven discs if asked."""
    answer = {
        "arm": poles.loop.arm.name,
        **law_answer(poles.loop.law),
        "poles": [[float(pole.real), float(pole.imag)] for pole in poles.values],
        "unstable": poles.unstable,
        "complete": True,
        "box": list(poles.box),
        "ends_at_shear_cutoff": poles.ends_at_shear_cutoff,
        "shear_cutoff_rad_s": poles.loop.arm.shear_cutoff,
    }
    if certify:
        discs = poles.certify()
        answer["proven_complete"] = True
        answer["discs"] = [{"re": disc.re, "im": disc.im, "radius": disc.radius} for disc in discs]
    return answer


def margins_answer(found: Margins) -> dict[str, Any]:
    """The verdict first; margins are null unless the loop is stable."""
    verdict = found.stability
    proof = lyapunov(verdict.loop.arm, verdict.loop.law)
    limits = found.in_band
    return {
        "arm": verdict.loop.arm.name,
        **law_answer(verdict.loop.law),
        "verdict": verdict.verdict,
        "stable": verdict.is_stable,
        "unstable_roots": verdict.unstable_roots,
        "unstable_roots_infinite": verdict.unstable_roots_infinite,
        "band_rad_s": verdict.band,
        "beyond_the_band": verdict.tail,
        "spectral_abscissa": verdict.poles.spectral_abscissa,
        "lyapunov": {"proven": proof.proven, "a1_over_a2": proof.a1_over_a2, "reason": proof.reason},
        **{key: value for name, windows in found.windows.items() for key, value in _windows(name, windows).items()},
        "gain_margin": None if limits is None else list(limits.gain),
        **_phases(limits),
        "delay_margin_s": found.exact_delay,
        "disk_margin": found.exact_disk,
        "peak_sensitivity": found.exact_peak,
        "at_rad_s": None if limits is None else {name: limits.at[name] for name in PHASES},
        "in_band": None if limits is None else _in_band(limits),
    }


def _windows(name: str, windows: Windows) -> dict[str, Any]:
    around = windows.around
    return {
        f"{name}_interval": None if around is None else list(around),
        f"{name}_interval_ends": None if around is None else [windows.end(value) for value in around],
        f"{name}_windows": [list(pair) for pair in windows.all],
        f"{name}_windows_ends": [[windows.end(value) for value in pair] for pair in windows.all],
        f"{name}_looked_at": list(windows.looked_at),
    }


def _in_band(limits: LoopMargins) -> dict[str, Any]:
    return {
        "band_rad_s": limits.band,
        **_phases(limits),
        "delay_margin_s": limits.delay,
        "disk_margin": limits.disk,
        "peak_sensitivity": limits.peak_sensitivity,
        "at_rad_s": limits.at,
    }


def _phases(limits: LoopMargins | None) -> dict[str, float | None]:
    """The phase margin, signed as python-control does, and the sizes of both sides: lag above 0, lead below."""
    return {
        "phase_margin_deg": None if limits is None else limits.phase,
        "phase_lag_deg": None if limits is None else limits.phase_lag,
        "phase_lead_deg": None if limits is None else limits.phase_lead,
    }


def map_answer(found: Region) -> dict[str, Any]:
    """Unstable poles over the grid (rows of K2), "inf" where they are infinitely many, and the boundary curve."""
    rows = [["inf" if count == INFINITE else int(count) for count in row] for row in found.unstable]
    low, high = (found.K1[0], found.K1[-1]), (found.K2[0], found.K2[-1])
    inside = [
        [float(value) for value in point]
        for point in found.boundary
        if low[0] <= point[0] <= low[1] and high[0] <= point[1] <= high[1]
    ]
    return {
        "arm": found.arm.name,
        "Kp": found.Kp,
        "sign_convention": SIGN,
        "K1": found.K1.tolist(),
        "K2": found.K2.tolist(),
        "unstable_roots": rows,
        "boundary": inside,
        "band_rad_s": found.band,
    }


def design_answer(found: Design) -> dict[str, Any]:
    """The gains, what they reach, the verdict, and how flat the optimum is."""
    law, bounds = found.law, found.bounds
    return {
        "arm": found.verdict.loop.arm.name,
        "objective": found.objective,
        **law_answer(law),
        "value": found.value,
        "verdict": found.verdict.verdict,
        "modes": found.modes,
        "bounds": {name: list(pair) for name, pair in bounds.items()},
        "at_bound": list(found.at_bound),
        "flat_K1": list(found.flat_K1),
        "flat_K2": list(found.flat_K2),
    }
