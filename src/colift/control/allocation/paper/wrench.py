"""The paper's cost with the balance of a wrench: its exact Newton steps, still at O(n) cost.

Problem, with unit directions ``alpha_i`` from drone to load and ends at ``s_i`` from the mean of all ends::

    min  J = 1/2 sum T_i^2 + mu sum_{i<j} (alpha_i . alpha_j)^2
    s.t. sum T_i alpha_i = -F,   sum s_i x T_i alpha_i = -M,   T_i >= 0,   |alpha_i| = 1

scaled to ``|F| = 1``; ``M`` is the moment about the mean of the ends. A cable feels of the two multipliers ``lam = (lam_F, lam_M)`` no
more than ``lam_i = lam_F + lam_M x s_i``. With it in the place of the one multiplier all of :mod:`~colift.control.allocation.paper.newton`
holds for each cable, and the reduced system grows from 8 to 11: ``U_i = [P_i; s_i x P_i; G_i]``.

Where the optimum is one point, as with three cables, a ``C_i`` is negative there as often as not. So its sign is kept as long as the inertia of
the reduced system says that the whole is convex along the balance (Gould 1985): as many negative pivots as there are negative eigenvalues of
all ``C_i``. Else the absolute values are taken, as there; and a stationary point that does not pass is left once.

Ends in one line make no moment about it, and those in one point none at all: these parts of ``M`` are zero, and their multipliers too.
"""

from __future__ import annotations

import math

from colift.control.allocation.paper.newton import (
    CONVERGED,
    DAMPING,
    ITERATION_LIMIT,
    MAX_TURN,
    NOT_FINITE,
    curvature,
    measure,
    optimal_objective,
    tangents,
    turning_scale,
    violation,
)
from colift.kernel.jit import inline
from colift.kernel.math.small import solve_symmetric
from colift.kernel.rounding import LEAST_DAMPING, LEVEL, RANK
from colift.kernel.spans import BODY, LINE, POINT

ORDER = 11
"""Of the reduced system: force, moment, change of ``M``."""
SQUARE = ORDER * ORDER
SYSTEM = SQUARE + 3 * ORDER
"""Workspace of the reduced system: matrix, right-hand side, one cable's ``U_i`` in two columns."""
FIRST, SECOND = 10, 10 + ORDER
TAUT = SECOND + ORDER
ROW = TAUT + 1
"""Workspace per cable: B (6), v (2), C^-1 q (2), C^-1 U^T (22), taut flag."""
RIGHT, U = SQUARE, SQUARE + ORDER
CURVED = 1e-6
"""Curvature over :func:`~colift.control.allocation.paper.newton.turning_scale`, down to which a direction counts as flat."""


def workspace_size(n: int) -> int:
    """Number of float64 that :func:`solve` needs for n cables."""
    return SYSTEM + ROW * n + 4 * n + 12


@inline
def pull(lam, s, i):  # type: ignore[no-untyped-def]
    """The multiplier that cable i feels, ``lam_F + lam_M x s_i``."""
    x, y, z = s[3 * i], s[3 * i + 1], s[3 * i + 2]
    return (
        lam[0] + lam[4] * z - lam[5] * y,
        lam[1] + lam[5] * x - lam[3] * z,
        lam[2] + lam[3] * y - lam[4] * x,
    )


@inline
def unmet(n, f, s, T, alpha):  # type: ignore[no-untyped-def]
    """What the cables leave of the balance ``f`` (6): zero in balance."""
    fx, fy, fz, mx, my, mz = f[0], f[1], f[2], f[3], f[4], f[5]
    for i in range(n):
        x, y, z = T[i] * alpha[3 * i], T[i] * alpha[3 * i + 1], T[i] * alpha[3 * i + 2]
        rx, ry, rz = s[3 * i], s[3 * i + 1], s[3 * i + 2]
        fx, fy, fz = fx + x, fy + y, fz + z
        mx, my, mz = mx + ry * z - rz * y, my + rz * x - rx * z, mz + rx * y - ry * x
    return fx, fy, fz, mx, my, mz


