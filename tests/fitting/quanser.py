"""Survey of the measured runs of a real rig: half of them fitted, the other half predicted, with their null models.

    python -m tests.fitting.quanser FOLDER

FOLDER has the .mat files of `rig/` of basta/quanser-2-dof-serial-flexible-link.
"""

from pathlib import Path

from scipy.io import loadmat

from tfarm.arm.law_tables import load_law
from tfarm.fitting.runs import Run

RIG = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
FITTED = ("10deg", "30deg", "neg_20deg", "neg_5deg")
PREDICTED = ("20deg", "neg_30deg", "neg_10deg", "5deg")
# N m/rad: root moment over the deflection angle of the gauge (lqg.toml)
STIFFNESS = 39.957


def measured_runs(folder, angles):
    """The records of both controllers: hub angle, deflection as the root moment that it stands for, reference."""
    for controller in ("lqg", "hinf"):
        law = load_law(RIG / f"{controller}.toml")
        for angle in angles:
            name = f"{controller}_step_{angle}_run01.mat"
            record = loadmat(Path(folder) / name)
            # a sample of the controller, each
            hub, deflection = record["X1_meas"].astype(float)[::5].T[:2]
            yield Run(
                period=0.01,
                outputs={"hub_angle": hub, "root_moment": STIFFNESS * deflection},
                references={"hub_angle": record["X1_ref"].astype(float)[::5, 0]},
                law=law,
                source=name,
            )
