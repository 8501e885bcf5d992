"""Candidates: sections and hubs that the paper leaves open, and the learning curves of the gain tuner.

The paper gives an area, 6e-4 m^2, but neither the second moment I nor the hub inertia I_h.  Two studies vary them one
at a time, everything else being the arm's own.  Both rest on the exact solution, and the sensitivities are exact too
(`Modes.sensitivity`); frequencies are those of the undamped arm.
"""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from tfarm import tuner
from tfarm.arm import MOMENT_GAIN, PLANE, Arm, Section
from tfarm.arm.checks import whole
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.dsp import Chain, Simulation, results, traces
from tfarm.ensemble.space import Subjects
from tfarm.errors import require
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum import modes
from tfarm.spectrum.gains import default_gains
from tfarm.stopping import Progress
from tfarm.studies.quantities import FREQUENCY, INTERVAL, STABILITY, intervals_of, prepare
from tfarm.tuner import LearningCurves, Tuning, compare_controllers, tried_loops, tune
from tfarm.tuner.baselines import Outcomes, quantised_chain
from tfarm.tuner.tuning import tune_by_default, usual_plan

# relative: a candidate nearer to the arm's own value is that value
OWN_VALUE = 1e-9


# ------------------------------------------------------------ sections and hubs


@frozen(kw_only=True)
class Candidate:
    """One candidate section or hub inertia, and the loop under the default gains of the arm itself.

    `K2_below` is None where the loop is not stable; `K2_below_is_edge` is whether poles reach the axis there.
    """

    is_own: Annotated[bool, Quantity("this arm", help="whether the row is the arm's own value")]
    depth: Annotated[
        float | None, Quantity("depth", "m", 4, "of the candidate rectangle, in the plane of bending")
    ] = None
    width: Annotated[
        float | None,
        Quantity("width", "m", 4, "of the candidate rectangle: the arm's own area over the depth"),
    ] = None
    second_moment: Annotated[
        float | None,
        Quantity(
            "I",
            "m^4",
            4,
            key="second_moment_m4",
            help="second moment of area about the neutral axis of bending",
        ),
    ] = None
    hub_inertia: Annotated[
        float | None,
        Quantity(
            "I_h",
            "kg m^2",
            4,
            key="hub_inertia_kg_m2",
            help="candidate inertia of hub and rotor about the axis",
        ),
    ] = None
    natural_frequency: Annotated[
        list[float],
        Quantity(
            "natural frequencies", "rad/s", help="flexible modes of the candidate from the first, undamped"
        ),
    ]
    sensitivity: Annotated[
        list[float], Quantity("sensitivities", "%/%", 4, "of frequency to I or I_h, exact")
    ]
    verdict: Annotated[
        str,
        Quantity(
            "loop",
            "",
            6,
            "stability of the loop with the default gains of the arm itself; no loop where the hub has no inertia",
        ),
    ] = "no loop"
    K2_below: Annotated[float | None, Quantity(f"stable below {MOMENT_GAIN}", help="of the default loop")] = (
        None
    )
    K2_below_is_edge: Annotated[
        bool,
        Quantity(
            "stability limit there",
            "",
            6,
            "whether a pole reaches the imaginary axis at that gain, or the search ended there",
        ),
    ] = False


@frozen
class Candidates:
    """Candidates of one assumed parameter, and the limits of every frequency where it is the hub's inertia."""

    arm: Arm
    held: Annotated[
        str, Quantity("sensitivity", help="what is kept constant where a frequency is differentiated")
    ]
    locked: Annotated[
        Real,
        Quantity(
            "locked hub (I_h = inf) [rad/s]",
            "",
            6,
            "limits of the frequencies for an infinite hub inertia",
            "locked_rad_s",
        ),
    ]
    pinned: Annotated[
        Real,
        Quantity(
            "free pin (I_h = 0) [rad/s]",
            "",
            6,
            "limits of the frequencies for a hub without inertia",
            "pinned_rad_s",
        ),
    ]
    area: Annotated[
        float,
        Quantity(
            "area", "m^2", key="area_m2", help="cross-section of the link, the same for every candidate"
        ),
    ]
    shear_factor: Annotated[
        float, Quantity("shear factor", help="of the arm's own section, kept for every candidate")
    ]
    candidates: Annotated[
        list[Candidate],
        Quantity("candidates", help="frequencies, sensitivities and stability, a row a candidate"),
    ]


