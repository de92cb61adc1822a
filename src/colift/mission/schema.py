"""What a mission file may contain. Defaults are the paper's where the paper gives a value."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    field_validator,
    model_validator,
)

from colift.catalogue import LAYERS
from colift.errors import ColiftError
from colift.team import Body, Team, vehicles
from colift.team import Ground as GroundBelow
from colift.team.geometry import Array, ring, ring_cone
from colift.team.load import box_inertia, flaw_of, usual_attachments
from colift.team.obstacles import BOX, CYLINDER, WIDTH
from colift.team.plan import plan

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


_NameForEach = Annotated[list[str], Tag("each")]
NamePerDrone = Annotated[Annotated[str, Tag("all")] | _NameForEach, _per_drone(0)]
_ThrustForEach = Annotated[list[vehicles.Thrust], Tag("each")]
ThrustPerDrone = Annotated[Annotated[vehicles.Thrust, Tag("all")] | _ThrustForEach, _per_drone(0)]
_LagForEach = Annotated[list[vehicles.Lag], Tag("each")]
LagPerDrone = Annotated[Annotated[vehicles.Lag, Tag("all")] | _LagForEach, _per_drone(0)]
_SizeForEach = Annotated[list[vehicles.Size], Tag("each")]
SizePerDrone = Annotated[Annotated[vehicles.Size, Tag("all")] | _SizeForEach, _per_drone(0)]
_RadiusForEach = Annotated[list[vehicles.Radius], Tag("each")]
RadiusPerDrone = Annotated[Annotated[vehicles.Radius, Tag("all")] | _RadiusForEach, _per_drone(0)]
_RotorsForEach = Annotated[list[vehicles.Rotors], Tag("each")]
RotorsPerDrone = Annotated[Annotated[vehicles.Rotors, Tag("all")] | _RotorsForEach, _per_drone(0)]
_RatioForEach = Annotated[list[vehicles.TorqueRatio], Tag("each")]
TorqueRatioPerDrone = Annotated[
    Annotated[vehicles.TorqueRatio, Tag("all")] | _RatioForEach, _per_drone(0)
]
_ShareForEach = Annotated[list[vehicles.Share], Tag("each")]
SharePerDrone = Annotated[Annotated[vehicles.Share, Tag("all")] | _ShareForEach, _per_drone(0)]
_DragForEach = Annotated[list[vehicles.RotorDrag], Tag("each")]
DragPerDrone = Annotated[Annotated[vehicles.RotorDrag, Tag("all")] | _DragForEach, _per_drone(0)]


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


class Ground(Section):
    """Level ground under everything (:class:`colift.team.Ground`)."""

    height: Coordinate = 0.0
    """Of its surface, m."""
    friction: Annotated[float, Field(ge=0.0, le=10.0)] = 0.8
    """Coefficient of friction of load and drones on it."""
    restitution: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Speed with which a body bounces off it over that with which it fell; a fast fall returns 0.135 at least."""


Size = Annotated[float, Field(gt=0.0, le=1e4)]


class Obstacle(Section):
    """Something in the way: a box along the axes, an upright cylinder, or a sphere (:mod:`colift.team.obstacles`)."""

    kind: Literal["box", "cylinder", "sphere"]
    """Which of them."""
    centre: Point
    """World frame, m."""
    size: tuple[Size, Size, Size] | None = None
    """Edges of a box, m."""
    radius: Size | None = None
    """Of a cylinder or sphere, m."""
    height: Size | None = None
    """Of a cylinder, m."""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        own = {"box": {"size"}, "cylinder": {"radius", "height"}, "sphere": {"radius"}}[self.kind]
        for name in ("size", "radius", "height"):
            if (name in own) != (getattr(self, name) is not None):
                needs = " and ".join(sorted(own))
                raise ValueError(f"a {self.kind} has {needs}, and no more than that")
        return self

    def row(self) -> Array:
        """The eight numbers (:mod:`colift.team.obstacles`)."""
        radius = self.radius or 0.0
        half, rounding = [0.0] * 3, 0.0
        if self.size is not None:
            half = [0.5 * edge for edge in self.size]
        elif self.height is not None:
            half = [radius, radius, 0.5 * self.height]
        else:
            rounding = radius
        kind = CYLINDER if self.kind == "cylinder" else BOX
        return np.array([kind, *self.centre, *half, rounding])