@inline
def project(n, kind, axis, f, s, T, alpha):  # type: ignore[no-untyped-def]
    """Make ``(T, alpha)`` satisfy balance and unit norms, in place; ``sum T`` before, 0 where the taut cables cannot.

    ``w_i -= T_i (a + b x (s_i - c))`` about the tensions' centre ``c``: the least of ``sum |dw_i|^2 / T_i``. Cables without tension stay
    slack.
    """
    total = 0.0
    for _ in range(2):  # the second time removes what rounding left
        total = cx = cy = cz = 0.0
        for i in range(n):
            t = T[i]
            total += t
            cx, cy, cz = cx + t * s[3 * i], cy + t * s[3 * i + 1], cz + t * s[3 * i + 2]
        if not total > 0.0:
            return 0.0
        scale = 1.0 / total
        cx, cy, cz = cx * scale, cy * scale, cz * scale
        ax, ay, az, mx, my, mz = unmet(n, f, s, T, alpha)
        mx, my, mz = mx - cy * az + cz * ay, my - cz * ax + cx * az, mz - cx * ay + cy * ax
        ax, ay, az = ax * scale, ay * scale, az * scale
        bx = by = bz = 0.0
        if kind != POINT:
            xx = xy = xz = yy = yz = zz = 0.0
            for i in range(n):
                x, y, z = s[3 * i] - cx, s[3 * i + 1] - cy, s[3 * i + 2] - cz
                xx, yy, zz = (
                    xx + T[i] * (y * y + z * z),
                    yy + T[i] * (x * x + z * z),
                    zz + T[i] * (x * x + y * y),
                )
                xy, xz, yz = xy - T[i] * x * y, xz - T[i] * x * z, yz - T[i] * y * z
            if kind == LINE:
                along = mx * axis[0] + my * axis[1] + mz * axis[2]
                mx, my, mz = mx - along * axis[0], my - along * axis[1], mz - along * axis[2]
                more = xx + yy + zz
                xx, yy, zz = (
                    xx + more * axis[0] * axis[0],
                    yy + more * axis[1] * axis[1],
                    zz + more * axis[2] * axis[2],
                )
                xy += more * axis[0] * axis[1]
                xz += more * axis[0] * axis[2]
                yz += more * axis[1] * axis[2]
            size = xx + yy + zz
            volume = xx * (yy * zz - yz * yz) - xy * (xy * zz - xz * yz) + xz * (xy * yz - xz * yy)
            if not volume > RANK * size * size * size:
                return 0.0
            bx, by, bz = solve_symmetric(xx, xy, xz, yy, yz, zz, mx, my, mz)
        for i in range(n):
            rx, ry, rz = s[3 * i] - cx, s[3 * i + 1] - cy, s[3 * i + 2] - cz
            x = alpha[3 * i] - ax - by * rz + bz * ry
            y = alpha[3 * i + 1] - ay - bz * rx + bx * rz
            z = alpha[3 * i + 2] - az - bx * ry + by * rx
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
def kkt_residual(n, mu, s, T, alpha, M, lam):  # type: ignore[no-untyped-def]
    """Largest violation of stationarity, as that of :mod:`~colift.control.allocation.paper.newton`."""
    along = float(n * n)
    across = 1.0 / turning_scale(n, mu) ** 2
    worst = 0.0
    for i in range(n):
        l0, l1, l2 = pull(lam, s, i)
        found = violation(
            alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2], T[i], l0, l1, l2, mu, M, along, across
        )
        if not found <= worst:  # unlike max(), lets NaN through
            worst = found
    return math.sqrt(worst)


