"""The paper's allocation problem on its manifold: exact Newton steps at O(n) cost.

Problem (paper eq. 14), with unit directions ``alpha_i`` from drone to load and wanted force ``F``::

    min  J = 1/2 sum T_i^2 + mu sum_{i<j} (alpha_i . alpha_j)^2
    s.t. sum T_i alpha_i = -F,   T_i >= 0,   |alpha_i| = 1

Everything below is scaled to ``|F| = 1``: ``T <- T / W``, ``mu <- mu / W^2`` with ``W = |F|``, under
which the problem is invariant.

Coordinates. A cable moves by ``(dT_i, xi_i)``, ``dalpha_i = B_i xi_i`` with ``B_i`` (3x2) a basis of the
tangent plane, so unit norms hold by construction. With ``M = sum alpha_i alpha_i^T`` the penalty
is ``mu/2 (|M|_F^2 - n)``; since ``dM`` is symmetric and traceless, its Gauss-Newton part has
rank 5 whatever n is. Let ``lam`` be the multiplier of the force balance, ``v_i = B_i^T lam``. The
tension eliminates itself, ``dT_i = -(T_i + lam+ . alpha_i + v_i . xi_i)``, and leaves per cable::

    C_i xi_i + q_i + P_i^T lam+ + G_i^T z = 0
    C_i = 2 mu (B_i^T M B_i - alpha_i^T M alpha_i I) - T_i (lam . alpha_i) I - v_i v_i^T    (2x2)
    q_i = 2 mu B_i^T M alpha_i - T_i v_i                                                 (2)
    P_i = T_i B_i - alpha_i v_i^T                                                        (3x2)
    G_i = sqrt(mu) * (orthonormal coordinates of alpha dalpha^T + dalpha alpha^T)        (5x2)

and, with ``U_i = [P_i; G_i]``, one symmetric positive definite 8x8 system for ``(lam+, z)``::

    (blkdiag(M_taut, I_5) + sum U_i C_i^-1 U_i^T) [lam+; z] = [F; 0] - sum U_i C_i^-1 q_i

Flat family. At the global optimum every ``C_i`` vanishes: the optimum is a (2n-5)-dimensional
family. ``C_i`` is therefore replaced by its absolute value, at least ``delta``, with ``delta`` proportional to
the residual (Levenberg-Marquardt under a local error bound): the iteration stays quadratic
and moves along the family as little as it can.

Feasible path. After a step, the second-order residual ``r`` of the force balance is removed in force
coordinates, ``T_i alpha_i <- T_i (alpha_i - r / sum T)``: every iterate satisfies force balance, unit norms and
``T >= 0``, so the objective itself is the merit function and any iterate is a usable command.

This file imports only the compiler front end and thresholds: it can be built for other targets.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.rounding import LEAST_DAMPING, LEVEL, SETTLED

ROW = 28
"""Workspace per cable: B (6), v (2), C^-1 q (2), C^-1 U^T (16), taut flag, spare."""

SYSTEM = 8 * 8 + 8 + 16
"""Workspace of the reduced system: matrix, right-hand side, one cable's ``U_i``."""


def workspace_size(n: int) -> int:
    """Number of float64 that :func:`solve` needs for n cables."""
    return SYSTEM + ROW * n + 4 * n + 12


DAMPING = 0.1
"""Levenberg-Marquardt factor: delta = DAMPING * residual."""

MAX_TURN = 0.7
"""Largest turn of one cable in one iteration, rad."""


@inline
def optimal_alignment(n, mu):  # type: ignore[no-untyped-def]
    """Closed-form optimum for ``|F| = 1``: ``a = F^T M* F``, the root of ``mu a^2 (3a - n) = 1``.

    For n = 2 the set of ``M`` has rank two and the law is ``4 mu a^2 (a - 1) = 1``; a <= n always
    (all cables parallel). Newton's method from the right of the root of a convex increasing
    function: it decreases monotonically.
    """
    if n == 1:
        return 1.0
    if mu * 2.0 * n * n * n <= 1.0:
        return float(n)
    lead = 3.0 if n > 2 else 4.0
    shift = float(n) if n > 2 else 4.0
    a = float(n)
    for _ in range(60):
        value = mu * a * a * (lead * a - shift) - 1.0
        slope = mu * a * (3.0 * lead * a - 2.0 * shift)
        step = value / slope
        a -= step
        if abs(step) <= SETTLED * n:
            break
    return a


