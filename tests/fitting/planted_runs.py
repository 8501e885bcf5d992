"""Arms found again from records in time of finite elements, in open and closed loop, with all that a rig has.

    python -m tests.fitting.planted_runs COUNT SEED [kind ...] FILE    # appends a line of JSON a rig
    python -m tests.fitting.planted_runs summary FILE

Random arms under torque or current, whose records come from `tests.fitting.elements_in_time`: hold, dead time of any
fraction, gain and bias of the drive, analog filter, offsets, noise and encoder steps of the sensors.  The kinds are
open (under its bias before the record, and some are pushed), closed (from rest), pushed (closed, in motion at the
start), and of a wrong model joint (one that moves mode 1 by 5 %) and elastic (a payload with a mode of its own below
mode 3).

Two to five numbers are free, each started up to 30 % off.  No fit may end above the sum of squares of a search from
the truth, nominal 95 % intervals are counted, and so are right models that are rejected; wrong ones have to be.

Derivatives of the noiseless records by the elements themselves give the shift of the numbers by shorter elements, in
standard deviations ("bias"), and chi-squared of a wrong model in excess of its freedom ("excess"), as far as both are
linear: numbers that may go farther explain more of a wrong model's record.
"""

import json
import math
import sys
import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binomtest

import tfarm
from tests.chain_elements import natural_frequencies, reached
from tests.fitting.elements_in_time import Body, Computer, Drive, Plant, simulate
from tests.fitting.planted import OFF, some_arm, values_of
from tests.fitting.planted_commands import input_of, log, references_of, some_law
from tfarm.arm.chain import Chain, Sampling
from tfarm.arm.writing import KeyedArms
from tfarm.fitting.fit import fit
from tfarm.fitting.runs import DRIVE_GAIN, GAIN_KEY, RigRun
from tfarm.fitting.solve import nearest_minimum

KINDS = ("open", "closed", "pushed", "joint", "elastic")
WRONG = ("joint", "elastic")
NUMBERS = (
    "hub.inertia",
    "link.damping",
    "payload.mass",
    "clamp.stiffness",
    "hub.friction",
    "drive.gain",
    "drive.delay",
)
# frequencies of the arm's own for which elements of records are short enough, and of shorter ones
MODES = 3
MORE = 6
# samples in which a push has died away by much: hundreds of periods of mode 1
SETTLED = 4000


