"""What drones and load feel, from measurements alone."""

from __future__ import annotations

import math

from colift.control.supervision._lift_memory import M, P
from colift.kernel.jit import inline
from colift.kernel.math import rotors
from colift.kernel.math.small import solve_symmetric
from colift.kernel.math.smooth import decay

USUAL = 0.5
"""Time constant of what counts as usual in flight, s."""
LITTLE = 0.05
"""Weight, over that of one drone, of what was felt before: along a single cable nobody feels the air."""


@inline
def span_of(i, sees):  # type: ignore[no-untyped-def]
    """Distance from drone i to its cable's end, m, and the direction there."""
    x = sees.estimated_ends[i, 0, 0] - sees.estimated_positions[i, 0]
    y = sees.estimated_ends[i, 0, 1] - sees.estimated_positions[i, 1]
    z = sees.estimated_ends[i, 0, 2] - sees.estimated_positions[i, 2]
    size = math.sqrt(max(x * x + y * y + z * z, 1e-12))
    return size, (x / size, y / size, z / size)


@inline
def arm_of(i, k, sees):  # type: ignore[no-untyped-def]
    """Along axis k, how far from the load's place cable i ends on it, m; nothing on a point."""
    return sees.estimated_ends[i, 0, k] - sees.estimated_load[0, k]


@inline
def length(i, sees, params):  # type: ignore[no-untyped-def]
    """Length of cable i as it is wound out and has been found in flight, m: that from which spans are counted."""
    return params[P.rows + P.width * i + P.L] + sees.reeled[i, 0] + sees.found_lengths[i]


@inline
def feel(sees, params, memory, dt):  # type: ignore[no-untyped-def]
    """Observers: what drones feel beyond thrust, drag and weight, the air's part of it, and the vertical force on the whole."""
    x, v, q = sees.estimated_positions, sees.estimated_velocities, sees.estimated_attitudes
    Omega, thrusts, load = sees.estimated_rates, sees.thrusts, sees.estimated_load
    g, w, delay = params[P.g], params[P.feel], params[P.delay]
    keep = decay(dt, params[P.lag])
    fresh = memory[M.started] == 0.0
    upward, carried = 0.0, params[P.m_L] * load[1, 2]
    for i in range(x.shape[0]):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        m = params[p + P.m]
        carried += m * v[i, 2]
        if fresh:
            memory[o + M.thrust] = thrusts[i]
            for k in range(3):
                memory[o + M.own + k] = m * v[i, k]
        thrust = keep * memory[o + M.thrust] + (1.0 - keep) * thrusts[i]
        memory[o + M.thrust] = thrust
        force = rotors.force_of(
            i, thrust, q, Omega, delay, params[p + P.drag], sees.estimated_wind, v
        )
        for k in range(3):
            known = force[k] - (m * g if k == 2 else 0.0)
            memory[o + M.own + k] += dt * (known + memory[o + M.felt + k])
            memory[o + M.felt + k] = w * (m * v[i, k] - memory[o + M.own + k])
            if k == 2:
                upward += known
    if fresh:
        memory[M.momentum] = carried
    memory[M.momentum] += dt * (upward - params[P.m_L] * g + memory[M.normal])
    memory[M.normal] = w * (carried - memory[M.momentum])
    # Across its cable a drone feels no tension: by least squares, the force per mass that is common to all.
    xx = yy = zz = LITTLE
    xy = xz = yz = 0.0
    bx, by, bz = LITTLE * memory[M.calm], LITTLE * memory[M.calm + 1], LITTLE * memory[M.calm + 2]
    for i in range(x.shape[0]):
        m, d = params[P.rows + P.width * i + P.m], M.rows + M.width * i + M.felt
        _, (ax, ay, az) = span_of(i, sees)
        dx, dy, dz = memory[d] / m, memory[d + 1] / m, memory[d + 2] / m
        along = ax * dx + ay * dy + az * dz
        xx, yy, zz = xx + 1.0 - ax * ax, yy + 1.0 - ay * ay, zz + 1.0 - az * az
        xy, xz, yz = xy - ax * ay, xz - ax * az, yz - ay * az
        bx, by, bz = bx + dx - along * ax, by + dy - along * ay, bz + dz - along * az
    air = solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz)
    for k in range(3):
        memory[M.air + k] = air[k]


@inline
def alone(i, k, params, memory):  # type: ignore[no-untyped-def]
    """Force on drone i along axis k without its cable's: what it felt in the mean, and by what the air has changed since."""
    m = params[P.rows + P.width * i + P.m]
    return memory[M.rows + M.width * i + M.mean + k] + m * (memory[M.air + k] - memory[M.calm + k])


@inline
def hold_out(i, dt, params, memory):  # type: ignore[no-untyped-def]
    """Make up for the force on drone i without its cable's, not so fast that the noise of it moves the drone."""
    follow, o = 1.0 - decay(dt, 1.0 / params[P.learn]), M.rows + M.width * i + M.bias
    for k in range(3):
        memory[o + k] += follow * (alone(i, k, params, memory) - memory[o + k])


@inline
def forget(i, sees, params, memory):  # type: ignore[no-untyped-def]
    """Begin to feel drone i anew, without the ground."""
    p, o = P.rows + P.width * i, M.rows + M.width * i
    for k in range(3):
        memory[o + M.felt + k] = 0.0
        memory[o + M.own + k] = params[p + P.m] * sees.estimated_velocities[i, k]


@inline
def make_up(i, rate, memory):  # type: ignore[no-untyped-def]
    """What is made up for follows what is felt, by this share."""
    o = M.rows + M.width * i
    for k in range(3):
        memory[o + M.bias + k] += rate * (memory[o + M.felt + k] - memory[o + M.bias + k])


@inline
def pull(i, sees, params, memory):  # type: ignore[no-untyped-def]
    """Length of cable i's span and the tension that its drone feels."""
    o = M.rows + M.width * i
    size, along = span_of(i, sees)
    tension = 0.0
    for k in range(3):
        tension += along[k] * (memory[o + M.felt + k] - alone(i, k, params, memory))
    return size, tension


@inline
def usual(dt, sees, memory):  # type: ignore[no-untyped-def]
    """What is usual in flight: the force on the whole, with its spread, and the forces on the drones and the load."""
    follow = 1.0 - decay(dt, USUAL)
    off = memory[M.normal] - memory[M.normal_mean]
    memory[M.normal_mean] += follow * off
    memory[M.normal_spread] += follow * (off * off - memory[M.normal_spread])
    n = sees.estimated_positions.shape[0]
    for i in range(n):
        o = M.rows + M.width * i + M.mean
        for k in range(3):
            memory[o + k] += follow * (sees.estimated_forces[i, k] - memory[o + k])
    for k in range(3):
        memory[M.held + k] += follow * (sees.estimated_forces[n, k] - memory[M.held + k])
        memory[M.calm + k] += follow * (memory[M.air + k] - memory[M.calm + k])