@inline
def optimal_objective(n, mu):  # type: ignore[no-untyped-def]
    """Global minimum of ``J`` for ``|F| = 1`` (no bound on tensions is active there)."""
    a = optimal_alignment(n, mu)
    if n == 1:
        return 0.5
    b = 0.5 * (n - a) if n > 2 else n - a
    copies = 2.0 if n > 2 else 1.0
    return 0.5 / a + 0.5 * mu * (a * a + copies * b * b - n)


@inline
def project(n, fx, fy, fz, T, alpha):  # type: ignore[no-untyped-def]
    """Make ``(T, alpha)`` satisfy force balance and unit norms exactly, in place; ``sum T`` before.

    ``w_i = T_i alpha_i - (T_i / sum T) r`` removes the residual ``r = sum T alpha + F``; then
    ``T_i = |w_i|`` and ``alpha_i`` its direction. Cables without tension stay slack.
    """
    rx, ry, rz, total = fx, fy, fz, 0.0
    for i in range(n):
        t = T[i]
        rx += t * alpha[3 * i]
        ry += t * alpha[3 * i + 1]
        rz += t * alpha[3 * i + 2]
        total += t
    if total > 0.0:
        rx /= total
        ry /= total
        rz /= total
    for i in range(n):
        x = alpha[3 * i] - rx
        y = alpha[3 * i + 1] - ry
        z = alpha[3 * i + 2] - rz
        norm = math.sqrt(x * x + y * y + z * z)
        T[i] *= norm
        if norm == 0.0:
            continue  # nothing left of this cable's force: slack, direction kept
        inverse = 1.0 / norm
        alpha[3 * i] = x * inverse
        alpha[3 * i + 1] = y * inverse
        alpha[3 * i + 2] = z * inverse
    return total


@inline
def rotate(n, ax, ay, az, bx, by, bz, alpha, lam):  # type: ignore[no-untyped-def]
    """Turn all directions and the multiplier by the smallest rotation from unit ``a`` to unit ``b``.

    Opposite vectors have no smallest rotation: the half-turn about a horizontal axis is taken.
    """
    vx = ay * bz - az * by
    vy = az * bx - ax * bz
    vz = ax * by - ay * bx
    c = ax * bx + ay * by + az * bz
    if c < -0.9:
        # ``1 / (1 + c)`` loses its digits here. The same rotation in two parts: half a turn about
        # the unit axis u along a x b, x -> 2 u (u.x) - x, then the small rotation from -a to b.
        ux, uy, uz = vx, vy, vz
        if ux * ux + uy * uy + uz * uz < 1e-24:
            if abs(ax) < 0.9:
                ux, uy, uz = 0.0, az, -ay
            else:
                ux, uy, uz = -az, 0.0, ax
        norm = math.sqrt(ux * ux + uy * uy + uz * uz)
        ux /= norm
        uy /= norm
        uz /= norm
        for i in range(n):
            d = 2.0 * (ux * alpha[3 * i] + uy * alpha[3 * i + 1] + uz * alpha[3 * i + 2])
            alpha[3 * i] = d * ux - alpha[3 * i]
            alpha[3 * i + 1] = d * uy - alpha[3 * i + 1]
            alpha[3 * i + 2] = d * uz - alpha[3 * i + 2]
        d = 2.0 * (ux * lam[0] + uy * lam[1] + uz * lam[2])
        lam[0] = d * ux - lam[0]
        lam[1] = d * uy - lam[1]
        lam[2] = d * uz - lam[2]
        # Where a went (-a, but for the rounding of u), then on from there.
        d = 2.0 * (ux * ax + uy * ay + uz * az)
        ax = d * ux - ax
        ay = d * uy - ay
        az = d * uz - az
        vx = ay * bz - az * by
        vy = az * bx - ax * bz
        vz = ax * by - ay * bx
        c = ax * bx + ay * by + az * bz
    h = 1.0 / (1.0 + c)
    r00 = c + h * vx * vx
    r01 = h * vx * vy - vz
    r02 = h * vx * vz + vy
    r10 = h * vx * vy + vz
    r11 = c + h * vy * vy
    r12 = h * vy * vz - vx
    r20 = h * vx * vz - vy
    r21 = h * vy * vz + vx
    r22 = c + h * vz * vz
    for i in range(n):
        x = alpha[3 * i]
        y = alpha[3 * i + 1]
        z = alpha[3 * i + 2]
        alpha[3 * i] = r00 * x + r01 * y + r02 * z
        alpha[3 * i + 1] = r10 * x + r11 * y + r12 * z
        alpha[3 * i + 2] = r20 * x + r21 * y + r22 * z
    x = lam[0]
    y = lam[1]
    z = lam[2]
    lam[0] = r00 * x + r01 * y + r02 * z
    lam[1] = r10 * x + r11 * y + r12 * z
    lam[2] = r20 * x + r21 * y + r22 * z


