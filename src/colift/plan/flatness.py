"""Exact flatness of a point load on cables, by truncated Taylor series.

The load's path ``x`` and the pulls ``f_i`` of the cables on it, in weights of the load, give all else: ``u_i = f_i / |f_i|`` from load to
drone, ``x_i = x + L_i u_i``, thrust ``U_i = m_i (x_i'' + g e_3) + m_L g f_i`` and body axis ``b_i = U_i / |U_i|``. A series is its
coefficients; that of a product is a convolution, and the derivative of ``f / |f|`` is the series ``A = (I - u u^T) / |f|``,
so that one set of coefficients gives values and gradients (Griewank and Walther 2008, ch. 13). Nothing is left out: with
the angular acceleration of the cables, which the generated dynamics of the public benchmark drop.
"""

from __future__ import annotations

import math

from colift.kernel.jit import aside, inline


@aside
def direction(f, order, r, u, A):  # type: ignore[no-untyped-def]
    """Series of ``u = f / |f|`` (order, 3), of ``r = 1 / |f|`` and of ``A`` (order, 3, 3), for ``f`` (order, 3); |f| must not be 0.

    Returns |f|.
    """
    # y = |f|^2, then r = y^(-1/2) by y r' = -y' r / 2, coefficient by coefficient.
    y0 = f[0, 0] * f[0, 0] + f[0, 1] * f[0, 1] + f[0, 2] * f[0, 2]
    size = math.sqrt(max(y0, 1e-16))
    y0 = size * size
    r[0] = 1.0 / size
    for k in range(1, order):
        total = 0.0
        for j in range(1, k + 1):
            y = 0.0
            for i in range(j + 1):
                y += f[i, 0] * f[j - i, 0] + f[i, 1] * f[j - i, 1] + f[i, 2] * f[j - i, 2]
            total += (-0.5 * j - (k - j)) * y * r[k - j]
        r[k] = total / (k * y0)
    for k in range(order):
        for c in range(3):
            total = 0.0
            for j in range(k + 1):
                total += f[j, c] * r[k - j]
            u[k, c] = total
    for k in range(order):
        for a in range(3):
            for b in range(a, 3):
                total = 0.0
                for j in range(k + 1):
                    P = 1.0 if a == b and j == 0 else 0.0
                    for i in range(j + 1):
                        P -= u[i, a] * u[j - i, b]
                    total += P * r[k - j]
                A[k, a, b] = total
                A[k, b, a] = total
    return size


@inline
def back(A, order, ubar, fbar):  # type: ignore[no-untyped-def]
    """Add to the gradient ``fbar`` with respect to ``f`` what the gradient ``ubar`` with respect to ``u`` makes of it."""
    for j in range(order):
        for k in range(j, order):
            for a in range(3):
                fbar[j, a] += (
                    A[k - j, a, 0] * ubar[k, 0]
                    + A[k - j, a, 1] * ubar[k, 1]
                    + A[k - j, a, 2] * ubar[k, 2]
                )


@inline
def thrust(x, u, f, L, q, g, U):  # type: ignore[no-untyped-def]
    """Series (3, 3) of the thrust over the drone's weight, for ``q`` = load's mass over the drone's."""
    for k in range(3):
        twice = (k + 2.0) * (k + 1.0) / g
        for c in range(3):
            U[k, c] = twice * (x[k + 2, c] + L * u[k + 2, c]) + q * f[k, c]
    U[0, 2] += 1.0
