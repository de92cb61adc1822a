"""What the simulator's node does: a mission's world, and what of the controllers no other node does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from colift.deploy.ros.holding import Held
from colift.flight.flight import Flight
from colift.kernel.math.quaternion import turn
from colift.mission.mission import Mission
from colift.record.exchange.messages import Body, Setpoint

Array = NDArray[np.float64]
Takes = Literal["cables", "setpoints"]

OUTSIDE = {
    "cables": ("allocation",),
    "setpoints": ("allocation", "load_control", "reference", "position_control"),
}
"""Layers that are driven by what comes over topics."""
REFERENCE = ("reference", "reference_attitude", "reference_rates")
"""Signals that a reference writes, but for the cables' planned forces."""


class Simulating:
    """A mission in the air, of which some layers are driven from outside.

    The first physics step is flown by the mission's own controllers; what they want there holds until the first word from
    outside. Then one period of the topics after the other: what the estimation says is one physics step old. The reference is the
    cascade's, for that one rests while the cascade does not hear the allocator, which may be sooner or later than the simulator.
    """

    def __init__(self, mission: Mission, takes: Takes) -> None:
        self.mission, self.takes = mission, takes
        self.flight = Flight(mission)
        self.period = round(mission.timing.allocation * 1e9)
        self.at = 0
        self._led: tuple[Body, tuple[Array, Array]] | None = None
        self._step = mission.timing.step
        self.flight.advance(self._step)
        reference = self.flight.wires.reference.writes
        course = {name: getattr(reference, name).copy() for name in REFERENCE}
        for layer in OUTSIDE[takes]:
            self.flight.change(layer, {"kind": "external"})
        if "reference" in OUTSIDE[takes]:
            self.flight.act("reference", **course)
        if mission.kinds["detection"] != "none":  # the team of nodes does not change
            self.flight.change("detection", {"kind": "none"})
        bus = self.flight.bus
        self.held = Held(bus.pace, bus.desired_tensions, bus.desired_directions, self.period)

    @property
    def over(self) -> bool:
        """Whether the mission is flown, or the flight has ended before."""
        return self.at * 1e-9 >= self.mission.timing.duration or self.flight.outcome != "completed"

    def load(self) -> Body:
        """The load as estimated."""
        bus = self.flight.bus
        position, velocity = bus.estimated_load
        return Body(position, velocity, bus.estimated_load_attitude, bus.estimated_load_rates)

    def drones(self) -> list[Body]:
        """The drones as estimated."""
        bus = self.flight.bus
        rows = zip(
            bus.estimated_positions, bus.estimated_velocities, bus.estimated_attitudes, bus.estimated_rates,
            strict=True,
        )  # fmt: skip
        return [Body(*row) for row in rows]

    def ends(self) -> Array:
        """Ends (n, 3) of the cables on the load, as estimated, m."""
        return np.asarray(self.flight.bus.estimated_ends[:, 0])

    def cables(self) -> Array:
        """Forces (n, 3) of the cables on the load as they are, N."""
        bus = self.flight.bus
        return np.asarray(-bus.tensions[:, None] * bus.directions)

    def led(self, reference: Body, acceleration: tuple[Array, Array]) -> None:
        """The cascade's reference, so that it is recorded."""
        self._led = reference, acceleration

    def _lead(self, ahead: float) -> None:
        """Record where the cascade's reference is after a time, s: rows are recorded when it has passed."""
        if self._led is None:
            return
        body, (linear, turning) = self._led
        course, rates = np.zeros((4, 3)), np.zeros((3, 3))
        course[0] = body.position + ahead * (body.velocity + 0.5 * ahead * linear)
        course[1], course[2] = body.velocity + ahead * linear, linear
        rates[0], rates[1] = body.rates + ahead * turning, turning
        attitude = turn(*body.attitude, *(ahead * (body.rates + 0.5 * ahead * turning)))
        self.flight.act(
            "reference", reference=course, reference_attitude=attitude, reference_rates=rates
        )

    def asked(self, force: Array, moment: Array) -> None:
        """The cascade's wanted force and moment, so that they are recorded."""
        self.flight.act("load_control", force=force, moment=moment)

    def told(self, wanted: Sequence[Setpoint]) -> None:
        """What the drones are to fly."""
        masses = self.mission.team.masses
        thrusts = masses * np.array([each.specific_force for each in wanted])
        attitudes = np.array([each.attitude for each in wanted])
        axes = 2.0 * np.stack(
            [
                attitudes[:, 1] * attitudes[:, 3] + attitudes[:, 0] * attitudes[:, 2],
                attitudes[:, 2] * attitudes[:, 3] - attitudes[:, 0] * attitudes[:, 1],
                0.5 - attitudes[:, 1] ** 2 - attitudes[:, 2] ** 2,
            ],
            axis=1,
        )
        self.flight.act(
            "position_control",
            thrusts=thrusts,
            desired_attitudes=attitudes,
            desired_rates=[each.rates for each in wanted],
            drone_forces=thrusts[:, None] * axes,
        )

    def advance(self) -> None:
        """One period, with what the drones have."""
        held = self.held
        held.look(self.at)
        self.flight.act(
            "allocation", desired_tensions=held.tensions, desired_directions=held.directions
        )
        period, row = 1e-9 * self.period, self.mission.timing.recording
        rows = max(1, round(period / row))
        each = period / rows if abs(period - rows * row) < 1e-9 else period
        for ahead in np.arange(each, period + 0.5 * each, each).tolist():
            self._lead(ahead)
            self.flight.advance(each)
        self.at += self.period
