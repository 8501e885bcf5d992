"""The (K1, K2) map: where the exact loop is stable, what its boundary is made of, and how well its modes are damped."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.scale import SymmetricalLogTransform
from numpy.typing import NDArray

import tfarm
from tfarm.arm import Arm, HubFeedback, many_laws
from tfarm.columns import Column, Table
from tfarm.dsp import Chain, sampled_verdict
from tfarm.dsp.brief import SampledBrief
from tfarm.errors import ConvergenceError
from tfarm.loop.damping import least_damping
from tfarm.loop.design import Design
from tfarm.loop.frequencies import band_of
from tfarm.loop.regions import Region, between, boundary, region
from tfarm.records import record
from tfarm.report.loop_laws import MODES, NamedLaw, best, brief_of, laws
from tfarm.report.overlay import Layer, ends_of_K1, sampled_layer
from tfarm.spectrum.scales import default_gains, rate_unit

Real = NDArray[np.float64]

COLUMNS, ROWS = 240, 200  # of the coloured grid
SPARSE = 4  # every so many of them the damping is computed
LOW, HIGH, DEEPEST = -4.0, 2.0, -50.0  # K2: the range shown, and how deep windows are looked for
SHORT, LONG, ROUNDS = 0.008, 0.03, 30  # lengths of the boundary's segments, as shares of the picture
SCAN = 32  # columns in which they are looked for
SAMPLED_COLUMNS = 120  # values of K1 at which the sampled region is cut, besides its exact ends
SIDE = 1e-9  # relative: so far to either side of an upright edge the region is cut too
OUTSIDE = 0.1  # of K2, beyond the picture: an edge there is none of the region
NEAR = 1.5  # beyond this many rows from the boundary the count must have changed


@dataclass(frozen=True)
class Axis:
    """One axis of the map: linear within +-`linear`, logarithmic beyond (all linear where `linear` is infinite)."""

    low: float
    high: float
    linear: float = math.inf

    @cached_property
    def _transform(self) -> Any:
        return SymmetricalLogTransform(10.0, self.linear, 0.5)

    @property
    def is_linear(self) -> bool:
        """Whether it is linear throughout."""
        return math.isinf(self.linear)

    def place(self, x: Real) -> Real:
        """Where values are along the axis, 0 to 1."""
        if self.is_linear:
            return np.asarray((x - self.low) / (self.high - self.low))
        low, high = self._transform.transform(np.array([self.low, self.high]))
        return np.asarray((self._transform.transform(np.asarray(x, float)) - low) / (high - low))

    def grid(self, number: int) -> Real:
        """So many values, evenly spaced as seen."""
        if self.is_linear:
            return between(self.low, self.high, number)
        low, high = self._transform.transform(np.array([self.low, self.high]))
        return np.asarray(self._transform.inverted().transform(between(low, high, number)))


@dataclass(frozen=True)
@record
class GainMap:
    """What the map shows.

    `region` is the exact count on the coloured grid, `edge` (n, 3) the exact boundary K1, K2, w within the picture
    with rows of nan where it leaves it; `damping` (rows, columns) the least damping ratio of the first `MODES` modes
    on every fourth point of the grid; `held` [rad/s] the first frequencies with the hub at rest; `design` the best
    gains.  `sampled` is where the loop is stable at the clock of `chain` too, None where that could not be settled;
    `briefs` are the sampled verdicts on the laws.
    """

    arm: Arm
    x: Axis
    y: Axis
    region: Region
    edge: Real
    K1: Real
    K2: Real
    damping: Real
    laws: tuple[NamedLaw, ...]
    design: Design | None
    held: Real
    chain: Chain
    sampled: Layer | None
    briefs: tuple[SampledBrief, ...]

    @property
    def is_undamped(self) -> bool:
        """Whether C = 0."""
        return self.arm.is_undamped

    @property
    def counts(self) -> NDArray[np.int64]:
        """Unstable poles on the grid of the damping."""
        half = SPARSE // 2
        return np.asarray(self.region.unstable[half::SPARSE, half::SPARSE])

    @property
    def band(self) -> float:
        """Below which [rad/s] the damping is the least."""
        return band_of(self.arm, MODES)


def gain_map(arm: Arm, chain: Chain | None = None) -> GainMap:
    """The map of an arm, its ranges chosen by J w1 and by the windows that it has; without a chain at 10 ms."""
    chain = Chain() if chain is None else chain
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    found = region(arm, x.grid(COLUMNS), y.grid(ROWS))
    half = SPARSE // 2
    K1, K2 = found.K1[half::SPARSE], found.K2[half::SPARSE]
    a, b = (each.ravel() for each in np.meshgrid(K1, K2))
    damping = least_damping(arm, many_laws(HubFeedback(), K1=a, K2=b), MODES).reshape(K2.size, K1.size)
    held = tfarm.modes(arm.having(hub_inertia=math.inf), count=3).natural_frequency
    named = laws(arm)
    briefs = tuple(brief_of(arm, each.law, chain) for each in named)
    sampled = sampled_region(arm, x, y, chain)
    return GainMap(arm, x, y, found, edge(found, x, y), K1, K2, damping, named, best(arm), held, chain, sampled, briefs)


def sampled_region(arm: Arm, x: Axis, y: Axis, chain: Chain) -> Layer | None:
    """Where in the picture the sampled loop is stable, with the modes of the verdict on the default gains."""
    try:
        loop = sampled_verdict(arm, default_gains(arm), chain).loop
        ends = np.array(ends_of_K1(loop))
        K1 = x.grid(SAMPLED_COLUMNS)
        sides = np.concatenate([K1[K1 > 0], ends * (1 - SIDE), ends * (1 + SIDE)])
        return sampled_layer(loop, np.unique(sides[sides < x.high]), (y.low - OUTSIDE, y.high + OUTSIDE))
    except ConvergenceError:
        return None


def rate_axis(arm: Arm) -> Axis:
    """K1 from just below 0 to 10 J w1, logarithmic from well below the default gain on."""
    unit = rate_unit(arm)
    linear = 10.0 ** math.floor(math.log10(default_gains(arm).K1))
    return Axis(-linear, 10 * unit, linear)


def moment_axis(arm: Arm, x: Axis) -> Axis:
    """K2 from -4 to 2, or as deep as unstable windows go."""
    if arm.is_undamped:
        return Axis(LOW, HIGH)
    K1 = x.grid(SCAN)
    deep = region(arm, K1[K1 > 0], between(DEEPEST, LOW, 400))
    rows = np.nonzero(~deep.stable.all(axis=1))[0]
    if not rows.size:
        return Axis(LOW, HIGH)
    return Axis(max(DEEPEST, 1.4 * float(deep.K2[rows[0]])), HIGH, 2.0)


def edge(found: Region, x: Axis, y: Axis) -> Real:
    """The boundary in the picture, finer where it is coarse, with rows of nan between its parts."""
    points = found.boundary
    if not points.size:
        return points
    for _ in range(ROUNDS):
        length, is_seen = _segments(points, x, y)
        (coarse,) = np.nonzero((length > SHORT) & is_seen)
        if not coarse.size:
            break
        middle = np.sqrt(points[coarse, 2] * points[coarse + 1, 2])
        middle = middle[(middle > points[coarse, 2]) & (middle < points[coarse + 1, 2])]
        points = np.concatenate([points, boundary(found.arm, middle)])
        points = points[np.unique(points[:, 2], return_index=True)[1]]
    length, is_seen = _segments(points, x, y)
    return _cut(points, is_seen & (length < LONG))


def _segments(points: Real, x: Axis, y: Axis) -> tuple[Real, NDArray[np.bool_]]:
    """How long each segment looks, and whether it may pass through the picture."""
    places = np.stack([axis.place(points[:, i]) for i, axis in enumerate((x, y))])
    low, high = np.minimum(places[:, 1:], places[:, :-1]), np.maximum(places[:, 1:], places[:, :-1])
    return np.hypot(*np.diff(places)), np.asarray(((high >= 0) & (low <= 1)).all(axis=0))


def _cut(points: Real, kept: NDArray[np.bool_]) -> Real:
    """The points that belong to kept segments, a row of nan after each run."""
    belongs = np.r_[kept, False] | np.r_[False, kept]
    rows: list[Real] = []
    for i in np.nonzero(belongs)[0]:
        rows.append(points[i])
        if i == len(points) - 1 or not kept[i]:
            rows.append(np.full(3, np.nan))
    return np.array(rows).reshape(-1, 3)


def stable_edge(data: GainMap) -> Real:
    """Points (n, 3) of the boundary with the stable region on one side."""
    points = data.edge[~np.isnan(data.edge[:, 0])] if data.edge.size else data.edge
    if not points.size:
        return points
    across = np.clip((data.x.place(points[:, 0]) * COLUMNS).astype(int), 0, COLUMNS - 1)
    up = data.y.place(points[:, 1]) * ROWS
    below, above = (np.clip(np.round(up + way).astype(int), 0, ROWS - 1) for way in (-NEAR - 0.5, NEAR - 0.5))
    unstable = data.region.unstable
    differ = (unstable[below, across] == 0) != (unstable[above, across] == 0)
    in_view = (up >= 0) & (up <= ROWS) & (data.x.place(points[:, 0]) <= 1) & (points[:, 0] > 0)
    return np.asarray(points[differ & in_view])


def map_data(data: GainMap) -> Table:
    """The grid with counts and damping, the boundary with its frequencies, then the ends of the sampled intervals."""
    K1, K2 = (each.ravel() for each in np.meshgrid(data.K1, data.K2))
    edge = data.edge[~np.isnan(data.edge[:, 0])] if data.edge.size else data.edge
    counts: list[float | int | str] = [math.inf if count < 0 else int(count) for count in data.counts.ravel()]
    none: list[float | int | str] = [""]
    sampled = _sampled_ends(data)
    beyond = len(edge) + len(sampled)
    what = ["grid"] * K1.size + ["boundary"] * len(edge) + ["sampled boundary"] * len(sampled)
    columns = (
        Column("what", "what", of=what),
        Column("K1_N_m_s_rad", "K1", "N m s/rad", of=np.r_[K1, edge[:, 0], sampled[:, 0]]),
        Column("K2", "K2", of=np.r_[K2, edge[:, 1], sampled[:, 1]]),
        Column("unstable_poles", "unstable poles", of=counts + none * beyond),
        Column("least_damping_ratio", "least damping ratio", of=[*data.damping.ravel().tolist(), *none * beyond]),
        Column("omega_rad_s", "frequency", "rad/s", of=none * K1.size + edge[:, 2].tolist() + none * len(sampled)),
    )  # fmt: skip
    return Table(stem="map-data", title="The map of K1 and K2", is_data=True, columns=columns)


def _sampled_ends(data: GainMap) -> Real:
    """K1 and K2 (n, 2) of the ends of the sampled loop's stable intervals, those cut by the picture left out."""
    if data.sampled is None:
        return np.empty((0, 2))
    columns = zip(data.sampled.K1, data.sampled.intervals, strict=True)
    ends = [(float(K1), end) for K1, column in columns for window in column for end in window]
    return np.array([each for each in ends if data.y.low <= each[1] <= data.y.high]).reshape(-1, 2)