class World(Section):
    """Surroundings."""

    gravity: Annotated[float, Field(ge=0.0, le=100.0)] = 9.81
    """m/s^2."""
    ground: Annotated[
        Annotated[Ground, Tag("table")] | Annotated[Literal["none"], Tag("none")],
        Discriminator(lambda value: "none" if isinstance(value, str) else "table"),
    ] = Ground()
    """The ground, at z = 0 unless its table says otherwise; or ``"none"``, which lets things fall for ever."""
    obstacles: Annotated[list[Obstacle], Field(max_length=1000)] = []
    """What nothing of the team may touch: a flight that does is lost. Nobody who controls knows of them but the plan that is flown."""
    scene: str | None = None
    """YAML file of a planning scene whose obstacles come before these, and are kept with the mission."""

    def wrong_lengths(self, n: int) -> list[tuple[str, str, str]]:
        """None: obstacles are no drones."""
        return []

    def rows(self) -> Array:
        """The obstacles (m, 8)."""
        return np.array([each.row() for each in self.obstacles]).reshape(-1, WIDTH)


Edge = Annotated[float, Field(ge=0.0, le=100.0)]
Lever = Annotated[float, Field(ge=-100.0, le=100.0)]
Place = tuple[Lever, Lever, Lever]
MOST_POINTS = 8


class Load(Section):
    """The load: a point mass, or a rigid body of which place and attitude are wanted.

    A rigid load is described in its own frame, whose origin is the middle of the box around it; that middle is what is called its place.
    """

    kind: Literal["point", "rigid"] = "point"
    """``"point"``, or ``"rigid"`` for one with an attitude."""
    mass: Annotated[float, Field(gt=0.0, le=1e5)] = 0.225
    """kg."""
    size: tuple[Edge, Edge, Edge] | None = None
    """Edges of a rigid load's box, m; a bar or a panel has edges of 0."""
    inertia: Inertia | None = None
    """Moments of inertia about the axes through the centre of mass, kg m^2; left out: those of a uniform box."""
    products: Place = (0.0, 0.0, 0.0)
    """Products of inertia: the entries yz, xz and xy of the inertia matrix, kg m^2."""
    attachments: list[Place] | None = None
    """Where the cables end, m, one for each drone; left out: on the upper face, two at the ends of the longer edge, four on the
    corners, others around its middle."""
    centre_of_mass: Place = (0.0, 0.0, 0.0)
    """m."""
    points: Annotated[list[Place], Field(min_length=1, max_length=MOST_POINTS)] | None = None
    """With which the load touches the ground, m; left out: the corners of its box."""

    def body(self, n: int) -> Body | None:
        """The rigid load on n cables; None for a point, and for what is none (:meth:`problems`)."""
        if self.kind == "point" or self.problems() or len(self.attachments or range(n)) != n:
            return None
        assert self.size is not None
        size = np.array(self.size)
        attachments = usual_attachments(n, size) if self.attachments is None else self.attachments
        return Body(
            inertia=self.matrix(size),
            attachments=np.array(attachments, dtype=float),
            centre=np.array(self.centre_of_mass),
            size=size,
            points=None if self.points is None else np.array(self.points),  # type: ignore[arg-type]
        )

    def matrix(self, size: Array) -> Array:
        """Inertia (3, 3), kg m^2."""
        if self.inertia is None:
            return box_inertia(self.mass, size)
        yz, xz, xy = self.products
        return np.asarray(
            np.diag(self.inertia) + np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
        )

    def problems(self) -> list[tuple[str, str, str]]:
        """What a point does not have, what a rigid load must have, and inertias that no body has."""
        own = sorted({*type(self).model_fields} - {"kind", "mass"})
        if self.kind == "point":
            given = {name: getattr(self, name) for name in own}
            message = 'is of a rigid load: give load.kind = "rigid" too'
            return [
                (name, str(value), message)
                for name, value in given.items()
                if value is not None and np.any(value)
            ]
        if self.size is None:
            return [("size", "", "is required of a rigid load: the edges of the box around it, m")]
        if self.inertia is None:
            if sum(edge > 0.0 for edge in self.size) < 2:
                return [
                    ("inertia", "", "is required of a load without width: no uniform box has it")
                ]
            if any(self.products):
                return [("products", str(list(self.products)), "needs load.inertia beside it")]
            return []
        matrix = self.matrix(np.array(self.size))
        flaw = flaw_of(matrix)
        return [("inertia", str(list(self.inertia)), flaw)] if flaw else []


