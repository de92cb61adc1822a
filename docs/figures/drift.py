"""How a warm-started allocator drifts along the flat family: ``python docs/figures/drift.py``.

n = 4, hover of the paper's load, white noise of 0.3 m/s^2 on the force command at 1 kHz for 20 s. Prints,
for each weight and kind of warm start, the smallest angle between two wanted cables over five seeds,
and the largest gap to the global optimum: every answer is optimal.
"""

import numpy as np

import colift
from colift.team.geometry import pairwise_angles

for mu in (0.15, 0.75, 1.35):
    for transport in (False, True):
        smallest, gap = [], 0.0
        for seed in range(5):
            noise = 0.3 * np.random.default_rng(seed).normal(size=(20_000, 3))
            allocator = colift.SqpAllocator(n=4, mu=mu, transport=transport)
            least = np.inf
            for force in 0.225 * (np.array([0.0, 0.0, 9.81]) + noise):
                answer = allocator.allocate(force)
                least = min(least, pairwise_angles(answer.directions).min())
                gap = max(gap, answer.optimality_gap)
            smallest.append(float(np.degrees(least)))
        print(
            f"mu = {mu:<4}  transport = {transport!s:5}  smallest angle "
            f"{min(smallest):5.1f} to {max(smallest):5.1f} deg, gap to the optimum {gap:.0e} N^2"
        )
