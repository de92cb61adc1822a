"""A part with a signal of its own: a scale that weighs the load by the drones' thrusts.

Its signal is one more line in the table of signals, ``src/colift/kernel/signals.py``.
"""

from typing import Annotated

from pydantic import Field

from colift.control.detection.base import SIGNATURE, DetectionPart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.smooth import decay

PARAMS = Layout(team={"filter": 1, "drones": 1, "g": 1})
P = PARAMS.at


@kernel(SIGNATURE)
def weigh(now, sees, params, memory, writes):
    q, lift = sees.estimated_attitudes, 0.0
    for i in range(q.shape[0]):
        axis = quaternion.third_axis(q[i, 0], q[i, 1], q[i, 2], q[i, 3])
        lift += sees.thrusts[i] * axis[2]
    mass = lift / params[P.g] - params[P.drones]
    # What a kernel writes holds, on entry, what it wrote last.
    keep = 0.0 if now.step == 0 else decay(now.dt, params[P.filter])
    writes.weighed_mass[0] = keep * writes.weighed_mass[0] + (1.0 - keep) * mass


class Scale(DetectionPart):
    """Weighs the load by the drones' thrusts; judges nobody."""

    kernel = weigh

    filter: Annotated[float, Field(gt=0.0, le=100.0)] = 0.5
    """Time constant of the filter, s."""

    def params(self, team):
        drones = team.masses.sum()
        return PARAMS.pack(team.n, filter=self.filter, drones=drones, g=team.gravity)
