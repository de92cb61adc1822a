"""Least squares of a plan: limits as squared hinges, their gradients, and Levenberg and Marquardt's iteration with time as an arrow column.

Unknowns are the free control points of the load's path (degree 7) and of the differences ``z`` of the pulls (degree 5) on the same
knots, and the duration T. ``f_i = F / n + sum_l N_il z_l`` with ``F = x'' / g + e_3`` balances the load for any of them.
"""

from __future__ import annotations

import math

import numpy as np

from colift.kernel.jit import aside, f8, i8, inline, kernel, matrix, tensor, vector, void
from colift.kernel.layout import Layout
from colift.plan.distances import along, distance
from colift.plan.flatness import back, direction, thrust

LIMITS = Layout(
    team={
        "g": 1, "q": 1, "kappa": 1, "most": 1, "least": 1, "rate": 1, "cable_rate": 1, "slack": 1, "speed": 1, "apart": 1,
        "radius": 1, "load_radius": 1, "cable_radius": 1, "smooth": 1,
    }
)  # fmt: skip
"""Gravity; mass of the load over a drone's; thrust per angular acceleration; most and least thrust of a motor over its part of the
drone's weight; body and cable rates, rad/s; least pull over an equal share of the load's weight; speed, m/s; distance between
drones' centres; radii of drones, load and cables, m; weight of smoothness."""
P = LIMITS.at
UNITS = (20.0, 10.0, 1.0, 10.0, 3.0)
"""Weights of a metre, of a weight of thrust, of a rad/s, of an equal share of pull, of a m/s."""
ENOUGH = 1e-9
"""Cost that is none."""
STALLED = 1e-5
"""Share of the cost by which it has to fall in three iterations. Time makes most of it, and gets shorter by small steps along the limits."""
FAINT = 0.1
"""Share of its weight by which a limit on thrust or rate that holds damps a step: else nothing stands against steps that turn bodies at once."""
NEVER = -1e9
"""Excess over a limit that nothing was held to."""
KINDS = ("obstacle", "separation", "thrust", "rate", "tension", "speed")


@inline
def _add(r, s, first, T, series, tables, bars, into):  # type: ignore[no-untyped-def]
    """One residual into the normal equations, by its gradient with respect to the series (``bars``), which is cleared.

    The last of ``grad`` and ``col`` are T's.
    """
    x, z = series
    BX, BZ, N, g = tables
    xbar, fbar, used, zbar = bars
    ix, iz, lo, hi, local, H, grad, col = into
    n = N.shape[0]
    for k in range(5):
        for c in range(3):
            total = 0.0
            for i in range(n):
                if used[i]:
                    total += fbar[i, k, c]
            xbar[k + 2, c] += (k + 2.0) * (k + 1.0) / (g * n) * total
    by_T = 0.0
    scale = 1.0
    for k in range(7):
        for c in range(3):
            by_T -= k / T * xbar[k, c] * x[k, c]
            xbar[k, c] *= scale
        scale /= T
    for a in range(8):
        o = ix[first + a]
        if o >= 0:
            for c in range(3):
                total = 0.0
                for k in range(7):
                    total += BX[s, k, a] * xbar[k, c]
                local[o - lo + c] += total
    for m in range(n - 1):
        scale = 1.0
        for k in range(5):
            for c in range(3):
                total = 0.0
                for i in range(n):
                    if used[i]:
                        total += N[i, m] * fbar[i, k, c]
                by_T -= k / T * total * z[m, k, c]
                zbar[k, c] = total * scale
            scale /= T
        for a in range(6):
            o = iz[first + a]
            if o >= 0:
                for c in range(3):
                    total = 0.0
                    for k in range(5):
                        total += BZ[s, k, a] * zbar[k, c]
                    local[o - lo + 3 * m + c] += total
    for a in range(hi - lo):
        v = local[a]
        if v != 0.0:
            grad[lo + a] += r * v
            col[lo + a] += by_T * v
            for b in range(a, hi - lo):
                H[lo + a, lo + b] += v * local[b]
    for a in range(hi - lo):
        local[a] = 0.0
    last = grad.shape[0] - 1
    grad[last] += r * by_T
    col[last] += by_T * by_T
    xbar[:] = 0.0
    for i in range(n):
        if used[i]:
            fbar[i] = 0.0
            used[i] = False


