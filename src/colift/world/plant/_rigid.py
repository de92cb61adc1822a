"""Rigid massless cables as constraints: one linear system for tensions, impulses and projections.

A set of cables holds its drones at the cable length. A pull ``T_i`` along each, from drone to load,
changes the drones by ``T_i alpha_i / m_i`` and the load by ``-sum_i T_i alpha_i / m_L``; it must take away what
``b_i`` would otherwise appear along the cables (acceleration, velocity or length)::

    (1 / m_i) T_i + alpha_i . y / m_L = b_i,    y = sum_i T_i alpha_i
    (I + sum_i m_i alpha_i alpha_i^T / m_L) y = sum_i m_i b_i alpha_i

On a rigid load the pull acts at the cable's end, on the load's rates as well: the vectors gain three places,
``g_i = (alpha_i, rho_i x R^T alpha_i)``, and ``m_L`` becomes ``H = diag(m_L, m_L, m_L, I)``::

    (H + sum_i m_i g_i g_i^T) p = sum_i m_i b_i g_i,    T_i = m_i (b_i - g_i . p)

Accelerations give the tensions (paper eqs. 1 to 5), velocities the impulses of a plastic jerk, lengths the
projection that keeps momentum. Cables that winches pay out have lengths with two derivatives, which are taken from ``b``.
"""

from __future__ import annotations

from colift.kernel.jit import aside, inline
from colift.kernel.math import quaternion
from colift.kernel.math.small import matrix_times, solve_symmetric
from colift.world.plant._bodies import (
    BODY,
    DRONE,
    LOAD,
    MASS,
    free_motion,
    line,
    normalise,
    parting_speed,
)
from colift.world.plant._contact import touch
from colift.world.plant._load import end_acceleration, into_load
from colift.world.plant._params import P


@aside
def lever(i, y, alpha, params):  # type: ignore[no-untyped-def]
    """Direction of cable i in the load's frame, and its moment about the centre of mass: ``g_i``."""
    o = MASS + BODY * i + P.rho
    a, b, c = params[o], params[o + 1], params[o + 2]
    u, v, w = into_load(y, alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2])
    return u, v, w, b * w - c * v, c * u - a * w, a * v - b * u


@aside
def solve_rigid(n, y, alpha, b, held, params, T):  # type: ignore[no-untyped-def]
    """The same for a rigid load: the system of 6 by its blocks of 3, of places A, of turning C and of both B."""
    m_L, o = params[P.m_L], P.inertia
    axx = ayy = azz = m_L
    axy = axz = ayz = 0.0
    cxx, cxy, cxz = params[o], params[o + 1], params[o + 2]
    cyy, cyz, czz = params[o + 4], params[o + 5], params[o + 8]
    bxx = bxy = bxz = byx = byy = byz = bzx = bzy = bzz = 0.0
    rx = ry = rz = sx = sy = sz = 0.0
    for i in range(n):
        if held[i] > 0.0:
            m = params[MASS + BODY * i]
            x, y_, z, p, q, r = lever(i, y, alpha, params)
            axx, axy, axz = axx + m * x * x, axy + m * x * y_, axz + m * x * z
            ayy, ayz, azz = ayy + m * y_ * y_, ayz + m * y_ * z, azz + m * z * z
            cxx, cxy, cxz = cxx + m * p * p, cxy + m * p * q, cxz + m * p * r
            cyy, cyz, czz = cyy + m * q * q, cyz + m * q * r, czz + m * r * r
            bxx, bxy, bxz = bxx + m * x * p, bxy + m * x * q, bxz + m * x * r
            byx, byy, byz = byx + m * y_ * p, byy + m * y_ * q, byz + m * y_ * r
            bzx, bzy, bzz = bzx + m * z * p, bzy + m * z * q, bzz + m * z * r
            pull = m * b[i]
            rx, ry, rz = rx + pull * x, ry + pull * y_, rz + pull * z
            sx, sy, sz = sx + pull * p, sy + pull * q, sz + pull * r
    # Columns of A^-1 B, and A^-1 r.
    fx, fy, fz = solve_symmetric(axx, axy, axz, ayy, ayz, azz, bxx, byx, bzx)
    gx, gy, gz = solve_symmetric(axx, axy, axz, ayy, ayz, azz, bxy, byy, bzy)
    hx, hy, hz = solve_symmetric(axx, axy, axz, ayy, ayz, azz, bxz, byz, bzz)
    kx, ky, kz = solve_symmetric(axx, axy, axz, ayy, ayz, azz, rx, ry, rz)
    px, py, pz = solve_symmetric(
        cxx - bxx * fx - byx * fy - bzx * fz,
        cxy - bxx * gx - byx * gy - bzx * gz,
        cxz - bxx * hx - byx * hy - bzx * hz,
        cyy - bxy * gx - byy * gy - bzy * gz,
        cyz - bxy * hx - byy * hy - bzy * hz,
        czz - bxz * hx - byz * hy - bzz * hz,
        sx - bxx * kx - byx * ky - bzx * kz,
        sy - bxy * kx - byy * ky - bzy * kz,
        sz - bxz * kx - byz * ky - bzz * kz,
    )
    ux = kx - fx * px - gx * py - hx * pz
    uy = ky - fy * px - gy * py - hy * pz
    uz = kz - fz * px - gz * py - hz * pz
    for i in range(n):
        T[i] = 0.0
        if held[i] > 0.0:
            x, y_, z, p, q, r = lever(i, y, alpha, params)
            along = x * ux + y_ * uy + z * uz + p * px + q * py + r * pz
            T[i] = params[MASS + BODY * i] * (b[i] - along)


