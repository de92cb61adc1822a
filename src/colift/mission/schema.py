"""What a mission file may contain. Defaults are the paper's where the paper gives a value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from colift.catalogue import LAYERS
from colift.team import Team
from colift.team.geometry import Array, ring

Positive = Annotated[float, Field(gt=0.0)]
Inertia = tuple[Positive, Positive, Positive]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Point = tuple[Coordinate, Coordinate, Coordinate]
Period = Annotated[float, Field(gt=0.0, le=1e6)]

MAX_DRONES = 1024


def _depth(value: Any) -> int:
    return 1 + _depth(value[0]) if isinstance(value, list | tuple) and value else 0


def _per_drone(depth: int) -> Discriminator:
    """Tell one value for all drones, a list of this depth, from a list with one value per drone."""
    return Discriminator(lambda value: "each" if _depth(value) > depth else "all")


_ForEach = Annotated[list[Positive], Tag("each")]
PerDrone = Annotated[Annotated[Positive, Tag("all")] | _ForEach, _per_drone(0)]
InertiaForEach = Annotated[list[Inertia], Tag("each")]
InertiaPerDrone = Annotated[Annotated[Inertia, Tag("all")] | InertiaForEach, _per_drone(1)]


Factor = Annotated[float, Field(gt=0.01, le=100.0)]
_FactorForEach = Annotated[list[Factor], Tag("each")]
FactorPerDrone = Annotated[Annotated[Factor, Tag("all")] | _FactorForEach, _per_drone(0)]


class Section(BaseModel):
    """A table of a mission file: unknown keys are errors, numbers are finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, validate_default=True)

    def problems(self) -> list[tuple[str, str, str]]:
        """Mistakes in how the fields go together, as ``(field, value, message)``."""
        return []

    def wrong_lengths(self, n: int) -> list[tuple[str, str, str]]:
        """Lists with one value per drone whose length is not the number of drones."""
        values = ((name, getattr(self, name)) for name in type(self).model_fields)
        message = f"must be one value or a list of drones.count = {n}"
        return [
            (name, f"{len(value)} values", message)
            for name, value in values
            if isinstance(value, list) and len(value) != n
        ]


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
    mass: PerDrone = 0.5
    """kg."""
    inertia: InertiaPerDrone = (0.021, 0.0187, 0.0397)
    """Principal moments of inertia, body frame, kg m^2."""
    cable_length: PerDrone = 1.0
    """m."""

    def problems(self) -> list[tuple[str, str, str]]:
        """Lists whose length is not the number of drones, and moments that no body has."""
        found = self.wrong_lengths(self.count)
        for row in self.inertia if isinstance(self.inertia, list) else [self.inertia]:
            if max(row) > sum(row) - max(row) + 1e-9 * sum(row):
                message = "no body has these: each moment must be at most the sum of the other two"
                found.append(("inertia", str(list(row)), message))
                break
        return found


class Truth(Section):
    """How the real bodies differ from what the controllers are told: factors of the nominal values.

    One value for all drones, or a list with one value per drone.
    """

    load_mass_factor: Factor = 1.0
    """Of ``load.mass``."""
    drone_mass_factor: FactorPerDrone = 1.0
    """Of ``drones.mass``."""
    inertia_factor: FactorPerDrone = 1.0
    """Of ``drones.inertia``."""
    cable_length_factor: FactorPerDrone = 1.0
    """Of ``drones.cable_length``."""


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

    def problems(self) -> list[tuple[str, str, str]]:
        """Directions without a length."""
        return [
            (f"directions.{i}", str(list(direction)), "is zero; a direction needs a length")
            for i, direction in enumerate(self.directions or [])
            if math.hypot(*direction) < 1e-9
        ]


class Timing(Section):
    """Duration, physics step and the period of each layer, s; periods are whole multiples of step."""

    duration: Annotated[float, Field(gt=0.0, le=1e6)] = 20.0
    """Length of the flight, s."""
    step: Annotated[float, Field(ge=1e-5, le=0.01)] = 0.001
    """Physics step, s (paper: 0.001)."""
    load_control: Period = 0.001
    """Period of the load controller, s."""
    allocation: Period = 0.001
    """Period of the allocator, s."""
    position_control: Period = 0.001
    """Period of the drones' position controllers, s."""
    attitude_control: Period = 0.001
    """Period of the drones' attitude controllers, s."""
    recording: Period = 0.005
    """Period of the recording, s; what happens once per allocation is recorded each time."""
    delay: Annotated[float, Field(ge=0.0, le=0.5)] | None = None
    """Age of what is measured when it arrives, s: of all sensors, and as the controllers are told. Each setting that says
    otherwise, such as ``sensing.load_delay`` (the truth) or ``estimation.delay`` (what is told), goes before it; without it each
    has its own default."""

    def multiples(self) -> dict[str, int]:
        """Each period as a number of physics steps."""
        names = ("load_control", "allocation", "position_control", "attitude_control", "recording")
        return {name: round(getattr(self, name) / self.step) for name in names}

    def problems(self) -> list[tuple[str, str, str]]:
        """Periods that are no whole multiple of the step, or longer than the flight."""
        found = []
        for name, count in self.multiples().items():
            period = getattr(self, name)
            if count < 1 or abs(count * self.step - period) > 1e-9 * period:
                nearest = max(1, count) * self.step
                message = f"must be a whole multiple of timing.step = {self.step:g} s; nearest {nearest:g}"
                found.append((name, f"{period:g}", message))
            elif period > self.duration:
                message = f"must not exceed timing.duration = {self.duration:g} s"
                found.append((name, f"{period:g}", message))
        return found

    @property
    def steps(self) -> int:
        """Physics steps of the flight, the one at t = duration included."""
        return round(self.duration / self.step) + 1