@dataclass(frozen=True)
class Planted:
    """A rig with its record: the arm that is fitted at the true numbers, and what differs from it in truth."""

    arm: object
    other: object  # the arm of the record
    body: Body | None
    truth: dict
    start: dict
    drive: Drive
    computer: Computer
    names: tuple
    corner: float  # of the analog filter, rad/s
    push: tuple  # duration, rest [s], and factor on the states
    settling: float | None  # s, in which the bias has come up before the record; None where it begins with it
    run: RigRun

    def plant_at(self, values, modes=MODES):
        """The plant of the arm that is fitted, at some numbers."""
        keys = [key for key in values if not key.startswith("drive.")]
        arm = KeyedArms(self.arm, keys).at({key: values[key] for key in keys})
        return Plant(arm, self.names, reached(self.arm, modes), corner=self.corner)

    def plant_of_record(self, modes=MODES):
        """The plant of the record."""
        return Plant(self.other, self.names, reached(self.arm, modes), body=self.body, corner=self.corner)

    @property
    def chain(self):
        """What is known of the computer: period, filter, and dead time unless it is free."""
        T = self.computer.period
        return Chain(sampling=Sampling(period=T, delay_samples=self.drive.delay / T, antialias_corner=self.corner))

    def columns(self, plant, values, **more):
        """Noiseless records over the deviations of their noise (samples of all signals, m)."""
        drive = replace(self.drive, delay=values.get("drive.delay", self.drive.delay))
        if "drive.gain" in values:
            drive = replace(drive, gain=values["drive.gain"] / torque_constant(self.arm))
        ideal = replace(self.computer, step={}, offset={})
        start = more.pop("start", None)
        if start is None:
            start = self.push[2] * plant.pushed(*self.push[:2]) + self.drive.bias * settled(plant, self.settling)
        read, _, _ = simulate(plant, drive, ideal, start=start, **more)
        return (read / deviations(self.computer, self.names)[:, None, None]).reshape(-1, read.shape[2])

    @cached_property
    def derivatives(self):
        """Of the record by ln of each free number, then by bias, offsets and initial states."""
        found = []
        for key, value in self.truth.items():
            sides = [self.truth | {key: value * math.exp(step)} for step in (1e-4, -1e-4)]
            up, down = (self.columns(self.plant_at(each), each)[:, 0] for each in sides)
            found.append((up - down) / 2e-4)
        plant = self.plant_at(self.truth)
        slow = plant.slow_states(1.2 * natural_frequencies(self.arm, 3)[-1])
        states, sensors = slow.shape[1], len(self.names)
        m = 1 + sensors + states
        start = np.zeros((len(plant.A), m))
        start[:, 1 + sensors :] = slow
        offset = np.zeros((sensors, m))
        offset[:, 1 : 1 + sensors] = np.diag(deviations(self.computer, self.names))
        bias = np.eye(m)[0] * self.unit_bias
        free = self.columns(plant, self.truth, start=start, bias=bias, offset=offset, factor=0.0)
        return np.c_[np.transpose(found), free]

    @property
    def unit_bias(self):
        return abs(self.drive.bias) or 1.0

    def projected(self, change):
        """The numbers' shifts over their deviations by a change of the record, and the square of what they leave."""
        J = self.derivatives
        size = np.linalg.norm(J, axis=0)
        Q, R = np.linalg.qr(J / size)
        n = len(self.truth)
        inverse = np.linalg.pinv(R, rcond=1e-10)
        shift = (inverse @ (Q.T @ change))[:n] / np.linalg.norm(inverse, axis=1)[:n]
        return shift, float(change @ change - (Q.T @ change) @ (Q.T @ change))

    @property
    def bias(self):
        """The largest shift of a number by the length of the elements, over its deviation."""
        fine, coarse = (self.columns(self.plant_of_record(modes), self.truth)[:, 0] for modes in (MORE, MODES))
        return float(abs(self.projected(fine - coarse)[0]).max())

    @property
    def expected(self):
        """The numbers' errors over their deviations, and chi-squared less what nuisances take, of linear least squares.

        Of an open loop alone: in a closed one the noise is in the record twice.
        """
        read = np.concatenate([self.run.outputs[name] - self.computer.offset[name] for name in self.names])
        noise = read / np.repeat(deviations(self.computer, self.names), self.run.count)
        return self.projected(noise - self.columns(self.plant_at(self.truth), self.truth)[:, 0])

    @property
    def excess(self):
        """How much larger chi-squared of the best arm is than its freedom, where the arm is another one."""
        change = self.columns(self.plant_of_record(), self.truth) - self.columns(self.plant_at(self.truth), self.truth)
        return self.projected(change[:, 0])[1]


def deviations(computer, names):
    """Of the noise of each signal, its steps included (signals,)."""
    squares = [computer.noise[name] ** 2 + computer.step.get(name, 0.0) ** 2 / 12 for name in names]
    return np.sqrt(squares)


def settled(plant, settling):
    """The states by a unit of bias at the start of a record."""
    return 0 * plant.B if settling is None else plant.settled(settling)


def torque_constant(arm):
    """What the gain of a drive is counted in: of a torque that of 1 N m, of a current that of its motor."""
    return 1.0 if arm.motor is None else arm.motor.torque_constant


# ------------------------------------------------------------ draws


def turning(rng):
    """An arm on a hub that may have friction or a spring, under a torque or the current of a geared motor."""
    arm = some_arm(rng)
    w1, J = natural_frequencies(arm, 1)[0], arm.turned_inertia
    hub = replace(
        arm.hub,
        friction=J * w1 * log(rng, -2, -0.5) if rng.random() < 0.7 else 0.0,
        stiffness=J * w1**2 * log(rng, -2, -0.5) if rng.random() < 0.3 else 0.0,
    )
    arm = replace(arm, hub=hub)
    if rng.random() < 0.5:
        return arm
    N = log(rng, 0, 2)
    motor = tfarm.Motor(resistance=1.0, torque_constant=0.05, gear_ratio=N, rotor_inertia=J / N**2 * log(rng, -2, -0.5))
    return replace(arm, motor=motor, input="motor_current")


