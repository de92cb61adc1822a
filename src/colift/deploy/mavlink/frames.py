"""Between our axes and MAVLink's: world x east, y north, z up against north, east, down; body z up against z down.

Both are signs and an exchange of two axes, so that vectors come back in every bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def world(vectors: ArrayLike) -> Array:
    """Vectors (..., 3) of our world (east, north, up) in north, east, down; and back, for it is its own inverse."""
    east, north, up = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    return np.stack([north, east, -up], axis=-1)


def body(vectors: ArrayLike) -> Array:
    """Vectors (..., 3) of our body (forward, left, up) in forward, right, down; and back."""
    forward, left, up = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    return np.stack([forward, -left, -up], axis=-1)


def attitude(quaternions: ArrayLike) -> Array:
    """Attitudes (..., 4), wxyz, from our body to our world, of their body to their world; and back, for it is its own inverse.

    ``(0, 1, 1, 0)/sqrt(2) * q * (0, 1, 0, 0)``, of the two signs of a quaternion one with ``w >= 0``.
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=float), -1, 0)
    turned = np.stack([w + z, x + y, x - y, w - z], axis=-1) * math.sqrt(0.5)
    return np.where(turned[..., :1] < 0.0, -turned, turned)


def yaw(angle: float) -> float:
    """Heading of our world (from east to north, rad) as theirs (from north to east), within pi; and back."""
    return math.remainder(0.5 * math.pi - angle, math.tau)
