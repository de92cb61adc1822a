"""Cascade of small QPs: a plane between every two cables, then least forces (Wahba and Hönig 2024)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import AllocatorPart, Status
from colift.control.allocation.common.plain import Outcome, Problem, plain_kernel
from colift.errors import MissingExtraError
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array, ring, rotation_between

PARAMS = Layout(
    team={"plane_weight": 1, "settling": 1, "formation_weight": 1, "slope": 1},
    drone={"length": 1, "tilt": 1, "spread": 3},
)
"""``slope``: tangent of the formation's cone, in which a cable stands at ``spread``."""
P = PARAMS.at
_EQUALITY, _ACTIVE = 5, 1  # DAQP's marks of a constraint
_RESTART_CONE = math.radians(45.0)
_PAIRS = 64


def separating_normal(near: Array, far: Array, force: Array, weight: float) -> Array | None:
    """Normal (3,) of the plane through the load with ``near`` below and ``far`` above it.

    Hard-margin support vector machine without offset, ``min |s|^2 + weight (s.force)^2`` subject to
    ``s.near <= -1`` and ``s.far >= 1``; a large weight lets the plane contain the force. ``None`` where
    no plane separates the two. Positions relative to the load, m.
    """
    import daqp

    normal, _, flag, _ = daqp.solve(
        np.eye(3) + weight * np.outer(force, force),
        np.zeros(3),
        np.ascontiguousarray([near, -far]),
        np.array([-1.0, -1.0]),
    )
    return np.array(normal) if flag == 1 else None


def half_spaces(
    positions: Array, force: Array, tilts: Array, weight: float
) -> tuple[NDArray[np.intp], Array] | None:
    """Owners (m,) and unit normals (m, 3): the force of cable ``owner`` has ``normal.f <= 0``.

    Each pair's plane is turned, for either cable, by that cable's tilt (n,) rad about the axis in the
    plane across the force, which opens a wedge between them around the force. ``None`` where a pair has no
    separating plane.
    """
    n = len(positions)
    owners, normals = [], []
    for i in range(n):
        for j in range(i + 1, n):
            s = separating_normal(positions[i], positions[j], force, weight)
            if s is None:
                return None
            s /= np.linalg.norm(s)
            up = force - (force @ s) * s  # the force's direction within the plane
            size = np.linalg.norm(up)
            if not size > 1e-6:
                return None
            up /= size
            for cable, side in ((i, 1.0), (j, -1.0)):
                owners.append(cable)
                normals.append(side * np.cos(tilts[cable]) * s + np.sin(tilts[cable]) * up)
    return np.array(owners, dtype=np.intp), np.array(normals).reshape(-1, 3)


def least_forces(
    owners: NDArray[np.intp],
    normals: Array,
    force: Array,
    aim: Array,
    active: Array,
    balance: Array | None = None,
) -> tuple[Array, Array, int] | None:
    """Forces (n, 3) nearest to ``aim`` within the half-spaces that add up to ``force``.

    ``active`` (m,) marks the half-spaces at work the last time. ``balance`` (k, 3 n) are other rows than those of the sum, for which
    ``force`` (k,) is wanted. Also multipliers (m,) and iterations; ``None`` where there are no such forces.
    """
    import daqp

    n, m = len(aim), len(owners)
    balance = np.tile(np.eye(3), n) if balance is None else balance
    k = len(balance)
    rows = np.zeros((k + m, 3 * n))
    rows[:k] = balance
    for row, (owner, normal) in enumerate(zip(owners, normals, strict=True)):
        rows[k + row, 3 * owner : 3 * owner + 3] = normal
    upper = np.concatenate([force, np.zeros(m)])
    lower = np.concatenate([force, np.full(m, -1e30)])
    marks = np.concatenate([np.full(k, _EQUALITY), np.where(active > 0.0, _ACTIVE, 0)])
    forces, _, flag, details = daqp.solve(
        np.eye(3 * n),
        -aim.ravel(),
        rows,
        upper,
        lower,
        marks.astype(np.int32),
        primal_tol=1e-9,
    )
    if flag != 1:
        return None
    return np.array(forces).reshape(n, 3), np.array(details["lam"])[k:], int(details["iterations"])


