"""The safe allocation problem: primal-dual interior-point steps at the cost of a sparse 2n system.

Problem, in *force coordinates* ``w_i = T_i alpha_i`` (the pull of drone i on the load is ``-w_i``), scaled by
``sigma = m_L g / n``. With weights ``omega_i``, the last answer's directions ``a_i`` (``b_i``: the same, turned
with the force, or after recovery has moved those outside a limit) and the thrust ``p_i - w_i`` of each drone,
``p_i = m_i (g e3 + a_d)``::

    min  1/2 sum omega_i T_i^2 + mu sum_{i<j} c_ij^2            (the paper's eq. 7)
         + rho/2 sum |alpha_i - b_i|^2 + elastic(s)             (tie-break; force gives way)
    s.t. sum w_i + F = s
         TENSION_MAX   T_max - |w|                     >= 0     concave
         TENSION_MIN   |w| - T_min                     >= 0     not concave
         CONE          d.w - cos(cone) |w|             >= 0     concave, d = -e3
         RATE          a.alpha - cos(delta)            >= 0     delta = max_rate dt
         THRUST        f_max - |p - w|                 >= 0     concave
         TILT          e3.(p - w) - cos(tilt) |p - w|  >= 0     concave
         PAIR          cos(min_angle) - alpha_i.alpha_j >= 0    not concave; a cosine for each pair where there are distances
         ELLIPSOID     |S (L_i alpha_i - L_j alpha_j)| >= d     not concave, see :mod:`colift.control.allocation.limits.distance`

Every limit is kept strictly by every iterate: limits hold whenever the iteration is stopped.

Barrier. Each limit ``g >= 0`` has a fixed small barrier ``kappa``: multiplier ``z`` with ``z g = kappa``. The
barrier of the pairs is the tie-break that spreads the cables: of the (2n-5)-dimensional family of
optima (:mod:`colift.control.allocation.paper.newton`) it picks a wide one. Since the last answer is central,
``z = kappa / g`` is its multiplier: nothing but the answer itself has to be remembered.

Step. In the frame ``(alpha_i, B_i)`` of each cable, ``dw_i = tau_i alpha_i + B_i eta_i``. A function
``phi`` of the direction alone has gradient ``gamma/T`` (``gamma = B^T dphi/dalpha``), Hessian ``H/T^2`` on ``eta``
and ``-gamma/T^2`` between ``tau`` and ``eta``. The balance is linear: one full step closes it
exactly, and its multiplier ``lam`` enters no Hessian. ``tau_i`` eliminates itself; what is left per
cable is ``C_i`` (2x2), ``q_i``, ``P_i = B_i - alpha_i h_i^T / h_tt`` (3x2), and ``G_i`` (5x2), the coordinates of
``sqrt(mu) d(alpha alpha^T)``: the penalty couples all cables, but with rank 5 only. With ``K`` = ``C_i`` on the
diagonal and the near pairs' 2x2 blocks, and ``U_i = [G_i; P_i]``, ::

    (blkdiag(I_5, sum alpha alpha^T / h_tt) + U K^-1 U^T) [zeta; lam] = rhs

Each cable has few near neighbours, so ``K`` is factored inside its envelope, the cables ordered
along one horizontal axis. If it is not positive definite, ``K + shift I`` is.

Elastic force. ``s`` costs ``E_h |s_h| + E_v |s_v|``; the dual of that is the bound ``|lam_h| <= E_h``, ``|lam_v| <= E_v``
on the multiplier, a problem in three unknowns after the elimination. Inside the bound ``s = 0`` exactly. Since
``E_v >> E_h``, the horizontal part gives way first. When the bounds rise and fall: :func:`colift.control.allocation.limits.cycle.iterate`.

Source: own derivation; interior point as in Nocedal and Wright, Numerical Optimization, ch. 19.
This file imports only the compiler front end, thresholds and the limits on distances.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from colift.control.allocation.limits import distance
from colift.kernel.jit import inline
from colift.kernel.math.vectors import add_quad, eliminate, solve
from colift.kernel.rounding import AT_THE_BOUND, ON_THE_RIM, PIVOT

TENSION_MAX, TENSION_MIN, CONE, RATE, THRUST, TILT = range(6)
LIMITS = 6
"""Limits of one cable."""

DATA = 16
"""Per cable and cycle: a (3), omega, T_min, T_max, cos cone, 1 - cos delta, p (3), f_max, cos tilt, b (3)."""
A, OMEGA, T_MIN, T_MAX, COS_CONE, VERS_RATE = 0, 3, 4, 5, 6, 7
P, F_MAX, COS_TILT, HOME = 8, 11, 12, 13

ROW = 20
"""Per cable and step: B (6), alpha (3), spare, C (3), q (2), h (2), h_tt, r_t, 1 / h_tt.

While the pairs are summed up, ``gamma`` and its barrier version stand where ``alpha`` is in the end."""

RHS = 9
"""Columns of the right-hand side: zeta (5), lam (3), q."""
PITCH = 12
"""Numbers from one row of it to the next: what is behind the ninth is zero."""

DENSE = 8
"""Teams of up to so many cables have their matrix as a square; larger ones by columns, as long as the envelope is."""
STRONG, STRONGEST = 0.004, 0.1
"""Stiffness of a pair over that of the proximal term from which on it is strong: up to 16 cables, and the most. It grows with the
square of the number of cables between: a step's matrix costs that much more, one more step does not."""

