"""The frame in which drones agree: it turns with the force that the plan asks for, so that a manoeuvre moves nothing in it.

All know the plan; by how much two drones' frames differ is the plan's rate of turn times the difference of their clocks.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline

LEVEL = 0.1
"""Least upward part of its axis: a plan that lets the load fall turns it no further."""


@inline
def follow_plan(memory, up, x, y, z, most):  # type: ignore[no-untyped-def]
    """Turn the axis at place ``up`` towards the planned force by ``most`` (rad) at most."""
    z = max(z, LEVEL * math.sqrt(x * x + y * y + z * z))
    norm = math.sqrt(x * x + y * y + z * z)
    if not (norm > 1e-9 and math.isfinite(norm)):
        return
    turn_to(memory, up, x / norm, y / norm, z / norm, most)


@inline
def turn_to(memory, a, x, y, z, most):  # type: ignore[no-untyped-def]
    """Turn the unit vector at place ``a`` towards the unit vector (x, y, z) by ``most`` (rad) at most."""
    c = memory[a] * x + memory[a + 1] * y + memory[a + 2] * z
    tx, ty, tz = x - c * memory[a], y - c * memory[a + 1], z - c * memory[a + 2]
    s = math.sqrt(tx * tx + ty * ty + tz * tz)
    if s < 1e-12:
        return
    angle = min(math.atan2(s, c), most)
    cosine, sine = math.cos(angle), math.sin(angle) / s
    x, y, z = (
        cosine * memory[a] + sine * tx,
        cosine * memory[a + 1] + sine * ty,
        cosine * memory[a + 2] + sine * tz,
    )
    norm = 1.0 / math.sqrt(x * x + y * y + z * z)
    memory[a], memory[a + 1], memory[a + 2] = x * norm, y * norm, z * norm


@inline
def to_world(memory, up, x, y, z):  # type: ignore[no-untyped-def]
    """A vector of the frame in the world: turned on the shortest way from the vertical to the axis at place ``up``."""
    return _turn(memory[up], memory[up + 1], memory[up + 2], x, y, z)


@inline
def to_frame(memory, up, x, y, z):  # type: ignore[no-untyped-def]
    """A vector of the world in the frame."""
    return _turn(-memory[up], -memory[up + 1], memory[up + 2], x, y, z)


@inline
def _turn(p, q, r, x, y, z):  # type: ignore[no-untyped-def]
    # R v = v + w x v + w x (w x v) / (1 + r) with w = e3 x u = (-q, p, 0)
    cx, cy, cz = p * z, q * z, -q * y - p * x
    share = 1.0 / (1.0 + r)
    return x + cx + share * p * cz, y + cy + share * q * cz, z + cz - share * (q * cy + p * cx)
