"""The contract of the network: broadcast messages from each drone to each other."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["network"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called once before each cycle of the agents, ``now.dt`` apart, and only for a team of agents. ``outboxes[i]`` is what drone i said in its
last cycle. ``inboxes[i, j]`` gets the newest of what has reached drone i of drone j until now, ``heard[i, j]`` 1 if that is new
and else 0; of several messages that arrive in one cycle it brings the newest, and one that was overtaken may come after
those sent later. Nobody hears itself. Nothing is sent before the first cycle: ``now.step`` is 0 then.
"""


class NetworkPart(Part):
    """Base of all networks."""

    layer: ClassVar[str] = "network"
