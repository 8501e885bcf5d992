"""How high may the gains go?  Verdict, windows and margins of the paper's law, and two pictures."""

import numpy as np
from matplotlib import pyplot

import tfarm

arm = tfarm.load("sasaki2012-lab")
law = tfarm.HubFeedback(K1=0.3, K2=0.3)  # u = -K1 theta_t - K2 E I phi'(0)

found = tfarm.margins(arm, law)  # the verdict comes first; margins of an unstable loop there are none
print(found.stability.word)
print("K2 alone may go from and to", found.windows["K2"].around)
assert found.in_band is not None  # the loop is stable
print("phase lag", found.in_band.phase_lag, "deg; delay margin", found.exact_delay, "s")

plane = tfarm.map(arm, np.linspace(0.05, 2.0, 40), np.linspace(-1.0, 1.5, 41))
figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 5.6))
tfarm.plots.nyquist(tfarm.nyquist(arm, law), ax=left)
tfarm.plots.gain_map(plane, ax=right)
figure.savefig("margins.png")
