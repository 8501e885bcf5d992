"""What are the numbers of the arm on the bench?  A measured response, the exact one over it, and a fit.

In the place of a rig: an arm with a softer link and a heavier hub than the data sheets say, seen through noise, written
to a file as an analyser writes it.
"""

from dataclasses import replace

import numpy as np

import tfarm
from tfarm.fitting.data import read_measured

sheet = tfarm.load("sasaki2012-lab")
softer = replace(sheet.link, youngs_modulus=0.93 * sheet.link.youngs_modulus)
bench = replace(sheet, link=softer, hub=replace(sheet.hub, inertia=1.1 * sheet.hub.inertia))

hertz = np.linspace(2.0, 60.0, 120)
value = tfarm.transfer(bench, "root_moment")(2j * np.pi * hertz)
noise = np.random.default_rng(1).normal(size=(2, hertz.size))
sigma = 0.02 * abs(value)
value = value + sigma * (noise[0] + 1j * noise[1])
columns = np.column_stack([hertz, value.real, value.imag, sigma])
np.savetxt("sweep.csv", columns, delimiter=",", header="hz,re,im,sigma", comments="")

measured = read_measured("sweep.csv", "root_moment", "hub_torque")
found = tfarm.fit(sheet, [measured], free=["link.youngs_modulus", "hub.inertia"], profile=False)
print(found.verdict)
for each in found.parameters:
    print(f"{each.key}: {each.value:.5g}, 95 % interval {each.low:.5g} to {each.high:.5g}")