class Drones(Section):
    """The drones and their cables; one value for all, or a list with one value per drone.

    A number that is left out is the vehicle's. Without a vehicle, mass and inertia are the paper's. Of what else is left
    out, thrust, lag, arm and torque ratio are those of the motors (``actuation``), which are usual ones where it does not say
    either; what depends on other numbers has a default of its own.
    """

    vehicle: NamePerDrone | None = None
    """A drone by its name, or the path of a TOML file with its numbers."""
    count: Annotated[int, Field(ge=1, le=MAX_DRONES)] = 4
    """Number of drones."""
    mass: PerDrone = vehicles.PAPER_MASS
    """With battery, kg."""
    inertia: InertiaPerDrone = vehicles.PAPER_INERTIA
    """Principal moments of inertia, body frame, kg m^2; left out, they are estimated where ``arm`` is known."""
    cable_length: PerDrone = 1.0
    """m."""
    cable_density: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Mass of the cables per length, as the controllers are told, kg/m: they reckon half of each cable to its drone, half to the load. So
    do plants whose cables have no mass; that of ``bead-cables`` is its own."""
    max_thrust: ThrustPerDrone | None = None
    """Largest steady thrust of a drone, all its rotors together, N."""
    motor_lag: LagPerDrone | None = None
    """Time constant of a motor's thrust, s."""
    arm: SizePerDrone | None = None
    """From a drone's centre to a rotor's axis, m."""
    radius: RadiusPerDrone | None = None
    """From the centre to the outermost tip of a rotor, m; left out: ``arm`` and ``rotor_radius`` together."""
    rotor_radius: SizePerDrone | None = None
    """Of one rotor, m."""
    rotors: RotorsPerDrone | None = None
    """Number of rotors: 4, 6 or 8."""
    torque_ratio: TorqueRatioPerDrone | None = None
    """Torque about a motor's axis per thrust, m."""
    rotor_drag: DragPerDrone | None = None
    """Force in the rotors' plane per thrust and speed across it, s/m."""
    energy: PerDrone | None = None
    """Of a full battery, J."""
    efficiency: SharePerDrone | None = None
    """Ideal power of the rotors in hover over the battery's power."""
    inertia_from: Literal["given", "vehicle", "estimate", "paper"] | None = None
    """Where the inertia comes from; written by colift, for whoever reads the resolved mission."""
    _assumed: tuple[str, ...] = PrivateAttr(default=())
    _guessed: frozenset[str] = PrivateAttr(default=frozenset())

    @property
    def assumed(self) -> tuple[str, ...]:
        """Numbers that the mission does not give here, but that its motors have."""
        return self._assumed

    def assuming(self, numbers: Mapping[str, Any], guessed: Iterable[str]) -> Self:
        """The same drones with numbers (n,) for fields that are not known, some of which are no more than ``guessed``."""
        known = {
            name: float(each[0]) if np.all(each == each[0]) else each.tolist()
            for name, each in numbers.items()
            if getattr(self, name) is None and np.isfinite(each).all()
        }
        if not known:
            return self
        copy = self.model_copy(update=known)
        copy.model_fields_set.difference_update(known)
        copy._assumed, copy._guessed = tuple(known), frozenset(known) & {*guessed}
        return copy

    @field_validator("vehicle")
    @classmethod
    def _known(cls, value: str | list[str] | None) -> str | list[str] | None:
        for name in [value] if isinstance(value, str) else value or []:
            try:
                vehicles.Vehicle.named(name)
            except ColiftError as error:
                raise ValueError(str(error)) from error
        return value

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Fill in what is left out: the vehicle's numbers, and what follows from them."""
        told = self.model_fields_set & {*vehicles.NUMBERS}
        if not told and self.vehicle is None:
            return self
        if self.wrong_lengths(self.count):
            return self
        names = self.vehicle if isinstance(self.vehicle, list) else [self.vehicle] * self.count
        kinds = {name: None if name is None else vehicles.Vehicle.named(name) for name in {*names}}
        given = self._numbers(told)
        bodies = [vehicles.complete(given[i], kinds[name]) for i, name in enumerate(names)]
        for name in {*vehicles.NUMBERS} - told:
            values = [body.numbers.get(name) for body in bodies]
            if None not in values:
                same = all(value == values[0] for value in values)
                self.__dict__[name] = values[0] if same else values
        if self.inertia_from is None:
            sources = [body.inertia_from for body in bodies]
            worst = next(s for s in ("estimate", "paper", "vehicle", "given") if s in sources)
            self.__dict__["inertia_from"] = None if worst == "given" else worst
        return self

    def numbers(self) -> list[dict[str, Any]]:
        """What is known of each drone, by field."""
        return self._numbers(vehicles.NUMBERS)

    def _numbers(self, fields: Iterable[str]) -> list[dict[str, Any]]:
        values = {field: getattr(self, field) for field in fields}
        return [
            {
                field: value[drone] if isinstance(value, list) else value
                for field, value in values.items()
                if value is not None
            }
            for drone in range(self.count)
        ]

    def problems(self) -> list[tuple[str, str, str]]:
        """Lists whose length is not the number of drones, and numbers that no drone has together."""
        found = self.wrong_lengths(self.count)
        wrong = {field for field, _, _ in found}
        if wrong & {*vehicles.NUMBERS}:
            rows = self.inertia if isinstance(self.inertia, list) else [self.inertia]
            bodies = [{"inertia": row} for row in rows]
        else:
            bodies = self.numbers()
        for number, body in enumerate(bodies):
            for field, message in vehicles.impossible(body):
                value = body[field]
                text = str(list(value)) if field == "inertia" else f"{value:g}"
                several = isinstance(getattr(self, field), list) and field != "inertia"
                found.append((f"{field}.{number}" if several else field, text, message))
            if len(found) > len(wrong):
                break
        return found

    def notes(self) -> list[tuple[str, str]]:
        """What was put in for what is left out and should be known better, as ``(field, message)``."""
        found = []
        if "max_thrust" in self._guessed:
            most = np.atleast_1d(np.asarray(self.max_thrust))
            message = (
                f"is not given: {most.max():.4g} N are assumed, {vehicles.THRUST_PER_MASS:g} N for each kg, and with them the "
                "limits of the motors and the allocator; give what the data sheet says, or a vehicle"
            )
            found.append(("max_thrust", message))
        if self.inertia_from == "estimate":
            for drone, body in enumerate(self.numbers()):
                usual = vehicles.usual_arm(body["mass"], vehicles.PAPER_INERTIA)
                J = vehicles.estimated_inertia(body["mass"], body.get("arm", usual))
                if tuple(body["inertia"]) == J:
                    text = ", ".join(f"{moment:.3g}" for moment in J)
                    message = (
                        f"is estimated from mass and arm, as m a^2 (1/4, 1/4, 1/2): {text} kg m^2 for drone {drone}, "
                        "good to a factor of two; measure it, or take it from a model"
                    )
                    found.append(("inertia", message))
                    break
        if self.inertia_from == "paper" and "mass" in self.model_fields_set:
            message = f"is that of the paper's drone of {vehicles.PAPER_MASS:g} kg: give yours, or arm, from which it is estimated"
            found.append(("inertia", message))
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
    load_inertia_factor: Factor = 1.0
    """Of a rigid load's inertia."""
    centre_of_mass_offset: Place = (0.0, 0.0, 0.0)
    """Of its true centre of mass from ``load.centre_of_mass``, m."""
    attachment_offset: Annotated[
        Annotated[Place, Tag("all")] | Annotated[list[Place], Tag("each")], _per_drone(1)
    ] = (0.0, 0.0, 0.0)
    """Of the true attachments from ``load.attachments``, m."""

    def body_of(self, told: Body) -> Body:
        """The true load that controllers are told like this."""
        return replace(
            told,
            inertia=told.inertia * self.load_inertia_factor,
            centre=told.centre + np.array(self.centre_of_mass_offset),
            attachments=told.attachments + np.array(self.attachment_offset),
        )


