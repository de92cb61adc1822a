"""Which settings can be turned in flight: those of the table that the flying parts have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.control.reference.base import ReferencePart
from colift.control.reference.guided import Guided
from colift.flight.flight import Flight
from colift.kernel.math.turning import angles_of
from colift.part import Part, answering, find
from colift.team import Team
from colift.world.disturbance.base import DisturbancePart


@dataclass(frozen=True)
class Knob:
    """A number that a person can turn.

    ``name`` is the path of a setting (:meth:`colift.flight.flight.Flight.change`). A setting with one
    value per axis is turned as a whole: the number is the largest of them, their ratios stay.
    """

    name: str
    label: str
    unit: str
    min: float
    max: float
    log: bool = False


_ALLOCATION = (
    Knob("allocation.mu", "Alignment penalty mu", "N^2", 0.001, 10.0, log=True),
    Knob("allocation.min_angle_deg", "Least angle of cables", "deg", 5.0, 60.0),
    Knob("allocation.max_cone_deg", "Widest cone", "deg", 20.0, 85.0),
)
POSE = (
    Knob("reference.roll", "Roll of the load", "deg", -20.0, 20.0),
    Knob("reference.pitch", "Pitch of the load", "deg", -20.0, 20.0),
    Knob("reference.yaw", "Yaw of the load", "deg", -180.0, 180.0),
)
"""What turns a rigid load: its wanted angles."""
_GAINS = {"k_p": "proportional", "k_d": "derivative", "k_i": "integral"}
_CONTROL = {"load_control": "Load", "position_control": "Drones"}
_UNITS = {"k_p": "N/m", "k_d": "N s/m", "k_i": "N/(m s)"}


def knobs_of(flight: Flight) -> dict[str, Knob]:
    """By name, the knobs of what flies; the mission's values give the ranges of mass and gains."""
    mass = flight.mission.load.mass
    found = [Knob("load.mass", "True mass of the load", "kg", 0.2 * mass, 3.0 * mass)]
    found += POSE if flight.mission.team.body is not None else ()
    parts = flight.parts
    found += [
        knob for knob in _ALLOCATION if knob.name.partition(".")[2] in fields(parts["allocation"])
    ]
    for section, owner in _CONTROL.items():
        for name, kind in _GAINS.items():
            if name in fields(parts[section]):
                usual = largest(getattr(getattr(flight.mission, section), name)) or 1.0
                label = f"{owner}: {kind} gain"
                found.append(Knob(f"{section}.{name}", label, _UNITS[name], 0.0, 4.0 * usual))
    for section, part in parts.items():
        if isinstance(part, DisturbancePart) and part.makes_wind and "speed" in fields(part):
            found.append(Knob(f"{section}.speed", "Wind", "m/s", 0.0, 15.0))
            if "heading_deg" in fields(part):
                label = "Wind blows towards"
                found.append(Knob(f"{section}.heading_deg", label, "deg", -180.0, 180.0))
    return {knob.name: knob for knob in found}


def read(flight: Flight, name: str) -> float:
    """Where a knob stands, read back from what flies."""
    if name == "load.mass":
        return flight.load_mass
    for k, knob in enumerate(POSE):
        if name == knob.name:
            return wanted_angles_deg(flight)[k]
    section, _, field = name.rpartition(".")
    return largest(getattr(flight.parts[section], field))


def angles(flight: Flight) -> NDArray[np.float64]:
    """Roll, pitch and yaw that the reference has now, with three derivatives (4, 3), rad."""
    reference = flight.parts["reference"]
    assert isinstance(reference, ReferencePart)
    _, attitude, rates = reference.pose(flight.mission.team, flight.clock)
    return np.asarray(angles_of(attitude, rates))


def wanted_angles_deg(flight: Flight) -> tuple[float, float, float]:
    """Roll, pitch and yaw that a rigid load goes to, where it is flown by hand, or has now, degrees; yaw from -180 to 180."""
    reference = flight.parts["reference"]
    now = np.degrees(angles(flight)[0]).tolist()
    roll, pitch, yaw = reference.attitude_deg if isinstance(reference, Guided) else now
    return roll, pitch, math.remainder(yaw, 360.0)


def setting(flight: Flight, name: str, value: float) -> Any:
    """What the setting becomes when its knob is turned to a value."""
    if name == "load.mass":
        return value
    section, _, field = name.rpartition(".")
    now = getattr(flight.parts[section], field)
    if isinstance(now, float):
        return value
    most = largest(now)
    return [value * each / most if most else value for each in now]


def conflicts(flight: Flight, name: str, value: Any) -> list[tuple[str, str]]:
    """What speaks against a setting, as :meth:`colift.part.Part.check` says it."""
    if name == "load.mass":
        return []
    section, _, field = name.rpartition(".")
    part, team = flight.parts[section], flight.mission.team
    changed = type(part).model_validate({**part.model_dump(), field: value})
    return changed.check(team) + changed.conflicts(team)


def allocators(team: Team) -> list[str]:
    """Names of the allocators that this team can fly with, with their default settings."""
    found = []
    for name in answering("allocation"):
        part = find("allocation", name)
        if not part.missing() and not [*(made := part()).check(team), *made.conflicts(team)]:
            found.append(name)
    return found


def make_allocator(kind: str, wanted: Mapping[str, Any]) -> Part:
    """An allocator with those of the wanted settings that it has."""
    found = find("allocation", kind)
    return found(**{name: value for name, value in wanted.items() if name in found.model_fields})


def fields(part: Part) -> set[str]:
    """Names of the settings of a part."""
    return set(type(part).model_fields)


def largest(value: float | tuple[float, ...]) -> float:
    """The number that stands for a setting."""
    return float(max(value)) if isinstance(value, tuple) else float(value)
