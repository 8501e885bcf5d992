"""Unstable poles under random laws, counted by a second method:  python -m tests.loop.law_counts SIZE SEED

Random arms (as in `tests.loop.arms`), one to three signals, rational entries of order 8 at most in all, some with
unstable poles and zeros, delays of 0 to 50 ms at C > 0.  Without damping the count is that of modal models of 30 and 40
modes closed with the law, wherever these agree; with damping, by Nyquist, that of the turns of the loop function of the
public transfer functions.
"""

import numpy as np

import tfarm
from tests import survey
from tests.loop.arms import some_loop, verdict_of
from tests.survey import Finding, each_of
from tfarm.arm import Law
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.reduced.modal import sensed_model
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

SIGNALS = ("hub_angle", "hub_rate", "root_moment", "tip_displacement", "tip_acceleration", "moment@", "deflection@")
MODELS = (30, 40)  # modes
SLOWEST = 1e-6  # of w1: the radius of the arc around the poles at 0
AT_REST, DOUBTFUL = 1e-9, 1e-7  # of w1: poles at 0 come out as small as the first; larger up to the second
CLEAR = 1e-8  # of its size: a pole of a model nearer to the axis decides nothing


def some_law(rng, arm, *, delay):
    """One to three random entries, scaled so that the loop function is of the order of 1 somewhere near a mode."""
    names = [str(each) for each in rng.choice(SIGNALS, size=rng.integers(1, 4), replace=False)]
    names = [
        f"{each}{round(float(rng.uniform(0.1, 0.9)) * arm.length, 6)}" if each.endswith("@") else each for each in names
    ]
    w1 = first_frequency(arm)
    entries, left = {}, 8
    for name in names:
        order = int(rng.integers(0, min(left, 5) + 1))
        left -= order
        poles, zeros = _roots(rng, order, w1), _roots(rng, int(rng.integers(0, order + 1)), w1)
        at = 1j * w1 * 10.0 ** rng.uniform(-1, 1.3)
        G = Signals(arm, (name,)).values(np.array([at]))[0, 0]
        shape = np.prod(at - np.array(zeros)) / np.prod(at - np.array(poles))
        if not 0 < abs(G) < np.inf:  # where the tip is held nothing is to be read of it
            continue
        size = 10.0 ** rng.uniform(-2, 0.5) / abs(G * shape)
        entries[name] = {"zeros": zeros, "poles": poles, "gain": float(size * rng.choice([-1, 1]))}
    return Law(entries or {"hub_rate": 1e-3}, delay=delay)


def some_delay(rng, arm):
    """None, or from a hundredth of 1/w1 to three of it, at most 50 ms."""
    return float(min(0.05, 10.0 ** rng.uniform(-2, 0.5) / first_frequency(arm))) if rng.random() < 0.5 else 0.0


def _roots(rng, count, w1):
    """Roots in conjugate pairs or alone, a tenth of them right of the axis."""
    found = []
    while len(found) < count:
        size, side = w1 * 10.0 ** rng.uniform(-1, 1.5), 1 if rng.random() < 0.1 else -1
        if count - len(found) > 1 and rng.random() < 0.5:
            ratio = rng.uniform(0.02, 0.95)
            root = complex(side * ratio * size, size * np.sqrt(1 - ratio**2))
            found += [root, root.conjugate()]
        else:
            found.append(complex(side * size))
    return found


def by_eigenvalues(arm, law, count, band):
    """Unstable poles of a modal model under the law below the band, or None where one is too near to it or the axis."""
    A, B, C, D = sensed_model(arm, law.signals, count)
    Ak, Bk, Ck, Dk = law.matrices()
    whole = 1 + (Dk @ D)[0, 0]
    closed = np.block([
        [A - B @ Dk @ C / whole, -B @ Ck / whole],
        [Bk @ (C - D @ Dk @ C / whole), Ak - Bk @ D @ Ck / whole],
    ])  # fmt: skip
    poles = np.linalg.eigvals(closed)
    if (abs(poles[poles.real > 0]) > 2 * band).any():  # of no arm: what the remainder makes up
        return None
    moving = abs(poles) > AT_REST * first_frequency(arm)
    poles = poles[moving & (poles.real > -CLEAR * abs(poles)) & (abs(poles.imag) < 1.01 * band)]
    doubtful = (poles.real < CLEAR * abs(poles)) | (abs(poles) < DOUBTFUL * first_frequency(arm))
    if (doubtful | (abs(poles.imag) > 0.99 * band)).any():
        return None
    return poles.size