@inline
def measure(n, mu, T, alpha, M):  # type: ignore[no-untyped-def]
    """Fill ``M`` (6: xx xy xz yy yz zz) and return the objective J."""
    xx = xy = xz = yy = yz = zz = tt = 0.0
    for i in range(n):
        x = alpha[3 * i]
        y = alpha[3 * i + 1]
        z = alpha[3 * i + 2]
        xx += x * x
        xy += x * y
        xz += x * z
        yy += y * y
        yz += y * z
        zz += z * z
        tt += T[i] * T[i]
    M[0] = xx
    M[1] = xy
    M[2] = xz
    M[3] = yy
    M[4] = yz
    M[5] = zz
    squares = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)
    return 0.5 * tt + 0.5 * mu * (squares - n)


@inline
def turning_scale(n, mu):  # type: ignore[no-untyped-def]
    """Size of the gradient across a cable, and of its curvature: ``T_i^2`` and ``mu |M|``."""
    return 1.0 / (n * n) + mu * n


@inline
def violation(x, y, z, t, l0, l1, l2, mu, M, along, across):  # type: ignore[no-untyped-def]
    """By how much one cable violates stationarity and the sign of an active bound's multiplier, squared; its multiplier is ``(l0, l1, l2)``."""
    slope_T = t + l0 * x + l1 * y + l2 * z
    px = 2.0 * mu * (M[0] * x + M[1] * y + M[2] * z) + t * l0
    py = 2.0 * mu * (M[1] * x + M[3] * y + M[4] * z) + t * l1
    pz = 2.0 * mu * (M[2] * x + M[4] * y + M[5] * z) + t * l2
    radial = px * x + py * y + pz * z
    px -= radial * x
    py -= radial * y
    pz -= radial * z
    found = across * (px * px + py * py + pz * pz)
    if t > 0.0 or slope_T < 0.0:
        found += along * slope_T * slope_T
    return found


@inline
def tangents(x, y, z):  # type: ignore[no-untyped-def]
    """Basis of the tangent plane at a direction without trigonometry (Duff et al. 2017): two unit vectors."""
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    c = x * y * a
    return 1.0 + sign * x * x * a, sign * c, -sign * x, c, sign + y * y * a, -y


@inline
def curvature(x, y, z, bx, by, bz, dx, dy, dz, t, radial, v1, v2, mu, M):  # type: ignore[no-untyped-def]
    """One cable's block ``C_i`` in its tangent plane, and the slope ``q_i`` there."""
    # M times the three axes of the cable's frame.
    px = M[0] * x + M[1] * y + M[2] * z
    py = M[1] * x + M[3] * y + M[4] * z
    pz = M[2] * x + M[4] * y + M[5] * z
    mbx = M[0] * bx + M[1] * by + M[2] * bz
    mby = M[1] * bx + M[3] * by + M[4] * bz
    mbz = M[2] * bx + M[4] * by + M[5] * bz
    mdx = M[0] * dx + M[1] * dy + M[2] * dz
    mdy = M[1] * dx + M[3] * dy + M[4] * dz
    mdz = M[2] * dx + M[4] * dy + M[5] * dz
    base = 2.0 * mu * (px * x + py * y + pz * z) + t * radial
    c11 = 2.0 * mu * (bx * mbx + by * mby + bz * mbz) - base - v1 * v1
    c12 = 2.0 * mu * (bx * mdx + by * mdy + bz * mdz) - v1 * v2
    c22 = 2.0 * mu * (dx * mdx + dy * mdy + dz * mdz) - base - v2 * v2
    q1 = 2.0 * mu * (bx * px + by * py + bz * pz) - t * v1
    q2 = 2.0 * mu * (dx * px + dy * py + dz * pz) - t * v2
    return c11, c12, c22, q1, q2


