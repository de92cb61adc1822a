"""One leads, the others hold a constant pull and give way, and nobody says a word: for comparison."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.agents.base import SIGNATURE, AgentPart, Status
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team

PARAMS = Layout(
    team={"leader": 1, "weight": 1, "damping": 1, "mass": 1, "smoothing": 1, "stiffness": 1}
)
MEMORY = Layout(drone={"started": 1, "pi": 3, "moves": 1, "v": 3})
"""Own constant pull on the load ``pi``; whether a velocity is known, and it, smoothed."""
P, M = PARAMS.at, MEMORY.at
FREE = int(Status.FREE)


@kernel(SIGNATURE)
def _lead_or_give_way(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    F, v = sees.wish, sees.velocity
    if memory[M.started] == 0.0:
        memory[M.started] = 1.0
        share = params[P.weight] / sees.members.shape[0]
        for k in range(3):
            memory[M.pi + k] = share * writes.direction[k] / min(writes.direction[2], -0.1)
    leads = sees.number[0] == params[P.leader] and math.isfinite(F[0] + F[1] + F[2])
    moves = math.isfinite(v[0] + v[1] + v[2])
    follow = now.dt / (now.dt + params[P.smoothing]) if memory[M.moves] != 0.0 else 1.0
    memory[M.moves] = 1.0 if moves else 0.0
    square = 0.0
    for k in range(3):
        f = memory[M.pi + k]
        if leads:
            beside = F[k] - (params[P.weight] if k == 2 else 0.0)
            f += params[P.stiffness] * beside
        elif moves:  # M_A dv/dt + B_A v = pi - f
            step = follow * (v[k] - memory[M.v + k])
            memory[M.v + k] += step
            f -= params[P.damping] * memory[M.v + k]
            if follow < 1.0:
                f -= params[P.mass] * step / now.dt
        square += f * f
        writes.direction[k] = -f
    size = math.sqrt(square)
    writes.tension[0] = size
    for k in range(3):
        writes.direction[k] = (
            writes.direction[k] / size if size > 1e-9 else (-1.0 if k == 2 else 0.0)
        )
    return FREE


class Leader(AgentPart):
    """One drone alone knows the way and makes up for all; each other holds the pull of the start formation, and gives way to its own cable.

    Tognon, Gabellieri, Pallottino and Franchi, "Aerial Co-Manipulation with Cables: The Role of Internal Force for Equilibria, Stability, and
    Passivity", IEEE RA-L 3(3), 2018: two robots carry a beam without communication, each an admittance ``M_A dv/dt + B_A v + K_A (p - p_d) =
    pi - f`` of the force ``f`` of its own cable, with ``K_A = 0`` for the one that follows; the constant ``pi`` holds its share of the weight
    and the internal force. Here on a load that is a point, by n drones. What is assumed: ``pi`` is what the start formation pulls, and
    the leader pulls beside it a share of what its load controller wants, in place of ``K_A``. Drones here hold a direction from
    the load, so the load's velocity is their own; where it is not known, a follower's pull is constant. Nothing keeps cables apart.
    """

    kernel = _lead_or_give_way
    remembers = MEMORY

    leader: Annotated[int, Field(ge=0, le=51)] = 0
    """Number of the drone that leads."""
    stiffness: Annotated[float, Field(gt=0.0, le=10.0)] = 0.5
    """Of what its load controller wants beside the weight, the leader gives so much."""
    damping: Annotated[float, Field(ge=0.0, le=1e3)] = 0.1
    """``B_A`` of each that follows, N s/m."""
    apparent_mass: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    """``M_A`` of each that follows, beside the drone's own, kg."""
    smoothing: Annotated[float, Field(gt=0.0, le=10.0)] = 0.1
    """Time with which the velocity is smoothed, s."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        there = self.leader < team.n
        return super().check(team) + [
            ("leader", f"there is no drone {self.leader}; the team has {team.n}")
        ] * (not there)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, leader=self.leader, weight=team.load_mass * team.gravity, damping=self.damping,
            mass=self.apparent_mass, smoothing=self.smoothing, stiffness=self.stiffness,
        )  # fmt: skip
