"""The contract of the supervision layer: from the estimate to a phase of the flight and the reference's clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from colift.kernel.phase import Phase
from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["supervision"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step, before the reference. ``clock[0]`` is the time that the reference is given in place of ``now.time``, s;
``clock[1]`` is how fast it runs: 1 as time does, 0 while it is held. Derivatives of the reference are those along the
clock; the loop makes those in time of them.
"""

FLYING = float(Phase.FLY)
"""``phase`` of a load that follows the reference; other numbers are those of :class:`colift.kernel.phase.Phase`."""


class SupervisionPart(Part):
    """Base of all supervisors."""

    layer: ClassVar[str] = "supervision"
    works_with: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    """Kinds of parts, by layer, that do what it asks for (beside ``external``); every kind of a layer that is not named."""
