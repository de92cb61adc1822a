"""Rigid massless cables as constraints: one linear system for tensions, impulses and projections.

A set of cables holds its drones at the cable length. A pull ``T_i`` along each, from drone to load,
changes the drones by ``T_i alpha_i / m_i`` and the load by ``-sum_i T_i alpha_i / m_L``; it must take away what
``b_i`` would otherwise appear along the cables (acceleration, velocity or length)::

    (1 / m_i) T_i + alpha_i . y / m_L = b_i,    y = sum_i T_i alpha_i
    (I + sum_i m_i alpha_i alpha_i^T / m_L) y = sum_i m_i b_i alpha_i

Accelerations give the tensions (paper eqs. 1 to 5), velocities the impulses of a plastic jerk, lengths the
projection that keeps momentum. Cables that winches pay out have lengths with two derivatives, which are taken from ``b``.
"""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.world.plant._bodies import BODY, DRONE, LOAD, MASS, free_motion, line, normalise
from colift.world.plant._contact import P, touch


@inline
def solve(n, alpha, b, held, params, T):  # type: ignore[no-untyped-def]
    """Pulls of the held cables; zero for the others."""
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
def pull(n, alpha, T, params, where, y):  # type: ignore[no-untyped-def]
    """Apply pulls to the positions (``where`` = 0) or velocities (3), in a state or its derivative."""
    for i in range(n):
        o = LOAD + DRONE * i + where
        m = params[MASS + BODY * i]
        for k in range(3):
            part = T[i] * alpha[3 * i + k]
            y[o + k] += part / m
            y[where + k] -= part / params[0]


@inline
def lines(n, y, alpha, lengths):  # type: ignore[no-untyped-def]
    """Unit vectors from the drones to the load, and the distances."""
    for i in range(n):
        x, y_, z, d = line(y, LOAD + DRONE * i)
        alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2] = x, y_, z
        lengths[i] = d


@inline
def closing(n, y, alpha, rates, b):  # type: ignore[no-untyped-def]
    """Velocities at which the load moves away from the drones, along the cables, less those at which they are paid out."""
    for i in range(n):
        o = LOAD + DRONE * i + 3
        b[i] = (
            alpha[3 * i] * (y[3] - y[o])
            + alpha[3 * i + 1] * (y[4] - y[o + 1])
            + alpha[3 * i + 2] * (y[5] - y[o + 2])
            - rates[i]
        )


@inline
def demand(n, y, dy, alpha, bends, b):  # type: ignore[no-untyped-def]
    """Accelerations by which the distances would outgrow the cables if these did not pull; ``b`` holds the distances before."""
    for i in range(n):
        o = LOAD + DRONE * i + 3
        x, y_, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        vx, vy, vz = y[3] - y[o], y[4] - y[o + 1], y[5] - y[o + 2]
        along = x * vx + y_ * vy + z * vz
        squared = vx * vx + vy * vy + vz * vz - along * along
        ax, ay, az = dy[3] - dy[o], dy[4] - dy[o + 1], dy[5] - dy[o + 2]
        b[i] = squared / max(b[i], 1e-12) + x * ax + y_ * ay + z * az - bends[i]


@inline
def derivative(  # type: ignore[no-untyped-def]
    n, y, thrusts, torques, external, held, anchors, w, params, bends, T, alpha, b, forces, dy
):
    """Time derivative of the state under the held cables; fills the tensions ``T`` and the ground's ``forces``.

    ``bends`` are the second derivatives of the cables' lengths.
    ``alpha`` (3 numbers a drone) and ``b`` (one) are for intermediate results.
    """
    free_motion(n, y, thrusts, torques, external, params, dy)
    if params[P.ground] > 0.0:
        touch(n, y, anchors, w, params, forces, dy)
    lines(n, y, alpha, b)
    demand(n, y, dy, alpha, bends, b)
    solve(n, alpha, b, held, params, T)
    pull(n, alpha, T, params, 3, dy)


@inline
def tighten(n, y, held, params, lengths, T, alpha, b):  # type: ignore[no-untyped-def]
    """Pull the held drones back to their distance; ``b`` holds the distances before."""
    for i in range(n):
        b[i] -= lengths[i]
    solve(n, alpha, b, held, params, T)
    pull(n, alpha, T, params, 0, y)


@inline
def project(n, y, held, params, lengths, rates, T, alpha, b):  # type: ignore[no-untyped-def]
    """Pull the held drones back to their distance and the velocities across it; keep momentum."""
    normalise(n, y)
    lines(n, y, alpha, b)
    tighten(n, y, held, params, lengths, T, alpha, b)
    lines(n, y, alpha, b)
    closing(n, y, alpha, rates, b)
    solve(n, alpha, b, held, params, T)
    pull(n, alpha, T, params, 3, y)
