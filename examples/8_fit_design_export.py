"""Fit, design, export: from a measured response to the file of a law that holds on the arm that was measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tfarm.arm.law_tables import load_law
from tfarm.arm.writing import save_law
from tfarm.fitting.fit import save_fit

sheet = tfarm.load("sasaki2012-lab")
softer = replace(sheet.link, youngs_modulus=0.93 * sheet.link.youngs_modulus)
bench = replace(sheet, link=softer)  # the rig, of which only `measured` is known
omega = np.linspace(15.0, 300.0, 80)
values = tfarm.transfer(bench, "root_moment")(1j * omega)
measured = tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=values)

found = tfarm.fit(sheet, [measured], free=["link.youngs_modulus"], profile=False)
save_fit(found, Path("fitted.toml"))
arm = tfarm.load("./fitted.toml")  # an arm as any other, for every command
print(f"E = {arm.link.youngs_modulus:.8g} Pa, fitted to {omega.size} lines")

chosen = tfarm.design(arm)  # K1 and K2 for the 10 ms loop
save_law(tfarm.Law.of_gains(chosen.law), Path("law.toml"))  # for `--law law.toml`
law = load_law("./law.toml")
assert law is not None  # None of a file without [law]
print(f"damping {100 * chosen.value:.4g} %;", tfarm.sampled(arm, law).verdict.sentence)
print("on the rig itself:", tfarm.sampled(bench, law).verdict.word)

made = tfarm.export(
    arm, law, what="loop", form="mat", folder="matlab"
)  # load_loop.m is for MATLAB and Octave
print(f"written: {', '.join(made.files)}; the loop is {made.verdict}")
