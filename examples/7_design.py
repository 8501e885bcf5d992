"""Which gains?  The best damping of two modes that the sampled loop allows, at two sampling periods."""

import tfarm
from tfarm.dsp import Chain, Sampling

arm = tfarm.load("sasaki2012-lab")
slow, fast = Chain(sampling=Sampling(period=0.01)), Chain(sampling=Sampling(period=0.005))  # s
chosen = {chain: tfarm.design(arm, "damping", chain=chain) for chain in (slow, fast)}
for chain, found in chosen.items():
    law, ms = found.law, 1e3 * chain.sampling.period
    print(f"{ms:g} ms: K1 = {law.K1:.4g}, K2 = {law.K2:.4g}, damping {100 * found.value:.4g} %")
print("the second, at the longer sampling period:", tfarm.sampled(arm, chosen[fast].law, slow).verdict.word)
