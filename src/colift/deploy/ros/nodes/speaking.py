"""What more than one node says."""

from __future__ import annotations

from typing import Any

from colift.record.exchange import messages
from colift.record.exchange.messages import Body
from colift.record.exchange.topics import LOAD


def say_load_side(node: Any, at: int, bus: Any) -> None:
    """Reference and wanted force of a time (ns), from the bus; the question to the allocator comes last."""
    at += node.zero
    wanted = Body(
        bus.reference[0], bus.reference[1], bus.reference_attitude, bus.reference_rates[0]
    )
    node.say("reference", messages.odometry(at, LOAD, wanted))
    node.say("acceleration", messages.acceleration(at, bus.reference[2], bus.reference_rates[1]))
    node.say("wrench", messages.wrench(at, bus.force, bus.moment))
