"""Pseudo-inverse: tensions of least norm along a formation that stands still in the world."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import (
    INFO_GAP,
    SIGNATURE,
    AllocatorPart,
    Status,
)
from colift.control.allocation.common.share import balance, begin, effort
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.rounding import PUSHING, RANK, UNBALANCED
from colift.part import Places, Vector
from colift.team import Team

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_CLAMPED = int(Status.CLAMPED)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)
_PUSHING = int(Status.PUSHING)

_UNKNOWN, _GIVEN, _READY = 0.0, 1.0, 2.0  # of the formation, and of its inverse

PARAMS = Layout(team={"push": 1})
MEMORY = Layout(team={"known": 1}, drone={"formation": 3, "inverse": 3})
P, M = PARAMS.at, MEMORY.at


@inline
def _pseudo_inverse(formation, inverse):  # type: ignore[no-untyped-def]
    """``A^+`` (n, 3) of ``A = formation^T``, one cable after the other.

    T. N. E. Greville, "Some applications of the pseudoinverse of a matrix", SIAM Review 2(1), 1960.
    """
    for k in range(formation.shape[0]):
        x, y, z = formation[k, 0], formation[k, 1], formation[k, 2]
        cx, cy, cz, size = x, y, z, 1.0
        bx = by = bz = 0.0
        for i in range(k):
            d = inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z
            cx -= d * formation[i, 0]
            cy -= d * formation[i, 1]
            cz -= d * formation[i, 2]
            bx += d * inverse[i, 0]
            by += d * inverse[i, 1]
            bz += d * inverse[i, 2]
            size += d * d
        outside = cx * cx + cy * cy + cz * cz
        if outside > RANK * RANK:
            bx, by, bz, size = cx, cy, cz, outside
        for i in range(k):
            d = inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z
            inverse[i, 0] -= d * bx / size
            inverse[i, 1] -= d * by / size
            inverse[i, 2] -= d * bz / size
        inverse[k, 0] = bx / size
        inverse[k, 1] = by / size
        inverse[k, 2] = bz / size


@kernel(SIGNATURE)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    rows = memory[M.rows :].reshape(n, M.width)
    formation = rows[:, M.formation : M.formation + 3]
    inverse = rows[:, M.inverse : M.inverse + 3]
    if memory[M.known] != _READY:
        if memory[M.known] == _UNKNOWN:
            for i in range(n):
                for k in range(3):
                    formation[i, k] = directions[i, k]
        _pseudo_inverse(formation, inverse)
        memory[M.known] = _READY
    W = begin(force, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    for i in range(n):
        tensions[i] = 0.0
    for _ in range(2):  # the second time removes what rounding left
        rx, ry, rz = force[0], force[1], force[2]
        for i in range(n):
            rx += tensions[i] * formation[i, 0]
            ry += tensions[i] * formation[i, 1]
            rz += tensions[i] * formation[i, 2]
        for i in range(n):
            tensions[i] -= inverse[i, 0] * rx + inverse[i, 1] * ry + inverse[i, 2] * rz
    negative = False
    for i in range(n):
        side = 1.0
        if tensions[i] < 0.0:
            negative = negative or tensions[i] < -PUSHING * W
            if params[P.push] == 0.0:
                tensions[i] = 0.0
            else:
                tensions[i] = -tensions[i]
                side = -1.0
        for k in range(3):
            directions[i, k] = side * formation[i, k]
    effort(W, tensions, info)
    missing = balance(force, tensions, directions, info) > UNBALANCED * W
    if missing:
        info[INFO_GAP] = math.nan
    if negative:
        return _CLAMPED if params[P.push] == 0.0 else _PUSHING
    return _FORCE_REDUCED if missing else _CONVERGED


class MinNorm(AllocatorPart):
    """Least ``1/2 sum T_i^2`` along given directions: ``T = -A^+ F`` with ``A = [alpha_1 ... alpha_n]``.

    What most simulators of cable-carried loads do. The formation is the one that the flight starts
    with, fixed in the world: a sideways force changes the tensions, where the parts ``ring`` and
    ``lopsided`` tilt their own pattern with the force and keep its shares. (Over free cable forces the
    least norm is ``F/n`` each, all parallel: ``internal-force`` with no internal force.)

    A negative tension is a cable that pushes, which no cable does; ``negative`` says what is
    made of it. A formation that cannot reach the force - one or two cables - gives the nearest force that
    it can, with status ``FORCE_REDUCED``.
    """

    kernel = _allocate
    remembers = MEMORY

    negative: Literal["clamp", "push"] = "clamp"
    """``clamp``: set to zero, which loses force (status ``CLAMPED``). ``push``: the mathematics' answer,
    shown as a positive tension on the opposite side, with the drone below the load (``PUSHING``)."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(team.n, push=self.negative == "push")

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        if np.any(places < 0):
            return fresh  # a drone has joined: the formation that it completes
        super().carry_over(old, fresh, places)
        fresh[M.known] = min(old[M.known], _GIVEN)
        return fresh

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return float(0.5 * tensions @ tensions)
