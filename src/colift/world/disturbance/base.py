"""The contract of disturbances: each adds its share to the wind and to the forces on the bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from colift.kernel.ports import PORTS
from colift.part import Part, Setup, Vector

SIGNATURE = PORTS["disturbance"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. ``wind`` and ``external_forces`` start at zero in each of them, and each part adds its share. Parts that
make wind (``makes_wind``) come first, whatever their order in the mission, so that those that turn wind into forces find all of it.
"""


class DisturbancePart(Part):
    """Base of all disturbances."""

    layer: ClassVar[str] = "disturbance"
    makes_wind: ClassVar[bool] = False
    """Whether it adds to the wind."""
    feels_wind: ClassVar[bool] = False
    """Whether it turns wind into forces."""

    steady: ClassVar[bool] = False
    """Whether the wind that it makes stays as it is."""

    def strongest_wind(self) -> Vector:
        """What it adds to the wind (3,) at its strongest, world frame, m/s, as long as a team takes to answer it."""
        return np.zeros(3)

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        if self.makes_wind and not any(part.feels_wind for part in mission.disturbance):
            yield (
                "kind",
                "makes wind, which acts on nothing: there is no disturbance of kind drag that turns it into forces",
            )