SYSTEM = 8 * 8 + 8 + 8
"""The system of eight, its right-hand side, and that after elimination."""


class Work(NamedTuple):
    """Arrays of one cycle, all flat: per cable (n), per limit ``LIMITS n + m``, per near pair (m)."""

    data: Any
    """``DATA`` per cable: what the cycle asks of it."""
    T: Any
    alpha: Any
    """Tensions (n) and directions (3n) of the iterate."""
    w: Any
    dw: Any
    w_new: Any
    """Forces of the cables, the step, and where it leads (3n)."""
    g: Any
    g_new: Any
    z: Any
    """Value of every limit, before and after a step, and its multiplier."""
    pairs: Any
    """Cables ``i, j`` of every near pair (2m), ``j < i``."""
    kappa_pair: Any
    cos_max: Any
    """Barrier of every near pair, and the largest cosine of its angle; or ``q`` of its ellipsoid."""
    cause: Any
    root: Any
    """What limits every near pair, as a bit; of an ellipsoid ``sqrt(L_i / L_j)``."""
    flat: float
    """Of ellipsoids, ``1 / stretch^2``."""
    first: Any
    strong: Any
    """First near neighbour of every cable, and first of those whose pair is stiff, see :func:`is_strong`."""
    last: Any
    begin: Any
    """Last cable in the columns of every cable, and where in ``K`` they begin, see :func:`lay_out`."""
    rows: Any
    """``ROW`` per cable and step."""
    K: Any
    Y: Any
    S: Any
    eta: Any
    """The matrix and its factor, ``L^-1 [U^T, q]``, the reduced system, and what it leaves for every cable (2n)."""
    lam: Any
    M: Any
    """Multiplier of the force balance (3), ``sum alpha alpha^T`` (6)."""


class Weights(NamedTuple):
    """Weights of the objective in one phase of the iteration, scaled."""

    cost: float
    mu: float
    rho: float
    kappa: float
    kappa_rate: float


@inline
def strength(n):  # type: ignore[no-untyped-def]
    """Stiffness over that of the proximal term from which on a pair of n cables is strong."""
    return min(STRONG * max(1.0, (n / 16.0) ** 2), STRONGEST)


@inline
def is_strong(c, g, kappa, stiff):  # type: ignore[no-untyped-def]
    """Whether a pair with the cosine c and the margin g couples its cables noticeably beside the proximal term."""
    return kappa * (1.0 - c * c + g) > stiff * g * g


@inline
def lay_out(n, whole, work):  # type: ignore[no-untyped-def]
    """Where the columns of every cable stand in ``K``; none where the matrix is a square.

    Cable j has two columns, one behind the other. Each has the rows of the cables j to ``last[j]``, two for each, and two more
    that are zero. All that the factor fills is within these: ``last`` never falls from cable to cable. Not ``whole`` leaves out
    pairs that are not strong and beyond all that are: steps take them for fixed, gradients do not.
    """
    if n <= DENSE:
        return
    last, begin = work.last, work.begin
    for j in range(n):
        last[j] = j
    for i in range(n):
        j = int(work.first[i] if whole else work.strong[i])
        last[j] = i
    at = 0
    reached = 0
    for j in range(n):
        reached = max(reached, int(last[j]))
        last[j] = reached
        begin[j] = at
        at += 2 * height(j, last)


@inline
def height(j, last):  # type: ignore[no-untyped-def]
    """Numbers in one column of cable j."""
    return 2 * (int(last[j]) - j) + 4


@inline
def block_of(n, i, j, work):  # type: ignore[no-untyped-def]
    """Where the block of the cables i and j < i stands in ``K``, the way to its next row and to its next column."""
    if n <= DENSE:
        return 4 * n * i + 2 * j, 2 * n, 1
    return int(work.begin[j]) + 2 * (i - j), 1, height(j, work.last)


@inline
def margins(n, limits, caps, m, work, w, g):  # type: ignore[no-untyped-def]
    """From ``w``: tensions, directions and the value of every limit, cables first, then pairs, of which ``caps`` are angles."""
    data, T, alpha, pairs, cos_max = work.data, work.T, work.alpha, work.pairs, work.cos_max
    for i in range(n):
        d = DATA * i
        x = w[3 * i]
        y = w[3 * i + 1]
        z = w[3 * i + 2]
        t = math.sqrt(x * x + y * y + z * z)
        inverse = 1.0 / max(t, 1e-300)
        ax = x * inverse
        ay = y * inverse
        az = z * inverse
        T[i] = t
        alpha[3 * i] = ax
        alpha[3 * i + 1] = ay
        alpha[3 * i + 2] = az
        o = LIMITS * i
        dx = ax - data[d]
        dy = ay - data[d + 1]
        dz = az - data[d + 2]
        versine = 0.5 * (dx * dx + dy * dy + dz * dz)
        g[o] = data[d + T_MAX] - t
        g[o + 1] = t - data[d + T_MIN]
        g[o + 2] = -z - data[d + COS_CONE] * t
        g[o + 3] = data[d + VERS_RATE] - versine
        if limits > 4:
            fx = data[d + P] - x
            fy = data[d + P + 1] - y
            fz = data[d + P + 2] - z
            thrust = math.sqrt(fx * fx + fy * fy + fz * fz)
            g[o + 4] = data[d + F_MAX] - thrust
            g[o + 5] = fz - data[d + COS_TILT] * thrust
    o = LIMITS * n
    for k in range(caps):
        i = 3 * int(pairs[2 * k])
        j = 3 * int(pairs[2 * k + 1])
        g[o + k] = cos_max[k] - (
            alpha[i] * alpha[j] + alpha[i + 1] * alpha[j + 1] + alpha[i + 2] * alpha[j + 2]
        )
    distance.margins(n, caps, m, o, work, g)


