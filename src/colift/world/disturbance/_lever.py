"""What a force beside the centre of mass does to a rigid load: it turns it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from colift.kernel.jit import inline
from colift.kernel.math import quaternion
from colift.kernel.math.small import cross
from colift.part import Vector
from colift.team import Team

Metre = Annotated[float, Field(ge=-1e3, le=1e3)]


def arm_of(point: ArrayLike | None, team: Team) -> Vector:
    """From the centre of mass to a point (3,) of the load, in its frame, m; zeros on a point, and where none is given."""
    if team.body is None or point is None:
        return np.zeros(3)
    return np.asarray(np.asarray(point, dtype=float) - team.body.centre)


def aside(name: str, point: ArrayLike | None, team: Team) -> list[tuple[str, str]]:
    """A problem where a place on the load is given, and it is a point."""
    if team.body is not None or point is None or not np.any(point):
        return []
    return [(name, 'is for rigid loads (load.kind = "rigid"): a point has one place')]


@inline
def turn_by(o, params, fx, fy, fz, sees, writes):  # type: ignore[no-untyped-def]
    """Add the moment of a force (N, world) at the end of the arm that stands at ``params[o]``, in the load's frame."""
    q = sees.load_attitude
    arm = quaternion.into_world(q[0], q[1], q[2], q[3], params[o], params[o + 1], params[o + 2])
    moment = cross(arm, (fx, fy, fz))
    for k in range(3):
        writes.external_moment[k] += moment[k]