@inline
def kkt_residual(n, mu, T, alpha, M, lam):  # type: ignore[no-untyped-def]
    """Largest violation of stationarity and of the sign of an active bound's multiplier.

    Relative to the size of the terms that must cancel: a mean tension ``1 / n`` along each cable,
    :func:`turning_scale` across it. Force balance, unit norms and bounds hold by construction.
    """
    along = float(n * n)
    across = 1.0 / turning_scale(n, mu) ** 2
    l0, l1, l2 = lam[0], lam[1], lam[2]
    worst = 0.0
    for i in range(n):
        found = violation(
            alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2], T[i], l0, l1, l2, mu, M, along, across
        )
        if not found <= worst:  # unlike max(), lets NaN through
            worst = found
    return math.sqrt(worst)


@inline
def assemble(n, fx, fy, fz, mu, T, alpha, M, lam, delta, rows, S):  # type: ignore[no-untyped-def]
    """Build the 8x8 system (matrix in ``S[:64]``, right-hand side in ``S[64:]``).

    Returns the smallest eigenvalue over all ``C_i``, before convexification.
    """
    l0, l1, l2 = lam[0], lam[1], lam[2]
    root = math.sqrt(2.0 * mu)  # sqrt(mu) of G times sqrt(2) of its off-diagonal coordinates
    root_a = math.sqrt(0.5 * mu)
    root_b = math.sqrt(1.5 * mu)
    for k in range(72):
        S[k] = 0.0
    S[64] = fx
    S[65] = fy
    S[66] = fz
    for k in range(3, 8):
        S[9 * k] = 1.0
    smallest = math.inf
    for i in range(n):
        x = alpha[3 * i]
        y = alpha[3 * i + 1]
        z = alpha[3 * i + 2]
        t = T[i]
        bx, by, bz, dx, dy, dz = tangents(x, y, z)
        radial = l0 * x + l1 * y + l2 * z
        taut = t > 0.0 or radial < 0.0
        v1 = l0 * bx + l1 * by + l2 * bz
        v2 = l0 * dx + l1 * dy + l2 * dz
        o = ROW * i
        if taut:
            S[0] += x * x
            S[1] += x * y
            S[2] += x * z
            S[8] += x * y
            S[9] += y * y
            S[10] += y * z
            S[16] += x * z
            S[17] += y * z
            S[18] += z * z
            rows[o + 26] = 1.0
        else:
            v1 = 0.0
            v2 = 0.0
            rows[o + 26] = 0.0
        c11, c12, c22, q1, q2 = curvature(
            x, y, z, bx, by, bz, dx, dy, dz, t, radial, v1, v2, mu, M
        )  # fmt: skip
        # C^-1 from its two eigenvalues, each replaced by max(|.|, delta).
        mean = 0.5 * (c11 + c22)
        half = 0.5 * (c11 - c22)
        spread = math.sqrt(half * half + c12 * c12)
        smallest = min(smallest, mean - spread)
        low = 1.0 / max(abs(mean - spread), delta)
        high = 1.0 / max(abs(mean + spread), delta)
        centre = 0.5 * (high + low)
        skew = 0.5 * (high - low) / max(spread, 1e-300)
        i11 = centre + skew * half
        i22 = centre - skew * half
        i12 = skew * c12
        rows[o] = bx
        rows[o + 1] = by
        rows[o + 2] = bz
        rows[o + 3] = dx
        rows[o + 4] = dy
        rows[o + 5] = dz
        rows[o + 6] = v1
        rows[o + 7] = v2
        rows[o + 8] = i11 * q1 + i12 * q2
        rows[o + 9] = i12 * q1 + i22 * q2
        # U_i, in the workspace next to S: constant distances let the compiler use vectors.
        S[72] = t * bx - x * v1
        S[73] = t * by - y * v1
        S[74] = t * bz - z * v1
        S[75] = root * (x * by + y * bx)
        S[76] = root * (x * bz + z * bx)
        S[77] = root * (y * bz + z * by)
        S[78] = root_a * 2.0 * (x * bx - y * by)
        S[79] = root_b * 2.0 * z * bz
        S[80] = t * dx - x * v2
        S[81] = t * dy - y * v2
        S[82] = t * dz - z * v2
        S[83] = root * (x * dy + y * dx)
        S[84] = root * (x * dz + z * dx)
        S[85] = root * (y * dz + z * dy)
        S[86] = root_a * 2.0 * (x * dx - y * dy)
        S[87] = root_b * 2.0 * z * dz
        for k in range(8):
            first = i11 * S[72 + k] + i12 * S[80 + k]
            second = i12 * S[72 + k] + i22 * S[80 + k]
            rows[o + 10 + k] = first
            rows[o + 18 + k] = second
            S[64 + k] -= first * q1 + second * q2
            for m in range(8):
                S[8 * k + m] += first * S[72 + m] + second * S[80 + m]
    return smallest