@inline
def assemble(n, limits, caps, m, weights, work):  # type: ignore[no-untyped-def]
    """Gradient and Hessian at ``(T, alpha)``: fills ``rows`` and the pair blocks of ``K``."""
    cost, mu, rho, kappa, kappa_rate = weights
    data, T, alpha, g, z, M = work.data, work.T, work.alpha, work.g, work.z, work.M
    pairs, kappa_pair, first = work.pairs, work.kappa_pair, work.first
    rows, K = work.rows, work.K
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(n):
        x = alpha[3 * i]
        y = alpha[3 * i + 1]
        zc = alpha[3 * i + 2]
        xx += x * x
        xy += x * y
        xz += x * zc
        yy += y * y
        yz += y * zc
        zz += zc * zc
        # Basis of the tangent plane without trigonometry (Duff et al. 2017).
        sign = math.copysign(1.0, zc)
        a = -1.0 / (sign + zc)
        c = x * y * a
        o = ROW * i
        rows[o] = 1.0 + sign * x * x * a
        rows[o + 1] = sign * c
        rows[o + 2] = -sign * x
        rows[o + 3] = c
        rows[o + 4] = sign + y * y * a
        rows[o + 5] = -y
        for k in range(6, ROW):
            rows[o + k] = 0.0
        if n <= DENSE:
            for k in range(2 * int(first[i]), 2 * i):
                K[4 * n * i + k] = 0.0
                K[4 * n * i + 2 * n + k] = 0.0
    M[0] = xx
    M[1] = xy
    M[2] = xz
    M[3] = yy
    M[4] = yz
    M[5] = zz
    if n > DENSE:
        for k in range(int(work.begin[n - 1]) + 2 * height(n - 1, work.last)):
            K[k] = 0.0

    for k in range(caps):
        i = int(pairs[2 * k])
        j = int(pairs[2 * k + 1])  # j < i
        oi = ROW * i
        oj = ROW * j
        gk = g[LIMITS * n + k]
        zk = z[LIMITS * n + k]
        stiff = zk / gk
        primal = kappa_pair[k] / gk
        aix, aiy, aiz = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        ajx, ajy, ajz = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
        bi0, bi1, bi2 = rows[oi], rows[oi + 1], rows[oi + 2]
        di0, di1, di2 = rows[oi + 3], rows[oi + 4], rows[oi + 5]
        bj0, bj1, bj2 = rows[oj], rows[oj + 1], rows[oj + 2]
        dj0, dj1, dj2 = rows[oj + 3], rows[oj + 4], rows[oj + 5]
        c = aix * ajx + aiy * ajy + aiz * ajz
        ui1 = bi0 * ajx + bi1 * ajy + bi2 * ajz
        ui2 = di0 * ajx + di1 * ajy + di2 * ajz
        uj1 = bj0 * aix + bj1 * aiy + bj2 * aiz
        uj2 = dj0 * aix + dj1 * aiy + dj2 * aiz
        rows[oi + 6] += zk * ui1
        rows[oi + 7] += zk * ui2
        rows[oj + 6] += zk * uj1
        rows[oj + 7] += zk * uj2
        rows[oi + 8] += primal * ui1
        rows[oi + 9] += primal * ui2
        rows[oj + 8] += primal * uj1
        rows[oj + 9] += primal * uj2
        rows[oi + 10] += stiff * ui1 * ui1 - zk * c
        rows[oi + 11] += stiff * ui1 * ui2
        rows[oi + 12] += stiff * ui2 * ui2 - zk * c
        rows[oj + 10] += stiff * uj1 * uj1 - zk * c
        rows[oj + 11] += stiff * uj1 * uj2
        rows[oj + 12] += stiff * uj2 * uj2 - zk * c
        if n > DENSE and i > work.last[j]:
            continue
        scale = 1.0 / (T[i] * T[j])
        top, down, right = block_of(n, i, j, work)
        low = top + down
        K[top] = scale * (stiff * ui1 * uj1 + zk * (bi0 * bj0 + bi1 * bj1 + bi2 * bj2))
        K[top + right] = scale * (stiff * ui1 * uj2 + zk * (bi0 * dj0 + bi1 * dj1 + bi2 * dj2))
        K[low] = scale * (stiff * ui2 * uj1 + zk * (di0 * bj0 + di1 * bj1 + di2 * bj2))
        K[low + right] = scale * (stiff * ui2 * uj2 + zk * (di0 * dj0 + di1 * dj1 + di2 * dj2))
    distance.assemble(n, caps, m, LIMITS * n, ROW, block_of, work)

    for i in range(n):
        d = DATA * i
        o = ROW * i
        at = LIMITS * i
        t = T[i]
        inv = 1.0 / t
        x, y, zc = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        b0, b1, b2 = rows[o], rows[o + 1], rows[o + 2]
        d0, d1, d2 = rows[o + 3], rows[o + 4], rows[o + 5]
        px = xx * x + xy * y + xz * zc
        py = xy * x + yy * y + yz * zc
        pz = xz * x + yz * y + zz * zc
        mb0 = xx * b0 + xy * b1 + xz * b2
        mb1 = xy * b0 + yy * b1 + yz * b2
        mb2 = xz * b0 + yz * b1 + zz * b2
        md0 = xx * d0 + xy * d1 + xz * d2
        md1 = xy * d0 + yy * d1 + yz * d2
        md2 = xz * d0 + yz * d1 + zz * d2
        ax, ay, az = data[d], data[d + 1], data[d + 2]
        near = ax * x + ay * y + az * zc
        e1 = ax * b0 + ay * b1 + az * b2
        e2 = ax * d0 + ay * d1 + az * d2
        # Functions of the direction: penalty, proximal term, rate, pairs.
        hx, hy, hz = rho * data[d + HOME], rho * data[d + HOME + 1], rho * data[d + HOME + 2]
        s1 = 2.0 * mu * (b0 * px + b1 * py + b2 * pz) - (hx * b0 + hy * b1 + hz * b2)
        s2 = 2.0 * mu * (d0 * px + d1 * py + d2 * pz) - (hx * d0 + hy * d1 + hz * d2)
        z3, g3 = z[at + 3], 1.0 / g[at + 3]
        f3 = z3 * g3
        k3 = kappa_rate * g3
        gamma1 = rows[o + 6] + s1 - z3 * e1
        gamma2 = rows[o + 7] + s2 - z3 * e2
        base = hx * x + hy * y + hz * zc - 2.0 * mu * (px * x + py * y + pz * zc) + z3 * near
        c11 = rows[o + 10] + 2.0 * mu * (b0 * mb0 + b1 * mb1 + b2 * mb2) + base + f3 * e1 * e1
        c12 = rows[o + 11] + 2.0 * mu * (b0 * md0 + b1 * md1 + b2 * md2) + f3 * e1 * e2
        c22 = rows[o + 12] + 2.0 * mu * (d0 * md0 + d1 * md1 + d2 * md2) + base + f3 * e2 * e2
        squared = inv * inv
        c11 *= squared
        c12 *= squared
        c22 *= squared
        h1 = -gamma1 * squared
        h2 = -gamma2 * squared
        q1 = (rows[o + 8] + s1 - k3 * e1) * inv
        q2 = (rows[o + 9] + s2 - k3 * e2) * inv
        # Functions of the force.
        omega = cost * data[d + OMEGA]
        htt = omega
        rt = omega * t
        cos_cone = data[d + COS_CONE]
        z0, z1, z2 = z[at], z[at + 1], z[at + 2]
        g0, g1, g2 = 1.0 / g[at], 1.0 / g[at + 1], 1.0 / g[at + 2]
        round_ = omega + (z0 - z1 + z2 * cos_cone) * inv
        c11 += round_
        c22 += round_
        htt += z0 * g0
        rt += kappa * g0
        htt += z1 * g1
        rt -= kappa * g1
        v = -zc - cos_cone
        f2 = z2 * g2
        k2 = kappa * g2
        htt += f2 * v * v
        rt -= k2 * v
        h1 -= f2 * v * b2
        h2 -= f2 * v * d2
        q1 += k2 * b2
        q2 += k2 * d2
        c11 += f2 * b2 * b2
        c12 += f2 * b2 * d2
        c22 += f2 * d2 * d2
        if limits > 4:
            fx = data[d + P] - t * x
            fy = data[d + P + 1] - t * y
            fz = data[d + P + 2] - t * zc
            r = 1.0 / math.sqrt(fx * fx + fy * fy + fz * fz)
            fx *= r
            fy *= r
            fz *= r
            cos_tilt = data[d + COS_TILT]
            ra = fx * x + fy * y + fz * zc
            r1 = fx * b0 + fy * b1 + fz * b2
            r2 = fx * d0 + fy * d1 + fz * d2
            z4, z5 = z[at + 4], z[at + 5]
            g4, g5 = 1.0 / g[at + 4], 1.0 / g[at + 5]
            bend = (z4 + z5 * cos_tilt) * r
            f4 = z4 * g4 - bend
            k4 = kappa * g4
            htt += bend + f4 * ra * ra
            h1 += f4 * ra * r1
            h2 += f4 * ra * r2
            c11 += bend + f4 * r1 * r1
            c12 += f4 * r1 * r2
            c22 += bend + f4 * r2 * r2
            rt -= k4 * ra
            q1 -= k4 * r1
            q2 -= k4 * r2
            va = cos_tilt * ra - zc
            v1 = cos_tilt * r1 - b2
            v2 = cos_tilt * r2 - d2
            f5 = z5 * g5
            k5 = kappa * g5
            htt += f5 * va * va
            h1 += f5 * va * v1
            h2 += f5 * va * v2
            c11 += f5 * v1 * v1
            c12 += f5 * v1 * v2
            c22 += f5 * v2 * v2
            rt -= k5 * va
            q1 -= k5 * v1
            q2 -= k5 * v2
        rows[o + 6] = x
        rows[o + 7] = y
        rows[o + 8] = zc
        rows[o + 10] = c11
        rows[o + 11] = c12
        rows[o + 12] = c22
        rows[o + 13] = q1
        rows[o + 14] = q2
        rows[o + 15] = h1
        rows[o + 16] = h2
        rows[o + 17] = htt
        rows[o + 18] = rt


