"""Cascade of small QPs for a rigid load: a plane between every two cables, then least forces (Wahba and Hönig 2024)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import Status
from colift.control.allocation.common.plain import Outcome, Problem, plain_kernel
from colift.control.allocation.common.wrenches import settled
from colift.control.allocation.wahba_hoenig import WahbaHoenig, least_forces
from colift.errors import MissingExtraError
from colift.kernel.layout import Layout
from colift.kernel.rounding import RANK
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import plan, wrench_map

PARAMS = Layout(
    team={"plane_weight": 1, "settling": 1, "formation_weight": 1},
    drone={"length": 1, "tilt": 1, "arm": 3, "home": 3},
)
"""``home``: the desired formation, forces on the load that hold a unit weight, in the load's frame."""
P = PARAMS.at
_SLIGHT = 1e-6
"""Weight of the plane's offset, which costs nothing but must have one for the solver's sake."""
_PAIRS = 64


def pair_forces(ends: Array, force: Array, moment: Array) -> Array:
    """Forces (2, 3) of two cables at ``ends`` (2, 3) that add up to ``force``: least squares of both and of the moment that they miss."""
    d, middle = ends[0] - ends[1], 0.5 * (ends[0] + ends[1])
    # Half of the difference: min 2 |g|^2 + |d x g - missing|^2.
    missing = moment - np.cross(middle, force)
    half = np.linalg.solve((2.0 + d @ d) * np.eye(3) - np.outer(d, d), np.cross(missing, d))
    return np.array([0.5 * force + half, 0.5 * force - half])


def separating_plane(
    near: Array, far: Array, wanted: tuple[Array, Array], weight: float
) -> tuple[Array, float] | None:
    """Unit normal (3,) and offset of the plane that has the points ``near`` (k, 3) below and ``far`` above it.

    Hard-margin support vector machine, ``min |s|^2 + weight (u^2 + v^2)``, which would like the ``wanted`` place of either cable on its side
    too, but for the slacks ``u`` and ``v``. ``None`` where no plane separates the two. Relative to the load, m.
    """
    import daqp

    middle = np.mean([*near, *far], axis=0)
    rows = np.zeros((2 + len(near) + len(far), 6))
    signs = np.concatenate([np.ones(len(near) + 1), -np.ones(len(far) + 1)])
    rows[:, :3] = signs[:, None] * (np.vstack([near, wanted[0], far, wanted[1]]) - middle)
    rows[:, 3] = -signs
    rows[len(near), 4] = rows[-1, 5] = -1.0
    found, _, flag, _ = daqp.solve(
        np.diag([1.0, 1.0, 1.0, _SLIGHT, weight + _SLIGHT, weight + _SLIGHT]),
        np.zeros(6),
        rows,
        np.full(len(rows), -1.0),
    )
    normal = np.array(found[:3])
    size = float(np.linalg.norm(normal))
    if flag != 1 or not size > 1e-6:
        return None
    return normal / size, float(found[3] + normal @ middle) / size


def half_spaces(
    ends: Array, lengths: Array, directions: Array, problem: Problem, tilts: Array, weight: float
) -> tuple[NDArray[np.intp], Array] | None:
    """Owners (m,) and unit normals (m, 3): the force of cable ``owner`` on the load has ``normal.f <= 0``.

    A pair's plane is hinged for either cable at its end: it leans to where the cable reaches the pair's plane highest, and back from
    there by the cable's tilt (n,), rad. A plane out of a cable's reach asks nothing of it. ``None`` where a pair has no plane.
    """
    n, force = len(ends), problem.force
    drones = ends - lengths[:, None] * directions
    owners, normals = [], []
    for i in range(n):
        for j in range(i + 1, n):
            wanted = pair_forces(ends[[i, j]], force, problem.moment)
            sizes = np.maximum(np.linalg.norm(wanted, axis=1), 1e-12)
            places = ends[[i, j]] + (lengths[[i, j]] / sizes)[:, None] * wanted
            plane = separating_plane(
                np.array([drones[i], ends[i]]), np.array([drones[j], ends[j]]),
                (places[0], places[1]), weight,
            )  # fmt: skip
            if plane is None:
                return None
            s, offset = plane
            up = force - (force @ s) * s  # the force's direction within the plane
            size = np.linalg.norm(up)
            if not size > 1e-6:
                return None
            up /= size
            for cable, side in ((i, 1.0), (j, -1.0)):
                far = (s @ ends[cable] - offset) / lengths[cable]
                if abs(far) >= 1.0:
                    continue
                level = math.sqrt(1.0 - far * far)
                hinged, reach = level * s + far * up, level * up - far * s
                owners.append(cable)
                normals.append(side * np.cos(tilts[cable]) * hinged + np.sin(tilts[cable]) * reach)
    return np.array(owners, dtype=np.intp), np.array(normals).reshape(-1, 3)


