"""From a wanted thrust vector to thrust, zero-yaw attitude and body rate (paper eqs. 9 and 10)."""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math import quaternion
from colift.kernel.rounding import NO_THRUST

AIM = 6
"""Numbers that :func:`aim` remembers of a drone."""
AIM_ALONG = 9
"""And :func:`aim_along`."""


@inline
def aim(i, fresh, dt, keep, u, norm, memory, o, thrusts, attitudes, rates):  # type: ignore[no-untyped-def]
    """Commands of drone i for the thrust vector ``u[i]`` of length ``norm``.

    ``memory[o : o + 6]`` holds the last thrust direction and its filtered rate; ``keep`` is the share of
    the old rate that the filter keeps.
    """
    thrusts[i] = norm
    if norm > NO_THRUST:
        hx, hy, hz = u[i, 0] / norm, u[i, 1] / norm, u[i, 2] / norm
    else:
        hx, hy, hz = 0.0, 0.0, 1.0
    if fresh:
        memory[o] = hx
        memory[o + 1] = hy
        memory[o + 2] = hz
    dx = (1.0 - keep) * (hx - memory[o]) / dt + keep * memory[o + 3]
    dy = (1.0 - keep) * (hy - memory[o + 1]) / dt + keep * memory[o + 4]
    dz = (1.0 - keep) * (hz - memory[o + 2]) / dt + keep * memory[o + 5]
    memory[o] = hx
    memory[o + 1] = hy
    memory[o + 2] = hz
    memory[o + 3] = dx
    memory[o + 4] = dy
    memory[o + 5] = dz
    _command(i, hx, hy, hz, dx, dy, dz, attitudes, rates)


@inline
def aim_along(i, fresh, dt, keep, planned, u, norm, memory, o, thrusts, attitudes, rates):  # type: ignore[no-untyped-def]
    """The same where a part of the thrust vector, ``planned`` (3,), is free of noise: its turning is not filtered.

    ``memory[o : o + 9]`` holds the last planned direction, then the last difference from it and its filtered rate.
    """
    thrusts[i] = norm
    hx, hy, hz = _unit(u[i, 0], u[i, 1], u[i, 2])
    px, py, pz = _unit(planned[0], planned[1], planned[2])
    h, p = (hx, hy, hz), (px, py, pz)
    for k in range(3):
        if fresh:
            memory[o + k] = p[k]
            memory[o + 3 + k] = h[k] - p[k]
        step = (h[k] - p[k] - memory[o + 3 + k]) / dt
        memory[o + 6 + k] = (1.0 - keep) * step + keep * memory[o + 6 + k]
        memory[o + 3 + k] = h[k] - p[k]
    dx = memory[o + 6] + (px - memory[o]) / dt
    dy = memory[o + 7] + (py - memory[o + 1]) / dt
    dz = memory[o + 8] + (pz - memory[o + 2]) / dt
    memory[o], memory[o + 1], memory[o + 2] = px, py, pz
    _command(i, hx, hy, hz, dx, dy, dz, attitudes, rates)


@inline
def limit(i, u, least, most, tangent):  # type: ignore[no-untyped-def]
    """Clip a wanted thrust vector to what the drone can give; height goes before place."""
    u[i, 2] = min(max(u[i, 2], least), most)
    across = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1])
    room = min(tangent * u[i, 2], math.sqrt(max(most * most - u[i, 2] * u[i, 2], 0.0)))
    if across > room:
        u[i, 0] *= room / across
        u[i, 1] *= room / across


@inline
def _unit(x, y, z):  # type: ignore[no-untyped-def]
    norm = math.sqrt(x * x + y * y + z * z)
    return (x / norm, y / norm, z / norm) if norm > NO_THRUST else (0.0, 0.0, 1.0)


@inline
def _command(i, hx, hy, hz, dx, dy, dz, attitudes, rates):  # type: ignore[no-untyped-def]
    """Attitude and rate of drone i for a thrust direction and its derivative."""
    qw, qx, qy, qz = quaternion.from_thrust_direction(hx, hy, hz)
    attitudes[i, 0] = qw
    attitudes[i, 1] = qx
    attitudes[i, 2] = qy
    attitudes[i, 3] = qz
    # Omega_id = 2 Im(q* qdot), with qdot from the rate of the thrust direction.
    root = 2.0 * qw
    if root < 1e-3:
        rates[i, 0] = 0.0
        rates[i, 1] = 0.0
        rates[i, 2] = 0.0
    else:
        stretch = dz / root
        w_dot = 0.5 * stretch
        x_dot = -dy / root + hy * stretch / (root * root)
        y_dot = dx / root - hx * stretch / (root * root)
        _, ox, oy, oz = quaternion.multiply(qw, -qx, -qy, 0.0, w_dot, x_dot, y_dot, 0.0)
        rates[i, 0] = 2.0 * ox
        rates[i, 1] = 2.0 * oy
        rates[i, 2] = 2.0 * oz


AHEAD = 15
"""Numbers that :func:`look_ahead` remembers of a drone."""


@inline
def look_ahead(i, fresh, dt, keep, lag, smooth, p, memory, o, attitudes, rates, turning):  # type: ignore[no-untyped-def]
    """What the thrust vector ``p`` (3,) that is planned of drone i, free of any feedback, will be while a command acts.

    By half a period and ``lag`` the size of the thrust is led, which is returned: it is held for a period. Its direction is not, for attitudes follow the wanted rate in
    between. Its angular acceleration, body frame, is put into ``turning[i]``: with ``p = s b``, ``b'' = (p'' - s'' b - 2 s' b') / s`` and, about the
    body's axis ``b``, ``b'' = alpha x b + omega x (omega x b)``. Where the plan is not ``smooth`` (1 or 0), as it follows answers that are held, only ``p''`` counts, as
    late as it is known: products and extrapolations of its steps disturb more than they tell. ``memory[o : o + 15]`` holds the last planned vector, its last differences, the second of them filtered, and
    both derivatives as they will be.
    """
    q = attitudes[i]
    size = math.sqrt(max(p[0] * p[0] + p[1] * p[1] + p[2] * p[2], 1e-12))
    half, late = 0.5 * dt, smooth * (1.5 + keep / (1.0 - keep))
    stretch = 0.0
    for k in range(3):
        rate = 0.0 if fresh else (p[k] - memory[o + k]) / dt
        bend = 0.0 if fresh else (rate - memory[o + 3 + k]) / dt
        change = (1.0 - keep) * (bend - memory[o + 6 + k])
        memory[o + k], memory[o + 3 + k] = p[k], rate
        memory[o + 6 + k] += change
        # A difference is that of the middle of the last period.
        memory[o + 9 + k] = rate + half * memory[o + 6 + k]
        # The second is a period old, more by the filter, and held for a period.
        memory[o + 12 + k] = memory[o + 6 + k] + late * change
        stretch += memory[o + 9 + k] * p[k] / size
    bx, by, _ = quaternion.into_body(
        q[0], q[1], q[2], q[3],
        memory[o + 9] - stretch * p[0] / size, memory[o + 10] - stretch * p[1] / size, memory[o + 11] - stretch * p[2] / size,
    )  # fmt: skip
    x, y, _ = quaternion.into_body(
        q[0], q[1], q[2], q[3], memory[o + 12], memory[o + 13], memory[o + 14]
    )
    twice, spin = smooth * 2.0 * stretch / size, smooth * rates[i, 2]
    turning[i, 0] = (twice * by - y + spin * bx) / size
    turning[i, 1] = (x - twice * bx + spin * by) / size
    turning[i, 2] = 0.0
    return (lag + half) * stretch
