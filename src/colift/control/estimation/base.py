"""The contract of the estimation layer: from measurements to the state that the controllers use."""

from __future__ import annotations

from typing import ClassVar

from colift.control.margins import Filter
from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["estimation"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. A sensor that has nothing new repeats its last value, which grows older (``measured_ages``); ``thrusts`` are
the last commands. ``estimated_ages`` are those of what is estimated, in the same columns: tracking, attitude, rates.
"""


class EstimationPart(Part):
    """Base of all estimators."""

    layer: ClassVar[str] = "estimation"

    def filters(self) -> tuple[Filter, Filter] | None:
        """Of each drone's place and of the load's; None where measurements are believed as they are."""
        return None
