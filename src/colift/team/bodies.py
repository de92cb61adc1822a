"""The drones, their cables and the load: the physical description that every layer is bound to."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.errors import SettingError
from colift.team.ground import Ground
from colift.team.load import Body
from colift.team.vehicles import Vehicle, complete, impossible, vehicle_of
from colift.wording import numbers, shown

Numbers = NDArray[np.float64]

PLACES = {
    "mass": "masses", "inertia": "inertias", "max_thrust": "max_thrusts", "motor_lag": "motor_lags", "arm": "arms",
    "radius": "radii", "rotor_radius": "rotor_radii", "rotors": "rotors", "torque_ratio": "torque_ratios",
    "rotor_drag": "rotor_drags", "energy": "energies", "efficiency": "efficiencies",
}  # fmt: skip
"""Of each number of a drone, the team's array."""

UNKNOWN = {name: math.inf if name == "max_thrusts" else math.nan for name in PLACES.values()}
"""What stands where a number is not known: no limit is known to the thrust, all else is not a number."""


class DroneNumbers(TypedDict, total=False):
    """Numbers of a drone that may be left out, as keywords; see :class:`colift.team.vehicles.Vehicle`."""

    max_thrust: float
    motor_lag: float
    arm: float
    radius: float
    rotor_radius: float
    rotors: int
    torque_ratio: float
    rotor_drag: float
    energy: float
    efficiency: float


