"""What a mission file may contain. Defaults are the paper's where the paper gives a value."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, SerializeAsAny, model_validator

from colift.allocation.base import AllocatorPart
from colift.attitude_control.base import AttitudeControlPart
from colift.geometry import ring
from colift.load_control.base import LoadControlPart
from colift.part import Vector
from colift.plant.base import PlantPart
from colift.position_control.base import PositionControlPart
from colift.reference.base import ReferencePart
from colift.team import Team

Positive = Annotated[float, Field(gt=0.0)]
Inertia = tuple[Positive, Positive, Positive]
Point = tuple[float, float, float]

MAX_DRONES = 1024


class Section(BaseModel):
    """A table of a mission file: unknown keys are errors, numbers are finite."""

    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True, validate_default=True
    )


class World(Section):
    """Surroundings."""

    gravity: Annotated[float, Field(ge=0.0, le=100.0)] = 9.81
    """m/s^2."""


class Load(Section):
    """The load, a point mass."""

    mass: Annotated[float, Field(gt=0.0, le=1e5)] = 0.225
    """kg."""


class Drones(Section):
    """The drones and their cables; one value for all, or a list with one value per drone."""

    count: Annotated[int, Field(ge=1, le=MAX_DRONES)] = 4
    """Number of drones."""
    mass: Positive | list[Positive] = 0.5
    """kg."""
    inertia: Inertia | list[Inertia] = (0.021, 0.0187, 0.0397)
    """Principal moments of inertia, body frame, kg m^2."""
    cable_length: Positive | list[Positive] = 1.0
    """m."""


class Start(Section):
    """State of load and drones at t = 0, at rest."""

    cone_deg: Annotated[float, Field(gt=0.0, lt=180.0)] = 35.0
    """Half-angle of the ring that the drones start on, degrees (paper: 35, see the errata)."""
    heading_deg: float = 0.0
    """Azimuth of the first drone, degrees."""
    directions: list[Point] | None = None
    """Cable directions from drone to load instead of the ring, one per drone; any length but zero."""
    load_offset: Point = (0.0, 0.0, 0.0)
    """Offset of the load from the reference's first point, m."""

    @model_validator(mode="after")
    def _no_zero_direction(self) -> Start:
        for i, direction in enumerate(self.directions or []):
            if math.hypot(*direction) < 1e-9:
                raise ValueError(f"directions.{i} is zero; a direction needs a length")
        return self


class Timing(Section):
    """Duration, physics step and the period of each layer, s; periods are whole multiples of step."""

    duration: Annotated[float, Field(gt=0.0, le=1e6)] = 20.0
    """Length of the flight, s."""
    step: Annotated[float, Field(ge=1e-5, le=0.01)] = 0.001
    """Physics step, s (paper: 0.001)."""
    load_control: Positive = 0.001
    """Period of the load controller, s."""
    allocation: Positive = 0.001
    """Period of the allocator, s."""
    position_control: Positive = 0.001
    """Period of the drones' position controllers, s."""
    attitude_control: Positive = 0.001
    """Period of the drones' attitude controllers, s."""
    recording: Positive = 0.005
    """Period of the recording, s; what happens once per allocation is recorded each time."""

    def multiples(self) -> dict[str, int]:
        """Each period as a number of physics steps."""
        names = ("load_control", "allocation", "position_control", "attitude_control", "recording")
        return {name: round(getattr(self, name) / self.step) for name in names}

    def problems(self) -> list[tuple[str, Any, str]]:
        """Periods that are no whole multiple of the step, as (field, value, message)."""
        found = []
        for name, count in self.multiples().items():
            period = getattr(self, name)
            if count < 1 or abs(count * self.step - period) > 1e-9 * period:
                nearest = max(1, count) * self.step
                found.append(
                    (name, period, f"must be a whole multiple of timing.step = {self.step:g} s; nearest {nearest:g}")
                )
            elif period > self.duration:
                found.append((name, period, f"must not exceed timing.duration = {self.duration:g} s"))
        return found

    @property
    def steps(self) -> int:
        """Physics steps of the flight, the one at t = duration included."""
        return round(self.duration / self.step) + 1


class Event(Section):
    """A change of the truth during the flight, unknown to the controllers."""

    at: Annotated[float, Field(ge=0.0)]
    """Time, s."""
    field: Literal["load.mass"]
    """What changes."""
    value: Annotated[float, Field(gt=0.0, le=1e5)]
    """New value, in the field's unit."""


class Mission(Section):
    """A complete flight. Each layer's section names a part with ``kind`` and gives its settings."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    """Short name."""
    description: Annotated[str, Field(max_length=10_000)] = ""
    """What the mission shows."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of everything random in the flight."""
    world: World = World()
    load: Load = Load()
    drones: Drones = Drones()
    start: Start = Start()
    timing: Timing = Timing()
    events: list[Event] = []
    """Changes of the truth during the flight."""
    kinds: dict[str, str]
    """Name of the part in each layer."""
    reference: SerializeAsAny[ReferencePart]
    load_control: SerializeAsAny[LoadControlPart]
    allocation: SerializeAsAny[AllocatorPart]
    position_control: SerializeAsAny[PositionControlPart]
    attitude_control: SerializeAsAny[AttitudeControlPart]
    plant: SerializeAsAny[PlantPart]

    @property
    def team(self) -> Team:
        """The drones, cables and load as arrays."""
        n, drones = self.drones.count, self.drones
        inertia = np.array(drones.inertia, dtype=float)
        return Team(
            load_mass=self.load.mass,
            masses=np.array(np.broadcast_to(drones.mass, n), dtype=float),
            inertias=np.array(np.broadcast_to(inertia, (n, 3))),
            cable_lengths=np.array(np.broadcast_to(drones.cable_length, n), dtype=float),
            gravity=self.world.gravity,
        )

    def start_directions(self) -> Vector:
        """Unit cable directions (n, 3) at t = 0."""
        if self.start.directions is None:
            cone, heading = math.radians(self.start.cone_deg), math.radians(self.start.heading_deg)
            return ring(self.drones.count, cone, heading=heading)
        given = np.array(self.start.directions, dtype=float)
        return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))

    def resolved(self) -> dict[str, Any]:
        """The whole mission with every default filled in, as plain data (a valid mission file)."""
        data = self.model_dump(mode="json", exclude={"kinds"}, exclude_none=True)
        for layer, kind in self.kinds.items():
            data[layer] = {"kind": kind, **data[layer]}
        return data
