"""The contract of the sensing layer: from the truth to what the controllers are told."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.jit import inline
from colift.kernel.math import quaternion
from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["sensing"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. ``measured_ages`` are times since the samples were taken, in columns as in :data:`AGES`; a sensor that
has nothing new repeats its last value, which grows older. An accelerometer measures the mean since its sample before
(:func:`felt`), whatever the plant; ``specific_force_ages`` are those of its samples.
"""


SENSORS = ("load", "tracking", "attitude", "rates", "specific_force")
"""What is measured: the load, and of each drone its position and velocity, its attitude, its body rates, its acceleration less gravity's."""


AGES = ("tracking", "attitude", "rates")
"""Columns of ``measured_ages``; of a load that is a point only the first has a sensor."""


@inline
def felt(i, velocities, attitudes, memory, before, g, dt):  # type: ignore[no-untyped-def]
    """Specific force of drone i over the last step (s), body frame, m/s^2: by its velocity now and that at ``memory[before]``."""
    x = (velocities[i, 0] - memory[before]) / dt
    y = (velocities[i, 1] - memory[before + 1]) / dt
    z = (velocities[i, 2] - memory[before + 2]) / dt
    for k in range(3):
        memory[before + k] = velocities[i, k]
    q = attitudes[i]
    return quaternion.into_body(q[0], q[1], q[2], q[3], x, y, z + g)


class SensingPart(Part):
    """Base of all sensor models."""

    layer: ClassVar[str] = "sensing"

    def delays(self) -> dict[str, float]:
        """Age of what is measured when it arrives, s: of ``load``, ``tracking``, ``attitude`` and ``rates``."""
        return dict.fromkeys(SENSORS, 0.0)
