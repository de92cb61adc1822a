"""An allocator of your own in one file: the formation stands still, fresh batteries carry more.

colift run --with examples/my_allocator.py --set allocation.kind=my-allocator \
    --set "allocation.charge=[1.0, 0.5, 1.0, 0.8]"
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.base import INFO_BALANCE, AllocatorPart, Status


def share(now, sees, params, memory, writes):
    """Least ``sum T_i^2 / charge_i`` along the directions that the flight starts with; no cable pushes."""
    force, (tensions, directions, info) = sees.force, writes
    if not np.isfinite(force @ force):
        return Status.INVALID_FORCE
    weighted = params[:, None] * directions
    np.maximum(-weighted @ np.linalg.pinv(directions.T @ weighted) @ force, 0.0, out=tensions)
    info[:], info[INFO_BALANCE] = 0.0, np.linalg.norm(tensions @ directions + force)
    return Status.CONVERGED if info[INFO_BALANCE] <= 1e-9 * abs(force).sum() else Status.CLAMPED


class ChargeWeighted(AllocatorPart):
    """Tensions along a formation at rest, by the charge of each drone's battery."""

    kernel = share

    charge: tuple[Annotated[float, Field(gt=0.0, le=1.0)], ...] = (1.0,)
    """Charge of each drone's battery; one value stands for all."""

    def params(self, team):
        return np.resize(np.array(self.charge), team.n)

    def of(self, drones):
        chosen = self.charge if len(self.charge) == 1 else [self.charge[i] for i in drones]
        return self.model_copy(update={"charge": tuple(chosen)})