@inline
def gradient(n, limits, caps, m, weights, work):  # type: ignore[no-untyped-def]
    """Gradient at ``(T, alpha)`` alone, world frame, into ``w_new``; the largest over the cables of the Lagrangian's."""
    cost, mu, rho, kappa, kappa_rate = weights
    data, T, alpha, g, M, lam = work.data, work.T, work.alpha, work.g, work.M, work.lam
    pairs, kappa_pair, G = work.pairs, work.kappa_pair, work.w_new
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        xx += x * x
        xy += x * y
        xz += x * z
        yy += y * y
        yz += y * z
        zz += z * z
        G[3 * i] = 0.0
        G[3 * i + 1] = 0.0
        G[3 * i + 2] = 0.0
    M[0] = xx
    M[1] = xy
    M[2] = xz
    M[3] = yy
    M[4] = yz
    M[5] = zz
    for k in range(caps):
        i = 3 * int(pairs[2 * k])
        j = 3 * int(pairs[2 * k + 1])
        primal = kappa_pair[k] / g[LIMITS * n + k]
        G[i] += primal * alpha[j]
        G[i + 1] += primal * alpha[j + 1]
        G[i + 2] += primal * alpha[j + 2]
        G[j] += primal * alpha[i]
        G[j + 1] += primal * alpha[i + 1]
        G[j + 2] += primal * alpha[i + 2]
    distance.add_gradient(caps, m, LIMITS * n, work, G)
    lx, ly, lz = lam[0], lam[1], lam[2]
    worst = 0.0
    for i in range(n):
        d = DATA * i
        at = LIMITS * i
        t = T[i]
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        # Functions of the direction.
        k3 = kappa_rate / g[at + RATE]
        ux = G[3 * i] + 2.0 * mu * (xx * x + xy * y + xz * z)
        uy = G[3 * i + 1] + 2.0 * mu * (xy * x + yy * y + yz * z)
        uz = G[3 * i + 2] + 2.0 * mu * (xz * x + yz * y + zz * z)
        ux -= rho * data[d + HOME] + k3 * data[d]
        uy -= rho * data[d + HOME + 1] + k3 * data[d + 1]
        uz -= rho * data[d + HOME + 2] + k3 * data[d + 2]
        # Functions of the force; what lies along the cable first.
        k2 = kappa / g[at + CONE]
        along = cost * data[d + OMEGA] * t + kappa / g[at] - kappa / g[at + TENSION_MIN]
        along += k2 * data[d + COS_CONE]
        inv = 1.0 / t
        along -= (ux * x + uy * y + uz * z) * inv
        ux = ux * inv + along * x
        uy = uy * inv + along * y
        uz = uz * inv + along * z + k2
        if limits > 4:
            fx = data[d + P] - t * x
            fy = data[d + P + 1] - t * y
            fz = data[d + P + 2] - t * z
            k5 = kappa / g[at + TILT]
            push = kappa / g[at + THRUST] + k5 * data[d + COS_TILT]
            push /= math.sqrt(fx * fx + fy * fy + fz * fz)
            ux -= push * fx
            uy -= push * fy
            uz -= push * fz - k5
        G[3 * i] = ux
        G[3 * i + 1] = uy
        G[3 * i + 2] = uz
        ux += lx
        uy += ly
        uz += lz
        worst = max(worst, ux * ux + uy * uy + uz * uz)
    return math.sqrt(worst)