def softer(arm):
    """The arm behind a joint by which the frequency of mode 1 is 5 % lower."""
    lower = 0.95 * natural_frequencies(arm, 1)[0]

    def behind(exponent):
        return replace(arm, joint=tfarm.RotarySpring(stiffness=arm.link.EI / arm.length * 10**exponent))

    return behind(brentq(lambda exponent: natural_frequencies(behind(exponent), 1)[0] - lower, -2, 5))


def numbers_of(rng, arm, kind):
    """Two to five free numbers with their true values, but for those of the drive."""
    there = [key for key in NUMBERS if key != "hub.friction" or arm.hub.friction]
    if kind == "joint":
        # a softer clamp is the same as a softer joint
        there.remove("clamp.stiffness")
    return ["link.youngs_modulus", *rng.choice(there, size=rng.integers(1, 5), replace=False).tolist()]


def planted(kind, seed):
    """A rig, by its kind and number; one whose law does not bring a push to rest is drawn again."""
    rng = np.random.default_rng([571, KINDS.index(kind), seed])
    found = None
    while found is None:
        found = drawn(rng, kind)
    return found


def drawn(rng, kind):
    """A rig, or None of a law that is not stable."""
    arm = turning(rng)
    w = natural_frequencies(arm, 3)
    w1, J = w[0], arm.turned_inertia
    per_input = 1.0 if arm.motor is None else 1 / (arm.motor.gear_ratio * arm.motor.torque_constant)
    body = None
    if kind == "elastic":
        body = Body(rng.uniform(0.5, 1), w1 * (0.9 * w[2] / w1) ** rng.uniform(0, 1), damping=0.01 / w1)
    other = softer(arm) if kind == "joint" else arm
    keys = numbers_of(rng, arm, kind)
    period, count = (
        2 * math.pi / w1 / log(rng, math.log10(4), math.log10(40)),
        int(log(rng, math.log10(500), math.log10(5000))),
    )
    drive = Drive(
        gain=log(rng, -0.5, 0.5) if "drive.gain" in keys else 1.0,
        delay=period * rng.uniform(0.1, 2.5) if "drive.delay" in keys or rng.random() < 0.5 else 0.0,
    )
    corner = math.pi / period * log(rng, -0.5, 0.3) if rng.random() < 0.3 else math.inf
    truth = values_of(arm, [key for key in keys if not key.startswith("drive.")])
    truth |= {"drive.gain": drive.gain * torque_constant(arm), "drive.delay": drive.delay}
    truth = {key: truth[key] for key in keys}
    size = 0.05 * J * w1**2 * per_input / drive.gain
    entries, law, task = {}, None, {"input": size * input_of(rng, count, period, w1)}
    if kind in ("closed", "pushed") or (kind in WRONG and rng.random() < 0.5):
        entries, law = some_law(rng, arm, w1, period, per_input / drive.gain)
        task = {"law": entries, "references": references_of(rng, entries, count, period, w1)}
    others = [name for name, chance in (("root_moment", 0.7), ("tip_acceleration", 0.2)) if rng.random() < chance]
    names = tuple(dict.fromkeys(["hub_angle", *entries, *others]))
    plant, computer = (
        Plant(other, names, reached(arm, MODES), body=body, corner=corner),
        Computer(period, count, **task),
    )
    # of the record, of a push before it, and of a bias: each its share
    push = 2 * math.pi / w1 * rng.uniform(0.3, 1.5), (3 + 5 * rng.random()) * period
    settling = None if entries else 10 * math.pi / w1
    pushed = np.c_[0 * plant.B, plant.pushed(*push), settled(plant, settling)]
    if entries and not is_stable(plant, drive, replace(computer, count=SETTLED), pushed[:, 1]):
        return None
    alone = simulate(plant, drive, computer, start=pushed, factor=np.eye(3)[0], bias=np.eye(3)[2])[0]
    record, by_push, by_bias = abs(alone[0]).max(axis=0)
    is_moving = kind == "pushed" or (not entries and rng.random() < 0.5)
    factor = rng.uniform(0, 0.5) * record / by_push if is_moving else 0.0
    drive = replace(drive, bias=rng.uniform(-0.5, 0.5) * record / by_bias)
    start = pushed @ [0.0, factor, drive.bias]
    whole = simulate(plant, drive, computer, start=start)[0][..., 0]
    computer = with_sensors(rng, computer, names, whole)
    seen, u, _ = simulate(plant, drive, computer, start=start, rng=rng)
    measured = dict(zip(names, seen[..., 0], strict=True))
    sigma = dict(zip(names, deviations(computer, names).tolist(), strict=True)) if rng.random() < 0.5 else {}
    recorded = u[:, 0] if law is None or rng.random() < 0.5 else None
    run = RigRun(period=period, outputs=measured, input=recorded, references=computer.references, law=law, sigma=sigma)
    start = {key: value * (1 + rng.uniform(-OFF, OFF)) for key, value in truth.items()}
    return Planted(arm, other, body, truth, start, drive, computer, names, corner, (*push, factor), settling, run)


