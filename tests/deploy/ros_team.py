"""What the tests of the nodes share: all roles in one process, and nodes as processes on the loopback address."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
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

    def fly(self, *, silent: Sequence[float] = (0.0, 0.0), killed: bool = False) -> Recording:
        """Fly the mission; the allocator answers nothing between two times, s, and is a new one after that where it was ``killed``."""
        world = self.world
        while not world.over:
            at = world.at
            if killed and at == round(silent[1] * 1e9):
                self.allocator = Allocating(self.mission)
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


class Listener:
    """A node of the test's own, in the same domain: it hears, and calls services."""

    def __init__(self, nodes: Nodes) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=int(nodes.environment["ROS_DOMAIN_ID"]))
        self.node = Node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_: object) -> None:
        self.node.destroy_node()
        self.context.try_shutdown()

    def listen(self, name: str, made: Any, quality: Any = 10) -> list[Any]:
        """All messages of a topic from now on."""
        found = self.heard[name] = []
        self.node.create_subscription(made, name, found.append, quality)
        return found

    def until(self, there: Callable[[], Any]) -> Any:
        """Spin until something is so, and return it."""
        end = time.monotonic() + LONGEST
        while not (found := there()):
            assert time.monotonic() < end, f"waited in vain; heard {self.heard.keys()}"
            self.executor.spin_once(timeout_sec=0.05)
        return found

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        """Call a service, once it is there."""
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready)
        asked = client.call_async(kind.Request(**fields))
        self.until(asked.done)
        return asked.result()

    def told(self, node: str) -> Any:
        """The last diagnostics of a node, as level, message and values; level -1 before the first."""
        for message in reversed(self.heard["/diagnostics"]):
            (status,) = message.status
            if status.name == f"colift: {node}":
                values = {each.key: each.value for each in status.values}
                return status.level[0], status.message, values
        return -1, "", {}