@inline
def stationarity(n, work):  # type: ignore[no-untyped-def]
    """Largest component over the cables of the Lagrangian's gradient (scaled force)."""
    alpha, rows, lam = work.alpha, work.rows, work.lam
    worst = 0.0
    for i in range(n):
        o = ROW * i
        rt = rows[o + 18] + (
            lam[0] * alpha[3 * i] + lam[1] * alpha[3 * i + 1] + lam[2] * alpha[3 * i + 2]
        )
        r1 = rows[o + 13] + lam[0] * rows[o] + lam[1] * rows[o + 1] + lam[2] * rows[o + 2]
        r2 = rows[o + 14] + lam[0] * rows[o + 3] + lam[1] * rows[o + 4] + lam[2] * rows[o + 5]
        worst = max(worst, rt * rt + r1 * r1 + r2 * r2)
    return math.sqrt(worst)


@inline
def factor(n, shift, mu, work):  # type: ignore[no-untyped-def]
    """Eliminate ``tau``; Cholesky of ``K + shift I`` in its envelope; ``Y = L^-1 [U^T, q]``.

    False if ``K + shift I`` is not positive definite.
    """
    right_sides(n, mu, work)
    if n <= DENSE:
        return factor_square(n, shift, work)
    return factor_columns(n, shift, work)


