"""Before the flight: what the wind of a mission asks of its team, and the margins that are left.

Of what the controllers are told, and of the disturbances that the mission names. Each number is a quotient or an angle that a
stranger can check by hand. ``benchmarks/any_team.py --unasked`` flies what they refuse as well, and counts false alarms and misses.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import Allocation
from colift.part import Part
from colift.team import Team
from colift.team.load import LEVEL
from colift.world.disturbance.base import DisturbancePart

Array = NDArray[np.float64]

MUCH_THRUST, MOST_THRUST = 0.87, 1.0
"""Shares of a drone's thrust from which the wind's strongest may leave it little to turn with, and from which it cannot stay."""
WIDE_LEAN = math.radians(70.0)
"""Lean of the load in gusts from which some of three cables or more may go slack."""

SWINGS = 0.9
"""How far gusts swing the load of one or two drones, over by how much more than the steady wind they would lean it."""


@dataclass(frozen=True)
class Forecast:
    """What the strongest wind of a mission does to its team.

    Attributes
    ----------
    wind : (3,) array
        World frame, m/s.
    thrusts : (n,) array
        What each drone needs in it, N.
    limits : (n,) array
        What each has, N; inf where nobody knows.
    cone : float
        Most that a cable may lean, from the vertical, rad.
    lean : float
        Of the force that holds the load, from the vertical, rad.
    offset : float
        By how much the load hangs aside of a place straight below its drones, m.
    swing : float
        By how much of that gusts change it, m.

    """

    wind: Array
    thrusts: Array
    limits: Array
    cone: float
    lean: float
    offset: float
    swing: float

    @property
    def thrust(self) -> float:
        """Largest share of its thrust that a drone needs."""
        return float(np.max(self.thrusts / self.limits))

    def problems(self, team: Team, allowed: float) -> Iterable[tuple[str, str]]:
        """Why this cannot be flown, by the layer at fault; ``allowed`` is the most error of the load's place, m; inf where none is given."""
        speed = float(np.linalg.norm(self.wind))
        if speed == 0.0:
            return
        if self.thrust > MOST_THRUST:
            yield "actuation", f"{self._needed()} that it has"
        if team.n >= 3 and self.lean > self.cone:
            yield (
                "disturbance",
                f"{speed:.3g} m/s of wind push the load of {team.load_mass:.4g} kg so hard that it leans by {math.degrees(self.lean):.3g} degrees, "
                f"more than the {math.degrees(self.cone):g} by which a cable may (allocation.max_cone_deg)",
            )
        if team.n <= 2 and self.offset > allowed:
            yield (
                "disturbance",
                f"{speed:.3g} m/s of wind blow the load {self.offset:.3g} m aside before {team.n} drones have learnt of it, more than "
                f"the {allowed:.3g} m that criteria.tracking_max_m allows",
            )
        usual = max(0.1, 0.1 * float(team.cable_lengths.max()))
        if team.n <= 2 and math.isinf(allowed) and SWINGS * self.swing > usual:
            yield (
                "disturbance",
                f"gusts swing the load below {'one drone' if team.n == 1 else 'two drones'} by about {SWINGS * self.swing:.3g} m, more than {usual:.3g} m, "
                "a tenth of a cable or 0.1 m; criteria.tracking_max_m, where it is given, takes the place of this bound",
            )

    def doubts(self, team: Team) -> Iterable[tuple[str, str]]:
        """What may go wrong with it, likewise: most such flights hold the load, and some do not."""
        speed = float(np.linalg.norm(self.wind))
        if speed == 0.0:
            return
        if MUCH_THRUST < self.thrust <= MOST_THRUST:
            most = f"beyond {100.0 * MUCH_THRUST:g} % little is left to turn with"
            yield "actuation", f"{self._needed()} that it has; {most}"
        if team.n >= 3 and WIDE_LEAN < self.lean <= self.cone:
            yield (
                "disturbance",
                f"{speed:.3g} m/s of wind push the load of {team.load_mass:.4g} kg so hard that it leans by {math.degrees(self.lean):.3g} "
                f"degrees; from {math.degrees(WIDE_LEAN):g} on some of {team.n} cables may go slack in gusts, and the load swings",
            )

    def _needed(self) -> str:
        """What the drone needs that has least to spare, and has."""
        i, speed = int(np.argmax(self.thrusts / self.limits)), float(np.linalg.norm(self.wind))
        return f"in {speed:.3g} m/s of wind drone {i} needs {self.thrusts[i]:.4g} N of thrust to stay, of the {self.limits[i]:.4g} N"


def forecast(
    team: Team,
    hover: Allocation,
    limits: Array,
    allocation: Part,
    disturbances: Sequence[Part],
) -> Forecast:
    """Judge a team that hovers as its ``allocation`` has it; ``limits`` (n,) is the thrust of each drone, N."""
    parts = [each for each in disturbances if isinstance(each, DisturbancePart)]
    wind = np.sum([np.zeros(3), *(each.strongest_wind() for each in parts)], axis=0)
    steady = np.sum([np.zeros(3), *(p.strongest_wind() for p in parts if p.steady)], axis=0)
    pushes = _pushes(team, hover, parts, wind)
    needed = team.hover_forces(hover.tensions, hover.directions)
    shares = hover.tensions / max(float(hover.tensions.sum()), 1e-300)
    across = np.hypot(needed[:, 0], needed[:, 1]) + np.hypot(pushes[:-1, 0], pushes[:-1, 1])
    across += shares * math.hypot(pushes[-1, 0], pushes[-1, 1])
    up = needed[:, 2] - np.minimum(pushes[:-1, 2] + shares * pushes[-1, 2], 0.0)
    weight = max(team.load_mass * team.gravity, 1e-300)
    longest = float(team.cable_lengths.max())
    offset, always = (
        longest * math.hypot(push[-1, 0], push[-1, 1]) / weight
        for push in (pushes, _pushes(team, hover, parts, steady))
    )
    lean, swing = math.atan(offset / longest), max(offset - always, 0.0)
    cone = math.radians(getattr(allocation, "max_cone_deg", None) or 90.0)
    return Forecast(wind, np.hypot(up, across), limits, cone, lean, offset, swing)


def _pushes(team: Team, hover: Allocation, parts: Sequence[DisturbancePart], wind: Array) -> Array:
    """Forces (n+1, 3) of a wind on the bodies of a team at rest, N."""
    if not wind.any():
        return np.zeros((team.n + 1, 3))
    signals: Mapping[str, Any] = {
        "load": np.zeros((2, 3)),
        "ends": np.zeros((team.n, 2, 3)),
        "positions": np.ascontiguousarray(-team.cable_lengths[:, None] * hover.directions),
        "velocities": np.zeros((team.n, 3)),
        "directions": np.ascontiguousarray(hover.directions),
        "direction_rates": np.zeros((team.n, 3)),
        "attitudes": np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1)),
        "applied_thrusts": team.hover_thrusts(hover.tensions, hover.directions),
        "attached": np.ones(team.n),
        "wind": np.array(wind),
        "external_forces": np.zeros((team.n + 1, 3)),
        "load_attitude": np.array(LEVEL) if team.body is None else team.body.hang,
    }
    found = np.zeros((team.n + 1, 3))
    for part in parts:
        if part.feels_wind:
            writes, _ = part.call(team, part.memory(team), **signals)
            found += writes.external_forces
    return found
