"""Three steel rulers on one small servo, from finite elements: one fit of an open loop each, then six closed loops.

    python -m tests.fitting.three_rulers [SEED]    # the fitted numbers, then the errors of each prediction in degrees

Gain, bias and dead time of the drive are free, and the hub is one for all three.  No closed loop is in the fit: each is
predicted from its reference through its law, and compared with the predictions of models that a user could have had
without a fit.
"""

import math
import sys
from dataclasses import replace

import numpy as np

import tfarm
from tests.chain_elements import reached
from tests.fitting.elements_in_time import Computer, Drive, Plant, simulate
from tfarm.arm.chain import Chain, Sampling
from tfarm.arm.law import Law
from tfarm.arm.writing import KeyedArms
from tfarm.fitting.run_model import fit_run
from tfarm.fitting.runs import DRIVE_GAIN, RigRun, commanded
from tfarm.fitting.together import fit_together

LENGTHS = (0.30, 0.24, 0.18)
PERIOD = 5e-3
STEP = math.radians(11.8)
SIGNALS = ("hub_angle", "root_moment")
NOISE = {"hub_angle": 3e-4, "root_moment": 4e-4}
TICK = {"hub_angle": 2 * math.pi / 4096}
# gain and dead time of the drive as they are; the bias is of a record
GAIN = 0.7
DELAY = 1.3 * PERIOD
CHAIN = Chain(sampling=Sampling(period=PERIOD))
OWN = ("link.youngs_modulus", "link.damping")
SHARED = ("hub.inertia", "hub.friction", DRIVE_GAIN, "drive.delay")


def ruler(length):
    """A steel ruler of 25 mm by 1 mm on the servo."""
    link = tfarm.Link.isotropic(
        length=length,
        density=7850.0,
        youngs_modulus=205e9,
        poissons_ratio=0.3,
        section=tfarm.Section.rectangle(width=0.025, depth=1e-3),
    )
    link = replace(link, damping=2e-4)
    return tfarm.Arm(
        link=link,
        hub=tfarm.Hub(inertia=1.5e-3, friction=0.02),
        payload=tfarm.Payload(),
        name=f"ruler-{round(1000 * length)}",
    )


def laws():
    """Two controllers, as difference equations and as laws of tfarm: a stiff one, and a soft one with more damping."""
    for Kp, Kd in ((1.0, 0.05), (0.4, 0.04)):
        pole = math.exp(-0.3)
        D = Kd / PERIOD * (1 - pole)
        entries = {"hub_angle": ([Kp + D, -Kp * pole - D], [1.0, -pole])}
        yield entries, Law(entries, period=PERIOD, references=("hub_angle",))


def measured(arm, rng, count, **task):
    """A record of the rig of finite elements, with offsets and a bias of its own."""
    plant = Plant(arm, SIGNALS, reached(arm, 3))
    offset = {"hub_angle": 0.0, "root_moment": 2e-3 * float(rng.normal())}
    computer = Computer(PERIOD, count, noise=NOISE, step=TICK, offset=offset, **task)
    read, u, _ = simulate(plant, Drive(GAIN, DELAY, bias=4e-3), computer, rng=rng)
    return dict(zip(SIGNALS, read[..., 0], strict=True)), u[:, 0]


def open_loop(arm, rng, count):
    """A binary sequence that leaves the hub about where it was."""
    part = rng.choice([-0.1, 0.1], count // 40 + 1).repeat(10)[: count // 4]
    u = np.r_[part, -part, -part, part]
    outputs, _ = measured(arm, rng, u.size, input=u)
    return RigRun(period=PERIOD, outputs=outputs, input=u)


def closed_loop(arm, rng, count, entries, law):
    """A step of the reference there and back."""
    reference = np.r_[np.zeros(20), np.full(count // 2, STEP), np.zeros(count)][:count]
    outputs, _ = measured(arm, rng, count, law=entries, references={"hub_angle": reference})
    return RigRun(period=PERIOD, outputs=outputs, references={"hub_angle": reference}, law=law)


def started(arm):
    """The arm before the fit: 15 % off in Young's modulus, a servo 40 % lighter, no friction known."""
    link = replace(arm.link, youngs_modulus=0.85 * 205e9, damping=4e-4)
    return replace(arm, link=link, hub=replace(arm.hub, inertia=0.9e-3, friction=0.01))


def fit_of(arms, runs, free=(*OWN, *SHARED), **how):
    """One fit of all rulers, each started elsewhere."""
    shared = [key for key in free if key in SHARED]
    begin = [started(arm) for arm in arms]
    return fit_together(begin, free, runs=[[run] for run in runs], shared=shared, chain=CHAIN, **how)


def error(arm, run, delay, bias):
    """The root mean square of the hub's angle, predicted less measured [deg], at a constant bias."""
    if arm.motor is not None:
        _, (run,) = commanded(arm, [run])
    chain = Chain(sampling=Sampling(period=PERIOD, delay_samples=delay / PERIOD))
    there = replace(fit_run(arm, run, chain), sigma=(1.0,) * len(SIGNALS))
    left = there.residuals_with(arm, None, np.r_[bias, np.zeros(len(SIGNALS))])
    return rms_degrees(left[: run.count])


def rms_degrees(angle):
    return math.degrees(float(np.sqrt(np.mean(angle**2))))


def with_modulus(arm, factor):
    """The arm with a factor on Young's modulus."""
    key = "link.youngs_modulus"
    family = KeyedArms(arm, [key])
    return family.at({key: factor * family.value(key)})


def drive_of(found, n):
    """Dead time of the drive, and the bias of the open loop of a ruler."""
    problem = found.problem
    own, _ = problem.runs[n].own_numbers(problem.arm(found.point, n), lambda place: problem.value(found.point, place))
    delays = [each.value for each in found.parameters if each.key == "drive.delay"]
    return sum(delays), float(own[0])


def predictions(rng, arms, found, plain=None, count=400):
    """A row a closed loop: the ruler, the law's number, and errors [deg] by model, the fit's first.

    `plain` is a fit without gain and dead time of the drive.
    """
    for n, arm in enumerate(arms):
        of_fit = drive_of(found, n)
        best = found.arms[n]
        for number, (entries, law) in enumerate(laws(), 1):
            run = closed_loop(arm, rng, count, entries, law)
            errors = {
                "fit": error(best, run, *of_fit),
                "rigid arm": error(with_modulus(best, 100.0), run, *of_fit),
                "E I 20 % off": error(with_modulus(best, 1.2), run, *of_fit),
                "before the fit": error(started(arm), run, 0.0, 0.0),
                "reference": rms_degrees(run.references["hub_angle"] - run.outputs["hub_angle"]),
            }
            if plain is not None:
                errors["fit without drive"] = error(plain.arms[n], run, 0.0, drive_of(plain, n)[1])
            yield arm.name, number, errors


def main():
    rng = np.random.default_rng(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
    arms = [ruler(length) for length in LENGTHS]
    runs = [open_loop(arm, rng, 1600) for arm in arms]
    found = fit_of(arms, runs)
    print(found.in_words)
    for each in found.parameters:
        print(f"{each.key:32} {each.value:12.6g}  {each.low:12.6g} to {each.high:12.6g} {each.unit}")
    plain = fit_of(arms, runs, (*OWN, *SHARED[:2]), profile=False)
    for name, number, errors in predictions(rng, arms, found, plain):
        print(name, "law", number, ", ".join(f"{what} {value:.3f}" for what, value in errors.items()))


if __name__ == "__main__":
    main()
