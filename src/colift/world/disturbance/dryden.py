"""Dryden turbulence at low altitude (MIL-F-8785C, section 3.7), discretised exactly."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

_FOOT = 0.3048
_LOWEST, _HIGHEST = 10.0, 1000.0  # of the low-altitude model, feet
_SLOWEST = 0.1  # airspeed, m/s: below it the air would not change at all
_ROOT3 = math.sqrt(3.0)

PARAMS = Layout(team={"speed": 1, "cosine": 1, "sine": 1})
MEMORY = Layout(team={"next": 1, "u": 1, "v": 2, "w": 2})
"""``next``: number of the tick that comes next, 0 at the start; ``u``, and p and q of ``v`` and ``w``, for unit standard deviation."""
P, M = PARAMS.at, MEMORY.at


@inline
def scales(height, speed):  # type: ignore[no-untyped-def]
    """Lengths (horizontal, vertical; m) and standard deviations (m/s) at a height (m), for the wind at 20 ft."""
    h = min(max(height / _FOOT, _LOWEST), _HIGHEST)
    base = 0.177 + 0.000823 * h
    sigma_w = 0.1 * speed
    return h / base**1.2 * _FOOT, h * _FOOT, sigma_w / base**0.4, sigma_w


@inline
def first_order(memory, o, x, a):  # type: ignore[no-untyped-def]
    """Advance ``1 / (1 + T s)`` with unit variance by ``x = dt / T``, driven by a standard normal."""
    memory[o] = math.exp(-x) * memory[o] + math.sqrt(-math.expm1(-2.0 * x)) * a


@inline
def second_order(memory, o, x, a, b):  # type: ignore[no-untyped-def]
    """Advance the states p of ``1 / (1 + T s)`` and q of ``1 / (1 + T s)^2`` by ``x = dt / T``.

    Their stationary variances are 1/2 and 1/4, their covariance 1/4. What two standard normals add has the
    covariances ``int e^-2s``, ``int s e^-2s`` and ``int s^2 e^-2s`` over (0, x).
    """
    keep = math.exp(-x)
    if x < 0.02:  # the closed forms cancel
        pp = x - x * x + 2.0 / 3.0 * x**3 - x**4 / 3.0
        pq = x * x * (0.5 - 2.0 / 3.0 * x + 0.5 * x * x)
        rest = x**3 / 12.0 * (1.0 - x)  # of the variance of q, given p
    else:
        keep2 = keep * keep
        pp = 0.5 * (1.0 - keep2)
        pq = 0.25 - keep2 * (0.5 * x + 0.25)
        qq = 0.25 - keep2 * (0.5 * x * x + 0.5 * x + 0.25)
        rest = max(qq - pq * pq / pp, 0.0)
    root = math.sqrt(pp)
    memory[o + 1] = keep * (memory[o + 1] + x * memory[o]) + pq / root * a + math.sqrt(rest) * b
    memory[o] = keep * memory[o] + root * a


@kernel(SIGNATURE)
def _dryden(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    load = sees.load
    wind = writes.wind
    L_u, L_w, sigma_u, sigma_w = scales(load[0, 2], params[P.speed])
    now = noise.tick(step, dt)
    if memory[M.next] == 0.0:
        memory[M.next] = now
        memory[M.u] = noise.normal(key, -1, 0)
        for m in range(2):
            a, b = noise.normals(key, -1, 1 + m)
            memory[M.v + 2 * m] = math.sqrt(0.5) * a
            memory[M.v + 2 * m + 1] = math.sqrt(0.125) * (a + b)
    x, y, z = wind[0] - load[1, 0], wind[1] - load[1, 1], wind[2] - load[1, 2]
    airspeed = max(math.sqrt(x * x + y * y + z * z), _SLOWEST)
    for number in range(int(memory[M.next]), now + 1):
        along = airspeed * noise.TICK / L_u
        first_order(memory, M.u, along, noise.normal(key, number, 0))
        a, b = noise.normals(key, number, 1)
        second_order(memory, M.v, along, a, b)
        a, b = noise.normals(key, number, 2)
        second_order(memory, M.w, airspeed * noise.TICK / L_w, a, b)
    memory[M.next] = now + 1
    u = sigma_u * memory[M.u]
    v = sigma_u * (_ROOT3 * memory[M.v] + (1.0 - _ROOT3) * memory[M.v + 1])
    w = sigma_w * (_ROOT3 * memory[M.w] + (1.0 - _ROOT3) * memory[M.w + 1])
    wind[0] += params[P.cosine] * u - params[P.sine] * v
    wind[1] += params[P.sine] * u + params[P.cosine] * v
    wind[2] += w


LASTING = 0.35
"""Gusts that last long enough to be answered to, over the mean wind."""


class Dryden(DisturbancePart):
    """Turbulence with Dryden's spectra; the same for all bodies, which are near for its length scales.

    Scales and intensities follow the load's height, between 3.05 and 305 m (10 and 1000 ft; beyond, those at
    the nearer end). The air is frozen and blows past the load: the airspeed is that of the load against the wind
    of the parts listed before this one, at least 0.1 m/s. It begins stationary, not calm, and changes each
    millisecond, whatever the physics step.
    """

    kernel = _dryden
    remembers = MEMORY
    makes_wind: ClassVar[bool] = True

    speed: Annotated[float, Field(ge=0.0, le=60.0)] = 5.0
    """Mean wind at a height of 6.1 m (20 ft), m/s: the intensity. MIL-F-8785C: 7.7 light, 15.4 moderate,
    23.1 severe."""
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Where the mean wind blows to, degrees from x towards y: the axis of the longitudinal part."""

    def strongest_wind(self) -> Vector:
        heading = math.radians(self.heading_deg)
        return LASTING * self.speed * np.array([math.cos(heading), math.sin(heading), 0.0])

    def params(self, team: Team) -> Vector:
        heading = math.radians(self.heading_deg)
        return PARAMS.pack(
            team.n, speed=self.speed, cosine=math.cos(heading), sine=math.sin(heading)
        )
