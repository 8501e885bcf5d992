"""A law with a notch, designed on a model of one mode: does it drive a mode that the model leaves out?"""

import control

import tfarm

arm = tfarm.load("sasaki2012")  # without damping
w = tfarm.modes(arm, count=1).natural_frequency[-1]
s = control.tf("s")
notch = (s**2 + 0.02 * w * s + (1.08 * w) ** 2) / (s**2 + 1.4 * w * s + w**2)
law = tfarm.Law({"tip_displacement": 3.0 * notch * (0.3 * s + 1) / (0.015 * s + 1)})

found = tfarm.spill(arm, law)  # the exact loop compared with models of 1, 2, 3 ... modes
print(found.in_words)

lab = tfarm.load("sasaki2012-lab")  # the same with 0.36 % of critical damping in its first mode
print("with damping:", tfarm.margins(lab, law).stability.word)
