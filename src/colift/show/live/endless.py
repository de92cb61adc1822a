"""Missions for flying by hand: before the flight without an end, after it as what was flown."""

from __future__ import annotations

from typing import Any

import numpy as np

from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.kernel.ports import MAX_DISTURBANCES
from colift.mission.checks import MAX_RECORDING, recorded_bytes
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.mission.schema import Timing
from colift.part import names

AIR = {"wind": {"speed": 0.0}, "drag": {}}
"""Disturbances that a wind needs, by kind; added calm where the mission has none of the kind."""


def live_mission(mission: Mission) -> dict[str, Any]:
    """The mission with what can be called on in flight: air that may move and, last, a push on the load.

    Faults at a random time, or of a random drone, are given the ones that the seed draws.
    """
    table = mission.resolved()
    kinds, known = mission.list_kinds["disturbance"], set(names("disturbance"))
    if not any(part.makes_wind for part in mission.disturbance) and known >= set(AIR):
        wanted = [kind for kind in AIR if kind not in kinds]
        if len(kinds) + len(wanted) < MAX_DISTURBANCES:
            table["disturbance"] += [{"kind": kind, **AIR[kind]} for kind in wanted]
    table["disturbance"].append({"kind": "push"})
    n, duration = mission.drones.count, mission.timing.duration
    for number, (fault, part) in enumerate(zip(table["fault"], mission.fault, strict=True)):
        drawn = part.drawn(np.random.default_rng([mission.seed, number]), n, duration)
        fault |= {"at": drawn.at, "drone": drawn.drone}
    return table


def flown_mission(mission: Mission, flight: Flight, commands: list[dict[str, Any]]) -> Mission:
    """The mission that flies the same again: as long as was flown, with the commands as its events.

    Its recording is sparser than the flight's where it would otherwise be too large.

    Raises
    ------
    ColiftError
        If hardly anything has been flown.

    """
    table = mission.resolved()
    timing = table["timing"]
    flown = flight.time - timing["step"]
    if flown < max(mission.timing.multiples().values()) * timing["step"]:
        raise ColiftError("there is nothing to save yet")
    timing["duration"] = flown
    table["events"] = [e for e in [*table["events"], *commands] if e["at"] <= flown]
    table["fault"] = [fault for fault in table["fault"] if fault["at"] <= flown]
    while recorded_bytes(mission.drones.count, Timing(**timing)) > MAX_RECORDING:
        timing["recording"] *= 2.0
    return load_mission(table)