PAPER_CONE, WIDEST_START = math.radians(35.0), math.radians(65.0)
"""Half-angles of the ring of a start that says none: the paper's, and the most, rad."""
APART = math.radians(33.0)
"""Angle between neighbours of such a ring, rad: a little more than the allocator's least."""
ROOM = 1.3
"""Half of the distance between them, in radii of the drones where these are known: a little more, too."""


class Start(Section):
    """State of load and drones at t = 0, at rest."""

    cone_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = None
    """Half-angle of the ring that the drones start on, degrees. None: 35 (the paper's, see the errata); where that brings
    neighbours nearer than 33 degrees or 2.6 ``drones.radius``, so much more, up to 65."""
    heading_deg: float = 0.0
    """Azimuth of the first drone, degrees."""
    directions: list[Point] | None = None
    """Cable directions from drone to load instead of the ring, one per drone; any length but zero."""
    load_offset: Point = (0.0, 0.0, 0.0)
    """Offset of the load from the reference's first point, m."""
    on_ground: bool = False
    """Whether load and drones stand on the ground, the drones around the load, cables slack; otherwise taut cables hold the load."""
    spread: Annotated[float, Field(gt=0.0, le=1.0)] = 0.7
    """On the ground, distance of each drone from the load as a share of its cable, in the direction of its place in the formation."""
    positions: list[Point] | None = None
    """Places of the drones, world, m, one per drone; cables between them and the load may be slack."""

    @property
    def slack(self) -> bool:
        """Whether cables may be slack at the start."""
        return self.on_ground or self.positions is not None

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
    r"^(load\.mass|drones\.(lose|join|cable_length)|reference"
    rf"|({_CHANGING}|disturbance\.[0-9]{{1,3}})(\.[a-z_]+)?)$"
)


