"""Drones by their numbers: one TOML file each, or a table of your own.

A file in this folder, an entry point of the group ``colift.vehicle`` or any TOML file with the same fields is a vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from colift.catalogue import read_vehicle
from colift.errors import ColiftError, SettingError, VehicleError
from colift.wording import Refusing, parse, problems_of

Positive = Annotated[float, Field(gt=0.0)]
Thrust = Annotated[float, Field(gt=0.0, le=4e4)]
Lag = Annotated[float, Field(ge=0.0, le=1.0)]
Size = Annotated[float, Field(gt=0.0, le=5.0)]
Radius = Annotated[float, Field(gt=0.0, le=10.0)]
Rotors = Literal[4, 6, 8]
TorqueRatio = Annotated[float, Field(gt=0.0, le=1.0)]
RotorDrag = Annotated[float, Field(ge=0.0, le=1.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]

PAPER_MASS = 0.5
"""Mass of the paper's drone, kg (section 4)."""
PAPER_INERTIA = (0.021, 0.0187, 0.0397)
"""Principal moments of inertia of the paper's drone, kg m^2 (section 4)."""

Moments = tuple[float, float, float]


class Vehicle(BaseModel, metaclass=Refusing):
    """A drone; what is not known is left out."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)

    description: str = ""
    """What it is."""
    mass: Positive
    """With battery, kg."""
    inertia: tuple[Positive, Positive, Positive] | None = None
    """Principal moments of inertia, body frame, kg m^2; left out: estimated from mass and arm."""
    max_thrust: Thrust | None = None
    """Largest steady thrust of all rotors together, N."""
    motor_lag: Lag | None = None
    """Time constant of a motor's thrust, s."""
    arm: Size | None = None
    """From the centre to a rotor's axis, m."""
    radius: Radius | None = None
    """From the centre to the outermost tip of a rotor, m; left out: arm and rotor_radius together."""
    rotor_radius: Size | None = None
    """Of one rotor, m."""
    rotors: Rotors | None = None
    """Number of rotors, evenly around the centre."""
    torque_ratio: TorqueRatio | None = None
    """Torque about a motor's axis per thrust, m."""
    rotor_drag: RotorDrag | None = None
    """Force in the rotors' plane per thrust and speed across it, s/m."""
    energy: Positive | None = None
    """Of a full battery, J."""
    efficiency: Share | None = None
    """Ideal power of the rotors in hover over the battery's power."""
    sources: dict[str, str] = {}
    """Where each number comes from, by its field."""

    @classmethod
    def named(cls, source: str) -> Vehicle:
        """A vehicle by name, or from the path of a TOML file.

        Raises
        ------
        UnknownNameError
            If there is none of this name.
        VehicleError
            For a file that cannot be read, or numbers that are refused; it names the file and the field.

        """
        table = read_vehicle(source)
        try:
            found = parse(cls, table)
        except ValidationError as error:
            raise VehicleError(
                f"{source}: {SettingError(problems_of(error, cls, table))}"
            ) from error
        if problems := impossible(found.numbers()):
            field, message = problems[0]
            raise VehicleError(f"{source}: {field}: {message}")
        return found

    def numbers(self) -> dict[str, Any]:
        """What is known, by field."""
        return {name: value for name in NUMBERS if (value := getattr(self, name)) is not None}


NUMBERS = tuple(name for name in Vehicle.model_fields if name not in ("description", "sources"))
"""Fields of a vehicle that are numbers: also fields of a mission's drones."""


def estimated_inertia(mass: float, arm: float) -> Moments:
    """Principal moments of inertia (3,), kg m^2, of a drone of ``mass`` (kg) whose rotors stand ``arm`` (m) from its centre.

    Those of a thin, even disc whose rim goes through the rotors' axes, ``m a^2 (1/4, 1/4, 1/2)``: motors and propellers
    at the rim and the battery in the middle together weigh about as much in it. Of the vehicles here and of other
    published drones it is within a factor of two, but for such with most of their mass at the rim.
    """
    J = mass * arm * arm
    return (0.25 * J, 0.25 * J, 0.5 * J)


THRUST_PER_MASS = 24.0
"""Largest thrust of a drone of which nobody says it, N/kg: 2.4 times its weight, as chosen for the paper's drone."""
PAPER_ARM = 0.2
"""Chosen for the paper's drone, which names none, m."""
PAPER_TORQUE_RATIO = 0.016
"""Likewise, m: near that of RotorS' Hummingbird."""
USUAL_LAG = 0.02
"""Time constant of a motor's thrust, s: between those of that model, 12.5 ms up and 25 ms down."""


def usual_arm(mass: float, inertia: Moments) -> float:
    """From the centre to a rotor's axis, m, of a drone of which nobody says it.

    The other way round of :func:`estimated_inertia`; with the paper's inertia, as with an unknown one, that of a
    drone like the paper's made larger or smaller, whose mass grows with the cube of its size.
    """
    if tuple(inertia) == PAPER_INERTIA:
        return float(PAPER_ARM * (mass / PAPER_MASS) ** (1.0 / 3.0))
    return 2.0 * math.sqrt(max(inertia[:2]) / mass)


def usual_torque_ratio(arm: float) -> float:
    """Torque about a motor's axis per thrust, m: rotors that are larger turn slower."""
    return PAPER_TORQUE_RATIO * (arm / PAPER_ARM)


@dataclass(frozen=True)
class Body:
    """The numbers of one drone: ``numbers`` by field, and whether its inertia is an estimate, or the paper's for lack of one."""

    numbers: dict[str, Any]
    inertia_from: Literal["given", "vehicle", "estimate", "paper"]


def complete(given: Mapping[str, Any], vehicle: Vehicle | None = None) -> Body:
    """What is known of a drone: what is given, else its vehicle's numbers, else what follows from them.

    Without mass it has the paper's. Without inertia it has the estimate, where need be for the usual arm; with the paper's mass and
    no arm, the paper's.
    """
    numbers = {**(vehicle.numbers() if vehicle else {}), **given}
    source: Any = "given" if "inertia" in given else "vehicle"
    numbers.setdefault("mass", PAPER_MASS)
    if "inertia" not in numbers:
        mass, known = numbers["mass"], "arm" in numbers or numbers["mass"] != PAPER_MASS
        source = "estimate" if known else "paper"
        arm = numbers.get("arm", usual_arm(mass, PAPER_INERTIA))
        numbers["inertia"] = estimated_inertia(mass, arm) if known else PAPER_INERTIA
    if {"arm", "rotor_radius"} <= numbers.keys():
        numbers.setdefault("radius", numbers["arm"] + numbers["rotor_radius"])
    return Body(numbers, source)


def impossible(numbers: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Numbers that no drone has together, as ``(field, message)``."""
    found = []
    if inertia := numbers.get("inertia"):
        largest, rest = max(inertia), sum(inertia) - max(inertia)
        if largest > rest + 1e-9 * sum(inertia):
            found.append(
                (
                    "inertia",
                    "no body has these: each moment must be at most the sum of the other two",
                )
            )
    if {"radius", "arm"} <= numbers.keys() and numbers["radius"] < numbers["arm"]:
        found.append(
            ("radius", f"must be at least arm = {numbers['arm']:g} m: it includes the rotors")
        )
    return found


def vehicle_of(vehicle: str | Vehicle | None) -> Vehicle | None:
    """A vehicle from its name."""
    if vehicle is None or isinstance(vehicle, Vehicle):
        return vehicle
    try:
        return Vehicle.named(vehicle)
    except ColiftError as error:
        raise SettingError.of("vehicle", repr(vehicle), str(error)) from error