@inline
def _tamed(r, w):  # type: ignore[no-untyped-def]
    """A residual and its weight: beyond 1 it grows with the logarithm, as rates have poles where a thrust vanishes."""
    if r <= 1.0:
        return r, w
    return 1.0 + math.log(r), w / r


@aside
def states(s, first, T, cx, cz, BX, BZ, N, L, params, x, z, f, u, A, size, U, b, B, weight):  # type: ignore[no-untyped-def]
    """All series at sample s: load (7, 3), z (n - 1, 5, 3), pulls, directions (n, 5, 3), thrusts and body axes (n, 3, 3)."""
    n = N.shape[0]
    g = params[P.g]
    r = np.empty(5)
    scale = 1.0
    for k in range(7):
        for c in range(3):
            total = 0.0
            for a in range(8):
                total += BX[s, k, a] * cx[first + a, c]
            x[k, c] = total * scale
        scale /= T
    for m in range(n - 1):
        scale = 1.0
        for k in range(5):
            for c in range(3):
                total = 0.0
                for a in range(6):
                    total += BZ[s, k, a] * cz[first + a, 3 * m + c]
                z[m, k, c] = total * scale
            scale /= T
    for i in range(n):
        for k in range(5):
            for c in range(3):
                total = (k + 2.0) * (k + 1.0) / g * x[k + 2, c] / n
                if k == 0 and c == 2:
                    total += 1.0 / n
                for m in range(n - 1):
                    total += N[i, m] * z[m, k, c]
                f[i, k, c] = total
        size[i] = direction(f[i], 5, r, u[i], A[i])
        thrust(x, u[i], f[i], L[i], params[P.q], g, U[i])
        weight[i] = direction(U[i], 3, r, b[i], B[i])


@aside
def _point(gx, gy, gz, reach, i, A, bars):  # type: ignore[no-untyped-def]
    """Gradient of a number that changes by ``g`` with the place ``reach`` along cable i; that of the load for i < 0."""
    xbar, fbar, used, _ = bars
    gs = (gx, gy, gz)
    for c in range(3):
        xbar[0, c] += gs[c]
    if i >= 0:
        used[i] = True
        for c in range(3):
            v = reach * gs[c]
            for a in range(3):
                fbar[i, 0, a] += A[i, 0, a, c] * v


_each = f8[:, :, :, ::1]