@inline
def right_sides(n, mu, work):  # type: ignore[no-untyped-def]
    """``[U^T, q]`` into ``Y``."""
    T, alpha, rows, Y = work.T, work.alpha, work.rows, work.Y
    root = math.sqrt(2.0 * mu)
    root_a = math.sqrt(2.0 * mu)
    root_b = math.sqrt(6.0 * mu)
    for i in range(n):
        o = ROW * i
        inv = 1.0 / T[i]
        x, y, zc = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        b0, b1, b2 = rows[o], rows[o + 1], rows[o + 2]
        d0, d1, d2 = rows[o + 3], rows[o + 4], rows[o + 5]
        inverse = 1.0 / rows[o + 17]
        rows[o + 19] = inverse
        h1, h2 = rows[o + 15] * inverse, rows[o + 16] * inverse
        rt = rows[o + 18]
        ra = root * inv
        rb = root_a * inv
        rc = root_b * inv
        k0 = PITCH * 2 * i
        k1 = k0 + PITCH
        Y[k0] = ra * (x * b1 + y * b0)
        Y[k0 + 1] = ra * (x * b2 + zc * b0)
        Y[k0 + 2] = ra * (y * b2 + zc * b1)
        Y[k0 + 3] = rb * (x * b0 - y * b1)
        Y[k0 + 4] = rc * zc * b2
        Y[k0 + 5] = b0 - x * h1
        Y[k0 + 6] = b1 - y * h1
        Y[k0 + 7] = b2 - zc * h1
        Y[k0 + 8] = rows[o + 13] - h1 * rt
        Y[k1] = ra * (x * d1 + y * d0)
        Y[k1 + 1] = ra * (x * d2 + zc * d0)
        Y[k1 + 2] = ra * (y * d2 + zc * d1)
        Y[k1 + 3] = rb * (x * d0 - y * d1)
        Y[k1 + 4] = rc * zc * d2
        Y[k1 + 5] = d0 - x * h2
        Y[k1 + 6] = d1 - y * h2
        Y[k1 + 7] = d2 - zc * h2
        Y[k1 + 8] = rows[o + 14] - h2 * rt


@inline
def own_block(i, shift, rows):  # type: ignore[no-untyped-def]
    """``C_i`` without ``tau``, shifted: lower triangle."""
    o = ROW * i
    inverse = rows[o + 19]
    h1, h2 = rows[o + 15] * inverse, rows[o + 16] * inverse
    c00 = rows[o + 10] - h1 * rows[o + 15] + shift
    c10 = rows[o + 11] - h1 * rows[o + 16]
    c11 = rows[o + 12] - h2 * rows[o + 16] + shift
    return c00, c10, c11


@inline
def factor_square(n, shift, work):  # type: ignore[no-untyped-def]
    """Row by row, each cable's two within their envelope: for few cables."""
    first, rows, K, Y = work.first, work.rows, work.K, work.Y
    size = 2 * n
    for i in range(n):
        c00, c10, c11 = own_block(i, shift, rows)
        k0 = PITCH * 2 * i
        k1 = k0 + PITCH
        top = size * 2 * i
        low = top + size
        for j in range(int(first[i]), i):
            tj = size * 2 * j
            lj = tj + size
            s00, s01 = K[top + 2 * j], K[top + 2 * j + 1]
            s10, s11 = K[low + 2 * j], K[low + 2 * j + 1]
            for k in range(2 * int(max(first[i], first[j])), 2 * j):
                x0, x1 = K[top + k], K[low + k]
                y0, y1 = K[tj + k], K[lj + k]
                s00 -= x0 * y0
                s01 -= x0 * y1
                s10 -= x1 * y0
                s11 -= x1 * y1
            i0 = K[tj + 2 * j]
            l10 = K[lj + 2 * j]
            i1 = K[lj + 2 * j + 1]
            s00 *= i0
            s10 *= i0
            s01 = (s01 - s00 * l10) * i1
            s11 = (s11 - s10 * l10) * i1
            K[top + 2 * j] = s00
            K[top + 2 * j + 1] = s01
            K[low + 2 * j] = s10
            K[low + 2 * j + 1] = s11
            c00 -= s00 * s00 + s01 * s01
            c10 -= s00 * s10 + s01 * s11
            c11 -= s10 * s10 + s11 * s11
            q0 = PITCH * 2 * j
            q1 = q0 + PITCH
            eliminate(Y, RHS, k0, k1, q0, q1, s00, s01, s10, s11)
        if not c00 > PIVOT:
            return False
        i0 = 1.0 / math.sqrt(c00)
        l10 = c10 * i0
        c11 -= l10 * l10
        if not c11 > PIVOT:
            return False
        i1 = 1.0 / math.sqrt(c11)
        K[top + 2 * i] = i0
        K[low + 2 * i] = l10
        K[low + 2 * i + 1] = i1
        solve(Y, RHS, k0, k1, i0, l10, i1)
    return True


