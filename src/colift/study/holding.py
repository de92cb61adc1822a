"""Before a rigid load flies: how its formation holds it, how far it can be pushed and turned, and what each lost drone costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colift.control.allocation.base import Allocator, AllocatorPart, Status
from colift.mission.mission import Mission
from colift.mission.outlook import Outlook, losses
from colift.mission.planned import Demand, demand_of
from colift.team import Team
from colift.team.geometry import Array, matrix_of
from colift.team.holding import Holding, holding
from colift.team.plan import wrench_map

AXES = ("x", "y", "z")
FORCE, MOMENT = "force", "moment"
SETTLED = 400
"""Cycles in which an allocator has turned its cables to any wrench."""
STEPS = 14
"""Of a bisection."""
FAR = 20.0
"""Most that is asked for, over the weight; moments with half the load's largest edge as arm."""


@dataclass(frozen=True)
class Report:
    """How a mission's first team holds its rigid load."""

    holding: Holding
    tensions: Array
    """Of the formation, N."""
    thrusts: Array
    """That it needs in hover, N, and that there are."""
    limits: Array
    reach: dict[str, float]
    """By ``force x`` or ``moment z`` the least of both senses that can be had beside the weight: N, N m; infinite beyond what is asked."""
    demand: Demand | None
    """What the reference asks of rotors and cables; None where nothing is planned."""
    losses: dict[int, Outlook]
    """By drone."""


def judge(mission: Mission) -> Report:
    """Judge a mission with a rigid load, by what its controllers are told."""
    drones = mission.first_drones()
    team, allocation = mission.team.of(drones), mission.allocation.of(drones)
    directions, tensions = allocation.formation(team)
    return Report(
        holding(team, directions, tensions), tensions, team.hover_thrusts(tensions, directions),
        mission.actuation.of(drones).thrust_limits(team), reach(team, allocation, mission.timing.allocation),
        demand_of(mission), losses(mission),
    )  # fmt: skip


def reach(team: Team, part: AllocatorPart, dt: float) -> dict[str, float]:
    """Largest forces and moments that the allocator gives beside the weight, once its cables have turned: the least of both senses."""
    assert team.body is not None
    weight = team.load_mass * team.gravity
    arm = 0.5 * max(float(team.body.size.max()), 1e-3)
    arms = team.levers @ matrix_of(team.body.hang).T
    balance = wrench_map(arms)
    made = balance @ np.linalg.pinv(balance)
    found = {}
    for name, unit in ((FORCE, weight), (MOMENT, weight * arm)):
        for k, axis in enumerate(AXES):
            row = k + (3 if name == MOMENT else 0)
            if made[row, row] < 1.0 - 1e-6:  # no cable force makes it
                found[f"{name} {axis}"] = 0.0
                continue
            senses = [_farthest(team, part, dt, name, k, sense * unit) for sense in (1.0, -1.0)]
            found[f"{name} {axis}"] = min(senses)
    return found


def _farthest(
    team: Team, part: AllocatorPart, dt: float, name: str, axis: int, unit: float
) -> float:
    """Along one direction, by bisection; infinite where all that is asked for is given."""
    low, high = 0.0, FAR
    if _gives(team, part, dt, name, axis, high * unit):
        return float("inf")
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        if _gives(team, part, dt, name, axis, middle * unit):
            low = middle
        else:
            high = middle
    return low * abs(unit)


def _gives(team: Team, part: AllocatorPart, dt: float, name: str, axis: int, amount: float) -> bool:
    """Whether so much is given in the end, on a way there that is slow enough for cables to follow."""
    allocator = Allocator(part, team, dt=dt)
    allocator.reset(*part.formation(team))
    force, moment = np.array([0.0, 0.0, team.load_mass * team.gravity]), np.zeros(3)
    (force if name == FORCE else moment)[axis] += amount
    answer = allocator.allocate(force, moment=moment)
    for _ in range(SETTLED):
        if answer.status is Status.CONVERGED:
            return True
        answer = allocator.allocate(force, moment=moment)
    return False
