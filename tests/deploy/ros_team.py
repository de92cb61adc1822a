"""What the tests of the nodes share: all roles in one process, and nodes as processes on the loopback address."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colift.deploy.ros.allocating import Allocating
from colift.deploy.ros.layers import mission_for
from colift.deploy.ros.simulating import Simulating
from colift.deploy.ros.steering import Steering
from colift.record.exchange.messages import Body
from colift.record.recording import Recording

LONGEST = 500.0
"""s, until a process that does not end is taken to hang."""


class Together:
    """Simulator, allocator and, where it takes set-points, cascade, wired as their nodes are."""

    def __init__(self, name: str, overrides: Mapping[str, Any], takes: str) -> None:
        self.mission, _ = mission_for(name, overrides)
        self.world, self.allocator = Simulating(self.mission, takes), Allocating(self.mission)
        self.cascade = Steering(self.mission) if takes == "setpoints" else None

    def fly(self, *, silent: Sequence[float] = (0.0, 0.0)) -> Recording:
        """Fly the mission; the allocator answers nothing between two times, s."""
        world = self.world
        while not world.over:
            at = world.at
            side = world
            if self.cascade is not None:
                side = self.cascade
                self.cascade.lead(at, world.load(), world.drones())
            bus = self.cascade.bus if self.cascade is not None else world.flight.bus
            acceleration = bus.reference[2].copy(), bus.reference_rates[1].copy()
            reference = Body(*bus.reference[:2], bus.reference_attitude, bus.reference_rates[0])
            if not silent[0] <= at * 1e-9 < silent[1]:
                if self.allocator.last < 0:
                    self.allocator.begin(world.load(), world.drones())
                self.allocator.told(
                    load=world.load(), reference=reference, acceleration=acceleration
                )
                forces = self.allocator.answer(at, bus.force, bus.moment)
                for drone, force in enumerate(forces):
                    side.held.hear(drone, at, force)
                    world.held.hear(drone, at, force)
            if self.cascade is not None:
                world.told(self.cascade.fly(at))
                world.led(reference, acceleration)
                world.asked(bus.force, bus.moment)
            world.advance()
        return world.flight.recording()


class Nodes:
    """Processes ``colift ros``, in a domain of ROS that is theirs; what is left of them ends with the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: dict[str, subprocess.Popen[str]] = {}
        self.environment = {
            **os.environ,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
            "ROS_LOG_DIR": str(folder / "log"),
            "OMP_NUM_THREADS": "1",
        }

    def start(self, node: str, *arguments: str) -> subprocess.Popen[str]:
        """Start a node; what it says goes to a file of its name."""
        with (self.folder / f"{node}.txt").open("a") as said:
            self.processes[node] = subprocess.Popen(
                [sys.executable, "-m", "colift", "ros", node, *arguments],
                cwd=self.folder, env=self.environment, stdout=said, stderr=said, text=True,
            )  # fmt: skip
        return self.processes[node]

    def said(self, node: str) -> str:
        return (self.folder / f"{node}.txt").read_text()

    def kill(self, node: str) -> None:
        """As a crash would."""
        process = self.processes[node]
        process.send_signal(signal.SIGKILL)
        process.wait()

    def __enter__(self) -> Nodes:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes.values():
            if process.poll() is None:
                process.terminate()
        for process in self.processes.values():
            try:
                process.wait(30.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