@frozen
class Assumptions:
    """The effect of the assumed section and hub; no hub where that has no inertia to choose."""

    arm: Annotated[str, Quantity("arm", help="arm whose section and hub inertia are varied")]
    count: Annotated[int, Quantity("flexible modes", help="number of flexible modes in each row")]
    gains: Annotated[
        dict[str, float],
        Quantity("gains of the loop", help="default gains of the arm, the same for every candidate"),
    ]
    section: Annotated[Candidates, Quantity("section", help="rectangles of the arm's own area")]
    hub: Annotated[
        Candidates | None, Quantity("hub", help="hub inertias; none where the hub is locked or a free pin")
    ]


def assumptions(arm: Arm, count: int) -> Assumptions:
    """Return frequencies over the candidates of section and hub inertia.

    Raises ParameterError for a rig: the paper leaves section and hub of one beam open.
    """
    require(
        arm.is_uniform,
        "arm",
        arm.name,
        "the assumptions studied are the paper's, of one Timoshenko beam on a hub; this is a rig",
    )
    gains = {name: default_gains(arm)[name] for name in PLANE}
    hub = hub_study(arm, count) if has_hub_inertia(arm) else None
    return Assumptions(arm.name, count, gains, section_study(arm, count), hub)


def has_hub_inertia(arm: Arm) -> bool:
    """Return whether the hub has an inertia that could be another: neither locked (inf) nor a free pin (0)."""
    return 0.0 < arm.hub.inertia < math.inf


def section_study(arm: Arm, count: int = 4) -> Candidates:
    """Return the first `count` flexible frequencies over rectangles of the arm's area.

    Depths are 2 to 60 mm for the paper's area, scaled with the root of the area to two digits, and that of the
    rectangle with the arm's own second moment.  The shear factor is the arm's own throughout.
    """
    area = arm.link.section.area
    own = math.sqrt(12.0) * arm.link.section.radius_of_gyration
    # m, for the paper's area
    of_paper = (0.002, 0.003, 0.004, 0.006, 0.008, 0.010, 0.015, 0.020, 0.030, 0.040, 0.060)
    scale = math.sqrt(area / 6.0e-4)
    depths = _with_own([float(f"{each * scale:.2g}") for each in of_paper], own)
    known = {
        "depth": depths,
        "width": [area / depth for depth in depths],
        "second_moment": [area * depth**2 / 12 for depth in depths],
    }
    plain = Section.general(area=area, second_moment=area * own**2 / 12, shear_factor=arm.link.shear_factor)
    # whose file has a second moment
    general = replace(arm, link=replace(arm.link, section=plain))
    rows = _candidates(general, count, "link.section.second_moment", depths.index(own), known)
    return Candidates(
        arm,
        "area, shear factor and all else held: I = A depth^2/12, so one per cent of depth counts twice",
        np.empty(0),
        np.empty(0),
        area,
        arm.link.shear_factor,
        rows,
    )


def hub_study(arm: Arm, count: int = 4) -> Candidates:
    """Return the first `count` flexible frequencies over inertias of a hub that has one.

    Inertias are 0.01 to 1 kg m^2, moved by whole decades if the arm's own lies outside, and the arm's own.
    """
    own = arm.hub.inertia
    # kg m^2, about the value assumed for the paper's hub
    usual = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
    decades = min(0, math.floor(math.log10(own / usual[0]) + OWN_VALUE))
    decades += max(0, math.ceil(math.log10(own / usual[-1]) - OWN_VALUE))
    inertias = _with_own([inertia * 10.0**decades for inertia in usual], own)
    rows = _candidates(arm, count, "hub.inertia", inertias.index(own), {"hub_inertia": inertias})
    pinned, locked = (
        modes(arm.with_numbers(hub_inertia=limit), count).natural_frequency[-count:]
        for limit in (0.0, math.inf)
    )
    # the first falls to 0, a heavy hub on the arm's own stiffness
    if not arm.with_numbers(hub_inertia=1.0).has_rigid_mode:
        locked = np.r_[0.0, locked[:-1]]
    return Candidates(
        arm, "all else held", locked, pinned, arm.link.section.area, arm.link.shear_factor, rows
    )