def _solve(problem: Problem) -> Outcome:
    n, force, params = len(problem.shares), problem.force, problem.params
    weight, settling = params[P.plane_weight], params[P.settling]
    formation, slope = params[P.formation_weight], params[P.slope]
    lengths, tilts = PARAMS.view(params, "length")[:, 0], PARAMS.view(params, "tilt")[:, 0]
    spread = PARAMS.view(params, "spread")
    last = -problem.shares[:, None] * problem.directions
    inertia = settling / max(problem.dt, 1e-6)
    total = 1.0 + inertia + formation
    aim = (inertia * last + formation * (force / n + slope / n * spread)) / total

    status, solution, active = Status.CONVERGED, None, problem.memory
    planes = half_spaces(-lengths[:, None] * problem.directions, force, tilts, weight)
    if planes is not None:
        solution = least_forces(*planes, force, aim, active)
    if planes is None or solution is None:
        status, active = Status.RECOVERING, np.zeros_like(active)
        fresh = ring(n, _RESTART_CONE) @ rotation_between(np.array([0.0, 0.0, 1.0]), force).T
        planes = half_spaces(-lengths[:, None] * fresh, force, tilts, weight)
        solution = planes and least_forces(*planes, force, np.zeros((n, 3)), active)
    if planes is None or solution is None:
        raise RuntimeError("no forces within the planes")
    forces, multipliers, iterations = solution
    problem.memory[:] = multipliers > 0.0
    gradient = forces - (aim if status is Status.CONVERGED else 0.0)
    owners, normals = planes
    np.add.at(gradient, owners, multipliers[:, None] * normals)
    residual = float(np.abs(gradient - gradient.mean(axis=0)).max())
    objective = 0.5 * float(np.sum(forces * forces))
    at_work = _PAIRS if np.any(multipliers > 0.0) else 0
    return Outcome(-forces, status, iterations, residual, objective, objective - 0.5 / n, at_work)


class WahbaHoenig(AllocatorPart):
    """Least cable forces, every two cables on different sides of a wedge through the load.

    Wahba and Hönig, "Efficient Optimization-Based Cable Force Allocation for Geometric Control of a
    Multirotor Team Transporting a Payload", IEEE RA-L, 2024 (arXiv:2304.02359), point-mass load. One
    small QP a pair finds a plane through the load between the two cables; it is tilted to either side
    so that drones keep a distance; a last QP finds the least forces within these half-spaces that add up to the
    wanted force, with the option of a desired formation.

    Differences from the paper. The planes come from the last wanted directions, since an allocator
    here is not told the measured ones. They are tilted about the axis across the wanted force, not
    across the vertical: the same in hover. The cables move to the optimum within ``settling``, where the
    paper weighs the last forces by a constant. Where no plane or no such forces exist the planes start
    anew from a ring about the force (status ``RECOVERING``); the paper drops the planes.

    What it does not promise: a wedge opens around the force only. Two cables that lean along the
    wedge's edge, away from the force, may come nearer to each other than ``distance``.
    """

    kernel = plain_kernel(_solve)
    needs = ("daqp", "qp")
    spread_setting = ("distance", (0.2, 0.5, 0.8, 1.1))

    distance: Annotated[float, Field(gt=0.0, le=1e3)] = 0.5
    """Distance that the wedges keep between two drones above the load, m."""
    plane_weight: Annotated[float, Field(ge=0.0, le=1e9)] = 1000.0
    """How strongly the planes are drawn to contain the wanted force."""
    settling: Annotated[float, Field(ge=0.0, le=60.0)] = 0.3
    """Time in which the forces settle at the optimum, s; zero jumps there."""
    formation_weight: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Weight of the squared distance to the forces of the desired formation."""
    formation_cone_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 35.0
    """Half-angle of the desired formation, a ring about the vertical, degrees."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        shortest = float(team.cable_lengths.min())
        if self.distance > 1.2 * shortest:
            limit = f"must be at most 1.2 of the shortest cable, {1.2 * shortest:g} m"
            return [("distance", f"{limit}; found {self.distance:g}")]
        return super().check(team)

    def tilts(self, team: Team) -> Array:
        """Angle (n,) between either side of a wedge and its middle, rad."""
        return 2.0 * np.arcsin(np.minimum(0.25 * self.distance / team.cable_lengths, 0.3))

    def params(self, team: Team) -> Vector:
        if message := self.missing():
            raise MissingExtraError(message)
        slope = math.tan(math.radians(self.formation_cone_deg))
        outward = -ring(team.n, math.radians(45.0)) * math.sqrt(2.0) - [0.0, 0.0, 1.0]
        return PARAMS.pack(
            team.n, plane_weight=self.plane_weight, settling=self.settling,
            formation_weight=self.formation_weight, slope=slope, length=team.cable_lengths,
            tilt=self.tilts(team), spread=outward * (team.n > 1),
        )  # fmt: skip

    def memory(self, team: Team) -> Vector:
        return np.zeros(team.n * (team.n - 1))

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return float(0.5 * tensions @ tensions)