@dataclass(frozen=True)
class Team:
    """n drones that carry one load.

    Attributes
    ----------
    load_mass : float
        kg.
    masses : (n,) array
        Drone masses, kg.
    inertias : (n, 3) array
        Principal moments of inertia of each drone, body frame, kg m^2.
    cable_lengths : (n,) array
        m.
    gravity : float
        m/s^2, along -z of the world frame.
    max_thrusts : (n,) array
        Largest steady thrust of each drone, all its rotors together, N; inf where it is not known.
    motor_lags : (n,) array
        Time constant of the motors' thrust, s. NaN where it is not known, as in all that follow.
    arms, radii, rotor_radii : (n,) array
        From a drone's centre to a rotor's axis, and to the outermost tip; radius of one rotor; m.
    rotors : (n,) array
        Number of rotors.
    torque_ratios : (n,) array
        Torque about a motor's axis per thrust, m.
    rotor_drags : (n,) array
        Force in the rotors' plane per thrust and speed across it, s/m.
    energies : (n,) array
        Of the full batteries, J.
    efficiencies : (n,) array
        Ideal power of the rotors in hover over the battery's power.
    ground : Ground or None
        What is below them; None for nothing.
    body : Body or None
        The load as a rigid body with n attachments; None for a point.

    Raises
    ------
    SettingError
        For a wrong shape, a number that is not finite or not positive (gravity may be 0).

    """

    load_mass: float
    masses: NDArray[np.float64]
    inertias: NDArray[np.float64]
    cable_lengths: NDArray[np.float64]
    gravity: float = 9.81
    max_thrusts: NDArray[np.float64] = None  # type: ignore[assignment]  # what is left out becomes an array
    motor_lags: NDArray[np.float64] = None  # type: ignore[assignment]
    arms: NDArray[np.float64] = None  # type: ignore[assignment]
    radii: NDArray[np.float64] = None  # type: ignore[assignment]
    rotor_radii: NDArray[np.float64] = None  # type: ignore[assignment]
    rotors: NDArray[np.float64] = None  # type: ignore[assignment]
    torque_ratios: NDArray[np.float64] = None  # type: ignore[assignment]
    rotor_drags: NDArray[np.float64] = None  # type: ignore[assignment]
    energies: NDArray[np.float64] = None  # type: ignore[assignment]
    efficiencies: NDArray[np.float64] = None  # type: ignore[assignment]
    ground: Ground | None = None
    body: Body | None = None

    def __post_init__(self) -> None:
        n = np.size(self.masses)
        if n < 1:
            raise SettingError.of("masses", shown(self.masses), "must be at least 1 number")
        for name, shape in (("masses", (n,)), ("inertias", (n, 3)), ("cable_lengths", (n,))):
            value = numbers(name, getattr(self, name), shape, above=0.0)
            object.__setattr__(self, name, value)
        for name in _OPTIONAL:
            value = getattr(self, name)
            value = np.full(n, UNKNOWN[name]) if value is None else _known(name, value, n)
            object.__setattr__(self, name, value)
        load_mass = numbers("load_mass", self.load_mass, (), above=0.0)
        object.__setattr__(self, "load_mass", float(load_mass))
        object.__setattr__(self, "gravity", float(numbers("gravity", self.gravity, (), least=0.0)))
        if self.body is not None and self.body.n != n:
            message = f"must be one for each of {n} drones"
            raise SettingError.of("attachments", f"{self.body.n} points", message)

    @property
    def n(self) -> int:
        """Number of drones."""
        return int(self.masses.shape[0])

    def of(self, drones: Sequence[int]) -> Team:
        """The team of these of its drones."""
        chosen = list(drones)
        if not chosen or any(drone not in range(self.n) for drone in chosen):
            raise SettingError.of("drones", shown(chosen), f"must be some of 0 to {self.n - 1}")
        return replace(
            self,
            body=None if self.body is None else self.body.of(chosen),
            **{name: getattr(self, name)[chosen] for name in (*PLACES.values(), "cable_lengths")},
        )

    @property
    def levers(self) -> NDArray[np.float64]:
        """Where the cables end (n, 3), from the load's centre of mass, in its frame, m; zeros for a point."""
        return np.zeros((self.n, 3)) if self.body is None else self.body.arms

    def with_ropes(self, density: float) -> Team:
        """The team with the mass of cables of this density (kg/m), half of each to its drone and half to the load.

        In balance that is exact, however much the rope sags: by the moments about either end, what a uniform rope does to the other
        is a pull along the chord between them and half of its weight.
        """
        half = 0.5 * density * self.cable_lengths
        body = None if self.body is None else self.body.with_masses(self.load_mass, half)
        load_mass = self.load_mass + float(half.sum())
        return replace(self, masses=self.masses + half, load_mass=load_mass, body=body)

    @property
    def disc_areas(self) -> NDArray[np.float64]:
        """Area that the rotors of each drone sweep (n,), m^2, for momentum theory; NaN where it is not known."""
        return np.asarray(self.rotors * np.pi * self.rotor_radii**2)

    def hover_thrusts(
        self, tensions: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Sizes of :meth:`hover_forces` (n,), N."""
        return np.asarray(np.linalg.norm(self.hover_forces(tensions, directions), axis=1))

    def hover_forces(
        self, tensions: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Thrust of each drone (n, 3), world frame, N, that holds its own weight and the pull of its cable.

        ``tensions`` (n,), N, along ``directions`` (n, 3), from the drones to the load.
        """
        thrust = np.asarray(-tensions[:, None] * directions)
        thrust[:, 2] += self.masses * self.gravity
        return thrust

    @classmethod
    def uniform(
        cls,
        n: int,
        *,
        load_mass: float = 0.225,
        mass: float | None = None,
        inertia: tuple[float, float, float] | None = None,
        cable_length: float = 1.0,
        gravity: float = 9.81,
        vehicle: str | Vehicle | None = None,
        **further: Unpack[DroneNumbers],
    ) -> Team:
        """n equal drones of a vehicle, with some of its numbers replaced; without one, the paper's (section 4).

        Without a vehicle, the inertia is estimated where ``arm`` is given.
        """
        try:
            n = operator.index(n)  # any kind of integer, NumPy's too
        except TypeError:
            raise SettingError.of("n", shown(n), "must be a whole number") from None
        if n < 1:
            raise SettingError.of("n", n, "must be at least 1")
        given: dict[str, Any] = dict(further)
        if mass is not None:
            given["mass"] = float(numbers("mass", mass, (), above=0.0))
        if inertia is not None:
            given["inertia"] = numbers("inertia", inertia, (3,), above=0.0).tolist()
        body = _one(given, vehicle_of(vehicle))
        return cls.of_bodies(
            [body] * n,
            load_mass=load_mass,
            cable_lengths=np.full(n, numbers("cable_length", cable_length, (), above=0.0)),
            gravity=gravity,
        )

    @classmethod
    def of_vehicles(
        cls,
        vehicles: Sequence[str | Vehicle],
        *,
        load_mass: float,
        cable_lengths: ArrayLike = 1.0,
        gravity: float = 9.81,
    ) -> Team:
        """The team of these vehicles, by name or with numbers of their own; one cable length (m), or one each."""
        bodies = [_one({}, vehicle_of(vehicle)) for vehicle in vehicles]
        if not bodies:
            raise SettingError.of("vehicles", "[]", "must name at least 1")
        lengths = numbers("cable_lengths", cable_lengths, np.shape(cable_lengths), above=0.0)
        if lengths.ndim == 0:
            lengths = np.full(len(bodies), lengths)
        return cls.of_bodies(bodies, load_mass=load_mass, cable_lengths=lengths, gravity=gravity)

    @classmethod
    def of_bodies(
        cls,
        bodies: Sequence[Mapping[str, Any]],
        *,
        load_mass: float,
        cable_lengths: NDArray[np.float64],
        gravity: float = 9.81,
        ground: Ground | None = None,
        body: Body | None = None,
    ) -> Team:
        """The team of drones with these numbers, by field of :class:`colift.team.vehicles.Vehicle`."""
        arrays: dict[str, Any] = {
            place: np.array([body.get(name, UNKNOWN[place]) for body in bodies], dtype=float)
            for name, place in PLACES.items()
        }
        return cls(
            load_mass=load_mass,
            cable_lengths=cable_lengths,
            gravity=gravity,
            ground=ground,
            body=body,
            **arrays,
        )


_OPTIONAL = tuple(name for name in PLACES.values() if name not in ("masses", "inertias"))


def _known(name: str, value: ArrayLike, n: int) -> Numbers:
    """Numbers (n,) that are not negative where they are known."""
    found = numbers(name, value, (n,), finite=False)
    if np.any(found < 0.0):
        raise SettingError.of(name, shown(found.tolist()), "must be at least 0, or not known")
    return found


def _one(given: Mapping[str, Any], vehicle: Vehicle | None) -> dict[str, Any]:
    """The numbers of a drone, each checked as a vehicle's are."""
    body = complete(given, vehicle).numbers
    Vehicle(**body)
    if problems := impossible(body):
        field, message = problems[0]
        raise SettingError.of(field, shown(body[field]), message)
    return body