def rows_of(problem: Problem) -> tuple[Array, Array]:
    """Independent rows (k, 3 n) of the balance, orthonormal, and what is wanted of them (k,); what no cables can make is left out."""
    left, sizes, rows = np.linalg.svd(wrench_map(problem.ends), full_matrices=False)
    k = int(np.count_nonzero(sizes > RANK * sizes[0]))
    wanted = left.T @ np.concatenate([problem.force, problem.moment])
    return rows[:k], wanted[:k] / sizes[:k]


def _solve(problem: Problem) -> Outcome:
    params, ends = problem.params, problem.ends
    weight, settling = params[P.plane_weight], params[P.settling]
    formation = params[P.formation_weight]
    lengths, tilts = PARAMS.view(params, "length")[:, 0], PARAMS.view(params, "tilt")[:, 0]
    home = PARAMS.view(params, "home") @ problem.turn.T
    balance, wanted = rows_of(problem)
    last = -problem.shares[:, None] * problem.directions
    inertia = settling / max(problem.dt, 1e-6)
    aim = (inertia * last + formation * home) / (1.0 + inertia + formation)

    def cascade(directions: Array, aim: Array) -> tuple[tuple[Array, Array, int], Array] | None:
        planes = half_spaces(ends, lengths, directions, problem, tilts, weight)
        found = planes and least_forces(*planes, wanted, aim, np.zeros(len(planes[0])), balance)
        if planes is None or not found:
            return None
        gradient = found[0] - aim
        np.add.at(gradient, planes[0], found[1][:, None] * planes[1])
        return found, gradient

    status, answer = Status.CONVERGED, cascade(problem.directions, aim)
    if answer is None:
        status = Status.RECOVERING
        answer = cascade(-home / np.linalg.norm(home, axis=1, keepdims=True), np.zeros_like(aim))
    if answer is None:
        raise RuntimeError("no forces within the planes")
    (forces, multipliers, iterations), gradient = answer
    slope = gradient.ravel()
    residual = float(np.abs(slope - balance.T @ (balance @ slope)).max())
    objective = 0.5 * float(np.sum(forces * forces))
    at_work = _PAIRS if np.any(multipliers > 0.0) else 0
    least = 0.5 * float(wanted @ wanted)
    return Outcome(-forces, status, iterations, residual, objective, objective - least, at_work)


class WahbaHoenigWrench(WahbaHoenig):
    """Least cable forces that make force and moment, every two cables on different sides of a plane.

    Wahba and Hönig, "Efficient Optimization-Based Cable Force Allocation for Geometric Control of a Multirotor Team Transporting a
    Payload", IEEE RA-L, 2024 (arXiv:2304.02359). For a rigid load the authors (their firmware, https://github.com/IMRCLab/col-trans) find for
    every two cables: the forces that these two would make the wrench with; by a support vector machine the plane between
    both cables, ends and drones, with these forces on their sides if that can be; for either cable that reaches the plane a
    second one through its own end and the highest point of its reach, tilted back by half of the distance. The last QP has the balance
    of moments as well.

    Differences from it, beside those of ``wahba-hoenig``: slacks of the planes are squared, as that part's ``plane_weight`` is. A pair's force is a place at the cable's length along it, where the authors add
    newtons to metres. The axis across the wanted force is that of hinges and tilts, where they have the one across the
    vertical. The desired formation is the ring of drones that all formations of rigid loads are (:func:`colift.team.plan.plan`).

    What it does not promise: a distance. Planes are apart where cables lean towards each other, not where they lean along them; and
    a plane asks nothing of a cable that ends farther from it than it is long.
    """

    kernel = plain_kernel(_solve, lambda params: PARAMS.view(params, "arm"))
    wrenches = True

    def formation(self, team: Team) -> tuple[Array, Array]:
        return settled(self, team)

    def params(self, team: Team) -> Vector:
        if message := self.missing():
            raise MissingExtraError(message)
        directions, tensions = plan(team, lean=math.radians(self.formation_cone_deg))
        weight = team.load_mass * max(team.gravity, 1e-3)
        return PARAMS.pack(
            team.n, plane_weight=self.plane_weight, settling=self.settling, formation_weight=self.formation_weight,
            length=team.cable_lengths, tilt=self.tilts(team), arm=team.levers,
            home=-tensions[:, None] * directions / weight,
        )  # fmt: skip

    def memory(self, team: Team) -> Vector:
        return np.zeros(0)
