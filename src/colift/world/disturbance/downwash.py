"""The rotors' wake on what is below: load, cables and other drones."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Area = Annotated[float, Field(ge=0.0, le=10.0)]

# Gauss and Legendre's five points on (0, 1): a wake may cross a small part of a cable.
_ROOTS = (
    math.sqrt(5.0 + 2.0 * math.sqrt(10.0 / 7.0)) / 3.0,
    math.sqrt(5.0 - 2.0 * math.sqrt(10.0 / 7.0)) / 3.0,
)
_POINTS = (
    0.5 - 0.5 * _ROOTS[0], 0.5 - 0.5 * _ROOTS[1], 0.5, 0.5 + 0.5 * _ROOTS[1], 0.5 + 0.5 * _ROOTS[0],
)  # fmt: skip
_HEAVY, _LIGHT = (
    (322.0 + 13.0 * math.sqrt(70.0)) / 1800.0,
    (322.0 - 13.0 * math.sqrt(70.0)) / 1800.0,
)
_WEIGHTS = (_LIGHT, _HEAVY, 64.0 / 225.0, _HEAVY, _LIGHT)
_CORE = 6.0  # length of a jet's core in diameters

PARAMS = Layout(team={"density": 1, "radius": 1, "drone_area": 1, "load_area": 1, "cable": 1})
"""``cable``: drag coefficient times diameter."""
P = PARAMS.at


@inline
def speed_at(depth, off, induced, radius):  # type: ignore[no-untyped-def]
    """Speed of the wake (m/s) at a depth below the rotors and a distance off its axis, m.

    ``radius`` is that of one disc as large as all rotors together. At the disc the air has the induced speed,
    far below twice that (McCormick 1967, for a vortex cylinder); beyond its core the jet decays and widens in
    proportion. The Gaussian profile carries the momentum of the thrust.
    """
    if depth <= 0.0:
        return 0.0
    spread = max(1.0, depth / (_CORE * math.sqrt(2.0) * radius))
    width = radius * spread
    if off > 4.0 * width:
        return 0.0
    growth = 1.0 + depth / math.sqrt(depth * depth + radius * radius)
    return induced * growth / spread * math.exp(-(off * off) / (width * width))


@inline
def _more_drag(scale, wx, wy, wz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """What a wake d adds to the quadratic drag in the relative wind w."""
    before = math.sqrt(wx * wx + wy * wy + wz * wz)
    x, y, z = wx + dx, wy + dy, wz + dz
    after = math.sqrt(x * x + y * y + z * z)
    return (
        scale * (after * x - before * wx),
        scale * (after * y - before * wy),
        scale * (after * z - before * wz),
    )


@inline
def _depth_and_off(x, y, z, px, py, pz, ax, ay, az):  # type: ignore[no-untyped-def]
    """Of the point (x, y, z): how far along a from p, and how far off that line."""
    rx, ry, rz = x - px, y - py, z - pz
    depth = rx * ax + ry * ay + rz * az
    ox, oy, oz = rx - depth * ax, ry - depth * ay, rz - depth * az
    return depth, math.sqrt(ox * ox + oy * oy + oz * oz)


@kernel(SIGNATURE)
def _wash(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, ends, positions, velocities = sees.load, sees.ends, sees.positions, sees.velocities
    attitudes, directions, thrusts = sees.attitudes, sees.directions, sees.applied_thrusts
    attached = sees.attached
    wind, external = writes.wind, writes.external_forces
    n = positions.shape[0]
    half_rho, radius = 0.5 * params[P.density], 2.0 * params[P.radius]  # four rotors as one disc
    drone, body = half_rho * params[P.drone_area], half_rho * params[P.load_area]
    cable = half_rho * params[P.cable]
    for j in range(n):
        if thrusts[j] <= 0.0:
            continue
        # Momentum theory: f = 2 rho A v^2.
        induced = math.sqrt(thrusts[j] / (2.0 * params[P.density] * math.pi * radius * radius))
        ux, uy, uz = quaternion.third_axis(
            attitudes[j, 0], attitudes[j, 1], attitudes[j, 2], attitudes[j, 3]
        )
        px, py, pz = positions[j, 0], positions[j, 1], positions[j, 2]
        # The far wake leaves at twice the induced speed, and is carried off by the wind past the drone.
        ax = wind[0] - velocities[j, 0] - 2.0 * induced * ux
        ay = wind[1] - velocities[j, 1] - 2.0 * induced * uy
        az = wind[2] - velocities[j, 2] - 2.0 * induced * uz
        norm = max(math.sqrt(ax * ax + ay * ay + az * az), 1e-9)
        ax, ay, az = ax / norm, ay / norm, az / norm

        depth, off = _depth_and_off(load[0, 0], load[0, 1], load[0, 2], px, py, pz, ax, ay, az)
        v = speed_at(depth, off, induced, radius)
        fx, fy, fz = _more_drag(
            body, wind[0] - load[1, 0], wind[1] - load[1, 1], wind[2] - load[1, 2],
            -v * ux, -v * uy, -v * uz,
        )  # fmt: skip
        external[n, 0] += fx
        external[n, 1] += fy
        external[n, 2] += fz
        for i in range(n):
            if i != j:
                depth, off = _depth_and_off(
                    positions[i, 0], positions[i, 1], positions[i, 2], px, py, pz, ax, ay, az
                )
                v = speed_at(depth, off, induced, radius)
                fx, fy, fz = _more_drag(
                    drone, wind[0] - velocities[i, 0], wind[1] - velocities[i, 1],
                    wind[2] - velocities[i, 2], -v * ux, -v * uy, -v * uz,
                )  # fmt: skip
                external[i, 0] += fx
                external[i, 1] += fy
                external[i, 2] += fz
            if attached[i] == 0.0 or cable == 0.0:
                continue
            cx, cy, cz = directions[i, 0], directions[i, 1], directions[i, 2]
            length = 0.0
            for k in range(3):
                length += (ends[i, 0, k] - positions[i, k]) * directions[i, k]
            for m in range(5):
                s = _POINTS[m]
                depth, off = _depth_and_off(
                    positions[i, 0] + s * length * cx, positions[i, 1] + s * length * cy,
                    positions[i, 2] + s * length * cz, px, py, pz, ax, ay, az,
                )  # fmt: skip
                v = speed_at(depth, off, induced, radius)
                if v == 0.0:
                    continue
                wx = wind[0] - (1.0 - s) * velocities[i, 0] - s * ends[i, 1, 0]
                wy = wind[1] - (1.0 - s) * velocities[i, 1] - s * ends[i, 1, 1]
                wz = wind[2] - (1.0 - s) * velocities[i, 2] - s * ends[i, 1, 2]
                along_w = wx * cx + wy * cy + wz * cz
                along_u = ux * cx + uy * cy + uz * cz
                fx, fy, fz = _more_drag(
                    _WEIGHTS[m] * cable * length,
                    wx - along_w * cx, wy - along_w * cy, wz - along_w * cz,
                    -v * (ux - along_u * cx), -v * (uy - along_u * cy), -v * (uz - along_u * cz),
                )  # fmt: skip
                external[i, 0] += (1.0 - s) * fx
                external[i, 1] += (1.0 - s) * fy
                external[i, 2] += (1.0 - s) * fz
                external[n, 0] += s * fx
                external[n, 1] += s * fy
                external[n, 2] += s * fz


class Downwash(DisturbancePart):
    """Drag of the load, the cables and lower drones in the wakes of the rotors.

    Momentum theory gives the induced speed from the thrust that acts; the wake contracts, then decays as a
    turbulent jet, and leans in the wind. Simplified: the four rotors are one disc of the same area, wakes are
    straight and do not see each other, each adds its own drag, and a lower drone's rotors lose no thrust.
    """

    kernel = _wash

    air_density: Annotated[float, Field(gt=0.0, le=10.0)] = 1.225
    """kg/m^3."""
    rotor_radius: Annotated[float, Field(gt=0.0, le=5.0)] = 0.1
    """Of each of the four rotors, m."""
    drone_area: Area = 0.02
    """Drag coefficient times area of a drone seen from above, m^2."""
    load_area: Area = 0.006
    """Drag coefficient times area of the load seen from above, m^2."""
    cable_diameter: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0015
    """m."""
    cable_coefficient: Annotated[float, Field(ge=0.0, le=3.0)] = 1.2
    """Drag coefficient of the cables across the wake."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, density=self.air_density, radius=self.rotor_radius, drone_area=self.drone_area,
            load_area=self.load_area, cable=self.cable_diameter * self.cable_coefficient,
        )  # fmt: skip
