"""What the plants share: the state of load and drones, their motion without cables, the integrator.

The state begins with position and velocity of the load (6 numbers); then 13 numbers per drone:
position and velocity (world), attitude ``q`` (wxyz) and body rate ``Omega``. Cables are no part of it,
so that a drone whose cable is cut or slack needs no other description than one that carries.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from colift.kernel.jit import aside, inline, kernel
from colift.kernel.load import ends_of
from colift.kernel.math import quaternion
from colift.kernel.math.small import matrix_times
from colift.kernel.math.winch import paid_out
from colift.part import Places, Vector
from colift.team import Body, Ground, Team
from colift.team.geometry import matrix_of, min_norm_tensions
from colift.team.load import corners
from colift.world.plant._contact import ANCHORS, FIRST, damping_ratio, feet
from colift.world.plant._load import (
    SPIN,
    TURN,
    end_place,
    end_speed,
    into_load,
    into_world,
    speed_at,
    spin,
    twist,
)
from colift.world.plant._params import BODY as BODY
from colift.world.plant._params import CORNERS, PARAMS, P
from colift.world.plant._params import DRONE as DRONE
from colift.world.plant._params import LOAD as LOAD
from colift.world.plant._params import MASS as MASS
from colift.world.plant.base import OBSERVE_SIGNATURE, STATE, PlantPart, Start


def state_size(n: int) -> int:
    """Length of the state of load and drones."""
    return STATE.size(n)


@inline
def free_motion(n, y, thrusts, torques, external, moment, params, dy):  # type: ignore[no-untyped-def]
    """Time derivative of the state without cables (paper eqs. 1 to 3 with T = 0)."""
    m_L, g = params[0], params[1]
    for k in range(3):
        dy[k] = y[3 + k]
        dy[3 + k] = external[n, k] / m_L
    dy[5] -= g
    spin(y, params, dy)
    if params[P.rigid] > 0.0:
        u, v, w = into_load(y, moment[0], moment[1], moment[2])
        twist(u, v, w, params, dy)
    for i in range(n):
        o = LOAD + DRONE * i
        m = params[MASS + BODY * i]
        qw, qx, qy, qz = y[o + 6], y[o + 7], y[o + 8], y[o + 9]
        ux, uy, uz = quaternion.third_axis(qw, qx, qy, qz)
        f = thrusts[i]
        dy[o], dy[o + 1], dy[o + 2] = y[o + 3], y[o + 4], y[o + 5]
        dy[o + 3] = (f * ux + external[i, 0]) / m
        dy[o + 4] = (f * uy + external[i, 1]) / m
        dy[o + 5] = (f * uz + external[i, 2]) / m - g
        p, q, r = y[o + 10], y[o + 11], y[o + 12]
        dw, dx, dy_, dz = quaternion.multiply(qw, qx, qy, qz, 0.0, 0.5 * p, 0.5 * q, 0.5 * r)
        dy[o + 6], dy[o + 7], dy[o + 8], dy[o + 9] = dw, dx, dy_, dz
        jx = params[MASS + BODY * i + 2]
        jy = params[MASS + BODY * i + 3]
        jz = params[MASS + BODY * i + 4]
        dy[o + 10] = (torques[i, 0] - (jz - jy) * q * r) / jx
        dy[o + 11] = (torques[i, 1] - (jx - jz) * r * p) / jy
        dy[o + 12] = (torques[i, 2] - (jy - jx) * p * q) / jz


STAGES = (0.0, 0.5, 0.5, 1.0)
"""When the slopes of :func:`runge_kutta` are due, over its step."""


@inline
def runge_kutta(stage, size, dt, begin, slope, total, y):  # type: ignore[no-untyped-def]
    """Take the slope of stage 0 to 3 of the classical method; ``y`` becomes where the next one is due.

    ``begin`` is the state at the beginning, ``total`` collects; after stage 3 ``y`` is the answer.
    """
    if stage == 0:
        for k in range(size):
            total[k] = slope[k]
            y[k] = begin[k] + 0.5 * dt * slope[k]
    elif stage < 3:
        part = 0.5 * dt if stage == 1 else dt
        for k in range(size):
            total[k] += 2.0 * slope[k]
            y[k] = begin[k] + part * slope[k]
    else:
        for k in range(size):
            y[k] = begin[k] + dt / 6.0 * (total[k] + slope[k])


@inline
def normalise(n, params, y):  # type: ignore[no-untyped-def]
    """Pull the quaternions back to unit norm; that of a rigid load stands as a drone's does."""
    for i in range(0 if params[P.rigid] > 0.0 else 1, n + 1):
        o = DRONE * i + 6
        norm = math.sqrt(
            y[o] * y[o] + y[o + 1] * y[o + 1] + y[o + 2] * y[o + 2] + y[o + 3] * y[o + 3]
        )
        for k in range(4):
            y[o + k] /= norm


