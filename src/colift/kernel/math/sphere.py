"""A reference filter on the unit sphere, inside kernels."""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.rounding import NO_TURN

FOLLOW = 9
"""Numbers that :func:`follow` keeps: direction, rate, acceleration."""


@inline
def follow(memory, o, tx, ty, tz, omega, dt, reach=math.pi):  # type: ignore[no-untyped-def]
    """Move the unit direction ``memory[o:o+3]`` with rate ``memory[o+3:o+6]`` towards the unit vector t.

    Second order, critically damped with natural frequency ``omega`` (rad/s), along geodesics: the
    direction keeps unit length and the rate stays tangent by construction. ``memory[o+6:o+9]`` receives
    the acceleration, so that direction, rate and acceleration are derivatives of each other. An error beyond
    ``reach`` (rad) counts as that: the acceleration stays within ``omega^2 reach``, the rate within half of
    ``omega reach``.
    """
    ax, ay, az = memory[o], memory[o + 1], memory[o + 2]
    bx, by, bz = memory[o + 3], memory[o + 4], memory[o + 5]
    # Error: the tangent vector at a that leads to t on the shortest way, as long as the angle.
    c = ax * tx + ay * ty + az * tz
    ex, ey, ez = tx - c * ax, ty - c * ay, tz - c * az
    s = math.sqrt(ex * ex + ey * ey + ez * ez)
    scale = min(math.atan2(s, c), reach) / s if s > NO_TURN else 1.0
    gain = omega * omega * scale
    # Damping implicitly: stable for any step.
    damp = 1.0 / (1.0 + 2.0 * omega * dt)
    ux = (bx + dt * gain * ex) * damp
    uy = (by + dt * gain * ey) * damp
    uz = (bz + dt * gain * ez) * damp
    px, py, pz = (ux - bx) / dt, (uy - by) / dt, (uz - bz) / dt
    speed = math.sqrt(ux * ux + uy * uy + uz * uz)
    angle = min(speed * dt, 1.0)
    if speed > NO_TURN:
        sine, cosine = math.sin(angle), math.cos(angle)
        hx, hy, hz = ux / speed, uy / speed, uz / speed
        nx, ny, nz = cosine * ax + sine * hx, cosine * ay + sine * hy, cosine * az + sine * hz
        ux = speed * (cosine * hx - sine * ax)
        uy = speed * (cosine * hy - sine * ay)
        uz = speed * (cosine * hz - sine * az)
    else:
        nx, ny, nz = ax, ay, az
    norm = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx * norm, ny * norm, nz * norm
    along = ux * nx + uy * ny + uz * nz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    square = ux * ux + uy * uy + uz * uz
    memory[o] = nx
    memory[o + 1] = ny
    memory[o + 2] = nz
    memory[o + 3] = ux
    memory[o + 4] = uy
    memory[o + 5] = uz
    memory[o + 6] = px - square * nx
    memory[o + 7] = py - square * ny
    memory[o + 8] = pz - square * nz