class Event(Section):
    """A change during the flight: of the truth, unknown to the controllers, or of the allocator."""

    at: Annotated[float, Field(ge=0.0)]
    """Time, s."""
    field: Annotated[str, Field(pattern=EVENT_FIELDS)]
    """What changes: ``load.mass`` (the plant's only), ``drones.lose``, ``drones.join``, ``drones.cable_length``, a setting of a layer
    or of a disturbance such as ``allocation.mu`` or ``disturbance.0.force``, or a whole section such as
    ``reference``; ``allocation.kind`` puts another allocator, with its defaults, in place."""
    value: Any
    """New value, in the field's unit; for a section a table with ``kind`` and settings; for ``drones.lose`` the number, from 0, of the drone whose cable is
    cut and that leaves the team, which is told at once; for ``drones.join`` the drone that hooks in then, in
    the widest gap between the cables, at the load's velocity, and that is not there before; for ``drones.cable_length`` the
    length to which winches bring the cables of the drones that fly then, m, one value or one per drone, which the controllers know."""
    rate: Annotated[float, Field(gt=0.0, le=10.0)] = 0.2
    """Of ``drones.cable_length``: fastest that a winch pays out or takes in, m/s. It goes smoothly from rest to rest, with
    1 m/s^2 at most."""

    @property
    def of_team(self) -> str:
        """``"lose"`` or ``"join"`` where the drone ``value`` leaves or joins; empty for other changes."""
        section, _, name = self.field.rpartition(".")
        return name if section == "drones" and not self.of_winches else ""

    @property
    def of_winches(self) -> bool:
        """Whether winches pay cable out or take it in."""
        return self.field == "drones.cable_length"


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
    derived: dict[str, Any] = {}
    """What follows from the team and the timing, by its path; written by colift for whoever reads the resolved mission. Changed
    here it changes nothing: give a setting in its own section."""

    @property
    def team(self) -> Team:
        """The drones, cables and load as arrays, with the cables' mass at their ends."""
        return self._roped(self._bare)

    def _roped(self, bare: Team) -> Team:
        density = self.drones.cable_density
        return bare.with_ropes(density) if density > 0.0 else bare

    @property
    def _bare(self) -> Team:
        n, drones = self.drones.count, self.drones
        return Team.of_bodies(
            drones.numbers(),
            load_mass=self.load.mass,
            cable_lengths=np.array(np.broadcast_to(drones.cable_length, n), dtype=float),
            gravity=self.world.gravity,
            ground=self.ground,
            body=self.load.body(n),
        )

    @property
    def ground(self) -> GroundBelow | None:
        """What is below the team."""
        found = self.world.ground
        return None if found == "none" else GroundBelow(**dict(found))

    @property
    def true_team(self) -> Team:
        """The bodies as they are; :attr:`team` is what the controllers are told."""
        return self._roped(self.true_bodies)

    @property
    def true_bodies(self) -> Team:
        """The same, without the cables' mass."""
        told, truth = self._bare, self.truth
        return replace(
            told,
            load_mass=told.load_mass * truth.load_mass_factor,
            masses=told.masses * truth.drone_mass_factor,
            inertias=told.inertias * np.reshape(truth.inertia_factor, (-1, 1)),
            cable_lengths=told.cable_lengths * truth.cable_length_factor,
            body=told.body and truth.body_of(told.body),
        )

    def first_drones(self) -> list[int]:
        """Numbers of the drones that fly from the start: all but those that join before they leave."""
        first: dict[int, str] = {}
        for event in sorted(self.events, key=lambda event: event.at):
            if event.of_team:
                first.setdefault(event.value, event.of_team)
        return [i for i in range(self.drones.count) if first.get(i) != "join"]

    @property
    def start_cone(self) -> float:
        """Half-angle of the ring that the drones start on, rad."""
        if self.start.cone_deg is not None:
            return math.radians(self.start.cone_deg)
        team = self.team.of(self.first_drones())
        reach = np.nan_to_num(ROOM * team.radii / team.cable_lengths).max()
        apart = max(APART, 2.0 * math.asin(min(float(reach), 1.0)))
        return max(PAPER_CONE, min(ring_cone(team.n, apart), WIDEST_START))

    def start_directions(self) -> Array:
        """Unit cable directions (k, 3) at t = 0 of the k drones that fly from the start."""
        drones = self.first_drones()
        if self.start.directions is None and self.load.kind == "rigid":
            team = self.team.of(drones)
            apart = np.nan_to_num(2.0 * ROOM * team.radii)
            lean = self.start.cone_deg
            more = {} if lean is None else {"lean": math.radians(lean)}
            return plan(team, distance=apart, **more)[0]
        if self.start.directions is None:
            heading = math.radians(self.start.heading_deg)
            return ring(len(drones), self.start_cone, heading=heading)
        given = np.array(self.start.directions, dtype=float)[drones]
        return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))

    @property
    def sole(self) -> float:
        """How high above the ground the load's place is when it stands, m."""
        body = self._bare.body
        return 0.0 if body is None else body.sole

    def start_places(self, load: Array) -> Array | None:
        """Places (k, 3) of the drones that fly from the start, world, m, around a load at ``load``; None for those on taut cables."""
        drones = self.first_drones()
        if self.start.positions is not None:
            return np.array(self.start.positions, dtype=float)[drones]
        if not self.start.on_ground:
            return None
        level = -self.start_directions()
        level[:, 2] = 0.0
        sizes = np.linalg.norm(level, axis=1, keepdims=True)
        around = 2.0 * math.pi * np.arange(len(drones)) / len(drones)
        spread = np.column_stack([np.cos(around), np.sin(around), np.zeros(len(drones))])
        level = np.where(sizes > 1e-9, level / np.maximum(sizes, 1e-9), spread)
        team = self.team.of(drones)
        ends = load + team.levers if team.body is None else load + team.body.attachments
        ends = ends - [0.0, 0.0, 1.0] * (ends - load + self.sole)  # on the ground
        return np.asarray(ends + self.start.spread * team.cable_lengths[:, None] * level)


def with_derived(table: Mapping[str, Any]) -> dict[str, Any]:
    """A resolved mission with what is derived put into its sections; these are copied as far as they change."""
    found = {name: section for name, section in table.items() if name != "derived"}
    for path, value in table.get("derived", {}).items():
        section, *places, leaf = path.split(".")
        node = found[section] = copy.copy(found.get(section, {}))
        for place in places:
            node[int(place)] = copy.copy(node[int(place)])
            node = node[int(place)]
        node[leaf] = value
    return found


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

    def settings(self) -> dict[str, Any]:
        """The same with what is derived in the sections where it counts: to look up, not to fly again."""
        return with_derived(self.resolved())


class RealFlight(Described):
    """What is known of a flight that colift did not fly: the team and the timing, no layers."""

    @property
    def kinds(self) -> Mapping[str, str]:
        """No part of ours flew it."""
        return {}

    @property
    def source(self) -> str:
        return "flight"
