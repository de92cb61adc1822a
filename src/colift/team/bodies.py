"""The drones, their cables and the load: the physical description that every layer is bound to."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from colift.errors import SettingError
from colift.wording import numbers, shown


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

    def __post_init__(self) -> None:
        n = np.size(self.masses)
        if n < 1:
            raise SettingError.of("masses", shown(self.masses), "must be at least 1 number")
        for name, shape in (("masses", (n,)), ("inertias", (n, 3)), ("cable_lengths", (n,))):
            value = numbers(name, getattr(self, name), shape, above=0.0)
            object.__setattr__(self, name, value)
        load_mass = numbers("load_mass", self.load_mass, (), above=0.0)
        object.__setattr__(self, "load_mass", float(load_mass))
        object.__setattr__(self, "gravity", float(numbers("gravity", self.gravity, (), least=0.0)))

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
            masses=self.masses[chosen],
            inertias=self.inertias[chosen],
            cable_lengths=self.cable_lengths[chosen],
        )

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
        mass: float = 0.5,
        inertia: tuple[float, float, float] = (0.021, 0.0187, 0.0397),
        cable_length: float = 1.0,
        gravity: float = 9.81,
    ) -> Team:
        """n equal drones; the defaults are the paper's (section 4)."""
        try:
            n = operator.index(n)  # any kind of integer, NumPy's too
        except TypeError:
            raise SettingError.of("n", shown(n), "must be a whole number") from None
        if n < 1:
            raise SettingError.of("n", n, "must be at least 1")
        return cls(
            load_mass=load_mass,
            masses=np.full(n, numbers("mass", mass, (), above=0.0)),
            inertias=np.tile(numbers("inertia", inertia, (3,), above=0.0), (n, 1)),
            cable_lengths=np.full(n, numbers("cable_length", cable_length, (), above=0.0)),
            gravity=gravity,
        )
