"""Least forces for a rigid load plus internal forces that pull its ends apart and make no wrench (Tognon et al. 2018)."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.wrenches import begin, nearest, settled
from colift.control.allocation.limits.usual import share_of
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import wrench
from colift.kernel.math.columns import column
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import LEAN, spanned

_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)

PARAMS = Layout(team={"span": 1, "axis": 3}, drone={"arm": 3, "pull": 3})
MEMORY = Layout(drone={"w": 3, "end": 3})
"""Both in columns; ``pull`` is the internal force on the drone, N, in the load's frame."""
P, PLACES = PARAMS.at, PARAMS.spans
M, COLUMNS = MEMORY.at, MEMORY.spans


@kernel(SIGNATURE)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force, moment = sees.force, sees.moment
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    w = column(memory, M.rows, n, COLUMNS.w)
    ends = column(memory, M.rows, n, COLUMNS.end)
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    W = begin(known, force, moment, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    wrench.turned(qw, qx, qy, qz, n, column(params, P.rows, n, PLACES.arm), ends)
    wrench.turned(qw, qx, qy, qz, n, column(params, P.rows, n, PLACES.pull), w)
    axis = params[P.axis : P.axis + 3]
    return nearest(
        W,
        force,
        moment,
        (qw, qx, qy, qz),
        params[P.span],
        axis,
        ends,
        w,
        tensions,
        directions,
        info,
    )


class InternalForceWrench(AllocatorPart):
    """Cable ``i`` pulls the load with the least forces that make the wrench, and with ``t_L d_i`` away from the middle of all ends.

    Tognon, Gabellieri, Pallottino and Franchi, "Aerial Co-Manipulation with Cables: The Role of Internal Force for Equilibria,
    Stability, and Passivity", IEEE RA-L 3(3), 2018: two robots carry a beam, each with half of its weight, and pull its ends apart
    with ``t_L > 0`` along the beam, which keeps its attitude stable. With ``s_i`` from the mean of the ends to that of cable i, ``d_i =
    s_i / max |s_j|`` add up to no force and, parallel to their arms, to no moment: two cables have the paper's pair, and
    any number has one of its kind in the null space. The ``d_i`` turn with the load, as the beam's axis does there.

    What differs: the paper's robots know no wanted wrench, they share the weight and react to the cables; here the least forces follow
    the wanted force and moment. Who ends in the middle gets no internal force; after the loss of a drone the others have
    theirs about the new middle at once. A point load has no ends to be pulled apart: see ``internal-force``.
    """

    kernel = _allocate
    remembers = MEMORY
    wrenches = True
    spread_setting = ("internal_force", (0.2, 0.4, 0.7, 1.0, 1.5))
    from_team: ClassVar = {"internal_force": 0.4}
    of_all = ("internal_force",)

    internal_force: Annotated[float, Field(ge=0.0, le=1e6)] | None = None
    """Internal force ``t_L`` of the cable that ends farthest out, N. None: 0.577 of a cable's share of the weight, which leans that
    cable by 30 degrees from the vertical in hover."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        return {"internal_force": np.full(team.n, math.tan(LEAN) * share_of(team))}

    def formation(self, team: Team) -> tuple[Array, Array]:
        return settled(self, team)

    def params(self, team: Team) -> Vector:
        span, axis = spanned(team)
        spread = team.levers - team.levers.mean(axis=0)
        size = max(float(np.linalg.norm(spread, axis=1).max()), 1e-9)
        pulls = -self.settled("internal_force", team)[:, None] * spread / size
        return np.concatenate([[span, *axis], team.levers.ravel(), pulls.ravel()])

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return float(0.5 * tensions @ tensions)