def is_stable(plant, drive, computer, start):
    """Whether a push dies away under the law, even if the drive's gain is larger."""
    loud = replace(drive, gain=1.2 * drive.gain)
    # of an unstable loop it may grow beyond what a float can be
    with np.errstate(all="ignore"):
        read = abs(simulate(plant, loud, replace(computer, references={}), start=start)[0])
    fifth = computer.count // 5
    return bool(np.isfinite(read).all() and (read[:, -fifth:].max(axis=1) < 0.9 * read[:, :fifth].max(axis=1)).all())


def with_sensors(rng, computer, names, record):
    """Noise of 0.1 to 5 % of what turns about a slow motion, steps of about the noise of the angle, and offsets."""
    t = np.linspace(-1, 1, computer.count)
    noise, offset, step = {}, {}, {}
    for name, signal in zip(names, record, strict=True):
        size = float(np.std(signal - np.polynomial.Chebyshev.fit(t, signal, 3)(t)))
        noise[name] = size * log(rng, -3, math.log10(0.05))
        offset[name] = size * float(rng.normal()) if name != "hub_rate" else 0.0
        if name == "hub_angle":
            step[name] = noise[name] * log(rng, -0.4, 0.4)
    return replace(computer, noise=noise, offset=offset, step=step)


# ------------------------------------------------------------ fits


def judged(kind, seed):
    """A row: the rig, the fit, the fit from the truth, and what the elements' own derivatives expect."""
    rig = planted(kind, seed)
    run, begin, of = rig.run, time.process_time(), {"free": list(rig.truth), "runs": [rig.run], "chain": rig.chain}
    found = fit(rig.arm, [], **of, start=rig.start, profile=kind not in WRONG)
    spent = time.process_time() - begin
    numbers = {}
    for each in found.parameters:
        key = DRIVE_GAIN if each.key == GAIN_KEY else each.key
        ends = {"low": each.low, "high": each.high, "identified": each.identified, "deviation": each.deviation}
        numbers[key] = {"truth": rig.truth[key], "start": rig.start[key], "value": each.value} | ends
    row = {"kind": kind, "seed": seed, "loop": "open" if run.law is None else "closed"}
    row |= {"samples": run.count, "signals": list(rig.names), "numbers": numbers}
    row |= {"sigma_known": bool(run.sigma), "input_known": run.input is not None}
    row |= {"cpu": spent, "verdict": found.verdict, "explained": found.is_explained, "converged": found.converged}
    row |= {"chi_squared": found.chi_squared, "freedom": found.freedom, "bias": rig.bias}
    row |= {"white": found.chance_of_white, "push": rig.push[2] != 0}
    if kind in WRONG:
        return row | {"excess": rig.excess}
    problem = found.problem
    truth = [
        each.coordinate(rig.truth[DRIVE_GAIN if each.key == GAIN_KEY else each.key]) for each in problem.parameters
    ]
    return row | {"from_truth": nearest_minimum(problem, np.array(truth)).chi_squared}