@inline
def assemble(n, kind, axis, f, mu, s, T, alpha, M, lam, delta, signed, rows, S):  # type: ignore[no-untyped-def]
    """Build the reduced system; the number of negative eigenvalues that are kept of all ``C_i``, none unless ``signed``."""
    root = math.sqrt(2.0 * mu)  # sqrt(mu) of G times sqrt(2) of its off-diagonal coordinates
    root_a = math.sqrt(0.5 * mu)
    root_b = math.sqrt(1.5 * mu)
    for k in range(SYSTEM):
        S[k] = 0.0
    for k in range(6):
        S[RIGHT + k] = f[k]
    for k in range(6, ORDER):
        S[(ORDER + 1) * k] = 1.0
    if kind != BODY:  # the multipliers of moments that nobody makes
        for k in range(3):
            for m in range(3):
                one = 1.0 if k == m else 0.0
                S[ORDER * (3 + k) + 3 + m] += axis[k] * axis[m] if kind == LINE else one
    negative = 0
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        rx, ry, rz = s[3 * i], s[3 * i + 1], s[3 * i + 2]
        l0, l1, l2 = pull(lam, s, i)
        t = T[i]
        bx, by, bz, dx, dy, dz = tangents(x, y, z)
        radial = l0 * x + l1 * y + l2 * z
        taut = t > 0.0 or radial < 0.0
        v1 = l0 * bx + l1 * by + l2 * bz
        v2 = l0 * dx + l1 * dy + l2 * dz
        o = ROW * i
        S[U], S[U + 1], S[U + 2] = x, y, z
        S[U + 3], S[U + 4], S[U + 5] = ry * z - rz * y, rz * x - rx * z, rx * y - ry * x
        if taut:
            for k in range(6):
                for m in range(6):
                    S[ORDER * k + m] += S[U + k] * S[U + m]
            rows[o + TAUT] = 1.0
        else:
            v1 = 0.0
            v2 = 0.0
            rows[o + TAUT] = 0.0
        c11, c12, c22, q1, q2 = curvature(
            x, y, z, bx, by, bz, dx, dy, dz, t, radial, v1, v2, mu, M
        )  # fmt: skip
        # C^-1 from its two eigenvalues, each at least delta in size.
        mean = 0.5 * (c11 + c22)
        half = 0.5 * (c11 - c22)
        spread = math.sqrt(half * half + c12 * c12)
        least, most = mean - spread, mean + spread
        low = 1.0 / max(abs(least), delta)
        high = 1.0 / max(abs(most), delta)
        if signed and least < -delta:
            low = -low
            negative += 1
        if signed and most < -delta:
            high = -high
            negative += 1
        centre = 0.5 * (high + low)
        skew = 0.5 * (high - low) / max(spread, 1e-300)
        i11 = centre + skew * half
        i22 = centre - skew * half
        i12 = skew * c12
        rows[o], rows[o + 1], rows[o + 2] = bx, by, bz
        rows[o + 3], rows[o + 4], rows[o + 5] = dx, dy, dz
        rows[o + 6], rows[o + 7] = v1, v2
        rows[o + 8] = i11 * q1 + i12 * q2
        rows[o + 9] = i12 * q1 + i22 * q2
        # U_i in the workspace behind S.
        gx, gy, gz = t * bx - x * v1, t * by - y * v1, t * bz - z * v1
        hx, hy, hz = t * dx - x * v2, t * dy - y * v2, t * dz - z * v2
        S[U], S[U + 1], S[U + 2] = gx, gy, gz
        S[U + 3], S[U + 4], S[U + 5] = ry * gz - rz * gy, rz * gx - rx * gz, rx * gy - ry * gx
        S[U + 6] = root * (x * by + y * bx)
        S[U + 7] = root * (x * bz + z * bx)
        S[U + 8] = root * (y * bz + z * by)
        S[U + 9] = root_a * 2.0 * (x * bx - y * by)
        S[U + 10] = root_b * 2.0 * z * bz
        e = U + ORDER
        S[e], S[e + 1], S[e + 2] = hx, hy, hz
        S[e + 3], S[e + 4], S[e + 5] = ry * hz - rz * hy, rz * hx - rx * hz, rx * hy - ry * hx
        S[e + 6] = root * (x * dy + y * dx)
        S[e + 7] = root * (x * dz + z * dx)
        S[e + 8] = root * (y * dz + z * dy)
        S[e + 9] = root_a * 2.0 * (x * dx - y * dy)
        S[e + 10] = root_b * 2.0 * z * dz
        for k in range(ORDER):
            first = i11 * S[U + k] + i12 * S[e + k]
            second = i12 * S[U + k] + i22 * S[e + k]
            rows[o + FIRST + k] = first
            rows[o + SECOND + k] = second
            S[RIGHT + k] -= first * q1 + second * q2
            for m in range(ORDER):
                S[ORDER * k + m] += first * S[U + m] + second * S[e + m]
    return negative


@inline
def solve_system(S):  # type: ignore[no-untyped-def]
    """Solve the symmetric system in place; the solution replaces the right-hand side. Number of negative pivots, -1 of none to trust.

    Elimination without pivoting; a pivot that all but vanishes in an indefinite matrix is not to trust.
    """
    negative = 0
    for k in range(ORDER):
        o = ORDER * k
        pivot = S[o + k]
        size = 0.0
        for m in range(k + 1, ORDER):
            size = max(size, abs(S[o + m]))
        if not abs(pivot) > RANK * size + 1e-300:
            return -1
        if pivot < 0.0:
            negative += 1
        inverse = 1.0 / pivot
        S[o + k] = inverse
        for r in range(k + 1, ORDER):
            factor = S[ORDER * r + k] * inverse
            for m in range(k + 1, ORDER):
                S[ORDER * r + m] -= factor * S[o + m]
            S[RIGHT + r] -= factor * S[RIGHT + k]
    for k in range(ORDER - 1, -1, -1):
        value = S[RIGHT + k]
        for m in range(k + 1, ORDER):
            value -= S[ORDER * k + m] * S[RIGHT + m]
        S[RIGHT + k] = value * S[(ORDER + 1) * k]
    return negative


