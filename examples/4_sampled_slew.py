"""The same gains from a digital controller: does the loop hold at 10 ms, and how does the arm come to rest?"""

import tfarm
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.loop.sampled_verdict import sampled_verdict

arm = tfarm.load("sasaki2012-lab")
law = tfarm.HubFeedback(K1=0.3, K2=0.3)

for period in (0.01, 0.02):  # s
    chain = Chain(sampling=Sampling(period=period))
    verdict = sampled_verdict(Case(arm, law, chain))  # tfarm.sampled has the margins too
    print(f"{1e3 * period:g} ms: {verdict.sentence}")

runs = {f"K2 = {K2:g}": tfarm.simulate(arm, law.with_number("K2", K2), duration=3.0) for K2 in (0.0, 0.3)}
for name, run in runs.items():
    after = run.at_samples.root_moment[run.t > 1.0]  # when the slew of 1 s is over
    print(f"{name}: up to {abs(after).max():.4g} N m at the root afterwards")
moment, _, _ = tfarm.plots.slew(arm, runs)
moment.figure.savefig("slew.png")