@inline
def _subtract_row(S, r, factor, p0, p1, p2, p3, p4, p5, p6, p7):  # type: ignore[no-untyped-def]
    """``S[r] -= factor * p`` for one row of eight; straight-line, so that it becomes vector code."""
    S[r] -= factor * p0
    S[r + 1] -= factor * p1
    S[r + 2] -= factor * p2
    S[r + 3] -= factor * p3
    S[r + 4] -= factor * p4
    S[r + 5] -= factor * p5
    S[r + 6] -= factor * p6
    S[r + 7] -= factor * p7


@inline
def solve_system(S):  # type: ignore[no-untyped-def]
    """Solve the symmetric 8x8 system in place; the solution replaces the right-hand side.

    Elimination without pivoting: the matrix is positive definite. Rows are treated whole, though only
    the columns right of the pivot matter.
    """
    for k in range(8):
        o = 8 * k
        inverse = 1.0 / max(S[9 * k], 1e-300)
        S[9 * k] = inverse
        p0, p1, p2, p3 = S[o], S[o + 1], S[o + 2], S[o + 3]
        p4, p5, p6, p7 = S[o + 4], S[o + 5], S[o + 6], S[o + 7]
        for r in range(o + 8, 64, 8):
            _subtract_row(S, r, S[r + k] * inverse, p0, p1, p2, p3, p4, p5, p6, p7)
        forward = S[64 + k] * inverse
        for m in range(k + 1, 8):
            S[64 + m] -= forward * S[o + m]
    for k in range(7, -1, -1):
        value = S[64 + k]
        for m in range(k + 1, 8):
            value -= S[8 * k + m] * S[64 + m]
        S[64 + k] = value * S[9 * k]


@inline
def newton_step(n, T, alpha, mu, M, lam, rows, S):  # type: ignore[no-untyped-def]
    """Back-substitute the solution in ``S[64:]``: per cable ``xi`` (row 8, 9) and ``dT`` (row 26).

    Returns the slope of J along the step and the largest ``|xi_i|^2``.
    """
    slope = 0.0
    largest = 0.0
    for i in range(n):
        o = ROW * i
        xi1 = -rows[o + 8]
        xi2 = -rows[o + 9]
        for k in range(8):
            xi1 -= rows[o + 10 + k] * S[64 + k]
            xi2 -= rows[o + 18 + k] * S[64 + k]
        x = alpha[3 * i]
        y = alpha[3 * i + 1]
        z = alpha[3 * i + 2]
        dT = 0.0
        if rows[o + 26] > 0.0:
            dT = -(T[i] + S[64] * x + S[65] * y + S[66] * z)
            dT -= rows[o + 6] * xi1 + rows[o + 7] * xi2
        rows[o + 8] = xi1
        rows[o + 9] = xi2
        rows[o + 26] = dT
        dx = rows[o] * xi1 + rows[o + 3] * xi2
        dy = rows[o + 1] * xi1 + rows[o + 4] * xi2
        dz = rows[o + 2] * xi1 + rows[o + 5] * xi2
        px = M[0] * x + M[1] * y + M[2] * z
        py = M[1] * x + M[3] * y + M[4] * z
        pz = M[2] * x + M[4] * y + M[5] * z
        slope += T[i] * dT + 2.0 * mu * (px * dx + py * dy + pz * dz)
        largest = max(largest, xi1 * xi1 + xi2 * xi2)
    return slope, largest


@inline
def trial_point(n, fx, fy, fz, s, T, alpha, rows, T_new, alpha_new):  # type: ignore[no-untyped-def]
    """Retract ``s`` times the step, make it feasible; the sum of tensions before that (>= 1 after)."""
    for i in range(n):
        o = ROW * i
        xi1 = s * rows[o + 8]
        xi2 = s * rows[o + 9]
        T_new[i] = max(0.0, T[i] + s * rows[o + 26])
        alpha_new[3 * i] = alpha[3 * i] + rows[o] * xi1 + rows[o + 3] * xi2
        alpha_new[3 * i + 1] = alpha[3 * i + 1] + rows[o + 1] * xi1 + rows[o + 4] * xi2
        alpha_new[3 * i + 2] = alpha[3 * i + 2] + rows[o + 2] * xi1 + rows[o + 5] * xi2
    return project(n, fx, fy, fz, T_new, alpha_new)


