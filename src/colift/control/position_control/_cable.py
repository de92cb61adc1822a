"""Direction of the cable that a drone holds, with its rate and acceleration: planned motion as it is, corrections filtered."""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math.sphere import FOLLOW, follow

CABLE = FOLLOW + 6
"""Numbers that it remembers of a cable: direction, rate and acceleration, then the correction and its rate."""


@inline
def size_of(i, nominal):  # type: ignore[no-untyped-def]
    """Size of the planned pull of cable i, with two derivatives."""
    T = T1 = T2 = 0.0
    for k in range(3):
        T += nominal[i, 0, k] * nominal[i, 0, k]
    T = math.sqrt(max(T, 1e-18))
    for k in range(3):
        T1 += nominal[i, 0, k] / T * nominal[i, 1, k]
    for k in range(3):
        rate = (nominal[i, 1, k] - nominal[i, 0, k] / T * T1) / T
        T2 += rate * nominal[i, 1, k] + nominal[i, 0, k] / T * nominal[i, 2, k]
    return T, T1, T2


@inline
def course_of(i, k, nominal, T, T1, T2):  # type: ignore[no-untyped-def]
    """Along axis k the direction of that pull, its rate and its second derivative."""
    direction = nominal[i, 0, k] / T
    rate = (nominal[i, 1, k] - direction * T1) / T
    return direction, rate, (nominal[i, 2, k] - direction * T2 - 2.0 * rate * T1) / T


@inline
def lead(i, alpha, nominal, omega, dt, memory, o, reach):  # type: ignore[no-untyped-def]
    """Lead the cable of drone i towards ``alpha[i]``: direction, rate and acceleration in ``memory[o : o + 9]``.

    ``omega`` (rad/s) and ``reach`` (rad) are those of :func:`colift.kernel.math.sphere.follow`.

    Where ``nominal[i]`` (3, 3) gives the planned pull and its derivatives, that motion passes unfiltered, and only what
    ``alpha`` differs by from it goes through a critically damped filter of the frequency ``omega``.
    """
    if math.isnan(nominal[i, 0, 0]):
        follow(memory, o, alpha[i, 0], alpha[i, 1], alpha[i, 2], omega, dt, reach)
        return
    T, T1, T2 = size_of(i, nominal)
    damp = 1.0 / (1.0 + 2.0 * omega * dt)
    c = o + FOLLOW
    for k in range(3):
        direction, rate, turning = course_of(i, k, nominal, T, T1, T2)
        before = memory[c + 3 + k]
        off = alpha[i, k] - direction - memory[c + k]
        speed = (before + dt * omega * omega * off) * damp
        memory[c + 3 + k] = speed
        memory[c + k] += dt * speed
        memory[o + k] = direction + memory[c + k]
        memory[o + 3 + k] = rate + speed
        memory[o + 6 + k] = turning + (speed - before) / dt


SWING = 6
"""Numbers that :func:`swing` remembers of a cable beside its direction, rate and acceleration."""


@inline
def swing(i, alpha, T, change, omega, dt, memory, o, reach):  # type: ignore[no-untyped-def]
    """Lead a cable of a team of one or two, where the load's motion is the cable's: that part passes unfiltered.

    ``change`` (9,) is what the reference's acceleration adds to this cable's pull, and two derivatives. The pull that is
    left of ``T[i] alpha[i]`` goes through a critically damped filter of the frequency ``omega``; of their
    sum the direction, its rate and acceleration are put into ``memory[o : o + 9]``.
    """
    damp = 1.0 / (1.0 + 2.0 * omega * dt)
    c = o + 9
    size = T[i] * reach
    away = 0.0
    for k in range(3):
        away += (T[i] * alpha[i, k] - change[k] - memory[c + k]) ** 2
    share = min(1.0, size / math.sqrt(max(away, 1e-18)))
    norm = 0.0
    for k in range(3):
        before = memory[c + 3 + k]
        off = share * (T[i] * alpha[i, k] - change[k] - memory[c + k])
        speed = (before + dt * omega * omega * off) * damp
        memory[c + 3 + k] = speed
        memory[c + k] += dt * speed
        # Pull, and in place of rate and acceleration its derivatives.
        memory[o + k] = memory[c + k] + change[k]
        memory[o + 3 + k] = speed + change[3 + k]
        memory[o + 6 + k] = (speed - before) / dt + change[6 + k]
        norm += memory[o + k] * memory[o + k]
    norm = math.sqrt(max(norm, 1e-18))
    stretch = stretch2 = 0.0
    for k in range(3):
        memory[o + k] /= norm
        stretch += memory[o + k] * memory[o + 3 + k]
    for k in range(3):
        memory[o + 3 + k] = (memory[o + 3 + k] - memory[o + k] * stretch) / norm
        stretch2 += memory[o + k] * memory[o + 6 + k]
    turn = 0.0
    for k in range(3):
        turn += memory[o + 3 + k] * memory[o + 3 + k]
    for k in range(3):
        # d'' = (p'' - d (d.p'') - 2 d' (d.p')) / |p| - d |d'|^2
        along = stretch2 * memory[o + k] + 2.0 * stretch * memory[o + 3 + k]
        memory[o + 6 + k] = (memory[o + 6 + k] - along) / norm - memory[o + k] * turn
