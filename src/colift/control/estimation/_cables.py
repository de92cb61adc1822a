"""Where the load hangs, from the drones and the lengths of their cables alone."""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math.small import solve_symmetric

_TRUST = 1e-3
"""Weight of the guess beside that of one cable: what three cables determine is not touched by it."""


@inline
def load_from_drones(n, drones, width, memory, lengths, apart, params, reeled, found, guess):  # type: ignore[no-untyped-def]
    """Position and velocity of the load that fit taut cables best (least squares); ``guess`` fills gaps.

    Drone i's position and velocity stand at ``memory[drones + width * i]``, its cable's length at
    ``params[lengths + apart * i]``, to which ``reeled`` and ``found`` add. Two Gauss-Newton steps on ``|p - x_i| = L_i``; then
    ``alpha_i . (v - v_i) = L_i'``, which rigid cables impose.
    """
    px, py, pz, vx, vy, vz = guess
    for sweep in range(3):
        xx = yy = zz = _TRUST
        xy = xz = yz = bx = by = bz = 0.0
        for i in range(n):
            o = drones + width * i
            ax, ay, az = px - memory[o], py - memory[o + 1], pz - memory[o + 2]
            d = math.sqrt(ax * ax + ay * ay + az * az)
            scale = 1.0 / max(d, 1e-6)
            ax, ay, az = ax * scale, ay * scale, az * scale
            if sweep < 2:
                r = params[lengths + apart * i] + reeled[i, 0] + found[i] - d
            else:
                r = (
                    ax * (memory[o + 3] - vx)
                    + ay * (memory[o + 4] - vy)
                    + az * (memory[o + 5] - vz)
                    + reeled[i, 1]
                )
            xx, yy, zz = xx + ax * ax, yy + ay * ay, zz + az * az
            xy, xz, yz = xy + ax * ay, xz + ax * az, yz + ay * az
            bx, by, bz = bx + ax * r, by + ay * r, bz + az * r
        sx, sy, sz = solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz)
        if sweep < 2:
            px, py, pz = px + sx, py + sy, pz + sz
        else:
            vx, vy, vz = vx + sx, vy + sy, vz + sz
    return px, py, pz, vx, vy, vz