@inline
def unit(x, y, z):  # type: ignore[no-untyped-def]
    """Unit vector and length; down for a vector without length, which is a direction too."""
    d = math.sqrt(x * x + y * y + z * z)
    if d > 1e-12:
        return x / d, y / d, z / d, d
    return 0.0, 0.0, -1.0, d


@inline
def line(i, y, params):  # type: ignore[no-untyped-def]
    """Unit vector and distance from drone i to the end of its cable on the load."""
    o = LOAD + DRONE * i
    x, y_, z = end_place(i, y, params)
    return unit(x - y[o], y_ - y[o + 1], z - y[o + 2])


@inline
def parting_speed(i, y, params):  # type: ignore[no-untyped-def]
    """Velocity (3) of the end of cable i on the load from its drone, m/s."""
    o = LOAD + DRONE * i
    x, y_, z = end_speed(i, y, params)
    return x - y[o + 3], y_ - y[o + 4], z - y[o + 5]


@aside
def yielding(i, y, ax, ay, az, params):  # type: ignore[no-untyped-def]
    """How far the end of cable i on a rigid load yields to a unit impulse along a direction, along it, 1/kg."""
    o = MASS + BODY * i + P.rho
    a, b, c = params[o], params[o + 1], params[o + 2]
    u, v, w = into_load(y, ax, ay, az)
    mx, my, mz = b * w - c * v, c * u - a * w, a * v - b * u
    tx, ty, tz = matrix_times(P.inverse, params, (mx, my, mz))
    return 1.0 / params[P.m_L] + mx * tx + my * ty + mz * tz


@inline
def wind(n, winches, t, params, lengths, rates, bends):  # type: ignore[no-untyped-def]
    """Lengths of the cables at a time (s), m, and two derivatives."""
    for i in range(n):
        more, rates[i], bends[i] = paid_out(winches, i, t)
        lengths[i] = params[MASS + BODY * i + 1] + more


@inline
def raise_peaks(n, T, peak_tensions):  # type: ignore[no-untyped-def]
    """Keep the largest tension of each cable and, last, the largest sum of their sizes."""
    total = 0.0
    for i in range(n):
        total += abs(T[i])
        peak_tensions[i] = max(peak_tensions[i], T[i])
    peak_tensions[n] = max(peak_tensions[n], total)


@inline
def catch_impulse(i, y, parting, params):  # type: ignore[no-untyped-def]
    """Impulse that stops drone ``i`` and the load's end of its cable, parting along it at this speed, when nothing else does."""
    m_L, m = params[0], params[MASS + BODY * i]
    if params[P.rigid] == 0.0:
        return parting * m * m_L / (m + m_L)
    x, y_, z, _ = line(i, y, params)
    return parting / (1.0 / m + yielding(i, y, x, y_, z, params))


