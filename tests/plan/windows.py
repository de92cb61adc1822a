"""A window through which a load of half a metre of cable fits."""

from __future__ import annotations

import numpy as np

from colift.plan.scene import Scene


def window(n=3, gap=0.4):
    obstacles = np.zeros((2, 8))
    obstacles[:, 1:4] = [[0.5, s * (0.2 + gap / 2), 0.0] for s in (1, -1)]
    obstacles[:, 4:7] = [0.2, 0.2, 1.5]
    ends = np.array([[-0.5, 0.0, 0.0], [1.5, 0.0, 0.0]])
    return Scene("window", *ends, None, np.full(n, 0.5), obstacles)