@aside
def moment_of(n, y, alpha, T, params):  # type: ignore[no-untyped-def]
    """By what the pulls change the rates of a rigid load, against their sense, in its frame."""
    mx = my = mz = 0.0
    for i in range(n):
        _, _, _, p, q, r = lever(i, y, alpha, params)
        mx, my, mz = mx + T[i] * p, my + T[i] * q, mz + T[i] * r
    return matrix_times(P.inverse, params, (mx, my, mz))


@inline
def solve(n, y, alpha, b, held, params, T):  # type: ignore[no-untyped-def]
    """Pulls of the held cables; zero for the others."""
    if params[P.rigid] > 0.0:
        solve_rigid(n, y, alpha, b, held, params, T)
        return
    m_L = params[0]
    sxx = syy = szz = 1.0
    sxy = sxz = syz = 0.0
    rx = ry = rz = 0.0
    for i in range(n):
        if held[i] > 0.0:
            m = params[MASS + BODY * i]
            x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
            share = m / m_L
            sxx += share * x * x
            sxy += share * x * y
            sxz += share * x * z
            syy += share * y * y
            syz += share * y * z
            szz += share * z * z
            rx += m * b[i] * x
            ry += m * b[i] * y
            rz += m * b[i] * z
    # y = S^-1 r by the adjugate; S is the identity plus a positive semidefinite matrix.
    cxx = syy * szz - syz * syz
    cxy = sxz * syz - sxy * szz
    cxz = sxy * syz - sxz * syy
    cyy = sxx * szz - sxz * sxz
    cyz = sxy * sxz - sxx * syz
    czz = sxx * syy - sxy * sxy
    det = sxx * cxx + sxy * cxy + sxz * cxz
    px = (cxx * rx + cxy * ry + cxz * rz) / det
    py = (cxy * rx + cyy * ry + cyz * rz) / det
    pz = (cxz * rx + cyz * ry + czz * rz) / det
    for i in range(n):
        T[i] = 0.0
        if held[i] > 0.0:
            along = alpha[3 * i] * px + alpha[3 * i + 1] * py + alpha[3 * i + 2] * pz
            T[i] = params[MASS + BODY * i] * (b[i] - along / m_L)


