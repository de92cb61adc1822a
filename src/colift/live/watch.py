"""Moments worth a mark while it flies: slack cables, fallbacks, drones lost, angles below the limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from colift.allocation import Status
from colift.geometry import pairwise_angles
from colift.simulation.flight import Flight
from colift.verdict import limits

PAUSE = 0.25
"""The same again within this time is no new moment, s."""
MOST_PAIRED = 64
"""Above so many drones no pair is looked at."""


def event(time: float, kind: str, text: str, drone: int | None = None) -> dict[str, Any]:
    """As a page gets it; ``kind`` is slack, fallback, fault, angle or command."""
    return {"time": round(time, 6), "kind": kind, "text": text, "drone": drone}


class Watch:
    """Looks at a flight after every stretch."""

    def __init__(self) -> None:
        self._slack: dict[int, float] = {}
        self._last: dict[tuple[str, Any], float] = {}
        self._found = 0
        self._ends = ["completed", ""]

    def look(self, flight: Flight) -> list[dict[str, Any]]:
        """What has begun since the last look."""
        return [*self._slack_cables(flight), *self._fallbacks(flight), *self._angles(flight),
                *self._losses(flight)]  # fmt: skip

    def _begins(self, flight: Flight, *what: Any) -> bool:
        """Whether something that is going on now has begun now."""
        before = self._last.get(what, -np.inf)
        self._last[what] = flight.time
        return flight.time - before > PAUSE

    def _slack_cables(self, flight: Flight) -> list[dict[str, Any]]:
        found = []
        for drone, spent in zip(flight.drones, flight.bus.slack_times, strict=True):
            if spent > self._slack.get(drone, 0.0) and self._begins(flight, "slack", drone):
                found.append(event(flight.time, "slack", f"Cable {drone + 1} slack", drone))
            self._slack[drone] = float(spent)
        return found

    def _fallbacks(self, flight: Flight) -> list[dict[str, Any]]:
        found = []
        for code in np.unique(flight.last_allocations[:, 0]):
            status = Status(int(code))
            if not status.ok and self._begins(flight, "fallback", status):
                name = status.name.replace("_", " ").lower()
                found.append(event(flight.time, "fallback", f"Allocator: {name}"))
        return found

    def _angles(self, flight: Flight) -> list[dict[str, Any]]:
        n, least = len(flight.drones), limits(flight.mission).angle_deg
        if least is None or not 2 <= n <= MOST_PAIRED:
            return []
        angles = np.degrees(pairwise_angles(flight.bus.directions))
        worst = int(angles.argmin())
        if not angles[worst] < least or not self._begins(flight, "angle"):
            return []
        one, other = (flight.drones[int(k[worst])] + 1 for k in np.triu_indices(n, k=1))
        text = f"Cables {one} and {other} closer than {least:g} deg"
        return [event(flight.time, "angle", text)]

    def _losses(self, flight: Flight) -> list[dict[str, Any]]:
        found = [
            event(time, "fault", f"Drone {drone + 1} is judged lost", drone)
            for time, drone in flight.found[self._found :]
        ]
        self._found = len(flight.found)
        ends = [flight.outcome, flight.descent]
        for now, before in zip(ends, self._ends, strict=True):
            if now != before:
                found.append(event(flight.time, "fault", now[:1].upper() + now[1:]))
        self._ends = ends
        return found
