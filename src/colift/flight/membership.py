"""Who flies: which drones leave and join, who judged them lost, and what follows for those that stay.

The loop flies one team; each change of it begins a leg (:mod:`colift.flight.leg`). What is decided then is decided here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from colift.control.allocation.base import AllocatorPart
from colift.control.reference.base import ReferencePart
from colift.control.reference.descent import Descent
from colift.mission.outlook import Outlook, bound, outlook
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import LEVEL
from colift.team.plan import taken_over

LEVELLED = 1.4
"""Time in which a rigid load that is brought down loses the attitude that was wanted of it, s."""
SWUNG = 6.0
"""Time in which one that falls into two cables comes to rest below them, s: then it goes down."""


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
    outlook : Outlook
        How the load hangs on those that fly, and at what pace the reference goes on.
    formation : array, optional
        Of a rigid load: cables' forces (n, 3) from which those that fly now went on; see :func:`colift.team.plan.shares`.
    said : tuple of (time, text)
        How a rigid load went on each time that the team changed, s.

    """

    team: Team
    found: list[tuple[float, int]] = field(default_factory=list)
    descent: str = ""
    outlook: Outlook = field(default_factory=Outlook)
    formation: Array | None = None
    said: tuple[tuple[float, str], ...] = ()

    def go_on(
        self,
        drones: list[int],
        before: list[int],
        bus: Any,
        parts: Mapping[str, Part],
        *,
        time: float,
        clock: float,
        end: float,
    ) -> dict[str, Part]:
        """Parts that take the place of others once ``drones`` fly instead of those ``before``: a descent if they cannot carry.

        ``bus`` holds the signals of those before; ``time`` is the flight's, ``clock`` the reference's, which is flown until ``end``, s.
        """
        team = self.team.of(drones)
        self.formation = None
        if self.descent or (team.body is None and not {*before} - {*drones}):
            return {}
        begin = None
        if team.body is not None:
            self.formation = self._taken_over(drones, before, bus, parts)
            begin = bus.reference_attitude, self.formation
        flying = [before.index(drone) for drone in drones if drone in before]
        found = outlook(
            team, bound(parts, drones), bus.desired_directions[flying], clock, end, begin
        )
        if found.carries:
            self.outlook, reference = found, parts["reference"]
            assert isinstance(reference, ReferencePart)
            self.said += ((time, str(found)),) if team.body is not None else ()
            return {"reference": reference.upright()} if found.upright else {}
        if not {*before} - {*drones}:  # who has joined is no reason to come down
            return {}
        self.outlook = found._replace(pace=1.0, within=max(found.within, LEVELLED))
        self.descent = f"descended from t = {time:g} s: {found.reason}"
        position, velocity = bus.reference[:2].tolist()
        wait = SWUNG if found.hang != LEVEL else 0.0
        return {"reference": Descent(position=position, velocity=velocity, at=clock, wait=wait)}

    def _taken_over(
        self, drones: list[int], before: list[int], bus: Any, parts: Mapping[str, Part]
    ) -> Array:
        """The formation that drones go on from: on the cables that stay as they are, on new ones as planned."""
        team, allocation = self.team.of(drones), parts["allocation"].of(drones)
        assert isinstance(allocation, AllocatorPart)
        directions, _ = allocation.formation(team)
        for row, drone in zip(directions, drones, strict=True):
            if drone in before:
                row[:] = bus.desired_directions[before.index(drone)]
        return taken_over(team, directions, bus.reference[2], bus.reference_attitude)