@kernel(OBSERVE_SIGNATURE, counted=False)
def observe(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, ends = writes.load, writes.ends
    positions, velocities = writes.positions, writes.velocities
    attitudes, rates, directions = writes.attitudes, writes.rates, writes.directions
    direction_rates = writes.direction_rates
    y = memory
    for k in range(3):
        load[0, k] = y[k]
        load[1, k] = y[3 + k]
    ends_of(load, ends)
    if params[P.rigid] > 0.0:
        for i in range(positions.shape[0]):
            place, speed = end_place(i, y, params), end_speed(i, y, params)
            for k in range(3):
                ends[i, 0, k] = place[k]
                ends[i, 1, k] = speed[k]
        o = P.centre
        a, b, c = params[o], params[o + 1], params[o + 2]
        middle = into_world(y, -a, -b, -c)
        speed = speed_at(y, -a, -b, -c)
        for k in range(3):
            load[0, k] += middle[k]
            load[1, k] = speed[k]
            writes.load_rates[k] = y[SPIN + k]
        for k in range(4):
            writes.load_attitude[k] = y[TURN + k]
    for i in range(positions.shape[0]):
        o = LOAD + DRONE * i
        ax, ay, az, d = unit(
            ends[i, 0, 0] - y[o], ends[i, 0, 1] - y[o + 1], ends[i, 0, 2] - y[o + 2]
        )
        vx, vy, vz = ends[i, 1, 0] - y[o + 3], ends[i, 1, 1] - y[o + 4], ends[i, 1, 2] - y[o + 5]
        along = ax * vx + ay * vy + az * vz
        d = max(d, 1e-12)
        directions[i, 0], directions[i, 1], directions[i, 2] = ax, ay, az
        direction_rates[i, 0] = (vx - along * ax) / d
        direction_rates[i, 1] = (vy - along * ay) / d
        direction_rates[i, 2] = (vz - along * az) / d
        for k in range(3):
            positions[i, k] = y[o + k]
            velocities[i, k] = y[o + 3 + k]
            rates[i, k] = y[o + 10 + k]
        for k in range(4):
            attitudes[i, k] = y[o + 6 + k]


def _load_numbers(body: Body | None) -> dict[str, Any]:
    """Parameters of the load, but for its mass."""
    if body is None:
        names = ("rigid", "inertia", "inverse", "centre", "corners", "corner")
        return dict.fromkeys(names, 0.0)
    points = body.points if len(body.points) <= CORNERS else corners(body.size)
    corner = np.zeros((CORNERS, 3))
    corner[: len(points)] = points - body.centre
    return {
        "rigid": 1.0,
        "inertia": body.inertia.ravel(),
        "inverse": np.linalg.inv(body.inertia).ravel(),
        "centre": body.centre,
        "corners": float(len(points)),
        "corner": corner.ravel(),
    }


class BodiesPart(PlantPart):
    """Base of the plants whose memory begins with the state of load and drones."""

    observe = observe
    reels: ClassVar[str] = ""
    anchored: ClassVar[bool] = True
    """Whether the memory ends with what contact with the ground remembers."""

    def params(self, team: Team) -> Vector:
        ground = team.ground or Ground()
        return PARAMS.pack(
            team.n, m_L=team.load_mass, g=team.gravity, ground=float(team.ground is not None),
            height=ground.height, friction=ground.friction, damping=damping_ratio(ground.restitution),
            m=team.masses, L=team.cable_lengths, J=team.inertias, foot=feet(team), rho=team.levers,
            **_load_numbers(team.body),
        )  # fmt: skip

    def stretched(self, team: Team, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lengths (n,) of the cables under these tensions, m."""
        return team.cable_lengths

    def initial(self, team: Team, start: Start) -> NDArray[np.float64]:
        """Memory at the start, with the cables as long as the tensions that hold the load make them."""
        memory = self.memory(team)
        weight = [0.0, 0.0, team.load_mass * team.gravity]
        turned = matrix_of(start.load_attitude)
        levers = team.levers @ turned.T
        tensions = np.maximum(min_norm_tensions(start.directions, weight, levers), 0.0)
        spans = self.stretched(team, tensions)[:, None] * start.directions
        load = STATE.view(memory[:LOAD], "load_position")
        load[:] = start.load_position
        if team.body is not None:
            load += turned @ team.body.centre
        memory[3:6] = start.load_velocity
        memory[TURN:SPIN] = start.load_attitude
        memory[SPIN:LOAD] = start.load_rates
        drones = memory[LOAD : state_size(team.n)].reshape(team.n, DRONE)
        drones[:, 0:3] = load + levers - spans if start.places is None else start.places
        drones[:, 3:6] = start.load_velocity
        drones[:, 6:10] = start.attitudes
        self._let_go(memory, team.n)
        return memory

    def _let_go(self, memory: Vector, n: int) -> None:
        """Put the anchors below the bodies."""
        if self.anchored:
            drones = memory[LOAD : state_size(n)].reshape(n, DRONE)
            anchors = memory[-ANCHORS.size(n) :]
            anchors[:FIRST] = np.tile(memory[:2], CORNERS)
            anchors[FIRST:] = drones[:, :2].ravel()

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        # A new drone joins the load where it is by now, not where it was when last observed.
        joining = fresh[LOAD : state_size(places.size)].reshape(places.size, DRONE)
        joining[:, :6] += old[:6] - fresh[:6]
        fresh = STATE.carry_over(old, fresh, places)
        self._let_go(fresh, places.size)
        return fresh
