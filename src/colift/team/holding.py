"""How a formation holds a rigid load's attitude: what its cables can make, and how it swings below drones that stay where they are.

With cables of fixed lengths the pose ``(x, theta)`` of the load below standing drones has what the cables leave free. Of the energy
``m g z`` and the cables' lengths, which tensions weigh as multipliers, the second derivative on these motions says whether the
load comes back to where it hangs and how fast it swings; that of a turn about the vertical alone is its yaw stiffness
``sum_i T_i / L_i (rho_i . d_i)_xy``, with drones at ``d_i`` from the centre of mass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from colift.team.bodies import Team
from colift.team.geometry import Array, matrix_of
from colift.team.plan import wrench_map

FREE = 1e-6
"""Singular value of the map from cable forces to wrenches, over the largest, from which on it counts as none."""
CONDITION = 50.0
"""Largest over least singular value beyond which a wrench is as good as not there."""


class Holding(NamedTuple):
    """How a formation holds the load."""

    rank: int
    """Of the six forces and moments so many can be made."""
    condition: float
    """Largest over least gain from cable forces to wrench, moments over the size of the load; infinite below rank 6."""
    yaw_stiffness: float
    """Moment that turns the load back, N m per rad; not above 0 where it turns away."""
    swings: Array
    """Frequencies of the motions that cables leave free, rad/s, the slowest first; imaginary ones as negative numbers."""

    def problems(self) -> list[tuple[str, str]]:
        """Name and message of what no drone can hold."""
        found = []
        if self.yaw_stiffness <= 0.0:
            found.append(
                (
                    "yaw stiffness",
                    f"the cables turn the load away from its heading: {self.yaw_stiffness:.3g} N m per rad",
                )
            )
        if self.swings.size and self.swings[0] < 0.0:
            found.append(
                (
                    "pose stability",
                    f"the load falls out of its attitude, e-fold in {-1.0 / self.swings[0]:.2g} s: its centre of mass is too high above the attachments",
                )
            )
        return found

    def warnings(self) -> list[tuple[str, str]]:
        """Name and message of what is hardly held."""
        if self.rank < 6:
            left = 6 - self.rank
            return [
                (
                    "rank",
                    f"the cables make {self.rank} of six forces and moments: {left} motion{'s' * (left > 1)} of the load nobody controls",
                )
            ]
        if self.condition > CONDITION:
            return [
                (
                    "conditioning",
                    f"what the cables make of forces differs {self.condition:.0f}-fold (at most {CONDITION:.0f}): attach them wider apart",
                )
            ]
        return []


def holding(team: Team, directions: Array, tensions: Array) -> Holding:
    """Of cables with these directions (n, 3), from drone to load, and tensions (n,), N, in hover.

    The load hangs as it does on this team (:attr:`colift.team.load.Body.hang`); one that is a point has no attitude to hold.
    """
    assert team.body is not None
    turned = matrix_of(team.body.hang)
    arms = team.levers @ turned.T
    size = max(float(np.abs(arms).max()), 1e-6)
    gains = np.linalg.svd(
        wrench_map(arms) / np.array([1.0, 1.0, 1.0, size, size, size])[:, None], compute_uv=False
    )
    rank = int(np.sum(gains > FREE * gains[0]))
    drones = arms - team.cable_lengths[:, None] * directions
    level = np.sum(arms[:, :2] * drones[:, :2], axis=1)
    yaw = float(np.sum(tensions / team.cable_lengths * level))
    inertia = turned @ team.body.inertia @ turned.T
    return Holding(
        rank, float(gains[0] / gains[5]) if rank == 6 else math.inf, yaw,
        _swings(arms, directions, tensions, team.cable_lengths, team.load_mass, inertia),
    )  # fmt: skip


def _swings(
    arms: Array, directions: Array, tensions: Array, lengths: Array, mass: float, inertia: Array
) -> Array:
    """Frequencies (k,) of the motions that taut cables leave free, rad/s; negative those of which the load falls away."""
    maps = wrench_map(arms).reshape(6, -1, 3).transpose(1, 0, 2)
    slopes = np.einsum("ikj,ij->ik", maps, directions)  # of each distance by the pose
    bend = np.zeros((6, 6))
    for G, rho, alpha, T, L in zip(maps, arms, directions, tensions, lengths, strict=True):
        bend += T / L * G @ (np.eye(3) - np.outer(alpha, alpha)) @ G.T
        # The end itself turns on a circle: exp(theta) rho to second order.
        bend[3:, 3:] += T * (
            0.5 * (np.outer(rho, alpha) + np.outer(alpha, rho)) - rho @ alpha * np.eye(3)
        )
    _, sizes, rows = np.linalg.svd(slopes)
    rank = int(np.sum(sizes > FREE * sizes[0]))
    free = rows[rank:].T
    if free.shape[1] == 0:
        return np.zeros(0)
    weight = np.zeros((6, 6))
    weight[:3, :3] = mass * np.eye(3)
    weight[3:, 3:] = inertia
    root = np.linalg.inv(np.linalg.cholesky(free.T @ weight @ free))
    squares = np.linalg.eigvalsh(root @ (free.T @ bend @ free) @ root.T)
    return np.asarray(np.sign(squares) * np.sqrt(np.abs(squares)))