@inline
def newton_step(n, s, T, alpha, mu, M, rows, S):  # type: ignore[no-untyped-def]
    """Back-substitute the solution: per cable ``xi`` (row 8, 9) and ``dT`` (row TAUT); slope of J, and the largest ``|xi_i|^2``."""
    slope = 0.0
    largest = 0.0
    lam = S[RIGHT : RIGHT + 6]
    for i in range(n):
        o = ROW * i
        xi1 = -rows[o + 8]
        xi2 = -rows[o + 9]
        for k in range(ORDER):
            xi1 -= rows[o + FIRST + k] * S[RIGHT + k]
            xi2 -= rows[o + SECOND + k] * S[RIGHT + k]
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        dT = 0.0
        if rows[o + TAUT] > 0.0:
            l0, l1, l2 = pull(lam, s, i)
            dT = -(T[i] + l0 * x + l1 * y + l2 * z) - (rows[o + 6] * xi1 + rows[o + 7] * xi2)
        rows[o + 8] = xi1
        rows[o + 9] = xi2
        rows[o + TAUT] = dT
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
def trial_point(n, kind, axis, f, step, s, T, alpha, rows, T_new, alpha_new):  # type: ignore[no-untyped-def]
    """Retract ``step`` times the Newton step, make it feasible; the sum of tensions, 0 where it cannot be."""
    for i in range(n):
        o = ROW * i
        xi1 = step * rows[o + 8]
        xi2 = step * rows[o + 9]
        T_new[i] = max(0.0, T[i] + step * rows[o + TAUT])
        for k in range(3):
            alpha_new[3 * i + k] = alpha[3 * i + k] + rows[o + k] * xi1 + rows[o + 3 + k] * xi2
    return project(n, kind, axis, f, s, T_new, alpha_new)


@inline
def solve(n, kind, axis, f, mu, tolerance, max_iterations, s, T, alpha, lam, work, info):  # type: ignore[no-untyped-def]
    """Minimise from ``(T, alpha)`` for the unit force and the moment in ``f`` (6); both are replaced by the answer.

    ``info`` receives iterations, KKT residual, objective and what it is above the least of all that balance the force alone: that bounds
    how far from the optimum it is.
    """
    S = work[:SYSTEM]
    rows = work[SYSTEM : SYSTEM + ROW * n]
    at = SYSTEM + ROW * n
    T_new, alpha_new = work[at : at + n], work[at + n : at + 4 * n]
    M, M_new = work[at + 4 * n : at + 4 * n + 6], work[at + 4 * n + 6 : at + 4 * n + 12]
    if not project(n, kind, axis, f, s, T, alpha) > 0.0:
        for i in range(n):
            T[i] = 1.0 / n
        project(n, kind, axis, f, s, T, alpha)
    J = measure(n, mu, T, alpha, M)
    best = optimal_objective(n, mu)
    scale = turning_scale(n, mu)
    status = ITERATION_LIMIT
    kicked = False
    damping = 1.0
    iterations = 0
    residual = math.inf
    while True:
        residual = kkt_residual(n, mu, s, T, alpha, M, lam)
        if not math.isfinite(residual + J):
            status = NOT_FINITE
            break
        if residual <= tolerance:
            status = CONVERGED
            if kicked or J - best <= 1e-7 * best or iterations >= max_iterations:
                break
            # Above what no moment could cost less than: leave it if it is a saddle.
            negative = assemble(
                n, kind, axis, f, mu, s, T, alpha, M, lam, CURVED * scale, True, rows, S
            )
            if solve_system(S) == negative:
                break
            kicked = True
            for i in range(n):
                angle = 2.399963229728653 * i  # golden angle: no two cables move alike
                xi1 = 1e-2 * math.cos(angle)
                xi2 = 1e-2 * math.sin(angle)
                for k in range(3):
                    alpha[3 * i + k] += rows[ROW * i + k] * xi1 + rows[ROW * i + 3 + k] * xi2
            project(n, kind, axis, f, s, T, alpha)
            J = measure(n, mu, T, alpha, M)
            status = ITERATION_LIMIT
        if iterations >= max_iterations:
            break
        iterations += 1
        delta = min(max(DAMPING * residual, LEAST_DAMPING), 1.0) * scale * damping
        accepted = solved = False
        for attempt in range(2):
            signed = attempt == 0
            negative = assemble(n, kind, axis, f, mu, s, T, alpha, M, lam, delta, signed, rows, S)
            if solve_system(S) != negative:
                continue
            solved = True
            slope, largest = newton_step(n, s, T, alpha, mu, M, rows, S)
            step = 1.0
            if largest > MAX_TURN * MAX_TURN:
                step = MAX_TURN / math.sqrt(largest)
            for _ in range(12):
                total = trial_point(n, kind, axis, f, step, s, T, alpha, rows, T_new, alpha_new)
                J_new = measure(n, mu, T_new, alpha_new, M_new)
                if total > 0.5 and J_new <= J + 1e-4 * step * min(slope, 0.0) + LEVEL * J:
                    accepted = True
                    break
                step *= 0.5
            if accepted or negative == 0:
                break
        if not accepted:
            damping *= 100.0
            if solved:  # a wrong multiplier may be why: keep the better one
                for k in range(6):
                    lam[k] = S[RIGHT + k]
            continue
        damping = max(1.0, 0.1 * damping)
        for k in range(6):
            lam[k] += step * (S[RIGHT + k] - lam[k])
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