def by_turns(arm, law, band):
    """The same of a damped or delayed loop: turns of the exact 1 + L around 0, along the axis and back far right of it.

    L is that of the public transfer functions; None where its phase does not settle.
    """
    slow, value = SLOWEST * first_frequency(arm), exact(arm, law)
    own = tfarm.damped_modes(tfarm.modes(arm, up_to=band)).eigenvalues.ravel()  # shear rings on where bending does not
    poles = np.r_[own, law.poles]
    right = 3 * max(band, *law.poles.real) if law.order else 3 * band
    width = np.maximum(abs(poles.real), 1e-9 * abs(poles))
    near = abs(poles.imag)[:, None] + width[:, None] * np.linspace(-20, 20, 160)
    turning = np.linspace(slow, band, 2 + int(4 * band * law.delay))  # a quarter of a radian of the delay a step
    up = np.unique(np.r_[np.geomspace(slow, band, 2000), turning, near[(near > slow) & (near < band)]])
    arc = slow * np.exp(1j * np.linspace(0, np.pi / 2, 40))
    path = np.r_[arc, 1j * up, 1j * band + np.linspace(0, right, 400), right + 1j * np.linspace(band, 0, 400)]
    f = value(path)
    for _ in range(30):
        (fast,) = np.nonzero(~(abs(np.angle(f[1:] / f[:-1])) < 0.5))
        if not fast.size:
            turns = -np.angle(f[1:] / f[:-1]).sum() / np.pi
            return round(turns) + int((law.poles.real > 0).sum()) if abs(turns - round(turns)) < 1e-6 else None
        middle = (path[fast] + path[fast + 1]) / 2
        path = np.insert(path, fast + 1, middle)
        f = np.insert(f, fast + 1, value(middle))
    return None


def exact(arm, law):
    """1 + L from the transfer functions of a rig."""
    read = [name.partition("@") for name in law.signals]
    G = [tfarm.transfer(arm, name, x=float(x) if x else None) for name, _, x in read]

    def value(s):
        return 1 + np.exp(-s * law.delay) * (law.values(s) * np.array([each(s) for each in G])).sum(axis=0)

    return value


def judge(arm, law):
    """ "right", "refused: ...", "wrong: ..." or "no second count"."""
    try:
        found = verdict_of(arm, law)
    except (ConvergenceError, ParameterError) as error:
        return f"refused: {str(error).splitlines()[0]}"
    if found.unstable_roots_infinite:
        return "no second count"
    try:
        if arm.damping:
            other = [by_turns(arm, law, found.band)]
        else:
            other = [by_eigenvalues(arm, law, count, found.band) for count in MODELS]
    except (ConvergenceError, ParameterError):  # a point on a pole
        return "no second count"
    if None in other or other[0] != other[-1]:
        return "no second count"
    if (abs(found.poles.values[found.poles.values.real > 0]) > found.band).any():  # further right than the models reach
        return "no second count"
    return "right" if other[0] == found.unstable_roots else f"wrong: {found.unstable_roots}, by models {other}"


def loops(rng):
    """The finding on one loop."""
    arm = some_loop(rng)[0]
    law = some_law(rng, arm, delay=some_delay(rng, arm) if arm.damping else 0.0)
    outcome, _, words = judge(arm, law).partition(":")
    known = f"{words} {arm.damping} {law.signals} {law.delay}" if outcome in ("wrong", "refused") else ""
    return Finding(outcome, known, outcome == "wrong")


if __name__ == "__main__":
    survey.main(each_of(loops))
