"""A plant of your own: the rigid cables, with linear air drag on the load.

It wraps the kernel of an existing plant. A plant from scratch overrides ``observe`` as well and keeps
whatever state it likes in its memory.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.kernel.jit import kernel
from colift.world.plant.base import STATE, STEP_SIGNATURE
from colift.world.plant.rigid_cables import RigidCables

rigid_step = RigidCables.kernel
S = STATE.at


@kernel(STEP_SIGNATURE)
def step(now, sees, params, memory, writes):
    on_load = sees.external_forces[-1]
    drag = params[params.shape[0] - 1]
    for k in range(3):
        on_load[k] -= drag * memory[S.load_velocity + k]
    rigid_step(now, sees, params, memory, writes)
    for k in range(3):
        on_load[k] = 0.0


class DraggyCables(RigidCables):
    """Rigid cables and a load with drag."""

    kernel = step

    drag: Annotated[float, Field(ge=0.0)] = 0.05
    """Drag of the load per speed, N s/m."""

    def params(self, team):
        return np.append(super().params(team), self.drag)
