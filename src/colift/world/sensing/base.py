"""The contract of the sensing layer: from the truth to what the controllers are told."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["sensing"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. ``measured_ages`` are times since the samples were taken, in columns as in :data:`AGES`; a sensor that
has nothing new repeats its last value, which grows older.
"""


SENSORS = ("load", "tracking", "attitude", "rates")
"""What is measured: the load, and of each drone its position and velocity, its attitude, its body rates."""


AGES = ("tracking", "attitude", "rates")
"""Columns of ``measured_ages``; of a load that is a point only the first has a sensor."""


class SensingPart(Part):
    """Base of all sensor models."""

    layer: ClassVar[str] = "sensing"

    def delays(self) -> dict[str, float]:
        """Age of what is measured when it arrives, s: of ``load``, ``tracking``, ``attitude`` and ``rates``."""
        return dict.fromkeys(SENSORS, 0.0)
