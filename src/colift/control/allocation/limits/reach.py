"""Forces that no allocator could have given: a proof that trusts no solver.

Within one cycle cable i may pull with ``T alpha``, ``T_min <= T <= T_max``, where ``alpha`` lies within the
turn of its last direction and within the cone about the vertical. The sum of these sets contains
every force that the team can give. A plane that parts it from the wanted force is a proof that the
force is out of reach; pairs of cables are left out, they could only make the set smaller.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.kernel.jit import f8, inline, kernel, matrix, tensor, vector, void
from colift.team.geometry import Array

STEPS = 100
"""Most planes that are tried."""
PROOF = 1e-9
"""Distance between force and set, N, from which on a plane counts as a proof."""


@inline
def farthest(dx, dy, dz, ax, ay, az, turn, cone, best):  # type: ignore[no-untyped-def]
    """Farthest direction along the unit ``d`` within ``turn`` of ``a`` and ``cone`` of the vertical.

    It is ``d`` itself, the nearest point of one rim, or a corner where the rims cross. Into ``best``;
    how far is returned.
    """
    c_turn, c_cone = math.cos(turn), math.cos(cone)
    value = -2.0
    for trial in range(4):
        if trial == 0:
            c = dx * ax + dy * ay + dz * az
            x, y, z = dx - c * ax, dy - c * ay, dz - c * az
            size = max(math.sqrt(x * x + y * y + z * z), 1e-300)
            k = math.sin(turn) / size
            x, y, z = c_turn * ax + k * x, c_turn * ay + k * y, c_turn * az + k * z
            if c >= c_turn:
                x, y, z = dx, dy, dz
        elif trial == 1:
            c = -dz
            size = max(math.sqrt(dx * dx + dy * dy), 1e-300)
            k = math.sin(cone) / size
            x, y, z = k * dx, k * dy, -c_cone
            if c >= c_cone:
                x, y, z = dx, dy, dz
        else:
            square = 1.0 - az * az
            if square < 1e-16:
                continue
            a = (c_turn + az * c_cone) / square
            b = (c_cone + az * c_turn) / square
            x, y, z = a * ax, a * ay, a * az - b
            height = (1.0 - x * x - y * y - z * z) / square
            if height < 0.0:
                continue
            height = math.sqrt(height) * (1.0 if trial == 2 else -1.0)
            x -= height * ay
            y += height * ax
        if x * ax + y * ay + z * az >= c_turn - 1e-12 and -z >= c_cone - 1e-12:
            far = dx * x + dy * y + dz * z
            if far > value:
                value = far
                best[0], best[1], best[2] = x, y, z
    return value


@inline
def _nearest_of(count, points, weights, gram):  # type: ignore[no-untyped-def]
    """Nearest point to the origin of the hull of at most four ``points``, as ``weights``; its square.

    Every face is tried: the nearest point of its plane, where that lies within the face.
    """
    nearest = math.inf
    for face in range(1, 1 << count):
        first = -1
        m = 0
        # Unknown weights b of the face's other corners: Gram matrix of the edges, right side last.
        for i in range(count):
            if not face >> i & 1:
                continue
            if first < 0:
                first = i
                continue
            column = 0
            for j in range(first + 1, count):
                if face >> j & 1:
                    value = 0.0
                    for k in range(3):
                        edge = points[i, k] - points[first, k]
                        value += edge * (points[j, k] - points[first, k])
                    gram[m, column] = value
                    column += 1
            value = 0.0
            for k in range(3):
                value -= (points[i, k] - points[first, k]) * points[first, k]
            gram[m, 3] = value
            m += 1
        flat = False
        for c in range(m):
            if gram[c, c] < 1e-14:
                flat = True
                break
            for r in range(m):
                if r != c:
                    f = gram[r, c] / gram[c, c]
                    for k in range(c, m):
                        gram[r, k] -= f * gram[c, k]
                    gram[r, 3] -= f * gram[c, 3]
        if flat:
            continue
        rest = 1.0
        inside = True
        for c in range(m):
            b = gram[c, 3] / gram[c, c]
            gram[c, 3] = b
            rest -= b
            inside = inside and b >= 0.0
        if not inside or rest < 0.0:
            continue
        square = 0.0
        for k in range(3):
            value = rest * points[first, k]
            c = 0
            for i in range(first + 1, count):
                if face >> i & 1:
                    value += gram[c, 3] * points[i, k]
                    c += 1
            square += value * value
        if square < nearest:
            nearest = square
            c = 0
            for i in range(count):
                weights[i] = 0.0
                if i == first:
                    weights[i] = rest
                elif face >> i & 1:
                    weights[i] = gram[c, 3]
                    c += 1
    return nearest


@kernel(void(matrix, tensor, vector, vector, f8, f8, vector, matrix, matrix, vector))
def _prove(  # type: ignore[no-untyped-def]
    forces, last, t_min, t_max, turn, cone, weights, points, gram, proved
):
    """See :func:`out_of_reach`; ``weights`` (4,), ``points`` (5, 3), ``gram`` (3, 4): room to work in."""
    n = last.shape[1]
    for k in range(forces.shape[0]):
        proved[k] = 0.0
        # The set is moved so that the wanted sum of the cables' forces is the origin.
        x, y, z = forces[k, 0], forces[k, 1], forces[k, 2]
        for i in range(n):
            x += t_min[i] * last[k, i, 0]
            y += t_min[i] * last[k, i, 1]
            z += t_min[i] * last[k, i, 2]
        points[0, 0], points[0, 1], points[0, 2] = x, y, z
        count = 1
        for _ in range(STEPS):
            size = math.sqrt(x * x + y * y + z * z)
            if size <= PROOF:
                break
            dx, dy, dz = -x / size, -y / size, -z / size
            for m in range(3):
                points[count, m] = forces[k, m]
            reach = 0.0
            for i in range(n):
                far = farthest(
                    dx, dy, dz, last[k, i, 0], last[k, i, 1], last[k, i, 2], turn, cone, gram[0]
                )
                share = t_max[i] if far > 0.0 else t_min[i]
                for m in range(3):
                    points[count, m] += share * gram[0, m]
            for m in range(3):
                reach += points[count, m] * (dx if m == 0 else dy if m == 1 else dz)
            if reach < -PROOF:
                proved[k] = 1.0
                break
            count += 1
            nearest = _nearest_of(count, points, weights, gram)
            if not nearest < size * size:
                break
            kept = 0
            x = y = z = 0.0
            for i in range(count):
                if weights[i] > 0.0:
                    weights[kept] = weights[i]
                    for m in range(3):
                        points[kept, m] = points[i, m]
                    x += weights[kept] * points[kept, 0]
                    y += weights[kept] * points[kept, 1]
                    z += weights[kept] * points[kept, 2]
                    kept += 1
            count = kept
            if count == 4:  # a tetrahedron around the origin: within reach
                break


def out_of_reach(
    forces: Array, last: Array, t_min: Array, t_max: Array, turn: float, cone: float
) -> NDArray[np.bool_]:
    """Which wanted forces are proved to be out of reach within one cycle; ``False`` proves nothing.

    Parameters
    ----------
    forces : (k, 3) array
        Wanted forces on the load, N, world frame.
    last : (k, n, 3) array
        Directions before the cycle, unit vectors from drone to load, within the cone.
    t_min, t_max : (n,) array
        Limits of the tensions, N.
    turn, cone : float
        Largest turn within the cycle, and half-angle of the cone about the vertical, rad.

    Notes
    -----
    The distance of a point from a convex set that is known by its support function: Gilbert (SIAM J.
    Control 4, 1966), with the corners kept as Gilbert, Johnson and Keerthi (IEEE J. Robot. Autom. 4,
    1988) do.

    """
    F, a, low, high = (np.ascontiguousarray(x, dtype=float) for x in (forces, last, t_min, t_max))
    proved = np.zeros(len(F))
    _prove(F, a, low, high, turn, cone, np.zeros(4), np.zeros((5, 3)), np.zeros((3, 4)), proved)
    return proved > 0.0
