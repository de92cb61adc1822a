"""Quadrotors on rigid massless cables under a point load (paper eqs. 1 to 5), RK4 with projection.

State: load position and velocity, and per drone the cable direction ``alpha`` (drone to load), its
angular velocity ``omega`` (``alpha_dot = omega x alpha``, ``omega . alpha = 0``), attitude ``q`` and body rate
``Omega``. The tensions follow from the constraint ``x_i = x_L - L_i alpha_i``: with
``y = sum_i T_i alpha_i`` and the accelerations ``a_L0``, ``a_i0`` that load and drones would have without cables::

    b_i = L_i |omega_i|^2 + alpha_i . (a_L0 - a_i0)
    (I + sum_i m_i alpha_i alpha_i^T / m_L) y = sum_i m_i b_i alpha_i
    T_i = m_i (b_i - alpha_i . y / m_L)

A tension may come out negative: a rigid rod would push. That time is counted as slack.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.jit import inline, kernel
from colift.math import quaternion
from colift.part import Places, Vector, carry_rows
from colift.plant.base import OBSERVE_SIGNATURE, STEP_SIGNATURE, PlantPart, Start
from colift.team import Team

_DRONE = 13  # state per drone: alpha (3), omega (3), q (4), Omega (3)
_BODY = 5  # params per drone: mass, cable length, inertia (3); after m_L and g


def state_size(n: int) -> int:
    """Length of the state vector: load (6) and 13 numbers per drone."""
    return 6 + _DRONE * n


@inline
def derivative(n, y, thrusts, torques, external, params, T, scratch, dy):  # type: ignore[no-untyped-def]
    """Time derivative of the state; fills the tensions ``T``. ``scratch`` holds 4 numbers a drone."""
    m_L, g = params[0], params[1]
    ax = external[n, 0] / m_L
    ay = external[n, 1] / m_L
    az = external[n, 2] / m_L - g
    sxx = syy = szz = 1.0
    sxy = sxz = syz = 0.0
    rx = ry = rz = 0.0
    for i in range(n):
        o = 6 + _DRONE * i
        m = params[2 + _BODY * i]
        L = params[3 + _BODY * i]
        x, y_, z = y[o], y[o + 1], y[o + 2]
        ux, uy, uz = quaternion.third_axis(y[o + 6], y[o + 7], y[o + 8], y[o + 9])
        f = thrusts[i]
        dx = (f * ux + external[i, 0]) / m
        dy_ = (f * uy + external[i, 1]) / m
        dz = (f * uz + external[i, 2]) / m - g
        w2 = y[o + 3] * y[o + 3] + y[o + 4] * y[o + 4] + y[o + 5] * y[o + 5]
        b = L * w2 + x * (ax - dx) + y_ * (ay - dy_) + z * (az - dz)
        scratch[4 * i] = dx
        scratch[4 * i + 1] = dy_
        scratch[4 * i + 2] = dz
        scratch[4 * i + 3] = b
        share = m / m_L
        sxx += share * x * x
        sxy += share * x * y_
        sxz += share * x * z
        syy += share * y_ * y_
        syz += share * y_ * z
        szz += share * z * z
        rx += m * b * x
        ry += m * b * y_
        rz += m * b * z
    # y = S^-1 r by the adjugate; S is the identity plus a positive semidefinite matrix.
    cxx = syy * szz - syz * syz
    cxy = sxz * syz - sxy * szz
    cxz = sxy * syz - sxz * syy
    cyy = sxx * szz - sxz * sxz
    cyz = sxy * sxz - sxx * syz
    czz = sxx * syy - sxy * sxy
    det = sxx * cxx + sxy * cxy + sxz * cxz
    px = (cxx * rx + cxy * ry + cxz * rz) / det
    py = (cxy * rx + cyy * ry + cyz * rz) / det
    pz = (cxz * rx + cyz * ry + czz * rz) / det
    ax -= px / m_L
    ay -= py / m_L
    az -= pz / m_L
    dy[0], dy[1], dy[2] = y[3], y[4], y[5]
    dy[3], dy[4], dy[5] = ax, ay, az
    for i in range(n):
        o = 6 + _DRONE * i
        m = params[2 + _BODY * i]
        L = params[3 + _BODY * i]
        x, y_, z = y[o], y[o + 1], y[o + 2]
        t = m * (scratch[4 * i + 3] - (x * px + y_ * py + z * pz) / m_L)
        T[i] = t
        # Acceleration of the load relative to the drone; L omega_dot = alpha x (a_L - a_i).
        ex = ax - scratch[4 * i] - t * x / m
        ey = ay - scratch[4 * i + 1] - t * y_ / m
        ez = az - scratch[4 * i + 2] - t * z / m
        wx, wy, wz = y[o + 3], y[o + 4], y[o + 5]
        dy[o] = wy * z - wz * y_
        dy[o + 1] = wz * x - wx * z
        dy[o + 2] = wx * y_ - wy * x
        dy[o + 3] = (y_ * ez - z * ey) / L
        dy[o + 4] = (z * ex - x * ez) / L
        dy[o + 5] = (x * ey - y_ * ex) / L
        p, q, r = y[o + 10], y[o + 11], y[o + 12]
        dw, di, dj, dk = quaternion.multiply(
            y[o + 6], y[o + 7], y[o + 8], y[o + 9], 0.0, 0.5 * p, 0.5 * q, 0.5 * r
        )
        dy[o + 6], dy[o + 7], dy[o + 8], dy[o + 9] = dw, di, dj, dk
        jx, jy, jz = params[4 + _BODY * i], params[5 + _BODY * i], params[6 + _BODY * i]
        dy[o + 10] = (torques[i, 0] - (jz - jy) * q * r) / jx
        dy[o + 11] = (torques[i, 1] - (jx - jz) * r * p) / jy
        dy[o + 12] = (torques[i, 2] - (jy - jx) * p * q) / jz


@inline
def project(n, y):  # type: ignore[no-untyped-def]
    """Pull directions and quaternions back to unit norm and ``omega`` perpendicular to ``alpha``."""
    for i in range(n):
        o = 6 + _DRONE * i
        scale = 1.0 / math.sqrt(y[o] * y[o] + y[o + 1] * y[o + 1] + y[o + 2] * y[o + 2])
        y[o] *= scale
        y[o + 1] *= scale
        y[o + 2] *= scale
        along = y[o + 3] * y[o] + y[o + 4] * y[o + 1] + y[o + 5] * y[o + 2]
        y[o + 3] -= along * y[o]
        y[o + 4] -= along * y[o + 1]
        y[o + 5] -= along * y[o + 2]
        scale = 1.0 / math.sqrt(
            y[o + 6] * y[o + 6] + y[o + 7] * y[o + 7] + y[o + 8] * y[o + 8] + y[o + 9] * y[o + 9]
        )
        for k in range(6, 10):
            y[o + k] *= scale


@kernel(STEP_SIGNATURE)
def _step(thrusts, torques, external, dt, params, memory, tensions, slack_times):  # type: ignore[no-untyped-def]
    n = thrusts.shape[0]
    size = 6 + _DRONE * n
    y = memory[:size]
    stage = memory[size : 2 * size]
    total = memory[2 * size : 3 * size]
    slope = memory[3 * size : 4 * size]
    scratch = memory[4 * size : 4 * size + 4 * n]
    T = memory[4 * size + 4 * n : 4 * size + 5 * n]
    derivative(n, y, thrusts, torques, external, params, tensions, scratch, slope)
    for k in range(size):
        total[k] = slope[k]
        stage[k] = y[k] + 0.5 * dt * slope[k]
    derivative(n, stage, thrusts, torques, external, params, T, scratch, slope)
    for k in range(size):
        total[k] += 2.0 * slope[k]
        stage[k] = y[k] + 0.5 * dt * slope[k]
    derivative(n, stage, thrusts, torques, external, params, T, scratch, slope)
    for k in range(size):
        total[k] += 2.0 * slope[k]
        stage[k] = y[k] + dt * slope[k]
    derivative(n, stage, thrusts, torques, external, params, T, scratch, slope)
    for k in range(size):
        y[k] += dt / 6.0 * (total[k] + slope[k])
    project(n, y)
    for i in range(n):
        if tensions[i] < 0.0:
            slack_times[i] += dt


@kernel(OBSERVE_SIGNATURE)
def _observe(  # type: ignore[no-untyped-def]
    params, memory, load, positions, velocities, attitudes, rates, directions, direction_rates
):
    y = memory
    for k in range(3):
        load[0, k] = y[k]
        load[1, k] = y[3 + k]
    for i in range(positions.shape[0]):
        o = 6 + _DRONE * i
        L = params[3 + _BODY * i]
        x, y_, z = y[o], y[o + 1], y[o + 2]
        wx, wy, wz = y[o + 3], y[o + 4], y[o + 5]
        direction_rates[i, 0] = wy * z - wz * y_
        direction_rates[i, 1] = wz * x - wx * z
        direction_rates[i, 2] = wx * y_ - wy * x
        for k in range(3):
            directions[i, k] = y[o + k]
            positions[i, k] = y[k] - L * y[o + k]
            velocities[i, k] = y[3 + k] - L * direction_rates[i, k]
            rates[i, k] = y[o + 10 + k]
        for k in range(4):
            attitudes[i, k] = y[o + 6 + k]


class RigidCables(PlantPart):
    """Rigid massless cables, point load; no settings."""

    kernel = _step
    observe = _observe

    def params(self, team: Team) -> Vector:
        bodies = np.column_stack([team.masses, team.cable_lengths, team.inertias])
        return np.concatenate([[team.load_mass, team.gravity], bodies.ravel()])

    def memory(self, team: Team) -> Vector:
        return np.zeros(4 * state_size(team.n) + 5 * team.n)

    def initial(self, team: Team, start: Start) -> NDArray[np.float64]:
        memory = self.memory(team)
        memory[0:3] = start.load_position
        memory[3:6] = start.load_velocity
        drones = memory[6 : state_size(team.n)].reshape(team.n, _DRONE)
        drones[:, 0:3] = start.directions
        drones[:, 6:10] = start.attitudes
        return memory

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 6, _DRONE, places)
