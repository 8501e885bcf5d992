"""Arms found again from responses of finite elements with noise.

    python -m tests.fitting.planted SIZE SEED [arms pairs rigs misses]

Random arms, two or three responses of an independent model (`tests.chain_elements`, nothing of tfarm in it), noise of
known size, four to six free numbers, each started up to 30 % off.  A fit is right where its sum of squares is at most
that of the truth and every number within five deviations of it; nominal 95 % intervals are counted.  With "pairs" two
of the numbers are known by their product or ratio alone, and a fit is right where it finds these two and no other.
With "rigs" they have springs, friction, a radius and a motor at the hub, over whatever drives them, their
frequencies even or in proportion and often few for the sharpness of a resonance.  None may end above the truth's sum.
No good fit may be called a miss, even if the size of its noise were unknown.  With "misses" one response has a factor
of 3, a delay of 5 ms, or the other sign, or the rig a body that the arm has not: each has to be named.
"""

import math
from dataclasses import replace

import numpy as np

import tfarm
from tests import chain_elements, survey
from tests.rigs import some_rig
from tests.survey import Finding
from tfarm.arm.writing import KeyedArms
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import fit
from tfarm.fitting.misses import misses_of
from tfarm.spectrum.table import first_frequency

ALWAYS = ("link.youngs_modulus", "hub.inertia", "link.damping")
SOMETIMES = ("payload.mass", "payload.inertia", "clamp.stiffness", "gain", "delay")
PAIRS = (  # of the arm's numbers, of which these responses determine but one combination
    ("tip_acceleration", "hub_angle"),
    ("tip_acceleration", "hub_torque"),
    ("hub_rate", "hub_torque"),
    ("root_moment", "hub_torque"),
)
RIG_OUTPUTS = ("hub_angle", "hub_rate", "tip_acceleration", "root_moment")
RIG_RATIOS = (("tip_acceleration", "hub_angle"), ("root_moment", "hub_rate"))
RIG_NUMBERS = ("payload.mass", "payload.inertia", "payload.offset", "clamp.stiffness", "hub.friction", "hub.stiffness",
               "hub.radius", "hub.inertia")  # fmt: skip
MOTOR_NUMBERS = ("motor.torque_constant", "motor.rotor_inertia")
POINTS = 200
OFF = 0.3  # of a number: its start
MOSTLY = 0.99  # of the fits are right


def some_arm(rng):
    """A slender arm with a clamp that yields, a payload and a little damping."""
    length = rng.uniform(0.2, 1.5)
    depth = length / rng.uniform(40, 200)
    width = depth * rng.uniform(2, 15)
    E, density = (70e9, 2700.0) if rng.random() < 0.5 else (205e9, 7850.0)
    link = tfarm.Link.isotropic(
        length=length, density=density, youngs_modulus=E, poissons_ratio=0.3,
        section=tfarm.Section.general(area=width * depth, second_moment=width * depth**3 / 12, shear_factor=5 / 6),
    )  # fmt: skip
    own = density * width * depth * length
    arm = tfarm.Arm(
        link=link,
        hub=tfarm.Hub(inertia=own * length**2 * 10 ** rng.uniform(-1, 0.7)),
        payload=tfarm.Payload(mass=own * rng.uniform(0.1, 1), inertia=own * length**2 * rng.uniform(0.005, 0.05)),
        clamp=tfarm.RotarySpring(stiffness=link.EI / length * 10 ** rng.uniform(0.5, 1.5)),
        name="planted",
    )
    zeta = 10 ** rng.uniform(-2.7, -1.7)
    return arm.with_numbers(damping=2 * zeta / first_frequency(arm))


