"""Nominal pulls of the cables of a rigid load, where its reference plans none: what its wanted motion asks of them, with two derivatives.

The wanted pose and its derivatives ask for a force ``F`` and a moment ``M``; the formation, turned to them, and
the nearest forces that make them exactly are what an allocator answers that nothing limits (:mod:`colift.kernel.math.wrench`). As they are free
of noise, their derivatives are differences. So what a load is wanted to do passes to the drones without the lag of the filter
that corrections go through.
"""

from __future__ import annotations

import math

import numpy as np

from colift.control.position_control._cable import course_of, size_of
from colift.kernel.jit import aside, inline
from colift.kernel.layout import Layout
from colift.kernel.math import inertial, quaternion, wrench
from colift.kernel.math.small import cross, matrix_times
from colift.kernel.math.sphere import FOLLOW
from colift.part import Vector
from colift.team import Team
from colift.team.plan import spanned

NUMBERS = Layout(team={"m": 1, "g": 1, "kind": 1, "axis": 3, "J": 9, "centre": 3})
"""Parameters, behind which the levers of all cables follow (3 n); ``kind`` and ``axis`` of the wrenches that they can make."""
N = NUMBERS.at
STATE = Layout(team={"calls": 1})
"""Memory, behind which forces, ends and planned forces (3 n each) follow; then what is
asked of each cable along its planned direction, over its part of the force (n), the second derivatives as they were (3 n), and the nominal pulls (9 n)."""
LATE = 1.0
"""Age of a filtered second difference, in periods."""
FIRM, FAINT = 0.35, 0.25
"""Share of a cable's part of the force below which its pull is not taken for a direction as it is, and least pull over that."""


def numbers(team: Team) -> Vector:
    """Parameters for a team; none for a load that is a point."""
    if team.body is None:
        return np.zeros(0)
    kind, axis = spanned(team)
    own = NUMBERS.pack(
        team.n, m=team.load_mass, g=team.gravity, kind=kind, axis=axis, J=team.body.inertia.ravel(),
        centre=team.body.centre,
    )  # fmt: skip
    return np.concatenate([own, team.levers.ravel()])


def room(team: Team) -> int:
    """Length of the memory."""
    return 0 if team.body is None else STATE.size(0) + 22 * team.n


@inline
def _hold_firm(i, firm, planned, w):  # type: ignore[no-untyped-def]
    """Where hardly anything is asked of cable i let its direction be the formation's: what a slack cable does to it is not a motion.

    Returns what is asked of it along that direction.
    """
    o = 3 * i
    size = math.sqrt(planned[o] ** 2 + planned[o + 1] ** 2 + planned[o + 2] ** 2)
    x, y, z = planned[o] / size, planned[o + 1] / size, planned[o + 2] / size
    along = x * w[o] + y * w[o + 1] + z * w[o + 2]
    u = min(max(0.5 * (along / firm + 1.0), 0.0), 1.0)
    if u == 1.0:
        return along
    # Along it from FAINT on, across it from 0 on, and as it is from 1 on; with two derivatives.
    u3 = u * u * u
    step = u3 * (10.0 + u * (-15.0 + 6.0 * u))
    pull = firm * (FAINT + (1.0 - FAINT) * step + 2.0 * u3 * (-4.0 + u * (7.0 - 3.0 * u)))
    u = max(2.0 * u - 1.0, 0.0)
    step = u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
    w[o] = pull * x + step * (w[o] - along * x)
    w[o + 1] = pull * y + step * (w[o + 1] - along * y)
    w[o + 2] = pull * z + step * (w[o + 2] - along * z)
    return along


