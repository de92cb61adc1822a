"""Simulated vehicles that fly a mission's plant by what they are told over MAVLink.

Each has an attitude loop, a position loop for itself, and the rules by which PX4 or ArduPilot follows set-points: a stream before
the mode, the mode before the motors, and what happens when the stream ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.deploy.mavlink import frames
from colift.deploy.mavlink.link import BEAT, LOAD, Line, mavlink
from colift.deploy.mavlink.setpoints import Convention, newtons
from colift.flight.flight import Flight, start_state
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.team.geometry import matrix_of, zero_yaw_quaternion
from colift.world.plant.base import STATE

Array = NDArray[np.float64]
State = tuple[Array, Array, Array, Array]
"""Place, velocity, attitude (wxyz) and rates."""

INNER = 0.005
"""Period of the vehicles' own loops, s, which a station's is a multiple of."""
TURN, DAMP = 200.0, 25.0
"""Of the attitude loop: 1/s² per turn, 1/s."""
K_P, K_D, K_I = 9.0, 5.0, 3.0
"""Of the position loop, 1/s², 1/s, 1/s³."""
LIMIT = 1.0
"""Largest integral of its error, m s."""
FLAT_OUT = 2.5
"""Largest thrust over the weight."""


class Peer:
    """One simulated vehicle.

    Attributes
    ----------
    armed, obeys : bool
    silent : bool
        While True it neither hears nor speaks, as if its radio were off.

    """

    def __init__(
        self,
        line: Line,
        convention: Convention,
        mass: float,
        inertia: Array,
        gravity: float,
        hover: float,
    ) -> None:
        self.line, self.convention = line, convention
        self._mass, self._inertia, self._gravity, self._hover = mass, inertia, gravity, hover
        self.armed = self.obeys = self.silent = False
        self._mode = 0
        self._target: Any = None
        self._since = self._heard = self._beat = -np.inf
        self._integral = np.zeros(3)
        self._held: Array | None = None
        self._told = False, -1

    def listen(self, now: float) -> None:
        """Take what has come in; without set-points for too long, go its own way."""
        for message in self.line.received():
            if self.silent:
                continue
            kind = message.get_type()
            if kind in {"SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"}:
                if now - self._heard > self.convention.slowest:
                    self._since = now
                self._heard, self._target = now, message
            elif kind == "COMMAND_LONG":
                self._obey(message, now)
        if self.obeys and now - self._heard > self.convention.silence:
            self._hold()

    def _obey(self, message: Any, now: float) -> None:
        good = True
        if message.command == mavlink.MAV_CMD_DO_SET_MODE:
            asked = message.param1, message.param2, message.param3
            if asked == tuple(self.convention.mode):
                streams = now - self._heard < self.convention.slowest and now - self._since >= 1.0
                good = self.obeys = self.obeys or streams
                self._mode = self.convention.custom_mode if good else self._mode
            elif asked == tuple(self.convention.hold):
                self._hold()
            else:
                good = False
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.armed = message.param1 == 1.0
        result = mavlink.MAV_RESULT_ACCEPTED if good else mavlink.MAV_RESULT_DENIED
        self.line.mav.command_ack_send(message.command, result)

    def _hold(self) -> None:
        self.obeys, self._mode, self._held = False, self.convention.hold_mode, None

    def control(self, state: State, dt: float) -> tuple[float, Array]:
        """Thrust, N, and torque, N m, for place, velocity, attitude and rates; none while it is not armed."""
        position, velocity, attitude, rates = state
        if not self.armed:
            return 0.0, np.zeros(3)
        weight = self._mass * self._gravity
        if self.obeys and self._target.get_type() == "SET_ATTITUDE_TARGET":
            wanted = frames.attitude(self._target.q)
            thrust = newtons(self._target.thrust, weight, self._hover)
        else:
            force = self._mass * self._acceleration(position, velocity, dt)
            force[2] += weight
            wanted = zero_yaw_quaternion(force[None] / max(float(np.linalg.norm(force)), 1e-9))[0]
            thrust = float(force @ matrix_of(attitude)[:, 2])
        # Angle of the turn that is left, body frame: twice the vector part of q_d* q, the short way round.
        between = matrix_of(wanted).T @ matrix_of(attitude)
        left = 0.5 * np.array(
            [
                between[2, 1] - between[1, 2],
                between[0, 2] - between[2, 0],
                between[1, 0] - between[0, 1],
            ]
        )
        torque = self._inertia * (-TURN * left - DAMP * rates)
        return min(max(thrust, 0.0), FLAT_OUT * weight), torque

    def _acceleration(self, position: Array, velocity: Array, dt: float) -> Array:
        """Wanted of its position loop: to its target, or to where it was when it began to hold."""
        place, speed, more = position, np.zeros(3), np.zeros(3)
        if self.obeys:
            target = self._target
            place, speed, more = frames.world(
                [[target.x, target.y, target.z], [target.vx, target.vy, target.vz], [target.afx, target.afy, target.afz]]
            )  # fmt: skip
        else:
            self._held = position.copy() if self._held is None else self._held
            place = self._held
        self._integral = np.clip(self._integral + dt * (place - position), -LIMIT, LIMIT)
        return np.asarray(
            more + K_P * (place - position) + K_D * (speed - velocity) + K_I * self._integral
        )

    def tell(self, now: float, state: State) -> None:
        """Say where it is."""
        if self.silent:
            return
        position, velocity, attitude, rates = state
        mav, stamp = self.line.mav, round(1e3 * now)
        if now - self._beat >= BEAT or self._told != (self.armed, self._mode):
            self._beat, self._told = now, (self.armed, self._mode)
            base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            mav.heartbeat_send(
                mavlink.MAV_TYPE_QUADROTOR, self.convention.autopilot, base, self._mode, mavlink.MAV_STATE_ACTIVE,
            )  # fmt: skip
        tell_place(mav, stamp, position, velocity)
        mav.attitude_quaternion_send(stamp, *frames.attitude(attitude), *frames.body(rates))


def tell_place(mav: Any, stamp: int, position: Array, velocity: Array) -> None:
    """Send a place and a velocity of our world."""
    mav.local_position_ned_send(stamp, *frames.world(position), *frames.world(velocity))


class World:
    """A mission's plant, flown by simulated vehicles, each on a UDP port of its own; a tracker tells where the load is.

    It stands still until all vehicles are armed and follow set-points.
    """

    def __init__(
        self,
        mission: Mission,
        ports: list[tuple[str, int]],
        convention: Convention,
        *,
        hover: float | None = None,
    ) -> None:
        table = mission.resolved()
        driven = {"attitude_control": {"kind": "external"}, "actuation": {"kind": "external"}}
        driven["detection"] = {"kind": "none"}  # they have none of their own
        self.flight = Flight(load_mission({**table, **driven}))
        team = self.flight.mission.true_team
        self._hover = convention.hover if hover is None else hover
        *own, load = ports
        self.peers = [
            Peer(
                Line(to[0], 0, i + 1, to), convention, float(team.masses[i]), team.inertias[i], team.gravity, self._hover,
            )
            for i, to in enumerate(own)
        ]  # fmt: skip
        self._tracker = Line(load[0], 0, LOAD, load)
        self.tracked = True
        start, _ = start_state(mission)
        memory = self.flight.wires.plant.memory
        n = team.n
        self._state = _states(memory, n)
        self._load = start.load_position, start.load_velocity
        self.flying = False

    def step(self, now: float, period: float) -> None:
        """Go on by a period, s, and tell where all are."""
        for peer in self.peers:
            peer.listen(now)
        self.flying = self.flying or all(peer.armed and peer.obeys for peer in self.peers)
        if self.flying:
            for _ in range(max(1, round(period / INNER))):
                self._control()
                self.flight.advance(INNER)
                self._look()
        for peer, state in zip(self.peers, self._state, strict=True):
            peer.tell(now, state)
        if self.tracked:
            tell_place(self._tracker.mav, round(1e3 * now), *self._load)

    def _control(self) -> None:
        said = [
            self.peers[drone].control(self._state[drone], INNER) for drone in self.flight.drones
        ]
        torques = np.array([torque for _, torque in said])
        self.flight.act(
            "actuation", applied_thrusts=[thrust for thrust, _ in said], applied_torques=torques
        )

    def _look(self) -> None:
        bus = self.flight.bus
        for i, drone in enumerate(self.flight.drones):
            self._state[drone] = (
                bus.positions[i].copy(), bus.velocities[i].copy(), bus.attitudes[i].copy(), bus.rates[i].copy(),
            )  # fmt: skip
        self._load = bus.load[0].copy(), bus.load[1].copy()

    def close(self) -> None:
        """Close all ports."""
        for line in (*(peer.line for peer in self.peers), self._tracker):
            line.close()


def _states(memory: Array, n: int) -> list[State]:
    """Place, velocity, attitude and rates of each drone, of a plant's memory."""
    state = memory[: STATE.size(n)]
    views = [
        STATE.view(state, name).copy() for name in ("position", "velocity", "attitude", "rates")
    ]
    return [(a, b, c, d) for a, b, c, d in zip(*views, strict=True)]
