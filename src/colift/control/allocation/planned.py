"""What a reference plans of the cables, and beside it as little as the wanted force asks for."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.allocation.base import SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.share import balance, begin
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.small import solve_symmetric
from colift.kernel.rounding import NO_TENSION
from colift.part import Vector
from colift.team import Team

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)

PARAMS = Layout(team={"turning": 1, "taut": 1})
MEMORY = Layout(drone={"along": 3, "pull": 3})
"""Planned direction and pull of each cable on its drone."""
P, M = PARAMS.at, MEMORY.at


@inline
def _begin_from(i, share, nominal, directions, memory, o):  # type: ignore[no-untyped-def]
    """Direction and pull of cable i as planned; where nobody plans, an equal ``share`` where it is."""
    a, p = o + M.along, o + M.pull
    T = 0.0
    for k in range(3):
        T += nominal[i, 0, k] * nominal[i, 0, k]
    T = math.sqrt(T)
    planned = math.isfinite(T) and T > 0.0
    for k in range(3):
        memory[p + k] = nominal[i, 0, k] if planned else share * directions[i, k]
        memory[a + k] = nominal[i, 0, k] / T if planned else directions[i, k]


@kernel(SIGNATURE)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force, nominal = sees.force, sees.nominal_forces
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n, w = tensions.shape[0], params[P.turning]
    W = begin(force, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    for i in range(n):
        _begin_from(i, W / n, nominal, directions, memory, M.rows + M.width * i)
    least, share = params[P.taut] * W / n, 1.0
    for _ in range(2):  # the second time removes what rounding left
        # Least sum of |d|^2 along and |d|^2 / w across what is planned: d_i = W_i l with W_i = w I + (1 - w) a a^T.
        xx = yy = zz = n * w
        xy = xz = yz = 0.0
        rx, ry, rz = -force[0], -force[1], -force[2]
        for i in range(n):
            o = M.rows + M.width * i
            ax, ay, az = memory[o + M.along], memory[o + M.along + 1], memory[o + M.along + 2]
            xx, yy, zz = (
                xx + (1.0 - w) * ax * ax,
                yy + (1.0 - w) * ay * ay,
                zz + (1.0 - w) * az * az,
            )
            xy, xz, yz = (
                xy + (1.0 - w) * ax * ay,
                xz + (1.0 - w) * ax * az,
                yz + (1.0 - w) * ay * az,
            )
            rx, ry, rz = (
                rx - memory[o + M.pull],
                ry - memory[o + M.pull + 1],
                rz - memory[o + M.pull + 2],
            )
        lx, ly, lz = solve_symmetric(xx, xy, xz, yy, yz, zz, rx, ry, rz)
        part = share
        for i in range(n):  # no more of it than leaves every cable taut
            o = M.rows + M.width * i
            a, p = o + M.along, o + M.pull
            more = memory[a] * lx + memory[a + 1] * ly + memory[a + 2] * lz
            room = -least
            for k in range(3):
                room += memory[p + k] * memory[a + k]
            if room + more < 0.0:
                part = min(part, max(room, 0.0) / max(-more, 1e-300))
        share = part
        for i in range(n):
            o = M.rows + M.width * i
            a, p = o + M.along, o + M.pull
            along = (1.0 - w) * (memory[a] * lx + memory[a + 1] * ly + memory[a + 2] * lz)
            memory[p] += share * (w * lx + along * memory[a])
            memory[p + 1] += share * (w * ly + along * memory[a + 1])
            memory[p + 2] += share * (w * lz + along * memory[a + 2])
        if share < 1.0:
            break
    for i in range(n):
        p = M.rows + M.width * i + M.pull
        x, y, z = memory[p], memory[p + 1], memory[p + 2]
        tensions[i] = math.sqrt(x * x + y * y + z * z)
        if tensions[i] > NO_TENSION * W:
            directions[i, 0] = x / tensions[i]
            directions[i, 1] = y / tensions[i]
            directions[i, 2] = z / tensions[i]
    balance(force, tensions, directions, info)
    return _CONVERGED if share == 1.0 else _FORCE_REDUCED


class Planned(AllocatorPart):
    """The nominal pulls of the reference, and the smallest corrections ``d_i`` that make the wanted force of them.

    ``min sum |d_i along|^2 + |d_i across|^2 / turning`` with ``sum (p_i + d_i) = -F``, along and across the planned
    cables: a load that is heavier than planned makes them pull more and hardly turns them, so the team keeps its shape among
    obstacles. Of a correction that would leave a cable slack only the part is made that does not (``FORCE_REDUCED``). Where nothing is
    planned, as after a drone has left, equal shares along the cables as they are stand for the plan.
    """

    kernel = _allocate
    remembers = MEMORY

    turning: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    """How readily a cable turns for a correction, over how readily it pulls more or less."""
    taut: Annotated[float, Field(ge=0.0, le=0.5)] = 0.1
    """Least pull that a correction leaves a cable, over an equal share of the force."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(team.n, turning=self.turning, taut=self.taut)
