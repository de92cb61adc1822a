"""Crazyflies on this machine: the exported app, compiled against headers of ours, a copy a drone, in a loop with the plant.

The flight is driven where autopilots are (:mod:`colift.deploy.sitl.team`): motors with the mission's lag and limit follow what each app's controller
commands, by way of the firmware's mixer. The controllers of the flight itself only look on.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from colift.flight.flight import Flight
from colift.flight.runner import Run
from colift.mission import load_mission
from colift.part import make
from colift.world.actuation.motors import Motors

HERE = Path(__file__).with_name("crazyflie")
FLAGS = ("-std=gnu11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror")
PACKET, LOAD = 63, 100
STEP, CYCLE = 5, 10
"""From one exchange with the plant to the next, and of the app's task and of the motion capture, ms."""
FORCE_TORQUE = 1
"""``controlModeForceTorque``."""
MILLISECOND = 0.001


def built(sources: Path) -> Path:
    """The apps of a folder as a library."""
    made = sources / "app.so"
    files = [str(each) for each in sorted(sources.glob("*.c"))]
    where = [f"-I{sources}", f"-I{HERE / 'firmware'}"]
    subprocess.run(
        ["gcc", *FLAGS, *where, "-shared", "-fPIC", *files, str(HERE / "host.c"), "-o", str(made), "-lm"], check=True
    )  # fmt: skip
    return made


class App:
    """One drone's firmware with its app."""

    def __init__(self, library: Path, folder: Path, number: int) -> None:
        own = folder / f"drone{number}.so"  # a copy of its own has memory of its own
        shutil.copy(library, own)
        self._code: Any = ctypes.CDLL(str(own))
        self._code.host_track.argtypes = [ctypes.c_int, *[ctypes.c_float] * 3]
        self._code.host_begin(number + 1)

    def set(self, name: str, value: int) -> None:
        assert self._code.host_set(name.encode(), value)

    def log(self, name: str) -> int:
        return int(self._code.host_log(name.encode()))

    def stabilize(self, now: int, state: Any) -> tuple[int, float, Any]:
        """Mode, thrust and torque that the controller commands."""
        told, wanted = np.asarray(state, dtype=np.float32), np.zeros(5, dtype=np.float32)
        self._code.host_stabilize(now, *(ctypes.c_void_p(each.ctypes.data) for each in (told, wanted)))  # fmt: skip
        return int(wanted[0]), float(wanted[1]), wanted[2:].astype(float)

    def cycle(self) -> None:
        self._code.colift_cycle()

    def track(self, place: Any) -> None:
        self._code.host_track(LOAD, *(float(each) for each in place))

    def said(self) -> bytes | None:
        packet = ctypes.create_string_buffer(PACKET)
        return packet.raw if self._code.host_said(packet) else None

    def hear(self, packet: bytes) -> None:
        self._code.host_hear(packet)


SIGNS = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0]])
"""Of roll, pitch and yaw in the motors' thrusts, as the firmware mixes them: front right, rear right, rear left, front left."""


class Crazyflies:
    """A mission, flown by as many apps as it has drones.

    Parameters
    ----------
    library : Path
        What :func:`built` made of the export of the same mission.
    folder : Path
        For a copy a drone.
    mission : str
    loss : float
        Share of messages that are not heard.
    overrides : mapping
        Of the world only.

    """

    def __init__(
        self, library: Path, folder: Path, mission: str, *, loss: float = 0.0, **overrides: Any
    ) -> None:
        asked = load_mission(mission, overrides)
        found: Any = asked.actuation
        motors = found if isinstance(found, Motors) else make("actuation", {"kind": "motors"}, asked)  # fmt: skip
        outside = {
            "attitude_control.kind": "external", "actuation": {"kind": "external", "lag": motors.motor_lag()}, "detection.kind": "none",
        }  # fmt: skip
        self.mission = load_mission(mission, overrides | outside)
        self.flight, team = Flight(self.mission), self.mission.team
        self._arms = np.array([motors.levers(team)[0]] * 2 + [motors.settled("torque_ratio", team)[0]])  # fmt: skip
        self._most = 0.25 * float(motors.thrust_limits(team)[0])
        self._share = 1.0 - np.exp(-STEP * MILLISECOND / motors.motor_lag())
        self.apps = [App(library, folder, drone) for drone in range(team.n)]
        self._loss, self._rng = loss, np.random.default_rng(1)
        self.now, self.modes, self.forces = 0, [0] * team.n, np.zeros((team.n, 4))
        self.fly()

    def fly(self, *, yes: bool = True) -> None:
        for app in self.apps:
            app.set("fly", int(yes))

    def step(self) -> None:
        """Stabilizers, now and then the apps' tasks with their radio, motors, plant."""
        bus = self.flight.bus
        if self.now % CYCLE == 0:
            for app in self.apps:
                app.track(bus.load[0])
        for i, app in enumerate(self.apps):
            seen = bus.positions, bus.velocities, bus.attitudes, bus.measured_specific_forces, bus.rates  # fmt: skip
            state = [each[i] for each in seen]
            self.modes[i], thrust, torque = app.stabilize(self.now, np.concatenate(state))
            wanted = np.zeros(4)
            if self.modes[i] == FORCE_TORQUE:
                wanted = 0.25 * (thrust + torque / self._arms @ SIGNS)
            self.forces[i] += self._share * (np.clip(wanted, 0.0, self._most) - self.forces[i])
            if self.now % CYCLE == STEP * (i % 2):  # their clocks are not one
                app.cycle()
                self._carry(i, app.said())
        bus.applied_thrusts[:] = self.forces.sum(axis=1)
        bus.applied_torques[:] = self.forces @ SIGNS.T * self._arms
        self.flight.advance(STEP * MILLISECOND)
        self.now += STEP

    def _carry(self, sender: int, packet: bytes | None) -> None:
        for i, app in enumerate(self.apps):
            if packet is not None and i != sender and self._rng.random() >= self._loss:
                app.hear(packet)

    def run(self, duration: float | None = None) -> Run:
        """To the end, or for a time, s."""
        for _ in range(round((duration or self.mission.timing.duration) / MILLISECOND / STEP)):
            self.step()
        return Run(recording=self.flight.recording(), loop_time=1.0, compiled=self.flight.compiled)