@inline
def factor_columns(n, shift, work):  # type: ignore[no-untyped-def]
    """Column by column, each cable's two less all that reach so far: the long loops are along columns and right sides."""
    last, begin, rows, K, Y = work.last, work.begin, work.rows, work.K, work.Y
    lowest = 0
    for j in range(n):
        while last[lowest] < j:
            lowest += 1
        c = int(begin[j])
        s = c + height(j, last)
        c00, c10, c11 = own_block(j, shift, rows)
        K[c] = c00
        K[c + 1] = c10
        K[s + 1] = c11
        y0 = PITCH * 2 * j
        y1 = y0 + PITCH
        for k in range(lowest, j):
            one = int(begin[k]) + 2 * (j - k)
            two = one + height(k, last)
            a00, a01, a10, a11 = K[one], K[two], K[one + 1], K[two + 1]
            eliminate(K, 2 * (int(last[k]) - j + 1), c, s, one, two, a00, a01, a10, a11)
            q0 = PITCH * 2 * k
            eliminate(Y, RHS, y0, y1, q0, q0 + PITCH, a00, a01, a10, a11)
        if not K[c] > PIVOT:
            return False
        i0 = 1.0 / math.sqrt(K[c])
        l10 = K[c + 1] * i0
        c11 = K[s + 1] - l10 * l10
        if not c11 > PIVOT:
            return False
        i1 = 1.0 / math.sqrt(c11)
        for r in range(2, 2 * (int(last[j]) - j + 1)):
            K[c + r] *= i0
            K[s + r] = (K[s + r] - l10 * K[c + r]) * i1
        K[c], K[c + 1], K[s + 1] = i0, l10, i1
        solve(Y, RHS, y0, y1, i0, l10, i1)
    return True


@inline
def reduced_system(n, rx, ry, rz, work):  # type: ignore[no-untyped-def]
    """The 8x8 system and its right-hand side (row 8), ``(rx, ry, rz) = sum w + F``."""
    alpha, rows, Y, S = work.alpha, work.rows, work.Y, work.S
    for k in range(SYSTEM):
        S[k] = 0.0
    for k in range(5):
        S[9 * k] = 1.0
    S[69] = rx
    S[70] = ry
    S[71] = rz
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        inverse = rows[ROW * i + 19]
        S[45] += x * x * inverse
        S[53] += y * x * inverse
        S[54] += y * y * inverse
        S[61] += z * x * inverse
        S[62] += z * y * inverse
        S[63] += z * z * inverse
        part = rows[ROW * i + 18] * inverse
        S[69] -= part * x
        S[70] -= part * y
        S[71] -= part * z
    # U K^-1 U^T whole, as its rows are the columns that the elimination needs.
    for r in range(0, 2 * PITCH * n, PITCH):
        for k in range(8):
            add_quad(S, 8 * k, Y, r, Y[r + k])
            add_quad(S, 8 * k + 4, Y, r + 4, Y[r + k])
        add_quad(S, 64, Y, r, -Y[r + 8])
        add_quad(S, 68, Y, r + 4, -Y[r + 8])


@inline
def solve_2x2_disc(a, b, c, x, y, radius):  # type: ignore[no-untyped-def]
    """Maximise ``r.l - 1/2 l^T A l`` over ``|l| <= radius``, ``A = [[a, b], [b, c]]`` positive definite.

    ``(A + nu I) l = r`` with the smallest ``nu >= 0`` that keeps ``|l| <= radius`` (secular equation).
    """
    nu = 0.0
    lx = ly = 0.0
    for _ in range(50):
        p = a + nu
        q = c + nu
        det = 1.0 / (p * q - b * b)
        lx = (q * x - b * y) * det
        ly = (p * y - b * x) * det
        norm = math.sqrt(lx * lx + ly * ly)
        if norm <= radius * (1.0 + ON_THE_RIM):
            break
        mx = (q * lx - b * ly) * det
        my = (p * ly - b * lx) * det
        nu += (norm / radius - 1.0) * norm * norm / (lx * mx + ly * my)
    return lx, ly


@inline
def multiplier(S, bound_h, bound_v, again):  # type: ignore[no-untyped-def]
    """Solve the 8x8 system with the multiplier of the force inside its bounds; into ``S[64:]``.

    ``again``: the matrix is eliminated already. Returns whether the bound is active (the force gives way).
    """
    for k in range(5):
        inverse = S[9 * k] if again else 1.0 / S[9 * k]
        f = 0.0
        for r in range(8 if again else k + 1, 9):
            f = S[8 * r + k] * inverse
            if k < 4:
                add_quad(S, 8 * r, S, 8 * k, -f)
            add_quad(S, 8 * r + 4, S, 8 * k + 4, -f)
        S[9 * k] = inverse
        S[72 + k] = f
    a, b, c = S[45], S[53], S[54]
    d, e, f = S[61], S[62], S[63]
    x, y, z = S[69], S[70], S[71]
    # Unbounded vertical part first: Schur complement on the horizontal part.
    inverse = 1.0 / f
    lx, ly = solve_2x2_disc(
        a - d * d * inverse,
        b - d * e * inverse,
        c - e * e * inverse,
        x - d * z * inverse,
        y - e * z * inverse,
        bound_h,
    )
    lz = (z - d * lx - e * ly) * inverse
    if abs(lz) > bound_v:
        lz = math.copysign(bound_v, lz)
        lx, ly = solve_2x2_disc(a, b, c, x - d * lz, y - e * lz, bound_h)
    active = lx * lx + ly * ly >= bound_h * bound_h * (1.0 - AT_THE_BOUND) or abs(lz) >= bound_v
    S[69] = lx
    S[70] = ly
    S[71] = lz
    for k in range(4, -1, -1):
        value = 0.0
        for m in range(k + 1, 8):
            value += S[8 * k + m] * S[64 + m]
        S[64 + k] = S[72 + k] - value * S[9 * k]
    return active


