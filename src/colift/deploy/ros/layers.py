"""A mission's controllers without a world: their kernels, called one by one on what is told from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.kernel.ports import PORTS
from colift.mission import load_mission
from colift.mission.mission import Mission

Array = NDArray[np.float64]

PERIOD = 0.01
"""Of what goes over topics, s, where a mission asks for a shorter one."""
LAYERS = ("load_control", "allocation", "position_control")
"""Layers whose period is that of the topics."""


def mission_for(
    name: str, overrides: Mapping[str, Any], period: float | None = None
) -> tuple[Mission, list[str]]:
    """A mission whose layers that speak to each other do so in one period, s; and what was put in for it.

    Raises
    ------
    ColiftError
        For a mission that nodes cannot fly, or that is not valid.

    """
    asked = load_mission(name, overrides)
    wanted = (
        max(PERIOD, *(getattr(asked.timing, layer) for layer in LAYERS))
        if period is None
        else period
    )
    changed = {
        f"timing.{layer}": wanted for layer in LAYERS if getattr(asked.timing, layer) != wanted
    }
    mission = load_mission(name, {**overrides, **changed}) if changed else asked
    if mission.agents.decides:
        raise ColiftError(
            f'agents.kind: must be "central" for nodes, not "{mission.kinds["agents"]}"'
        )
    for event in mission.events:
        if event.of_team:
            raise ColiftError(
                f"events: {event.field} at {event.at:g} s: the team of nodes does not change"
            )
    return mission, [f"{field} = {value:g}" for field, value in changed.items()]


class Layers:
    """The kernels of a mission's controllers, wired to one bus; nothing is simulated.

    Attributes
    ----------
    flight : Flight
        Never advanced: it holds the parts, and takes changes of their settings.
    period : int
        Of the topics, ns.

    """

    def __init__(self, mission: Mission) -> None:
        self.mission, self.team = mission, mission.team
        self.flight = Flight(mission)
        self.period = round(mission.timing.allocation * 1e9)

    @property
    def bus(self) -> Any:
        """Signals by name."""
        return self.flight.bus

    def call(self, layer: str, at: int, dt: float) -> int:
        """Call a layer's kernel at a time (ns), ``dt`` s after the last time; its status."""
        step = round(at * 1e-9 / self.mission.timing.step)
        wire = getattr(self.flight.wires, layer)
        return int(PORTS[layer].invoke(wire, step, at * 1e-9, dt) or 0)
