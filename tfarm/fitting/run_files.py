"""Runs that a command line names: a file in open loop, or with the law's file of a closed one.

Where a record has the input and every signal of its law, the law has to explain the input: the law in z is driven by
the recorded signals, and its output is compared with the recorded input, up to the first state of the law, a constant
and a delay of up to two samples, all of which the record does not have.

A law's file names the run that was measured under it, and what is known of the arm from other runs:

    [measured]
    file = "step.csv"                    # in the folder of the law's file, as the others
    source = "laboratory X, run 7"       # shown with it
    signals = ["hub_angle=enc[deg]"]     # its columns, if they have other names or units
    posterior = "rig.posterior.json"     # of the fit, for the band of the prediction
    before = "drawing.toml"              # the arm before the fit, a null model

The record has a column `t` [s], one `reference:hub_angle` [rad], the reference of the controller, and one for each of
`hub_angle` [rad] and `root_moment` [N m] that was measured.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import Field

from tfarm.arm import Arm, Law, load
from tfarm.arm.law import REFERENCE
from tfarm.arm.law_tables import load_law
from tfarm.arm.reading import AnyFile, load_tables
from tfarm.arm.schema import StrictTable, validate_table
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.dsp.discretise import discretise_law
from tfarm.errors import MISSING, name_file, require
from tfarm.fitting.posterior import Posterior, load_posterior
from tfarm.fitting.recording import decimated, read_recording
from tfarm.fitting.runs import RigRun, run_of
from tfarm.fitting.signals import RecordSignal, signal_of
from tfarm.records import frozen


def runs_of(texts: Sequence[str], arm: Arm, signals: Sequence[str] = (), decimate: int = 1) -> list[RigRun]:
    """Return the runs of an arm that the command line means by "run.csv", or "run.csv=law.toml" under a law.

    `signals` name columns of each record as `read_recording` reads them; `decimate` keeps one sample of that number,
    where the input is held over them (`decimated`).
    Raises ParameterError as these do and as `RigRun` does, for a law whose period is no multiple of the record's, and
    for a law that does not explain the recorded input.
    """
    named = [signal_of(text) for text in signals]
    for each in named:
        each.check()
    return [read_run(text, arm, named, decimate) for text in texts]


def read_run(text: str, arm: Arm, named: Sequence[RecordSignal], decimate: int) -> RigRun:
    """Return one of them."""
    path, _, file = text.rpartition("=") if text.endswith(".toml") else (text, "", "")
    require(path, "--run", text, "write FILE, or FILE=LAW.toml of a record in closed loop")
    law = load_law(file) if file else None
    require(
        law is not None or not file, "law", MISSING, "give the file of the controller that was running", file
    )
    recording = read_recording(path, named)
    with name_file(path):
        driven = arm.input if law is None or law.input is None else law.input
        run = run_of(decimated(recording, decimate, held=driven), arm, law)
        if law is not None:
            check_period(law, run.period, file)
            check_law(law, run, file)
    return run


def check_period(law: Law, period: float, file: str) -> None:
    """Raise ParameterError unless the period of a law in z is that of its record, or a whole multiple of it."""
    # of the period of a record
    away = 1e-3
    ratio = 1.0 if law.period is None else law.period / period
    is_multiple = abs(ratio - round(ratio)) <= away * ratio
    remedy = (
        f"is sampled every {period:.6g} s, and the law of {file} every {law.period} s: the law's period is that of the "
        "record, or a whole multiple of it"
    )
    require(is_multiple, "record", f"{period:.6g} s", remedy)


def check_law(law: Law, run: RigRun, file: str) -> None:
    """Raise ParameterError where a law leaves more than half of the recorded input unexplained.

    That is the root mean square of the input's difference from that of the law, over that of the input about its mean,
    where the input is between its limits.  A record without a signal of the law is not checked, nor is a law that is
    slower than the record, not stable by itself, or with anti-windup, whose state depends on the limits.
    """
    # a gain of the wrong sign leaves 200 %, one of twice the size 50 %
    most = 0.5
    columns = {**run.outputs} | {f"{REFERENCE}{name}": values for name, values in run.references.items()}
    needed = {*law.signals, *law.wanted, *(f"{REFERENCE}{name}" for name in law.references)}
    is_slower = law.is_discrete and law.period > 1.5 * run.period  # type: ignore[operator]
    if run.input is None or is_slower or law.anti_windup or not needed <= columns.keys():
        return
    own = law if law.is_discrete else discretise_law(law, run.period)
    for name in law.references:
        columns[name] = columns[name] - columns[f"{REFERENCE}{name}"]
    # samples: a second of the processor for the largest law
    first = slice(0, 20_000)
    driving = np.array([columns[name][first] for name in (*own.signals, *own.wanted)])
    share = unexplained(own, driving, run.input[first])
    remedy = (
        f"driven by the record's {', '.join(own.signals)} it leaves {100 * share:.3g} % of its input unexplained, "
        f"of {100 * most:g} % at most: another law was running, a sign or unit of a column is wrong, or "
        "the law reads other signals than these: then leave the input out with --signal"
    )
    require(share <= most, "law", file, remedy)


def unexplained(law: Law, columns: Real, recorded: Real) -> float:
    """Return the share of a recorded input that a law in z leaves, with its delay of least residuals.

    0 for an input that does not move, and for a law that is not stable by itself.
    """
    A, B, C, D = law.matrices((*law.signals, *law.wanted))
    if abs(law.poles).max(initial=0.0) > 1 + 1e-9:
        return 0.0
    # of the law at rest at first, and of each first state alone
    states = np.hstack([np.zeros((law.order, 1)), np.eye(law.order)])
    forced = B @ columns
    rows = np.empty((recorded.size, law.order + 1))
    for n, row in enumerate(rows):
        row[:] = C[0] @ states
        states = A @ states
        states[:, 0] += forced[:, n]
    # matrices of a law are to -u; the constant is in the place of its output
    u = -(rows[:, 0] + D[0] @ columns)
    rows[:, 0] = 1.0
    shares = []
    for late in range(3):
        now = recorded[late:]
        is_between = (now > now.min()) & (now < now.max())
        residuals = (now - u[: now.size])[is_between]
        basis = rows[: now.size][is_between]
        left = residuals - basis @ np.linalg.lstsq(basis, residuals)[0]
        size = max(float(np.linalg.norm(now - now.mean())), LEAST_SIZE)
        shares.append(float(np.linalg.norm(left)) / size)
    return min(shares)


class RunTable(StrictTable):
    """[measured]."""

    file: str
    source: str = ""
    signals: list[str] = Field(default_factory=list)
    posterior: str = ""
    before: str = ""


@frozen
class MeasuredRun:
    """A run measured under the law of a file, and what is known of the arm: a posterior, the arm before a fit."""

    run: RigRun
    posterior: Posterior | None = None
    before: Arm | None = None


def load_run(name_or_path: AnyFile) -> MeasuredRun | None:
    """Return the run of a file's [measured] table under the law of that file, None where it has none.

    Raises ParameterError for an unknown key, and for a record without these signals or that is none, naming the file.
    """
    tables, file = load_tables(name_or_path)
    if "measured" not in tables:
        return None
    folder = Path(file).parent
    with name_file(file):
        table = validate_table(RunTable, tables["measured"], "measured")
        found = read_recording(folder / table.file, table.signals)
        reference = found.signal("reference:hub_angle", "measured.file")
        outputs: dict[str, Real] = {
            name: found.signals[name] for name in ("hub_angle", "root_moment") if name in found.signals
        }
        remedy = "has neither hub_angle [rad] nor root_moment [N m] with reference:hub_angle [rad]"
        require(outputs, "measured.file", table.file, remedy)
        run = RigRun(
            period=found.period,
            outputs=outputs,
            references={"hub_angle": reference},
            law=load_law(name_or_path),
            source=table.source or table.file,
            digest=found.digest,
            note=found.note,
        )
    posterior = load_posterior(folder / table.posterior) if table.posterior else None
    before = load(folder / table.before) if table.before else None
    return MeasuredRun(run, posterior, before)
