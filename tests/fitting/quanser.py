"""Survey of the measured runs of a real rig: half of them fitted, the others predicted, with their null models.

    python -m tests.fitting.quanser FOLDER [values]

FOLDER has the .mat files of `rig/` of the repository basta/quanser-2-dof-serial-flexible-link.  With "values" the
numbers of `VALUES` are taken for those of the fit, which takes minutes.  The rig has dry
friction, which the model lacks: the deviations of the records are its misses, 1 deg and 0.5 deg, and no noise.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.io import loadmat

import tfarm
from tfarm.arm.chain import load_chain
from tfarm.arm.law_tables import load_law
from tfarm.arm.writing import KeyedArms
from tfarm.fitting.runs import RigRun, from_rest

RIG = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
FITTED = ("10deg", "30deg", "neg_20deg", "neg_5deg")
PREDICTED = ("20deg", "neg_30deg", "neg_10deg", "5deg")
# N m/rad: root moment over the deflection angle of the gauge (lqg.toml)
STIFFNESS = 39.957
MISS = {"hub_angle": np.radians(1.0), "root_moment": np.radians(0.5) * STIFFNESS}
# of the least squares next to the maker's numbers, without a bias, each hub at the start where it was measured
VALUES = {
    "hub.friction": 2.79466,
    "motor.torque_constant": 0.0949514,
    "payload.inertia": 0.0933962,
    "link.damping": 0.10375,
    "drive.delay": 0.0101357,
    "gain:root_moment": 1.13645,
}


def measured_runs(folder, angles):
    """The records of both controllers at their samples: hub angle, deflection as the root moment that it stands for."""
    for controller in ("lqg", "hinf"):
        law = load_law(RIG / f"{controller}.toml")
        for angle in angles:
            name = f"{controller}_step_{angle}_run01.mat"
            record = loadmat(Path(folder) / name)
            hub, deflection = record["X1_meas"].astype(float)[::5].T[:2]
            yield RigRun(
                period=0.01,
                outputs={"hub_angle": hub, "root_moment": STIFFNESS * deflection},
                references={"hub_angle": record["X1_ref"].astype(float)[::5, 0]},
                law=law,
                source=name,
            )


def in_degrees(found):
    """Rms of hub angle and deflection angle [deg] of a prediction and of each null model, by its name."""
    scales = {"hub_angle": np.degrees(1.0), "root_moment": np.degrees(1.0) / STIFFNESS}
    return {
        origin: [
            np.nan if (rms := found.rms_of(origin, name)) is None else scale * rms for name, scale in scales.items()
        ]
        for origin in ("predicted", *found.null_models)
    }


def fitted(folder):
    """The fit of one half of the moving runs."""
    rig = tfarm.load(str(RIG / "rig.toml"))
    # s: without it the LQG is unstable in mode 3
    start = replace(rig, link=replace(rig.link, damping=1e-3))
    runs = [replace(from_rest(each)[0], sigma=MISS) for each in measured_runs(folder, FITTED)]
    chain = load_chain(RIG / "rig.toml")
    # a dead time of 0 is on its bound, where no search begins
    return tfarm.fit(start, [], [*VALUES], runs=runs, chain=chain, start={"drive.delay": 0.01}, profile=False)


def predictions(runs, values):
    """The prediction of each run with these numbers, beside the maker's."""
    rig = tfarm.load(str(RIG / "rig.toml"))
    chain = load_chain(RIG / "rig.toml")
    of_arm = {key: value for key, value in values.items() if key not in ("drive.delay", "gain:root_moment")}
    arm = KeyedArms(rig, [*of_arm]).at(of_arm)
    sampling = replace(chain.sampling, delay_samples=values["drive.delay"] / chain.sampling.period)
    new = {"motor.torque_constant": rig.motor.torque_constant, "drive.delay": 0.0, "gain:root_moment": 1.0}
    gains = {"root_moment": values["gain:root_moment"]}
    how = {"before": rig, "before_chain": chain, "without": new, "gains": gains}
    return [tfarm.predict(arm, each, replace(chain, sampling=sampling), **how) for each in runs]


def main(folder, *how):
    values = VALUES
    if not how:
        values = {each.key: each.value for each in fitted(folder).parameters}
    for key, value in values.items():
        print(f"{key} = {value:.6g}", flush=True)
    found = predictions(measured_runs(folder, PREDICTED), values)
    rows = [in_degrees(each) for each in found]
    for origin in rows[0]:
        hub, deflection = np.nanmedian([row[origin] for row in rows], axis=0)
        print(f"{origin}: median over {len(rows)} runs: hub {hub:.3f} deg, deflection {deflection:.3f} deg")
    for each, row in zip(found, rows, strict=True):
        print(f"{each.source}: {row['predicted'][0]:.2f}, {row['predicted'][1]:.2f} deg; {each.finding}; {each.cause}")


if __name__ == "__main__":
    main(*sys.argv[1:])
