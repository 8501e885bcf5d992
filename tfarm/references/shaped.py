"""The reference of a slew in numbers: its impulses, the modes that it is shaped for, and the vibration that it leaves.

The frequency error e is one of the whole arm: moduli of every link and stiffnesses of clamp and joint times (1 + e)^2,
so that each frequency of the arm alone is (1 + e) times its own, but for rotary damping.  Controller, references and
impulses stay those of the nominal arm.  The loop is sampled, with its converters.

The bound on the residual at every sample after the slew is that of `bounds`, for the arm itself and for ranges of its
numbers: every mode of a band is in it, those left out with a bound of their own.
"""

import math
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import Chain
from tfarm.arm.checks import number
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.case import Case
from tfarm.dsp import kernel
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import Scenario, slew_scenario
from tfarm.dsp.shaping import impulses_at, loop_modes, share_left
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.stages import admit_case
from tfarm.errors import CertificationError, ConvergenceError, require
from tfarm.records import frozen
from tfarm.references.bounds import Ranges, SlewBounds, check_ranges, range_words
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Column, Percent, Quantity, Table
from tfarm.spectrum import modes
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.table import first_frequency


class Impulse(NamedTuple):
    """An impulse of a shaper."""

    time: Annotated[float, Quantity("time", "s", digits=6, help="after the begin of the slew")]
    size: Annotated[float, Quantity("size", "", 6, help="share of the reference; all together are 1")]


class ShapedMode(NamedTuple):
    """A mode of the loop, and what its impulses leave of its vibration."""

    mode: Annotated[int, Quantity("mode", help="number of the flexible mode")]
    frequency: Annotated[
        float, Quantity("frequency", "Hz", 5, help="|s|/(2 pi) of the pole of the sampled loop")
    ]
    damping_ratio: Annotated[float, Quantity("damping ratio", "", 4, help="-Re s/|s| of that pole")]
    is_shaped: Annotated[bool, Quantity("shaped", help="whether the shaper has a zero at or next to it")]
    share: Annotated[Percent, Quantity("share left", digits=3, help="of its vibration, by the impulses")]
    tolerance: Annotated[
        Percent | None,
        Quantity(
            "tolerance", digits=3, help="frequency error up to which at most 5 % are left, on both sides"
        ),
    ]


class RangeBound(NamedTuple):
    """The bound on the residual of every arm with numbers in some ranges."""

    ranges: Annotated[str, Quantity("ranges", help="numbers of the arm by key, with both ends")]
    bound: Annotated[
        float | None,
        Quantity(
            "bound",
            "N m",
            4,
            help="above the residual root moment of every arm; null where none is certified",
        ),
    ]
    certainty: Annotated[
        str, Quantity("certainty", help="frequency and number of boxes of arms, or why there is none")
    ]


