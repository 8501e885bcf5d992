"""What the live page carries of the sampled loop: the modal plants of verdict and slew, whose loops it closes itself.

Gains enter both linearly, so that with poles, residues and static parts of the plant every sampled pole and every
simulated signal at any gains is arithmetic in the page, as exact as `tfarm sampled` and `tfarm simulate`.
"""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import FED_BACK, Arm, HubFeedback
from tfarm.dsp import Chain, PulseTransfer, Sampled, Scenario, Simulator, scenario
from tfarm.dsp.plant import Plant, sensed_plant
from tfarm.dsp.results import enough_modes, ideal_chain
from tfarm.dsp.simulate import FOLDED_UP, quantisers
from tfarm.dsp.traces import RECORD_LENGTH
from tfarm.errors import TfarmError
from tfarm.response import transfer

STATIONS = 24  # places along the arm at which its shape is drawn, besides the clamp
OFF_A_POLE = 1e-9  # of a pole: where the ratio of two outputs is taken that both have it; the ratio is off by as much
MOST_LIVE_SAMPLES = 5000  # of a slew: 160 kB of references; a longer one is left to `tfarm simulate`


def packed(values: Any) -> str:
    """The bytes of doubles; of complex numbers real and imaginary parts in turn."""
    array = np.ascontiguousarray(values)
    doubles = array.view(float) if np.iscomplexobj(array) else array.astype(float)
    return base64.b64encode(doubles.astype("<f8").tobytes()).decode("ascii")


def sampled_numbers(loop: Sampled) -> dict[str, Any]:
    """The sampled loop with the modes that it has; `states`: poles at z = 1 that the hub's own motion has.

    These are 2, 1 where it is damped or driven through a motor, or 0.
    """
    plant = sensed_plant(loop.plant.arm, loop.chain, FED_BACK, loop.plant.count).together
    twice, once = plant.rigid[0]
    states = {"states": 2 if twice else 1 if once else 0, "modes": plant.count}
    return _clock(loop.chain) | _plant(PulseTransfer(plant, loop.chain.sampling).folded().plant) | states


def slew_numbers(arm: Arm, chain: Chain, law: HubFeedback) -> dict[str, Any] | None:
    """The slew of the chain for three times as long as it takes, with the modes that it takes under `law`, and the
    arm's shapes; None where there is no such slew."""
    try:
        task = scenario("slew", arm, chain, RECORD_LENGTH * chain.slew.rise_time)
        if task.t.size > MOST_LIVE_SAMPLES:
            return None
        linear = ideal_chain(chain)
        count = enough_modes(lambda number: Simulator(arm, linear, task, count=number).linear(law)).modes
        plant = Simulator(arm, chain, task, count=count).plant
        return _clock(chain) | _upper(plant) | _task(task, chain, arm) | {"modes": count} | _shapes(arm, plant)
    except TfarmError:
        return None


def _clock(chain: Chain) -> dict[str, Any]:
    """The period [s], the delay in samples, and how the hub rate is had: `smoothing` is the rate filter's pole."""
    converters, T = chain.converters, chain.sampling.period
    differences = converters.hub_rate == "difference"
    return {
        "period": T,
        "delay": chain.sampling.whole_delay,
        "fraction": chain.sampling.fraction,
        "smoothing": math.exp(-converters.rate_filter * T) if differences else None,
    }


def _plant(plant: Plant) -> dict[str, Any]:
    """Poles (m,) [1/s] but s = 0, the outputs' residues (outputs, m), and what they have of 1/s^2, 1/s and 1."""
    return {
        "eigenvalues": packed(plant.poles.astype(complex)),
        "residues": packed(plant.residues.astype(complex)),
        "rigid": plant.rigid.tolist(),
        "static": plant.static.tolist(),
    }


def _upper(plant: Plant) -> dict[str, Any]:
    """The same with the poles whose imaginary part is not negative alone, those with a conjugate counted twice."""
    upper, weight = _kept(plant)
    mode = plant.mode[upper].tolist()
    return _plant(plant) | {
        "eigenvalues": packed(plant.poles[upper].astype(complex)),
        "residues": packed((plant.residues[:, upper] * weight).astype(complex)),
        "mode": mode,
    }


def _kept(plant: Plant) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    upper = np.nonzero(plant.poles.imag >= 0)[0]
    return upper, np.where(plant.poles[upper].imag > 0, 2.0, 1.0)


def _task(task: Scenario, chain: Chain, arm: Arm) -> dict[str, Any]:
    """References a sample, converters, and what a person is told of the slew."""
    rows = quantisers(chain).tolist()
    ideal = np.c_[task.feedforward, task.hub_angle, task.hub_rate, task.moment_reference, task.rigid_moment]
    return {
        "ideal": packed(ideal),
        "converters": [[x if math.isfinite(x) else None for x in row] for row in rows],
        "single": chain.converters.arithmetic == "float32",
        "bound": FOLDED_UP * arm.bending_scale,
        "rise": task.busy_until,
        "drive": arm.input.split("_")[1],
        "unit": arm.input_unit,
        "reach": arm.reach,
        "length": arm.length,
        "travel": chain.slew.travel_of(arm.reach),
    }


def _shapes(arm: Arm, plant: Plant) -> dict[str, Any]:
    """Displacement along the arm over that of the tip, (stations, m) at each kept pole, which the clamp's comes first.

    The ratio of residues is that of the numerators, whatever drives the hub.
    """
    upper, _ = _kept(plant)
    s = plant.poles[upper].astype(complex) * (1 + OFF_A_POLE)
    x = np.linspace(0.0, arm.length, STATIONS + 1)
    ratios = []
    for place in x:
        here, tip = transfer(arm, ["displacement", "tip_displacement"], x=float(place))(s)
        ratios.append(here / tip)
    return {"x": x.tolist(), "offset": arm.reach - arm.length, "shapes": packed(np.array(ratios))}