@aside
def plan_pulls(n, formation, reference, attitude, rates, learned, dt, keep, params, memory):  # type: ignore[no-untyped-def]
    """Fill the nominal pulls (n, 3, 3), the last in the memory, of the load as told and ``learned`` (10,); ``keep`` is what a filter keeps of the second derivative."""
    count = 3 * n
    share, levers = formation.reshape(count), params[N.rows : N.rows + count]
    w, ends = memory[1 : 1 + count], memory[1 + count : 1 + 2 * count]
    qw, qx, qy, qz = attitude[0], attitude[1], attitude[2], attitude[3]
    Omega = (rates[0, 0], rates[0, 1], rates[0, 2])
    turning = (rates[1, 0], rates[1, 1], rates[1, 2])
    J, m = N.J, params[N.m]
    c = (params[N.centre], params[N.centre + 1], params[N.centre + 2])
    gyration = cross(Omega, matrix_times(J, params, Omega))
    M = matrix_times(J, params, turning)
    u = quaternion.into_body(
        qw, qx, qy, qz, reference[2, 0], reference[2, 1], reference[2, 2] + params[N.g]
    )
    more, moment = inertial.needed(learned, Omega, turning, u)
    lever = cross(c, more)
    mx, my, mz = quaternion.into_world(
        qw, qx, qy, qz,
        M[0] + gyration[0] + moment[0] - lever[0],
        M[1] + gyration[1] + moment[1] - lever[1],
        M[2] + gyration[2] + moment[2] - lever[2],
    )  # fmt: skip
    bend, twist = cross(Omega, cross(Omega, c)), cross(turning, c)
    ax, ay, az = quaternion.into_world(
        qw, qx, qy, qz, bend[0] + twist[0], bend[1] + twist[1], bend[2] + twist[2]
    )
    px, py, pz = quaternion.into_world(qw, qx, qy, qz, more[0], more[1], more[2])
    fx, fy = m * (reference[2, 0] + ax) + px, m * (reference[2, 1] + ay) + py
    fz = max(m * (reference[2, 2] + az + params[N.g]) + pz, 0.1 * m * params[N.g])
    W = max(math.sqrt(fx * fx + fy * fy + fz * fz), 1e-9)
    wrench.turned(qw, qx, qy, qz, n, levers, ends)
    cos_yaw, sin_yaw = wrench.heading(qw, qx, qy, qz)
    wrench.planned(n, fx, fy, fz, W, cos_yaw, sin_yaw, share, w)
    planned, taut = memory[1 + 2 * count : 1 + 3 * count], memory[1 + 3 * count :]
    for k in range(count):
        planned[k] = w[k]
    o = N.axis
    ax, ay, az = quaternion.into_world(qw, qx, qy, qz, params[o], params[o + 1], params[o + 2])
    ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, w)
    wrench.correct(n, params[N.kind], ax, ay, az, ux, uy, uz, vx, vy, vz, ends, w)
    for i in range(n):
        taut[i] = n / W * _hold_firm(i, FIRM * W / n, planned, w)
    calls = memory[0]
    memory[0] = min(calls + 1.0, 3.0)
    for i in range(n):
        o, f = 1 + 4 * count + n + 9 * i, 1 + 3 * count + n + 3 * i
        for k in range(3):
            # Differences are those in the middle of a period, or at its begin: they are led to its end.
            past = memory[o + 3 + k] - 0.5 * dt * memory[o + 6 + k]
            rate = 0.0 if calls < 1.0 else (w[3 * i + k] - memory[o + k]) / dt
            bend_k = 0.0 if calls < 2.0 else (rate - past) / dt
            before = memory[f + k]
            memory[f + k] = keep * before + (1.0 - keep) * bend_k
            memory[o + 6 + k] = memory[f + k] + LATE * (memory[f + k] - before)
            memory[o + 3 + k] = rate + 0.5 * dt * memory[o + 6 + k]
            memory[o + k] = w[3 * i + k]


@aside
def keep_courses(n, state, memory, first, width):  # type: ignore[no-untyped-def]
    """After the team has changed: let the cables go on from where they are led, and the correction to a new plan fade.

    The directions, with rates, that are led stand ``width`` apart from ``first`` on, as :func:`colift.control.position_control._cable.lead` keeps them.
    """
    pulls = state[state.shape[0] - 9 * n :].reshape(n, 3, 3)
    for i in range(n):
        o = first + width * i
        T, T1, T2 = size_of(i, pulls)
        for k in range(3):
            direction, rate, _ = course_of(i, k, pulls, T, T1, T2)
            memory[o + FOLLOW + k] = memory[o + k] - direction
            memory[o + FOLLOW + 3 + k] = memory[o + 3 + k] - rate