@frozen
class ShapedReference:
    """The reference of a slew: impulses, modes, and the residual root moment over the error of the frequency.

    `residual` and `unshaped` are rms [N m] over equally long records from the end of each slew on.
    """

    controller: Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]
    profile: Annotated[str, Quantity("profile", help="of the slew before the shaper")]
    shaper: Annotated[str, Quantity("shaper", help="none, ZV, ZVD or EI")]
    feedforward: Annotated[
        str,
        Quantity("feedforward", help="torque of the rigid arm, inverse of the exact one at the hub, or none"),
    ]
    torque_after: Annotated[
        float,
        Quantity(
            "feedforward after the slew",
            "N m",
            4,
            help="its largest size; an inverse rings on as the held arm",
        ),
    ]
    torque_time: Annotated[
        float | None,
        Quantity(
            "time until it is small",
            "s",
            3,
            help="1 % of its largest, by the least damped mode of the arm with its hub held; null where it never is",
        ),
    ]
    rise_time: Annotated[float, Quantity("rise time", "s", 4, help="of the profile")]
    added: Annotated[float, Quantity("time added by the shaper", "s", 4, help="until its last impulse")]
    impulses: Annotated[tuple[Impulse, ...], Quantity("impulses", help="of the shaper, all modes together")]
    modes: Annotated[
        tuple[ShapedMode, ...], Quantity("modes of the loop", help="below half the sampling rate")
    ]
    residual: Annotated[
        float,
        Quantity(
            "residual root moment",
            "N m rms",
            4,
            key="residual_moment_rms",
            help="after the slew, less the rigid arm's",
        ),
    ]
    unshaped: Annotated[
        float,
        Quantity(
            "the same without shaper", "N m rms", 4, key="unshaped_moment_rms", help="of the profile alone"
        ),
    ]
    bound: Annotated[
        float | None,
        Quantity(
            "bound on the residual at the samples",
            "N m",
            4,
            key="residual_moment_bound",
            help="above the size of the root moment at every sample after the slew; null where none is certified",
        ),
    ]
    certainty: Annotated[
        str,
        Quantity(
            "certainty of the bound", help="frequency up to which it has every mode, or why there is none"
        ),
    ]
    ranges: Annotated[
        tuple[RangeBound, ...],
        Quantity("bound over ranges of the arm", help="with controller and impulses of the nominal arm"),
    ]
    modes_used: Annotated[
        int, Quantity("modes of the model", help="flexible modes of the arm in the simulation")
    ]
    errors: Annotated[
        Real, Quantity("frequency error", curve=True, help="share of each frequency of the arm")
    ]
    residuals: Annotated[Real, Quantity("residual", "N m rms", curve=True, help="with the shaper")]
    unshaped_residuals: Annotated[
        Real, Quantity("without shaper", "N m rms", curve=True, help="of the profile")
    ]
    nominal: Scenario
    plain: Scenario

    @property
    def worst_share(
        self,
    ) -> Annotated[
        Percent,
        Quantity("largest share left", digits=3, help="of the residual of the profile, over the curve"),
    ]:
        """The largest ratio of both residuals over the frequency error."""
        return Percent(float((self.residuals / self.unshaped_residuals).max()))

    @property
    def csv_table(self) -> Table:
        """Both residuals over the error of the frequency."""
        columns = (
            Column("frequency_error", of=self.errors),
            Column("residual", unit="N m rms", of=self.residuals),
            Column("unshaped_residual", unit="N m rms", of=self.unshaped_residuals),
        )
        return Table(columns=columns)


def reference(
    arm: Arm,
    law: AnyLaw,
    chain: Chain | None = None,
    *,
    error: float = 0.3,
    ranges: Ranges | None = None,
) -> ShapedReference:
    """Return impulses, modes and residual vibration of the slew of a chain, over frequency errors up to `error`.

    Parameters
    ----------
    arm, law, chain
        The loop; the chain has the slew and its reference, bang-bang without a shaper unless given.
    error
        Largest error of the frequencies, as a share.
    ranges
        Ends of numbers of the arm by key, over all of which the residual is bounded: {"payload.mass": (0.1, 0.11)}.
        Controller, references and impulses stay those of `arm`.

    Raises
    ------
    ParameterError
        As `simulate` does, for a loop whose simulation stops, for an error outside (0, 0.9], and for a range of another
        number than mass or inertia of payload, hub or attachment, friction or stiffness of the hub.
    """
    remedy = "the largest error of the frequencies is a share up to 0.9, such as 0.3"
    require(0 < number("error", error, remedy) <= 0.9, "error", error, remedy)
    check_ranges(ranges or {})
    case = admit_case(kernel.CONSUMER, Case(arm, law, chain))
    chain = case.chain
    shaping = chain.reference
    period = chain.sampling.period
    poles = loop_modes(case)
    impulses = impulses_at(poles, shaping.shaper, shaping.modes)
    added = (impulses.size - 1) * period
    # after the end of each slew
    left = max(2 * chain.slew.rise_time, 4 * 2 * np.pi / first_frequency(case.arm))
    plain = slew_scenario(case.arm, chain, chain.slew.rise_time + left)
    late = slew_scenario(case.arm, chain, chain.slew.rise_time + added + left).through(impulses)
    _, used = simulate_modes(case, late)
    errors = np.linspace(-error, error, 25)
    residuals = [
        [residual_of(case.on(with_frequencies(case.arm, 1 + e)), task, used.modes) for e in errors.tolist()]
        for task in (late, plain)
    ]
    middle = errors.size // 2
    torque_after = float(abs(late.feedforward[late.is_after]).max())
    bound, certainty = certified_bound(case, late, {})
    rows = []
    if ranges:
        rows.append(RangeBound(range_words(ranges), *certified_bound(case, late, ranges)))
    return ShapedReference(
        controller=controller(case.law, case.arm),
        profile=shaping.profile,
        shaper=shaping.shaper,
        feedforward=shaping.feedforward,
        torque_after=torque_after,
        torque_time=time_until_small(case.arm, torque_after / max(abs(late.feedforward).max(), LEAST_SIZE)),
        rise_time=chain.slew.rise_time,
        added=added,
        impulses=tuple(Impulse(k * period, float(impulses[k])) for k in np.flatnonzero(impulses).tolist()),
        modes=tuple(shaped_mode(mode, z, impulses, case) for mode, z in poles.items()),
        residual=residuals[0][middle],
        unshaped=residuals[1][middle],
        bound=bound,
        certainty=certainty,
        ranges=tuple(rows),
        modes_used=used.modes,
        errors=errors,
        residuals=np.array(residuals[0]),
        unshaped_residuals=np.array(residuals[1]),
        nominal=late,
        plain=plain,
    )