@kernel(void(matrix, matrix, f8, tensor, tensor, matrix, vector, vector, tensor, _each, _each, _each))  # fmt: skip
def sampled(cx, cz, T, BX, BZ, N, L, params, x, f, u, U):  # type: ignore[no-untyped-def]
    """The series at all samples: load (S, 7, 3), pulls and directions (S, n, 5, 3), thrusts (S, n, 3, 3)."""
    S, n, K = BX.shape[0], N.shape[0], cx.shape[0] + 1 - BX.shape[2]
    samples = (S - 1) // K
    z, A = np.zeros((max(n - 1, 1), 5, 3)), np.zeros((n, 5, 3, 3))
    b, B, size, weight = np.zeros((n, 3, 3)), np.zeros((n, 3, 3, 3)), np.zeros(n), np.zeros(n)
    for s in range(S):
        first = min(s // samples, K - 1)
        states(
            s, first, T, cx, cz, BX, BZ, N, L, params, x[s], z, f[s], u[s], A, size, U[s], b, B, weight
        )  # fmt: skip


PROBLEM = (tensor, tensor, matrix, vector, vector, matrix, vector, i8[::1], i8[::1], i8[:, ::1], matrix)  # fmt: skip
"""Tables of load and pulls, basis, lengths, limits, obstacles, margins; places of control points in the unknowns, of each interval's, and H."""


@kernel(f8(matrix, matrix, f8, i8, *PROBLEM, vector, vector, vector))
def assemble(  # type: ignore[no-untyped-def]
    cx, cz, T, fill, BX, BZ, N, L, params, obstacles, margins, ix, iz, spans, H, grad, col, worst
):  # fmt: skip
    """Half the sum of the squared residuals; with ``fill`` also normal equations. ``worst`` gets the largest excess of each kind."""
    n, S, K = N.shape[0], BX.shape[0], spans.shape[0]
    samples = (S - 1) // K
    g = params[P.g]
    x, z = np.zeros((7, 3)), np.zeros((max(n - 1, 1), 5, 3))
    f, u, A = np.zeros((n, 5, 3)), np.zeros((n, 5, 3)), np.zeros((n, 5, 3, 3))
    U, b, B = np.zeros((n, 3, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3, 3))
    size, weight, place = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    xbar, fbar, ubar = np.zeros((7, 3)), np.zeros((n, 5, 3)), np.zeros((5, 3))
    Ubar, bbar, zbar = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((5, 3))
    used = np.zeros(n, dtype=np.bool_)
    local = np.zeros(H.shape[0])
    series, tables, bars = (x, z), (BX, BZ, N, g), (xbar, fbar, used, zbar)
    cost = 0.0
    for k in range(worst.shape[0]):
        worst[k] = NEVER
    if fill:
        H[:] = 0.0
        grad[:] = 0.0
        col[:] = 0.0
    for s in range(S):
        first = min(s // samples, K - 1)
        into = ix, iz, spans[first, 0], spans[first, 1], local, H, grad, col
        states(s, first, T, cx, cz, BX, BZ, N, L, params, x, z, f, u, A, size, U, b, B, weight)
        v = math.sqrt(x[1, 0] ** 2 + x[1, 1] ** 2 + x[1, 2] ** 2 + 1e-12)
        excess = v - params[P.speed]
        worst[5] = max(worst[5], excess)
        if excess > 0.0:
            w = UNITS[4]
            cost += 0.5 * (w * excess) ** 2
            if fill:
                for c in range(3):
                    xbar[1, c] = w * x[1, c] / v
                _add(w * excess, s, first, T, series, tables, bars, into)
        # Obstacles: load, drones, cables.
        for o in range(obstacles.shape[0]):
            for i in range(-1, 2 * n):
                drone = i % n if i >= 0 else -1
                if i < 0:
                    t, need = 0.0, params[P.load_radius]
                elif i < n:
                    t, need = 1.0, params[P.radius]
                else:
                    length = L[drone]
                    need = params[P.cable_radius]
                    t = along(
                        obstacles[o],
                        x[0, 0],
                        x[0, 1],
                        x[0, 2],
                        length * u[drone, 0, 0],
                        length * u[drone, 0, 1],
                        length * u[drone, 0, 2],
                        need + margins[0] + 0.02,
                    )
                    if t < 0.0:
                        continue
                need += margins[0]
                reach = t * L[drone] if drone >= 0 else 0.0
                k = max(drone, 0)
                d, gx, gy, gz = distance(
                    obstacles[o],
                    x[0, 0] + reach * u[k, 0, 0],
                    x[0, 1] + reach * u[k, 0, 1],
                    x[0, 2] + reach * u[k, 0, 2],
                )
                excess = need - d
                worst[0] = max(worst[0], excess)
                if excess <= 0.0:
                    continue
                w = UNITS[0]
                cost += 0.5 * (w * excess) ** 2
                if fill:
                    _point(-w * gx, -w * gy, -w * gz, reach, drone, A, bars)
                    _add(w * excess, s, first, T, series, tables, bars, into)
        # Between drones.
        for i in range(n):
            for c in range(3):
                place[i, c] = x[0, c] + L[i] * u[i, 0, c]
        for i in range(n):
            for j in range(i):
                dx, dy, dz = (
                    place[i, 0] - place[j, 0],
                    place[i, 1] - place[j, 1],
                    place[i, 2] - place[j, 2],
                )
                d = math.sqrt(dx * dx + dy * dy + dz * dz + 1e-12)
                excess = params[P.apart] + margins[1] - d
                worst[1] = max(worst[1], excess)
                if excess <= 0.0:
                    continue
                w = UNITS[0]
                cost += 0.5 * (w * excess) ** 2
                if fill:
                    _point(-w * dx / d, -w * dy / d, -w * dz / d, L[i], i, A, bars)
                    _point(w * dx / d, w * dy / d, w * dz / d, L[j], j, A, bars)
                    _add(w * excess, s, first, T, series, tables, bars, into)
        # Each drone: motors (most, least), body rate, cable's rate, pull.
        for i in range(n):
            dot = 2.0 * (
                b[i, 0, 0] * b[i, 2, 0] + b[i, 0, 1] * b[i, 2, 1] + b[i, 0, 2] * b[i, 2, 2]
            )
            px, py, pz = (
                2.0 * b[i, 2, 0] - dot * b[i, 0, 0],
                2.0 * b[i, 2, 1] - dot * b[i, 0, 1],
                2.0 * b[i, 2, 2] - dot * b[i, 0, 2],
            )
            alpha = math.sqrt(px * px + py * py + pz * pz + 1e-6)
            rate = math.sqrt(b[i, 1, 0] ** 2 + b[i, 1, 1] ** 2 + b[i, 1, 2] ** 2 + 1e-9)
            swing = math.sqrt(u[i, 1, 0] ** 2 + u[i, 1, 1] ** 2 + u[i, 1, 2] ** 2 + 1e-9)
            turn = params[P.kappa] * alpha
            for kind in range(5):
                if kind == 0:
                    excess, w, which = weight[i] + turn - params[P.most] + margins[2], UNITS[1], 2
                elif kind == 1:
                    excess, w, which = params[P.least] + turn - weight[i] + margins[2], UNITS[1], 2
                elif kind == 2:
                    excess, w, which = rate - params[P.rate] + margins[3], UNITS[2], 3
                elif kind == 3:
                    excess, w, which = swing - params[P.cable_rate] + margins[3], UNITS[2], 3
                else:
                    excess, w, which = params[P.slack] + margins[4] - n * size[i], UNITS[3], 4
                worst[which] = max(worst[which], excess)
                r = 0.0
                if excess > 0.0:
                    r, w = _tamed(w * excess, w)
                    cost += 0.5 * r * r
                elif kind & 1 or kind == 4 or s & 1:
                    continue
                else:
                    w *= FAINT
                if not fill:
                    continue
                if kind <= 1:
                    # |b''| across b pulls the axis as well: -(b . b'') of it.
                    e = w * params[P.kappa] / alpha
                    bbar[2, 0], bbar[2, 1], bbar[2, 2] = 2.0 * e * px, 2.0 * e * py, 2.0 * e * pz
                    bbar[0, 0], bbar[0, 1], bbar[0, 2] = -dot * e * px, -dot * e * py, -dot * e * pz
                    sign = w if kind == 0 else -w
                    for c in range(3):
                        Ubar[0, c] += sign * b[i, 0, c]
                elif kind == 2:
                    for c in range(3):
                        bbar[1, c] = w * b[i, 1, c] / rate
                elif kind == 3:
                    for c in range(3):
                        ubar[1, c] = w * u[i, 1, c] / swing
                else:
                    for c in range(3):
                        fbar[i, 0, c] -= w * n * u[i, 0, c]
                if kind <= 2:
                    back(B[i], 3, bbar, Ubar)
                    for k in range(3):
                        twice = (k + 2.0) * (k + 1.0) / g
                        for c in range(3):
                            xbar[k + 2, c] += twice * Ubar[k, c]
                            ubar[k + 2, c] += twice * L[i] * Ubar[k, c]
                            fbar[i, k, c] += params[P.q] * Ubar[k, c]
                back(A[i], 5, ubar, fbar[i])
                used[i] = True
                _add(r, s, first, T, series, tables, bars, into)
                ubar[:] = 0.0
                Ubar[:] = 0.0
                bbar[:] = 0.0
    # Smoothness: second differences of neighbouring control points.
    for which in range(2):
        points, index = (cx, ix) if which == 0 else (cz, iz)
        w = params[P.smooth] * (1.0 if which == 0 else 0.3)
        for k in range(1, points.shape[0] - 1):
            for c in range(points.shape[1]):
                r = w * (points[k - 1, c] - 2.0 * points[k, c] + points[k + 1, c])
                cost += 0.5 * r * r
                if fill:
                    for a in range(-1, 2):
                        va = -2.0 * w if a == 0 else w
                        if index[k + a] < 0:
                            continue
                        grad[index[k + a] + c] += r * va
                        for e in range(a, 2):
                            if index[k + e] >= 0:
                                H[index[k + a] + c, index[k + e] + c] += va * (
                                    -2.0 * w if e == 0 else w
                                )
    return cost


@aside
def _solve(H, mu, band, grad, col, work, d, e):  # type: ignore[no-untyped-def]
    """Solve the damped banded equations for two right sides, -grad and col, into d and e."""
    N = H.shape[0]
    for i in range(N):
        top = min(i + band + 1, N)
        work[i, i:top] = H[i, i:top]
        work[i, i] = H[i, i] * (1.0 + mu) + 1e-9 + 1e-6 * mu
        d[i], e[i] = -grad[i], col[i]
    for k in range(N):
        top = min(k + band + 1, N)
        pivot = max(work[k, k], 1e-12)
        for i in range(k + 1, top):
            share = work[k, i] / pivot
            if share != 0.0:
                for j in range(i, top):
                    work[i, j] -= share * work[k, j]
                d[i] -= share * d[k]
                e[i] -= share * e[k]
    for k in range(N - 1, -1, -1):
        top = min(k + band + 1, N)
        a, c = d[k], e[k]
        for j in range(k + 1, top):
            a -= work[k, j] * d[j]
            c -= work[k, j] * e[j]
        pivot = max(work[k, k], 1e-12)
        d[k], e[k] = a / pivot, c / pivot


@kernel(i8(matrix, matrix, vector, f8, i8, matrix, *PROBLEM, vector))
def optimise(  # type: ignore[no-untyped-def]
    cx, cz, T, hurry, most, work, BX, BZ, N, L, params, obstacles, margins, ix, iz, spans, H, worst
):  # fmt: skip
    """Levenberg and Marquardt from these control points, which are replaced; T (1,) is free where ``hurry``, its weight, is not 0.

    Ends where there is no cost, where it no longer falls, or after ``most`` iterations; returns how many.
    """
    M = H.shape[0]
    grad, col = np.zeros(M + 1), np.zeros(M + 1)
    d, e = np.zeros(M), np.zeros(M)
    newx, newz = cx.copy(), cz.copy()
    problem = (BX, BZ, N, L, params, obstacles, margins, ix, iz, spans, H, grad, col, worst)
    band = 0
    for k in range(spans.shape[0]):
        band = max(band, spans[k, 1] - spans[k, 0])
    mu = 1e-3
    stalls = 0
    cost = assemble(cx, cz, T[0], 1, *problem)
    cost += 0.5 * (hurry * T[0]) ** 2
    for iteration in range(most):
        if hurry == 0.0 and cost < ENOUGH:
            return iteration
        _solve(H, mu, band, grad, col, work, d, e)
        step = 0.0
        if hurry > 0.0:
            top, bottom = (
                grad[M] + hurry * hurry * T[0],
                (col[M] + hurry * hurry) * (1.0 + mu) + 1e-9,
            )
            for k in range(M):
                top += col[k] * d[k]
                bottom -= col[k] * e[k]
            step = -top / max(bottom, 1e-9)
            step = min(max(step, -0.15 * T[0]), 0.15 * T[0])
        largest = 0.0
        for k in range(M):
            largest = max(largest, abs(d[k] - step * e[k]))
        shrink = min(1.0, 0.6 / max(largest, 1e-12))
        newT = T[0] + shrink * step
        for p in range(cx.shape[0]):
            for c in range(3):
                newx[p, c] = cx[p, c] + (
                    shrink * (d[ix[p] + c] - step * e[ix[p] + c]) if ix[p] >= 0 else 0.0
                )
        for p in range(cz.shape[0]):
            for c in range(cz.shape[1]):
                newz[p, c] = cz[p, c] + (
                    shrink * (d[iz[p] + c] - step * e[iz[p] + c]) if iz[p] >= 0 else 0.0
                )
        new = assemble(newx, newz, newT, 0, *problem)
        new += 0.5 * (hurry * newT) ** 2
        if new < cost:
            stalls = stalls + 1 if cost - new < STALLED * cost else 0
            cx[:] = newx
            cz[:] = newz
            T[0] = newT
            cost = new
            mu = max(0.3 * mu, 1e-9)
            if stalls >= 3:
                return iteration
            assemble(cx, cz, T[0], 1, *problem)
        else:
            mu *= 5.0
            if mu > 1e6:
                return iteration
    return most
