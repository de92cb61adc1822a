"""Cable geometry in plain NumPy: formations, angles, attitudes. For set-up and analysis only."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def ring(n: int, cone: float, *, heading: float = 0.0) -> Array:
    """Directions (n, 3) of n cables evenly on a cone of half-angle ``cone`` (rad) about the vertical.

    Unit vectors from drone to load; the first drone stands at azimuth ``heading`` (rad). One cable
    hangs straight down.
    """
    if n == 1:
        return np.array([[0.0, 0.0, -1.0]])
    azimuth = heading + 2.0 * np.pi * np.arange(n) / n
    return -np.column_stack(
        [np.sin(cone) * np.cos(azimuth), np.sin(cone) * np.sin(azimuth), np.full(n, np.cos(cone))]
    )


def ring_cone(n: int, apart: float) -> float:
    """Half-angle of a ring of n cables on which neighbours are ``apart`` (rad); a quarter turn where no ring has room."""
    if n < 2:
        return 0.0
    reach = math.sin(0.5 * apart) / math.sin(math.pi / n)
    return math.asin(reach) if reach < 1.0 else 0.5 * math.pi


def rotation_between(a: Array, b: Array) -> Array:
    """Matrix (3, 3) of the smallest rotation from the unit vector ``a`` to the unit vector ``b``."""
    c = float(a @ b)
    if c > -0.999:
        v = np.cross(a, b)
        return np.asarray(
            np.eye(3) + _cross_matrix(v) + _cross_matrix(v) @ _cross_matrix(v) / (1.0 + c)
        )
    across = np.eye(3)[int(np.argmin(np.abs(a)))]
    half = across - (across @ a) * a  # turn a to its opposite about this axis, then the rest
    half /= np.linalg.norm(half)
    return rotation_between(-a, b) @ (2.0 * np.outer(half, half) - np.eye(3))


def _cross_matrix(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def pairwise_angles(directions: Array) -> Array:
    """Angles (..., n(n-1)/2) between all pairs of cables, rad, from directions (..., n, 3)."""
    i, j = np.triu_indices(directions.shape[-2], k=1)
    a, b = directions[..., i, :], directions[..., j, :]
    # atan2 keeps full accuracy near 0 and pi, where arccos loses half of the digits.
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(cross, np.sum(a * b, axis=-1)))


def min_norm_tensions(directions: Array, force: ArrayLike, levers: Array | None = None) -> Array:
    """Tensions (n,) of least norm with ``sum T_i alpha_i = -force``, N; may be negative.

    With ``levers`` (n, 3), m, world, from the centre of mass to the cables' ends, also ``sum r_i x T_i alpha_i = 0``, as far as it goes.
    """
    wrench = np.asarray(directions.T)
    wanted = -np.asarray(force, dtype=float)
    if levers is not None and levers.any():
        wrench = np.vstack([wrench, np.cross(levers, directions).T / np.abs(levers).max()])
        wanted = np.append(wanted, np.zeros(3))
    solution = np.linalg.lstsq(wrench, wanted, rcond=None)[0]
    return np.asarray(solution)


def matrix_of(attitude: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (4,), wxyz."""
    w, x, y, z = np.asarray(attitude, dtype=float)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(matrix: Array) -> Array:
    """Unit quaternion (4,), wxyz, of a rotation matrix (3, 3): the eigenvector of Bar-Itzhack's symmetric matrix (JGCD 2000)."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    K = np.array(
        [[a + e + i, h - f, c - g, d - b], [h - f, a - e - i, b + d, c + g], [c - g, b + d, e - a - i, f + h], [d - b, c + g, f + h, i - a - e]]
    )  # fmt: skip
    found = np.linalg.eigh(K)[1][:, -1]
    return np.asarray(found if found[0] >= 0.0 else -found)


def zero_yaw_quaternion(thrust_direction: Array) -> Array:
    """Attitude (..., 4), wxyz, that turns e3 into the unit ``thrust_direction`` (..., 3) without yaw.

    Paper section 2.3; undefined for a direction straight down.
    """
    root = np.sqrt(2.0 * thrust_direction[..., 2] + 2.0)
    return np.stack(
        [
            0.5 * root,
            -thrust_direction[..., 1] / root,
            thrust_direction[..., 0] / root,
            np.zeros_like(root),
        ],
        axis=-1,
    )


def widest_gap(directions: Array, cone: float) -> Array:
    """Direction (3,) within ``cone`` (rad) of the vertical that is farthest from the given ones (n, 3).

    The best of a grid of about a degree.
    """
    rim = np.cos(cone)
    count = max(64, round(20_000 * (1.0 - rim)))
    k = np.arange(count) + 0.5
    down = 1.0 - (1.0 - rim) * k / count
    level, azimuth = np.sqrt(1.0 - down**2), np.pi * (3.0 - np.sqrt(5.0)) * k
    grid = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), -down])
    return np.asarray(grid[np.argmin(np.max(grid @ directions.T, axis=1))])