CONVERGED = 0
ITERATION_LIMIT = 1
NOT_FINITE = 2


@inline
def solve(n, fx, fy, fz, mu, tolerance, max_iterations, T, alpha, lam, work, info):  # type: ignore[no-untyped-def]
    """Minimise from ``(T, alpha)`` for the unit force ``f``; both are replaced by the answer.

    ``info`` receives iterations, KKT residual, objective and the gap to the global optimum.
    """
    S = work[:SYSTEM]
    rows = work[SYSTEM : SYSTEM + ROW * n]
    T_new = work[SYSTEM + ROW * n : SYSTEM + ROW * n + n]
    alpha_new = work[SYSTEM + ROW * n + n : SYSTEM + ROW * n + 4 * n]
    M = work[SYSTEM + ROW * n + 4 * n : SYSTEM + ROW * n + 4 * n + 6]
    M_new = work[SYSTEM + ROW * n + 4 * n + 6 : SYSTEM + ROW * n + 4 * n + 12]
    if not project(n, fx, fy, fz, T, alpha) > 0.0:
        for i in range(n):
            T[i] = 1.0 / n
        project(n, fx, fy, fz, T, alpha)
    J = measure(n, mu, T, alpha, M)
    best = optimal_objective(n, mu)
    scale = turning_scale(n, mu)
    status = ITERATION_LIMIT
    kicked = False
    damping = 1.0
    iterations = 0
    residual = math.inf
    while True:
        residual = kkt_residual(n, mu, T, alpha, M, lam)
        if not math.isfinite(residual + J):
            status = NOT_FINITE
            break
        if residual <= tolerance:
            status = CONVERGED
            if kicked or J - best <= 1e-7 * best or iterations >= max_iterations:
                break
            # A stationary point above the optimum: leave it if it is a saddle.
            smallest = assemble(n, fx, fy, fz, mu, T, alpha, M, lam, 1.0, rows, S)
            if smallest > -1e-6 * scale:
                break
            kicked = True
            for i in range(n):
                angle = 2.399963229728653 * i  # golden angle: no two cables move alike
                xi1 = 1e-2 * math.cos(angle)
                xi2 = 1e-2 * math.sin(angle)
                for k in range(3):
                    alpha[3 * i + k] += rows[ROW * i + k] * xi1 + rows[ROW * i + 3 + k] * xi2
            project(n, fx, fy, fz, T, alpha)
            J = measure(n, mu, T, alpha, M)
            status = ITERATION_LIMIT
        if iterations >= max_iterations:
            break
        iterations += 1
        delta = min(max(DAMPING * residual, LEAST_DAMPING), 1.0) * scale * damping
        assemble(n, fx, fy, fz, mu, T, alpha, M, lam, delta, rows, S)
        solve_system(S)
        slope, largest = newton_step(n, T, alpha, mu, M, lam, rows, S)
        s = 1.0
        if largest > MAX_TURN * MAX_TURN:
            s = MAX_TURN / math.sqrt(largest)
        accepted = False
        for _ in range(12):
            total = trial_point(n, fx, fy, fz, s, T, alpha, rows, T_new, alpha_new)
            J_new = measure(n, mu, T_new, alpha_new, M_new)
            if total > 0.5 and J_new <= J + 1e-4 * s * slope + LEVEL * J:
                accepted = True
                break
            s *= 0.5
        if not accepted:
            damping *= 100.0
            for k in range(3):  # a wrong multiplier may be why: keep the better estimate
                lam[k] = S[64 + k]
            continue
        damping = max(1.0, 0.1 * damping)
        for k in range(3):
            lam[k] += s * (S[64 + k] - lam[k])
        for i in range(n):
            T[i] = T_new[i]
        for i in range(3 * n):
            alpha[i] = alpha_new[i]
        for k in range(6):
            M[k] = M_new[k]
        J = J_new
    info[0] = iterations
    info[1] = residual
    info[2] = J
    info[3] = J - best
    return status
