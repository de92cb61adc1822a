"""The ground below team and load."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ground:
    """Level ground.

    Attributes
    ----------
    height : float
        Of its surface in the world frame, m.
    friction : float
        Coefficient of Coulomb's friction on it.
    restitution : float
        Speed with which a body leaves it over the speed with which it fell onto it.

    """

    height: float = 0.0
    friction: float = 0.8
    restitution: float = 0.0
