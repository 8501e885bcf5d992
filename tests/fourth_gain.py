"""The program with a fourth gain, made as CONTRIBUTING says: a row of GAINS and a field of HubFeedback.

`python -m tests.fourth_gain` reads cases from standard input and answers on standard output, both JSON.  The row and
the field are put into the source of `tfarm.arm.feedback` while it is imported; no file is changed.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

OUTPUT = "tip_displacement"  # follows the hub's angle, feels every mode, and is not of the hub
LAST_ROW, LAST_FIELD = 'Gain("K2", "root_moment", "1", "M"),\n', "    Kp: float = 0.0\n"
ROW, FIELD = f'    Gain("K3", "{OUTPUT}", "N m/m", "w"),\n', "    K3: float = 0.0\n"
AXES = np.array([-0.2, 0.1, 1.0]), np.array([-1.5, 0.4, 1.2])  # of a map


class _Extended(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        source = Path(self.path).read_text(encoding="utf-8")
        assert source.count(LAST_ROW) == source.count(LAST_FIELD) == 1
        source = source.replace(LAST_ROW, LAST_ROW + ROW).replace(LAST_FIELD, LAST_FIELD + FIELD)
        return compile(source, self.path, "exec")


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        found = importlib.machinery.PathFinder.find_spec(name, path) if name == "tfarm.arm.feedback" else None
        if found is not None and found.origin is not None:
            found.loader = _Extended(name, found.origin)
        return found


def answers_of(cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a program with the fourth gain answers, from a process of its own."""
    command = [sys.executable, "-m", "tests.fourth_gain"]
    done = subprocess.run(command, input=json.dumps(cases), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def _loop(arm: Any, law: Any) -> dict[str, Any]:
    """Verdict, margins, windows and proof of a loop, and the end of a locus along the fourth gain."""
    import tfarm
    from tfarm.loop.locus import locus
    from tfarm.loop.lyapunov import lyapunov

    found = tfarm.margins(arm, law)
    verdict, limits = found.stability, found.in_band
    ended = locus(arm, law, "K3", 0.1 * law["K3"], law["K3"], points=5, branches=4)
    return {
        "verdict": verdict.verdict,
        "unstable": verdict.unstable_roots,
        "infinite": verdict.unstable_roots_infinite,
        "tail": verdict.tail,
        "known": verdict.is_known_beyond,
        "poles": [[pole.real, pole.imag] for pole in verdict.poles.values[:6].tolist()],
        "margins": limits and [*limits.gain, limits.phase, limits.disk],
        "exact": [found.exact_delay, found.exact_disk],
        "windows": {name: each.all for name, each in found.windows.items()},
        "proven": lyapunov(arm, law).proven,
        "ends": [[pole.real, pole.imag] for pole in ended.branches[:, -1].tolist()],
    }


def _sampled(arm: Any, law: Any) -> dict[str, Any]:
    """The verdict on the sampled loop, its windows of the fourth gain, and what its modes gain a sample."""
    from tfarm.dsp import sampled_loop, sampled_verdict
    from tfarm.dsp.crossings import stable_windows
    from tfarm.dsp.modes import mode_table

    verdict = sampled_verdict(arm, law)
    table = mode_table(sampled_loop(arm, law.having("K1", 0.0).having("K2", 0.0).times(1e-6), count=8))
    return {
        "sentence": verdict.sentence,
        "outside": verdict.loop.poles.unstable,
        "log_radius": verdict.log_radius,
        "windows": stable_windows(verdict.full, "K3"),
        "off": (table.first_order - table.log_radius + table.by_damping).tolist(),
        "size": table.first_order.tolist(),
    }


def _simulated(arm: Any, law: Any) -> dict[str, Any]:
    """The input and the tip of a slew, and what a controller that measures three signals says to the law."""
    import tfarm
    from tfarm.dsp.simulate import Measurement
    from tfarm.errors import ParameterError

    found = tfarm.simulate(arm, law, duration=1.0, count=4)
    try:
        refused = str(Measurement(0, *[0.0] * 9).asked(law, 0.3))
    except ParameterError as error:
        refused = str(error)
    return {
        "torque": found.torque.tolist(),
        "tip": found.at_samples.tip_displacement.tolist(),
        "refused": refused,
    }


def _map(arm: Any, law: Any) -> list[list[int]] | str:
    """The plane of K1 and K2 with the fourth gain held, or why there is none."""
    import tfarm
    from tfarm.errors import ConvergenceError

    try:
        return tfarm.map(arm, *AXES, law=law).unstable.tolist()  # type: ignore[no-any-return]
    except ConvergenceError as error:
        return str(error)


def _of_the_arm(arm: Any) -> dict[str, Any]:
    """What no law has a part in: the poles of a transfer function, and a damped shape."""
    import tfarm

    poles = tfarm.transfer(arm, "root_moment").poles(up_to=300.0).values
    x = np.linspace(0.0, 1.0, 3)
    shape = tfarm.damped_modes(tfarm.modes(arm, 2)).shape(x)
    return {"poles": [[each.real, each.imag] for each in poles], "shape": abs(np.asarray(shape)).tolist()}


def _answer(case: dict[str, Any]) -> dict[str, Any]:
    import tfarm
    from tfarm.loop.regions import region

    arm = tfarm.load(case["arm"])
    arm = replace(arm, hub=replace(arm.hub, friction=case["friction"]))
    law = tfarm.HubFeedback(**case["gains"])
    return {
        "loop": _loop(arm, law),
        "map": region(arm, *AXES, tfarm.HubFeedback(Kp=law["Kp"])).unstable.tolist(),
        "map_of_law": _map(arm, law),
        "without_law": _of_the_arm(arm),
        "sampled": _sampled(arm, law),
        "simulated": _simulated(arm, law),
    }


if __name__ == "__main__":
    sys.meta_path.insert(0, _Finder())
    print(json.dumps([_answer(case) for case in json.load(sys.stdin)]))