def record(count, seed, kinds, path):
    """Append a row a rig to a file, but for those that it has."""
    done = {(row["kind"], row["seed"]) for row in rows_of(path)}
    for number in range(seed * 10000, seed * 10000 + count):
        for kind in kinds:
            if (kind, number) in done:
                continue
            try:
                row = judged(kind, number)
            except Exception as error:
                row = {"kind": kind, "seed": number, "error": f"{type(error).__name__}: {error}"}
            with path.open("a", encoding="utf-8") as file:
                print(json.dumps(row, default=float), file=file)


def rows_of(path):
    """The rows of a file, none where there is no file."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [json.loads(line) for line in lines]


def is_inside(number):
    """Whether an interval, whose ends may be open, has the truth."""
    low, high = number["low"], number["high"]
    return (low is None or low <= number["truth"]) and (high is None or number["truth"] <= high)


def is_above(row):
    """Whether a fit ended above the search from the truth, by more than where searches end."""
    return row["chi_squared"] > row["from_truth"] + 0.01


def is_rejected(row):
    """Whether the verdict is that the model does not explain the record."""
    return row["explained"] is False or row["verdict"].startswith("misses")


def is_visible(row):
    """Whether the excess of chi-squared of a wrong model is far beyond the scatter of chi-squared."""
    return row["excess"] > 5 * math.sqrt(2 * row["samples"] * len(row["signals"]))


def coverage(rows):
    """Yield the shares of intervals that have the truth, by number and of all."""
    inside = {}
    for row in rows:
        for key, number in row["numbers"].items():
            if number["identified"]:
                inside.setdefault(key, []).append(is_inside(number))
    for key, held in sorted(inside.items()):
        yield f"{key}: {sum(held)} of {len(held)}"
    held = [each for some in inside.values() for each in some]
    if held:
        p = binomtest(sum(held), len(held), 0.95).pvalue
        yield f"all: {sum(held)} of {len(held)} = {sum(held) / len(held):.1%}, p = {p:.3g}"


def summary(path):
    """Print coverage, local minima, rejections and times, by loop or kind."""
    rows = rows_of(path)
    for kind in KINDS:
        some = [row for row in rows if row["kind"] == kind and "error" not in row]
        for row in rows:
            if row["kind"] == kind and "error" in row:
                print(f"{kind} {row['seed']}: {row['error']}")
        if not some:
            continue
        cpu, bias = [row["cpu"] for row in some], max(row["bias"] for row in some)
        rejected = [row["seed"] for row in some if is_rejected(row)]
        print(f"{kind}: {len(some)} rigs, {len(rejected)} = {len(rejected) / len(some):.1%} rejected")
        print(
            f"  CPU: median {np.median(cpu):.3g} s, most {max(cpu):.3g} s; bias of the elements {bias:.2g} deviations"
        )
        print(f"  not converged: {[row['seed'] for row in some if not row['converged']]}")
        if kind in WRONG:
            seen = [row for row in some if is_visible(row)]
            count = sum(map(is_rejected, seen))
            print(f"  visible in the record: {len(seen)}, {count} = {count / max(len(seen), 1):.1%} rejected")
            for row in some:
                if not is_rejected(row):
                    print(f"  {row['seed']} not rejected: {row['verdict']}, excess {row['excess']:.3g}")
            continue
        print(f"  rejected: {rejected}")
        print(f"  above the search from the truth: {[row['seed'] for row in some if is_above(row)]}")
        for words, is_known in (("known", True), ("estimated", False)):
            for line in coverage([row for row in some if row["sigma_known"] is is_known]):
                print(f"  sigma {words}, inside 95 %: {line}")


if __name__ == "__main__":
    *words, name = sys.argv[1:]
    if words == ["summary"]:
        summary(Path(name))
    else:
        size, first, *kinds = words
        record(int(size), int(first), kinds or KINDS, Path(name))