def _candidates(
    arm: Arm, count: int, key: str, own: int, known: Mapping[str, Sequence[Any]]
) -> list[Candidate]:
    """Return the rows of a study of that key, whose values are the last of those known; `own` is the arm's own row."""
    parameter, values = list(known.items())[-1]
    limit = f"{INTERVAL}.{MOMENT_GAIN}.high"
    family = Subjects(Case(arm, default_gains(arm)), (key,))
    subjects = [family.at((value,)) for value in values]
    prepare(subjects, [f"{FREQUENCY}.{count}"])
    rows = []
    for n, one in enumerate(subjects):
        table = modes(one.case.arm, count)
        loop: dict[str, Any] = {}
        # no loop of a locked hub or a free pin
        if has_hub_inertia(arm):
            found = intervals_of(one, {limit})
            is_edge = found.get(f"{limit}_is") == "edge"
            loop = {"verdict": found[STABILITY], "K2_below": found.get(limit), "K2_below_is_edge": is_edge}
        rows.append(
            Candidate(
                is_own=n == own,
                natural_frequency=table.natural_frequency[-count:].tolist(),
                sensitivity=(table.sensitivity[parameter][-count:] + 0.0).tolist(),
                **loop,
                **{name: column[n] for name, column in known.items()},
            )
        )
    return rows


def _with_own(candidates: Sequence[float], own: float) -> list[float]:
    """Return the candidates and the arm's own value, ascending; one that equals it, but for rounding, is replaced."""
    return sorted([*(value for value in candidates if abs(value / own - 1) >= OWN_VALUE), own])


# ------------------------------------------------------------ learning curves


def learning_curves(
    arm: Arm, plan: tuner.Plan, chain: Chain, seeds: int, progress: Progress = lambda *_: None
) -> tuner.LearningCurves:
    """Return the learning curves of a plan from a number of seeds, its own and those that follow (paper's Figure 5).

    `progress` gets (done, total, text).  Raises ParameterError for a number of seeds out of range.
    """
    most = 10_000
    seeds = whole("seeds", seeds, 1, most, f"a whole number of seeds from 1 to {most}")
    costs = np.full((seeds, plan.trials), np.inf)
    found: list[tuner.Training] = []
    # compiled loops let other threads run; a report uses no more cores
    with ThreadPoolExecutor(2) as pool:
        for training in pool.map(
            lambda n: tune_by_default(arm, chain, plan, seed=plan.seed + n).training, range(seeds)
        ):
            costs[len(found), : training.costs.size] = training.costs
            found.append(training)
            progress(len(found), seeds, "learning curves")
    return tuner.LearningCurves(
        costs=costs,
        final=np.array([np.inf if each.stopped else each.result.cost for each in found]),
        diverged=sum(each.stopped is not None for each in found),
        died=sum(each.died for each in found),
    )


# ------------------------------------------------------------ one tuning, and what it is compared with


WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
# that the trials of learning curves may have together, some 35 s of one core
CURVE_SAMPLES = 80_000_000
# samples: the comparison of a longer one is of the arm itself alone
LONG_TRIAL = 16_000


@frozen
class TunerNumbers:
    """One tuning and what is compared with it.

    `slews` and `coarse` hold two simulations each, without and with the tuner.
    """

    arm: Arm
    tuning: Tuning
    slews: Mapping[str, Simulation]
    coarse: Mapping[str, Simulation]
    curves: LearningCurves
    rows: tuple[Outcomes, ...]


def tuner_numbers(arm: Arm, chain: Chain) -> TunerNumbers:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, CertificationError where no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    own = results.ideal_chain(chain)
    tuning = tune(arm, plan, own)
    trial = tuning.trial
    # the first are those of the arm itself, of which the last is quantised and late
    late = 3
    listed = tried_loops(trial.case, quantised_chain(arm, chain))
    rows = compare_controllers(
        trial,
        tuning.gain(),
        tuning.training.guard,
        listed[: late + 1 if trial.n > LONG_TRIAL else None],
        tuning.best_constant.gain,
    )
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulate_both(tuning, trial.loop.chain),
        coarse=_simulate_both(tuning, listed[late].case.chain),
        curves=learning_curves(arm, plan, own, curve_seeds(plan.trials * trial.n)),
        rows=tuple(rows),
    )


def curve_seeds(samples: int) -> int:
    """Return the number of seeds of the learning curves, at most 20, for trainings of that length."""
    return min(20, max(1, CURVE_SAMPLES // samples))


def _simulate_both(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = traces.resolve_simulations(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}
