"""What the cascade's node does: from where load and drones are to the wanted force, and on to what each drone is to fly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from colift.deploy.ros.holding import Held
from colift.deploy.ros.layers import Layers
from colift.errors import ColiftError
from colift.flight.loop import follow_clock
from colift.kernel.load import add_arms, add_wanted_arms, ends_of, is_rigid
from colift.mission.mission import Mission
from colift.record.exchange.messages import Body, Setpoint

Array = NDArray[np.float64]


CALLED = ("supervision", "reference", "load_control", "observation", "position_control")


class Steering(Layers):
    """Reference, load control, observation and position control of a mission, called as :mod:`colift.flight.loop` does."""

    def __init__(self, mission: Mission) -> None:
        if mission.kinds["supervision"] != "none":
            raise ColiftError(
                f'supervision.kind: must be "none" for the cascade node, not "{mission.kinds["supervision"]}"; '
                "the simulator flies it where it takes cables"
            )
        super().__init__(mission)
        bus = self.bus
        bus.force[:] = [0.0, 0.0, self.team.load_mass * self.team.gravity]
        self.held = Held(bus.pace, bus.received_tensions, bus.received_directions, self.period)
        self._fresh = {layer: getattr(self.flight.wires, layer).memory.copy() for layer in CALLED}
        self._rigid = is_rigid(bus.attachments)

    def again(self) -> None:
        """Forget what was: nothing is learned before the flight begins."""
        for layer, memory in self._fresh.items():
            getattr(self.flight.wires, layer).memory[:] = memory

    def lead(self, at: int, load: Body, drones: Sequence[Body]) -> None:
        """Reference, wanted force and moment at a time (ns), where load and drones are there; on the bus."""
        bus, dt = self.bus, 1e-9 * self.period
        bus.estimated_load[:] = load.position, load.velocity
        bus.estimated_load_attitude[:], bus.estimated_load_rates[:] = load.attitude, load.rates
        for i, drone in enumerate(drones):
            bus.estimated_positions[i], bus.estimated_velocities[i] = drone.position, drone.velocity
            bus.estimated_attitudes[i], bus.estimated_rates[i] = drone.attitude, drone.rates
        ends_of(bus.estimated_load, bus.estimated_ends)
        if self._rigid:
            p, q, r = bus.estimated_load_rates
            add_arms(bus.attachments, bus.estimated_load_attitude, p, q, r, bus.estimated_ends)
        self.call("supervision", at, dt)
        self.call("reference", round(bus.clock[0] * 1e9), dt)
        follow_clock(self.flight.wires.reference.writes, at * 1e-9, self._rigid, bus)
        ends_of(bus.reference, bus.wanted_ends)
        if self._rigid:
            add_wanted_arms(
                bus.attachments, bus.reference_attitude, bus.reference_rates, bus.wanted_ends
            )
        self.call("load_control", at, dt)

    def fly(self, at: int) -> list[Setpoint]:
        """What each drone is to fly at a time (ns), with the cables' forces that it has (:attr:`held`)."""
        bus, held, dt = self.bus, self.held, 1e-9 * self.period
        bus.received_ages[:] = held.look(at)
        bus.desired_tensions[:], bus.desired_directions[:] = held.tensions, held.directions
        bus.received_tensions[:] = bus.lift_share[0] * held.tensions
        bus.received_directions[:] = held.directions
        self.call("observation", at, dt)
        self.call("position_control", at, dt)
        forces = bus.thrusts / self.team.masses
        rows = zip(bus.desired_attitudes, bus.desired_rates, forces, strict=True)
        return [Setpoint(q.copy(), rates.copy(), float(f)) for q, rates, f in rows]
