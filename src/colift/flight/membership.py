"""Who flies: which drones leave and join, who judged them lost, and what follows for those that stay.

The loop flies one team; each change of it begins a leg (:mod:`colift.flight.leg`). What is decided then is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from colift.control.allocation.base import AllocatorPart
from colift.control.reference.descent import Descent
from colift.part import Part
from colift.team import Team
from colift.world.actuation.base import ActuationPart


@dataclass
class Membership:
    """What has become of the team.

    Attributes
    ----------
    team : Team
        All drones of the mission, as the controllers are told.
    found : list of (time, drone)
        Drones that were judged lost by the mission's ``detection``, s.
    descent : str
        Why the load is brought down because the drones left cannot carry it; empty while they can.

    """

    team: Team
    found: list[tuple[float, int]] = field(default_factory=list)
    descent: str = ""

    def judged_lost(self, drones: list[int], carrying: Any, time: float) -> list[int]:
        """Those of ``drones`` whose ``carrying`` (n,) is 0 now; they are noted in :attr:`found`."""
        lost = [drone for drone, carries in zip(drones, carrying, strict=True) if not carries]
        self.found += [(time, drone) for drone in lost]
        return lost

    def left_with(
        self,
        rest: list[int],
        drones: list[int],
        bus: Any,
        parts: Mapping[str, Part],
        *,
        time: float,
        clock: float,
    ) -> dict[str, Part]:
        """Parts that take the place of others once only ``rest`` of ``drones`` fly: a descent if they cannot carry.

        ``bus`` holds the signals of ``drones``; ``time`` is the flight's, ``clock`` the reference's, s.
        """
        if self.descent or not (reason := self.cannot_carry(rest, drones, bus, parts)):
            return {}
        self.descent = f"descended from t = {time:g} s: {reason}"
        position, velocity = bus.reference[:2].tolist()
        return {"reference": Descent(position=position, velocity=velocity, at=clock)}

    def cannot_carry(
        self, rest: list[int], drones: list[int], bus: Any, parts: Mapping[str, Part]
    ) -> str:
        """Why ``rest`` cannot carry the load on; empty when they can, as far as their models say."""
        team = self.team.of(rest)
        actuation, allocation = parts["actuation"].of(rest), parts["allocation"].of(rest)
        assert isinstance(actuation, ActuationPart)
        assert isinstance(allocation, AllocatorPart)
        directions = bus.desired_directions[[drones.index(drone) for drone in rest]]
        problems = [message for _, message in actuation.conflicts(team)]
        problems += allocation.cannot_hold(team, actuation.thrust_limits(team), directions)
        return "; ".join(problems)
