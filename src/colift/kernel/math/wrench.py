"""Cable forces on a rigid load, in closed form: where its ends are, a plan turned with the force, the correction of least norm.

About the ends' mean ``c`` force and moment part: with ``s_i = r_i - c`` the forces of least norm that add up to ``f`` and turn by
``m`` about ``c`` are ``f / n + (J^-1 m) x s_i``, where ``J = sum |s_i|^2 I - s_i s_i^T``. Ends in one line leave ``J`` singular along
it, and ends in one point altogether: moments that no cable force makes are left out. With a moment ``M`` about the centre of mass,
``m = M - c x f``.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math import quaternion
from colift.kernel.math.small import solve_symmetric
from colift.kernel.spans import BODY, LINE, POINT


@inline
def unit_attitude(attitude):  # type: ignore[no-untyped-def]
    """The quaternion at length one, and whether it is one at all."""
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    size = w * w + x * x + y * y + z * z
    if not (size > 1e-12 and size < 1e12):
        return False, 1.0, 0.0, 0.0, 0.0
    scale = 1.0 / math.sqrt(size)
    return True, w * scale, x * scale, y * scale, z * scale


@inline
def heading(w, x, y, z):  # type: ignore[no-untyped-def]
    """Cosine and sine of the turn about the vertical that an attitude contains (its twist)."""
    size = w * w + z * z
    if size < 1e-12:
        return 1.0, 0.0
    return (w * w - z * z) / size, 2.0 * w * z / size


@inline
def yawed(n, cos_yaw, sin_yaw, vectors):  # type: ignore[no-untyped-def]
    """Turn n vectors (3 n) about the vertical, in place."""
    for i in range(n):
        x, y = vectors[3 * i], vectors[3 * i + 1]
        vectors[3 * i] = cos_yaw * x - sin_yaw * y
        vectors[3 * i + 1] = sin_yaw * x + cos_yaw * y


@inline
def turned(w, x, y, z, n, vectors, out):  # type: ignore[no-untyped-def]
    """Of n vectors (3 n) in the load's frame those in the world."""
    xx, xy, xz = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    yx, yy, yz = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    zx, zy, zz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    for i in range(n):
        a, b, c = vectors[3 * i], vectors[3 * i + 1], vectors[3 * i + 2]
        out[3 * i] = xx * a + xy * b + xz * c
        out[3 * i + 1] = yx * a + yy * b + yz * c
        out[3 * i + 2] = zx * a + zy * b + zz * c


@inline
def planned(n, fx, fy, fz, W, cos_yaw, sin_yaw, plan, out):  # type: ignore[no-untyped-def]
    """A plan (3 n) for a unit upward force, turned to the heading and then with the force ``(fx, fy, fz)`` of size W."""
    w, x, y, z = quaternion.from_thrust_direction(fx / W, fy / W, fz / W)
    half = math.sqrt(max(0.5 * (1.0 + cos_yaw), 0.0))
    other = math.copysign(math.sqrt(max(0.5 * (1.0 - cos_yaw), 0.0)), sin_yaw)
    w, x, y, z = quaternion.multiply(w, x, y, z, half, 0.0, 0.0, other)
    turned(w, x, y, z, n, plan, out)
    for k in range(3 * n):
        out[k] *= W


@inline
def unmet(n, fx, fy, fz, mx, my, mz, ends, w):  # type: ignore[no-untyped-def]
    """What cable forces ``w`` at ``ends`` leave of ``sum w = -F``, ``sum r x w = -M``: six numbers, zero in balance."""
    for i in range(n):
        rx, ry, rz = ends[3 * i], ends[3 * i + 1], ends[3 * i + 2]
        x, y, z = w[3 * i], w[3 * i + 1], w[3 * i + 2]
        fx += x
        fy += y
        fz += z
        mx += ry * z - rz * y
        my += rz * x - rx * z
        mz += rx * y - ry * x
    return fx, fy, fz, mx, my, mz


@inline
def middle(n, ends):  # type: ignore[no-untyped-def]
    """Mean of the ends."""
    cx = cy = cz = 0.0
    for i in range(n):
        cx += ends[3 * i]
        cy += ends[3 * i + 1]
        cz += ends[3 * i + 2]
    scale = 1.0 / n
    return cx * scale, cy * scale, cz * scale


@inline
def possible(n, kind, ax, ay, az, fx, fy, fz, mx, my, mz, ends):  # type: ignore[no-untyped-def]
    """The moment nearest to ``(mx, my, mz)`` that ends in a point or along the unit ``a`` can make beside the force."""
    if kind == BODY:
        return mx, my, mz
    cx, cy, cz = middle(n, ends)
    px, py, pz = cy * fz - cz * fy, cz * fx - cx * fz, cx * fy - cy * fx
    if kind == POINT:
        return px, py, pz
    along = (mx - px) * ax + (my - py) * ay + (mz - pz) * az
    return mx - along * ax, my - along * ay, mz - along * az


@inline
def correct(n, kind, ax, ay, az, fx, fy, fz, mx, my, mz, ends, w):  # type: ignore[no-untyped-def]
    """Take from ``w`` the forces of least norm that make the wrench: what :func:`unmet` says becomes zero."""
    cx, cy, cz = middle(n, ends)
    mx -= cy * fz - cz * fy
    my -= cz * fx - cx * fz
    mz -= cx * fy - cy * fx
    scale = 1.0 / n
    fx, fy, fz = fx * scale, fy * scale, fz * scale
    tx = ty = tz = 0.0
    if kind != POINT:
        xx = xy = xz = yy = yz = zz = 0.0
        for i in range(n):
            x, y, z = ends[3 * i] - cx, ends[3 * i + 1] - cy, ends[3 * i + 2] - cz
            xx += y * y + z * z
            yy += x * x + z * z
            zz += x * x + y * y
            xy -= x * y
            xz -= x * z
            yz -= y * z
        if kind == LINE:
            along = mx * ax + my * ay + mz * az
            mx, my, mz = mx - along * ax, my - along * ay, mz - along * az
            more = xx + yy + zz
            xx += more * ax * ax
            yy += more * ay * ay
            zz += more * az * az
            xy += more * ax * ay
            xz += more * ax * az
            yz += more * ay * az
        tx, ty, tz = solve_symmetric(xx, xy, xz, yy, yz, zz, mx, my, mz)
    for i in range(n):
        x, y, z = ends[3 * i] - cx, ends[3 * i + 1] - cy, ends[3 * i + 2] - cz
        w[3 * i] -= fx + ty * z - tz * y
        w[3 * i + 1] -= fy + tz * x - tx * z
        w[3 * i + 2] -= fz + tx * y - ty * x