@inline
def next_right_side(n, rx, ry, rz, work):  # type: ignore[no-untyped-def]
    """For another step with the same matrix: column ``q`` of ``Y`` and the right-hand side of the 8x8 system.

    From the gradient in ``w_new``, in the frames of the matrix, and ``(rx, ry, rz) = sum w + F``.
    """
    first, G, eta = work.first, work.w_new, work.eta
    rows, K, Y, S = work.rows, work.K, work.Y, work.S
    for k in range(5):
        S[64 + k] = 0.0
    S[69] = rx
    S[70] = ry
    S[71] = rz
    for i in range(n):
        o = ROW * i
        gx, gy, gz = G[3 * i], G[3 * i + 1], G[3 * i + 2]
        x, y, z = rows[o + 6], rows[o + 7], rows[o + 8]
        q1 = rows[o] * gx + rows[o + 1] * gy + rows[o + 2] * gz
        q2 = rows[o + 3] * gx + rows[o + 4] * gy + rows[o + 5] * gz
        rt = x * gx + y * gy + z * gz
        rows[o + 13] = q1
        rows[o + 14] = q2
        rows[o + 18] = rt
        part = rt * rows[o + 19]
        S[69] -= part * x
        S[70] -= part * y
        S[71] -= part * z
        eta[2 * i] = q1 - rows[o + 15] * part
        eta[2 * i + 1] = q2 - rows[o + 16] * part
    for i in range(n):
        k0 = PITCH * 2 * i
        k1 = k0 + PITCH
        y0, y1 = eta[2 * i], eta[2 * i + 1]
        if n <= DENSE:
            top = 4 * n * i
            low = top + 2 * n
            for j in range(int(first[i]), i):
                v0, v1 = eta[2 * j], eta[2 * j + 1]
                y0 -= K[top + 2 * j] * v0 + K[top + 2 * j + 1] * v1
                y1 -= K[low + 2 * j] * v0 + K[low + 2 * j + 1] * v1
            y0 *= K[top + 2 * i]
            y1 = (y1 - K[low + 2 * i] * y0) * K[low + 2 * i + 1]
        else:
            c = int(work.begin[i])
            s = c + height(i, work.last)
            y0 *= K[c]
            y1 = (y1 - K[c + 1] * y0) * K[s + 1]
            for r in range(2, 2 * (int(work.last[i]) - i + 1)):
                eta[2 * i + r] -= K[c + r] * y0 + K[s + r] * y1
        eta[2 * i], eta[2 * i + 1] = y0, y1
        Y[k0 + 8] = y0
        Y[k1 + 8] = y1
        for k in range(8):
            S[64 + k] -= Y[k0 + k] * y0 + Y[k1 + k] * y1


@inline
def back_substitute(n, work):  # type: ignore[no-untyped-def]
    """``dw`` of every cable from the solution in ``S[64:]``; the largest component of the Lagrangian's gradient before it."""
    first, dw, eta = work.first, work.dw, work.eta
    rows, K, Y, S = work.rows, work.K, work.Y, work.S
    for r in range(2 * n):
        o = PITCH * r
        value = Y[o + 8]
        for k in range(8):
            value += Y[o + k] * S[64 + k]
        eta[r] = -value
    lx, ly, lz = S[69], S[70], S[71]
    worst = 0.0
    for i in range(n - 1, -1, -1):
        eta1, eta2 = eta[2 * i], eta[2 * i + 1]
        if n <= DENSE:
            top = 4 * n * i
            low = top + 2 * n
            eta2 *= K[low + 2 * i + 1]
            eta1 = (eta1 - K[low + 2 * i] * eta2) * K[top + 2 * i]
            for k in range(2 * int(first[i]), 2 * i):
                eta[k] -= K[top + k] * eta1 + K[low + k] * eta2
        else:
            c = int(work.begin[i])
            s = c + height(i, work.last)
            a, b = 0.0, 0.0
            for r in range(2, 2 * (int(work.last[i]) - i + 1), 2):
                u, v = eta[2 * i + r], eta[2 * i + r + 1]
                eta1 -= K[c + r] * u
                eta2 -= K[s + r] * u
                a += K[c + r + 1] * v
                b += K[s + r + 1] * v
            eta2 = (eta2 - b) * K[s + 1]
            eta1 = (eta1 - a - K[c + 1] * eta2) * K[c]
            eta[2 * i], eta[2 * i + 1] = eta1, eta2
        o = ROW * i
        x, y, z = rows[o + 6], rows[o + 7], rows[o + 8]
        rt = rows[o + 18] + lx * x + ly * y + lz * z
        r1 = rows[o + 13] + lx * rows[o] + ly * rows[o + 1] + lz * rows[o + 2]
        r2 = rows[o + 14] + lx * rows[o + 3] + ly * rows[o + 4] + lz * rows[o + 5]
        worst = max(worst, rt * rt + r1 * r1 + r2 * r2)
        tau = -(rt + rows[o + 15] * eta1 + rows[o + 16] * eta2) * rows[o + 19]
        dx = tau * x + rows[o] * eta1 + rows[o + 3] * eta2
        dy = tau * y + rows[o + 1] * eta1 + rows[o + 4] * eta2
        dz = tau * z + rows[o + 2] * eta1 + rows[o + 5] * eta2
        dw[3 * i] = dx
        dw[3 * i + 1] = dy
        dw[3 * i + 2] = dz
    return math.sqrt(worst)