@inline
def pull(n, state, alpha, T, params, where, y):  # type: ignore[no-untyped-def]
    """Apply pulls to the positions (``where`` = 0) or velocities (3) of the ``state``, or to its derivative ``y``."""
    if params[P.rigid] > 0.0:
        ax, ay, az = moment_of(n, state, alpha, T, params)
        if where > 0:
            y[10] -= ax
            y[11] -= ay
            y[12] -= az
        else:
            y[6], y[7], y[8], y[9] = quaternion.turn(y[6], y[7], y[8], y[9], -ax, -ay, -az)
    for i in range(n):
        o = LOAD + DRONE * i + where
        m = params[MASS + BODY * i]
        for k in range(3):
            part = T[i] * alpha[3 * i + k]
            y[o + k] += part / m
            y[where + k] -= part / params[0]


@inline
def lines(n, y, params, alpha, lengths):  # type: ignore[no-untyped-def]
    """Unit vectors from the drones to the ends of their cables, and the distances."""
    for i in range(n):
        x, y_, z, d = line(i, y, params)
        alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2] = x, y_, z
        lengths[i] = d


@inline
def closing(n, y, params, alpha, rates, b):  # type: ignore[no-untyped-def]
    """Velocities at which the load moves away from the drones, along the cables, less those at which they are paid out."""
    for i in range(n):
        vx, vy, vz = parting_speed(i, y, params)
        b[i] = alpha[3 * i] * vx + alpha[3 * i + 1] * vy + alpha[3 * i + 2] * vz - rates[i]


@inline
def demand(n, y, dy, params, alpha, bends, b):  # type: ignore[no-untyped-def]
    """Accelerations by which the distances would outgrow the cables if these did not pull; ``b`` holds the distances before."""
    for i in range(n):
        o = LOAD + DRONE * i + 3
        x, y_, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        vx, vy, vz = parting_speed(i, y, params)
        along = x * vx + y_ * vy + z * vz
        squared = vx * vx + vy * vy + vz * vz - along * along
        ax, ay, az = end_acceleration(i, y, dy, params)
        ax, ay, az = ax - dy[o], ay - dy[o + 1], az - dy[o + 2]
        b[i] = squared / max(b[i], 1e-12) + x * ax + y_ * ay + z * az - bends[i]


@inline
def derivative(  # type: ignore[no-untyped-def]
    n,
    y,
    thrusts,
    torques,
    external,
    moment,
    held,
    anchors,
    w,
    params,
    bends,
    T,
    alpha,
    b,
    forces,
    dy,
):
    """Time derivative of the state under the held cables; fills the tensions ``T`` and the ground's ``forces``.

    ``bends`` are the second derivatives of the cables' lengths.
    ``alpha`` (3 numbers a drone) and ``b`` (one) are for intermediate results.
    """
    free_motion(n, y, thrusts, torques, external, moment, params, dy)
    if params[P.ground] > 0.0:
        touch(n, y, anchors, w, params, forces, dy)
    lines(n, y, params, alpha, b)
    demand(n, y, dy, params, alpha, bends, b)
    solve(n, y, alpha, b, held, params, T)
    pull(n, y, alpha, T, params, 3, dy)


@inline
def tighten(n, y, held, params, lengths, T, alpha, b):  # type: ignore[no-untyped-def]
    """Pull the held drones back to their distance; ``b`` holds the distances before."""
    for i in range(n):
        b[i] -= lengths[i]
    solve(n, y, alpha, b, held, params, T)
    pull(n, y, alpha, T, params, 0, y)


@inline
def project(n, y, held, params, lengths, rates, T, alpha, b):  # type: ignore[no-untyped-def]
    """Pull the held drones back to their distance and the velocities across it; keep momentum."""
    normalise(n, params, y)
    lines(n, y, params, alpha, b)
    tighten(n, y, held, params, lengths, T, alpha, b)
    lines(n, y, params, alpha, b)
    closing(n, y, params, alpha, rates, b)
    solve(n, y, alpha, b, held, params, T)
    pull(n, y, alpha, T, params, 3, y)