def time_until_small(arm: Arm, share: float) -> float | None:
    """Return the time [s] until a share is 1 % by the least damped mode of the held arm; None for never."""
    if share <= 0.01:
        return 0.0
    held = modes(replace(arm, hub=replace(arm.hub, inertia=math.inf)), 10)
    if arm.is_undamped:
        return None
    # the modes beyond the tenth are damped more
    decay = -float(np.nanmax(damped_modes(held).eigenvalues.real))
    return math.log(100 * share) / decay if decay > 0 else None


def with_frequencies(arm: Arm, factor: float) -> Arm:
    """Return the arm with moduli and stiffnesses times factor^2: its frequencies are `factor` times its own."""
    links = [
        replace(
            link, youngs_modulus=factor**2 * link.youngs_modulus, shear_modulus=factor**2 * link.shear_modulus
        )
        for link in (arm.link, *arm.outer)
    ]
    clamp, joint = (replace(each, stiffness=factor**2 * each.stiffness) for each in (arm.clamp, arm.joint))
    return replace(arm, link=links[0], outer=tuple(links[1:]), clamp=clamp, joint=joint)


def residual_of(case: Case, task: Scenario, count: int) -> float:
    """Return the rms of the residual root moment [N m].  Raises ConvergenceError where the simulation stops."""
    found = Simulator(case, task, count=count).run().residual_moment
    if found is None:
        raise ConvergenceError(
            "the loop grows at a frequency within the error: no residual", case.arm, math.inf
        )
    return found


def shaped_mode(mode: int, z: complex, impulses: Real, case: Case) -> ShapedMode:
    """Return the row of a mode with the pole z of the sampled loop."""
    period = case.chain.sampling.period
    s = complex(np.log(z)) / period
    reference = case.chain.reference
    is_shaped = reference.shaper != "none" and mode <= reference.modes
    # the frequency alone changes, and the damping with it as a ratio
    errors = np.linspace(0.0, 0.9, 901)
    shares = np.maximum(*(share_left(impulses, np.exp(s * (1 + way * errors) * period)) for way in (1, -1)))
    # of the vibration that is tolerated, as usual
    (beyond,) = np.nonzero(shares > 0.05 * (1 + 1e-6))
    first = int(beyond[0]) if beyond.size else errors.size
    return ShapedMode(
        mode,
        abs(s) / (2 * np.pi),
        -s.real / abs(s),
        is_shaped,
        Percent(float(share_left(impulses, z))),
        Percent(float(errors[first - 1])) if is_shaped and first else None,
    )


def certified_bound(case: Case, task: Scenario, ranges: Ranges) -> tuple[float | None, str]:
    """Return the bound on the residual root moment over ranges of the arm [N m] and its certainty, in words."""
    try:
        found, number = SlewBounds(case, task).over(ranges)
    except CertificationError as error:
        return None, f"not certified: {error}"
    words = f"certified up to {found.band.top:.3g} rad/s, not determined beyond"
    return found.most, f"{words}; {number} boxes" if ranges else words