_CHANGING = "|".join(layer for layer in LAYERS if layer not in ("plant", "reference"))
EVENT_FIELDS = (
    r"^(load\.mass|drones\.(lose|join)|reference"
    rf"|({_CHANGING}|disturbance\.[0-9]{{1,3}})(\.[a-z_]+)?)$"
)


class Event(Section):
    """A change during the flight: of the truth, unknown to the controllers, or of the allocator."""

    at: Annotated[float, Field(ge=0.0)]
    """Time, s."""
    field: Annotated[str, Field(pattern=EVENT_FIELDS)]
    """What changes: ``load.mass`` (the plant's only), ``drones.lose``, ``drones.join``, a setting of a layer
    or of a disturbance such as ``allocation.mu`` or ``disturbance.0.force``, or a whole section such as
    ``reference``; ``allocation.kind`` puts another allocator, with its defaults, in place."""
    value: Any
    """New value, in the field's unit; for a section a table with ``kind`` and settings; for ``drones.lose`` the number, from 0, of the drone whose cable is
    cut and that leaves the team, which is told at once; for ``drones.join`` the drone that hooks in then, in
    the widest gap between the cables, at the load's velocity, and that is not there before."""

    @property
    def of_team(self) -> str:
        """``"lose"`` or ``"join"`` where the drone ``value`` leaves or joins; empty for other changes."""
        section, _, name = self.field.rpartition(".")
        return name if section == "drones" else ""


class Bound(Section):
    """What a number must keep within for the flight to pass; one end may be left open."""

    min: float | None = None
    """Least value, in the metric's unit."""
    max: float | None = None
    """Largest value, in the metric's unit."""

    def problems(self) -> list[tuple[str, str, str]]:
        """Bounds that bound nothing, or that exclude everything."""
        if self.min is None and self.max is None:
            return [("", "", "must give min, max or both")]
        if self.min is not None and self.max is not None and self.min > self.max:
            return [("min", f"{self.min:g}", f"must be at most max = {self.max:g}")]
        return []

    def holds(self, value: float) -> bool:
        """Whether a value is within; what is not a number is not."""
        return (self.min is None or value >= self.min) and (self.max is None or value <= self.max)

    def __str__(self) -> str:
        low = "" if self.min is None else f">= {self.min:g}"
        high = "" if self.max is None else f"<= {self.max:g}"
        return " and ".join(filter(None, (low, high)))


class Frame(Section):
    """What is the same in every mission: all but the sections of the layers."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    """Short name."""
    description: Annotated[str, Field(max_length=10_000)] = ""
    """What the mission shows."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Seed of everything random in the flight."""
    world: World = World()
    load: Load = Load()
    drones: Drones = Drones()
    truth: Truth = Truth()
    start: Start = Start()
    timing: Timing = Timing()
    events: list[Event] = []
    """Changes during the flight."""
    criteria: dict[str, Bound] = {}
    """What makes the flight a pass: bounds by the name of a metric."""

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

    @property
    def true_team(self) -> Team:
        """The bodies as they are; :attr:`team` is what the controllers are told."""
        told, truth = self.team, self.truth
        return replace(
            told,
            load_mass=told.load_mass * truth.load_mass_factor,
            masses=told.masses * truth.drone_mass_factor,
            inertias=told.inertias * np.reshape(truth.inertia_factor, (-1, 1)),
            cable_lengths=told.cable_lengths * truth.cable_length_factor,
        )

    def first_drones(self) -> list[int]:
        """Numbers of the drones that fly from the start: all but those that join before they leave."""
        first: dict[int, str] = {}
        for event in sorted(self.events, key=lambda event: event.at):
            if event.of_team:
                first.setdefault(event.value, event.of_team)
        return [i for i in range(self.drones.count) if first.get(i) != "join"]

    def start_directions(self) -> Array:
        """Unit cable directions (k, 3) at t = 0 of the k drones that fly from the start."""
        drones = self.first_drones()
        if self.start.directions is None:
            cone, heading = math.radians(self.start.cone_deg), math.radians(self.start.heading_deg)
            return ring(len(drones), cone, heading=heading)
        given = np.array(self.start.directions, dtype=float)[drones]
        return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))


class Described(Frame):
    """What a recording can tell of its mission: the frame, and by name what flew it."""

    if TYPE_CHECKING:  # fields of some, constants of others

        @property
        def kinds(self) -> Mapping[str, str]:
            """Name of the part in each layer."""

        @property
        def source(self) -> str:
            """``"simulation"``, or ``"flight"`` for one that was flown in the real world."""

    def resolved(self) -> dict[str, Any]:
        """All that is known, as plain data."""
        return self.model_dump(mode="json", exclude_none=True)


class RealFlight(Described):
    """What is known of a flight that colift did not fly: the team and the timing, no layers."""

    @property
    def kinds(self) -> Mapping[str, str]:
        """No part of ours flew it."""
        return {}

    @property
    def source(self) -> str:
        return "flight"