def elements_response(arm, omega, pairs):
    """Responses (pairs, n) of finite elements, of one signal over another or over the arm's input."""
    outputs = sorted({name for pair in pairs for name in pair if name != arm.input})
    held = arm.input == "hub_angle"
    model = chain_elements.assemble(arm, chain_elements.FINER * omega[-1], held=held)
    system = chain_elements.System(model, omega[len(omega) // 2])
    values = np.array([system.response(1j * w, outputs, None) for w in omega]).T
    by = dict(zip(outputs, values, strict=True)) | {arm.input: np.ones(omega.size)}
    return [by[over] / by[under] for over, under in pairs]


def chi_squared_at(found, values):
    """The sum of squared residuals at other numbers, by key."""
    problem = found.problem
    residuals = problem.residuals(np.array([each.coordinate(values[each.key]) for each in problem.parameters]))
    return float(residuals @ residuals)


def is_called_a_miss(found):
    """Whether a fit would be called a miss if the size of its noise were unknown."""
    responses = [replace(each, noise=replace(each.noise, is_known=False)) for each in found.problem.responses]
    return bool(misses_of(replace(found, problem=replace(found.problem, responses=tuple(responses)))))


def with_noise(rng, pair, omega, H, least=-2.5):
    """A measured response: H with noise of a known size."""
    sigma = abs(H) * 10 ** rng.uniform(least, -1.3) + 1e-3 * np.median(abs(H))
    noise = sigma * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
    return Measured(output=pair[0], input=pair[1], omega=omega, values=H + noise, sigma=sigma)


def geared(rng, arm):
    """The arm at a hub that may have a radius, a spring, friction and a motor, its links hardly damped."""
    w1, J = first_frequency(arm), arm.turned_inertia

    def some(chance, low, high):
        return 10 ** rng.uniform(low, high) if rng.random() < chance else 0.0

    hub = tfarm.Hub(
        inertia=arm.hub.inertia, radius=arm.length * rng.uniform(0, 0.3), stiffness=J * w1**2 * some(0.5, -4, 0),
        friction=J * w1 * some(0.5, -4, -1),
    )  # fmt: skip
    clamp = arm.clamp if rng.random() < 0.5 else tfarm.RotarySpring()
    arm = replace(arm, hub=hub, clamp=clamp).with_numbers(damping=arm.damping * some(1, -2, 0))
    if rng.random() < 0.6:
        return arm
    N, R = 10 ** rng.uniform(0, 2), 10 ** rng.uniform(-1, 1)
    motor = tfarm.Motor(
        resistance=R, torque_constant=math.sqrt(R * J * w1 / N**2 * some(1, -3, 0)), gear_ratio=N,
        rotor_inertia=J / N**2 * some(1, -3, 0), inductance=R / w1 * some(0.5, -3, -0.5),
    )  # fmt: skip
    return replace(arm, motor=motor, input=str(rng.choice(["motor_voltage", "motor_current", "hub_torque"])))


def values_of(arm, keys):
    """Numbers of an arm by their keys."""
    family = KeyedArms(arm, list(keys))
    return {key: family.value(key) for key in keys}


def elsewhere(rng, truth):
    """A start of each number, up to `OFF` away."""
    return {key: value * (1 + rng.uniform(-OFF, OFF)) for key, value in truth.items()}


def planted_rig(rng):
    """The same as `planted` of a rig, every second one of `tests.rigs`."""
    is_geared, arm = rng.random() < 0.5, None
    while arm is None or not math.isfinite(arm.hub.inertia + arm.payload.mass + arm.payload.inertia):
        arm = geared(rng, some_arm(rng)) if is_geared else some_rig(rng, damped=True, segments=int(rng.integers(1, 3)))
    w1, count = first_frequency(arm), int(rng.integers(60, 200))
    low, high = 0.3 * w1, w1 * 10 ** rng.uniform(0.6, 1.6)
    spaced = np.geomspace if rng.random() < 0.5 else np.linspace
    omega = spaced(low if rng.random() < 0.5 else min(low, high / count), high, count)
    pairs = [(each, arm.input) for each in RIG_OUTPUTS if each != arm.input]
    pairs += RIG_RATIOS if arm.input != "hub_angle" else ()
    pairs = [pairs[n] for n in rng.choice(len(pairs), size=rng.integers(1, 4), replace=False)]
    link = "link" if len(arm.links) == 1 else "link.1"
    numbers = (f"{link}.damping", *RIG_NUMBERS, *(MOTOR_NUMBERS if arm.input.startswith("motor") else ()))
    there = [key for key, value in values_of(arm, numbers).items() if math.isfinite(value) and value != 0]
    chosen = rng.choice(there, size=min(len(there), rng.integers(1, 5)), replace=False).tolist()
    truth = values_of(arm, (f"{link}.youngs_modulus", *chosen))
    responses = zip(pairs, elements_response(arm, omega, pairs), strict=True)
    data = [with_noise(rng, pair, omega, H) for pair, H in responses]
    return arm, data, list(truth), truth, elsewhere(rng, truth)


def planted(rng):
    """An arm, its measured responses, the free keys, their true values, and an arm that starts elsewhere."""
    arm = some_arm(rng)
    w1 = first_frequency(arm)
    omega = np.geomspace(0.3 * w1, rng.uniform(15, 60) * w1, POINTS)
    some = rng.choice(len(PAIRS), size=rng.integers(2, 4), replace=False)
    pairs = [PAIRS[n] for n in some]
    keys = [*ALWAYS, *rng.choice(SOMETIMES, size=rng.integers(1, 4), replace=False)]
    truth = values_of(arm, [key for key in keys if "." in key])
    gains = [float(rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1)) if "gain" in keys else 1.0 for _ in pairs]
    delays = [float(rng.uniform(0, 0.3) / omega[-1]) if "delay" in keys else 0.0 for _ in pairs]
    data = []
    for (output, under), H, gain, delay in zip(pairs, elements_response(arm, omega, pairs), gains, delays, strict=True):
        data.append(with_noise(rng, (output, under), omega, gain * H * np.exp(-1j * omega * delay)))
    start = elsewhere(rng, truth)
    for n in range(len(data)):
        truth |= {f"gain:{n + 1}": gains[n], f"delay:{n + 1}": delays[n]}
    return arm, data, keys, truth, start


def judged(seed, *, profile=True):
    """One fit: right or why not, the shares of its nominal 95 % intervals that hold the truth, and itself."""
    arm, data, keys, truth, start = planted(np.random.default_rng([852780, seed]))
    found, inside = fit(arm, data, free=keys, start=start, profile=profile), {}
    problems = ["not converged"] * (not found.converged) + ["called a miss"] * is_called_a_miss(found)
    problems += ["a worse minimum"] * (found.chi_squared > chi_squared_at(found, truth) * (1 + 1e-9))
    for each in found.parameters:
        if not each.identified:
            problems.append(f"{each.key} not identified")
        elif each.deviation and abs(each.value - truth[each.key]) > 5 * each.deviation:
            problems.append(f"{each.key} too far")
        if profile and each.identified:
            kind = f"{each.key.partition(':')[0]} inside 95 %"
            inside.setdefault(kind, []).append(each.low <= truth[each.key] <= each.high)
    return next(iter(problems), "right"), {kind: float(np.mean(of)) for kind, of in inside.items()}, found


def planted_pair(rng):
    """A very slender arm, of whose E and I, or (no payload, over the hub's angle) E and density, one is known."""
    arm = some_arm(rng)
    depth = arm.length / rng.uniform(300, 1000)
    section = tfarm.Section.general(area=depth * 5 * depth, second_moment=5 * depth**4 / 12, shear_factor=5 / 6)
    link = replace(arm.link, section=section)
    by_ratio = rng.random() < 0.5
    inertia = link.rhoA * arm.length**3 * rng.uniform(0.1, 2)
    payload = tfarm.Payload() if by_ratio else tfarm.Payload(mass=link.rhoA * arm.length * rng.uniform(0.1, 1))
    arm = tfarm.Arm(link=link, hub=tfarm.Hub(inertia=inertia), payload=payload, name="pair")
    w1 = first_frequency(arm)
    arm = arm.with_numbers(damping=2 * 10 ** rng.uniform(-2.5, -1.7) / w1)
    omega = np.geomspace(0.2 * w1, 12 * w1, POINTS)
    pair = ("tip_acceleration", "hub_angle") if by_ratio else PAIRS[int(rng.integers(1, len(PAIRS)))]
    (H,) = elements_response(arm, omega, [pair])
    data = with_noise(rng, pair, omega, H, least=-2.0)
    both = ["link.youngs_modulus", "link.density" if by_ratio else "link.section.second_moment"]
    keys = [*both, "link.damping", *([] if by_ratio else ["hub.inertia"])]
    return arm, data, keys, elsewhere(rng, values_of(arm, keys)), both


def judged_pair(seed):
    """Whether the two, and no other, are found to be known in one combination only."""
    arm, data, keys, start, both = planted_pair(np.random.default_rng([852780, seed]))
    found = fit(arm, [data], free=keys, start=start, profile=False)
    unknown = [each.key for each in found.parameters if not each.identified]
    named = [words for words in found.not_determined if all(key in words for key in both) and "only" in words]
    is_right = found.converged and unknown == both and len(named) == 1 and not is_called_a_miss(found)
    return "right" if is_right else f"wrong: {unknown}, {found.not_determined}", {}, found


def judged_rig(seed):
    """Whether the sum of squares of one fit is at most the truth's."""
    arm, data, keys, truth, start = planted_rig(np.random.default_rng([852780, seed]))
    found = fit(arm, data, free=keys, start=start, profile=False)
    at_truth = chi_squared_at(found, truth)
    if is_called_a_miss(found):
        return "called a miss", {}, found
    words = f"above the truth: {found.chi_squared:.5g} > {at_truth:.5g}, {found.starts} starts: {keys}"
    return words if found.chi_squared > at_truth * (1 + 1e-9) else "right", {}, found


MISSES = ("gain", "delay", "sign", "arm")  # of one response, by a factor of 3 and by 5 ms; of the arm by a body
SHORTEST_TOP = 600.0  # rad/s: a lower range does not show 5 ms


def planted_miss(seed):
    """The kind, the arm of the fit, its measured responses, the free keys, their start, and the response changed."""
    rng, kind = np.random.default_rng([852780, seed]), MISSES[seed % len(MISSES)]
    arm = true = some_arm(rng)
    if kind == "arm":
        body = tfarm.Attachment(x=arm.length * rng.uniform(0.4, 0.6), mass=3 * arm.own_mass)
        true = replace(arm, attachments=(body,))
    w1 = first_frequency(arm)
    omega = np.geomspace(0.3 * w1, max(rng.uniform(15, 60) * w1, SHORTEST_TOP), POINTS)
    pairs = [PAIRS[n] for n in rng.choice(len(PAIRS), size=rng.integers(1, 3), replace=False)]
    factors = {"gain": 3.0, "sign": -1.0, "delay": np.exp(-5e-3j * omega)}
    responses, wrong = elements_response(true, omega, pairs), int(rng.integers(len(pairs)))
    responses[wrong] = responses[wrong] * factors.get(kind, 1.0)
    data = [with_noise(rng, pair, omega, H) for pair, H in zip(pairs, responses, strict=True)]
    data = data if seed // len(MISSES) % 2 else [replace(each, sigma=None) for each in data]
    return kind, arm, data, list(ALWAYS), elsewhere(rng, values_of(arm, ALWAYS)), wrong


def judged_miss(seed):
    """Whether a miss is called so, and the remedy is what was planted."""
    kind, arm, data, keys, start, wrong = planted_miss(seed)
    found = fit(arm, data, free=keys, start=start, profile=False)
    if found.verdict != "misses the data":
        return f"{kind} not called a miss: {found.verdict}, rms {found.rms_log_error:.3g}", {}, found
    of_sensors = {"gain": "a free gain (--free gain): ", "delay": "a free delay (--free delay): "}
    if kind in of_sensors:
        words, _, values = found.advice.partition(of_sensors[kind])
        numbers = [float(each.removesuffix(" s")) for each in values.split(" and ")] if values else [0.0]
        expected = {"gain": [1.0, 3.0], "delay": [0.0, 5e-3]}[kind]
        wanted = [expected[n == wrong] for n in range(len(data))]
        is_right = words == "" and np.allclose(numbers, wanted, rtol=0.1, atol=5e-4)
    elif kind == "sign":
        is_right = found.advice == f"the other sign of {data[wrong].name}"
    else:
        is_right = found.advice.startswith("no gain, delay, sign or bound is enough")
        is_right |= found.advice.endswith("the arm does not explain the data even then")
    return "right" if is_right else f"{kind} wrong: {found.advice}", {}, found


def share_right(name, judge, least):
    """A survey that is wrong where fewer than the `least` share of the fits are right."""

    def findings(size, seed):
        right = 0
        for n in range(seed * 10000, seed * 10000 + size):
            verdict, figures, _ = judge(n)
            right += verdict == "right"
            yield Finding(verdict.partition(":")[0], "" if verdict == "right" else f"{n} {verdict}", figures=figures)
        if right < least * size:
            yield Finding("too few right", f"{right} of {size}", is_wrong=True)

    findings.__name__ = name
    return findings


if __name__ == "__main__":
    mostly = share_right("arms", judged, MOSTLY), share_right("pairs", judged_pair, MOSTLY)
    survey.main(*mostly, share_right("rigs", judged_rig, 1.0), share_right("misses", judged_miss, 1.0))
