"""The drones, their cables and the load: the physical description that every layer is bound to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


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

    """

    load_mass: float
    masses: NDArray[np.float64]
    inertias: NDArray[np.float64]
    cable_lengths: NDArray[np.float64]
    gravity: float = 9.81

    @property
    def n(self) -> int:
        """Number of drones."""
        return int(self.masses.shape[0])

    def of(self, drones: Sequence[int]) -> Team:
        """The team of these of its drones."""
        chosen = list(drones)
        return replace(
            self,
            masses=self.masses[chosen],
            inertias=self.inertias[chosen],
            cable_lengths=self.cable_lengths[chosen],
        )

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
        return cls(
            load_mass=load_mass,
            masses=np.full(n, mass),
            inertias=np.tile(np.asarray(inertia, dtype=float), (n, 1)),
            cable_lengths=np.full(n, cable_length),
            gravity=gravity,
        )
