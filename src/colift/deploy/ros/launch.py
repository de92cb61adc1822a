"""All nodes of a mission as processes of this machine: started together, ended together, started again where one has died."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence

from colift.interrupts import heard

FIRST = {"cables": ("allocator", "simulator"), "setpoints": ("allocator", "cascade", "simulator")}
"""The nodes, by what the drones take; with the last one the flight ends."""
RECORDER = "recorder"
PATIENCE = 20.0
"""Time that a node has to end by itself, s: the simulator saves its recording."""
LOOK, AGAIN = 0.1, 1.0
"""Time between two looks at who lives, and until who has died is started again, s."""
SHORT = 5.0
"""A node that lives no longer than that, s, as often as ``TRIES``, is not started again."""
TRIES = 3

Say = Callable[[str], None]


class Launch:
    """Processes by node; ``arguments`` are the command's for each.

    Where there is a recorder the others start once it has said that it hears, so that the bag has the whole flight.
    """

    def __init__(self, arguments: Mapping[str, Sequence[str]], say: Say) -> None:
        self._arguments, self._say = dict(arguments), say
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._since: dict[str, float] = {}
        self._short = dict.fromkeys(arguments, 0)

    def run(self) -> int:
        """Run them until the last one of them ends, or somebody interrupts; its exit code."""
        *_, last = self._arguments
        with heard() as interrupted:
            try:
                for node in self._arguments:
                    self._start(node)
                while (code := self._processes[last].poll()) is None:
                    for node in self._arguments:
                        if not self._lives(node):
                            return 1
                    time.sleep(LOOK)
                    interrupted()
                return code
            except KeyboardInterrupt:
                return self._end(last)
            finally:  # the recorder, which is the first, hears the others' end
                for node in reversed(self._arguments):
                    self._end(node)

    def _start(self, node: str) -> None:
        command = [sys.executable, "-m", "colift", "ros", node, *self._arguments[node]]
        environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **os.environ}
        said = subprocess.PIPE if node == RECORDER else None
        self._processes[node] = process = subprocess.Popen(
            command, env=environment, start_new_session=True, stdout=said
        )
        self._since[node] = time.monotonic()
        if process.stdout is not None:
            self._say(process.stdout.readline().decode().rstrip())

    def _lives(self, node: str) -> bool:
        """Start a node again that has died; whether it is worth it."""
        process, now = self._processes[node], time.monotonic()
        code = process.poll()
        if code is None or code == 0 or now < self._since[node] + AGAIN:
            return True
        self._short[node] = self._short[node] + 1 if now < self._since[node] + SHORT else 1
        if self._short[node] >= TRIES:
            self._say(f"{node} ended with {code} again and again; its message is above")
            return False
        self._say(f"{node} ended with {code}; it is started again")
        self._start(node)
        return True

    def _end(self, node: str) -> int:
        """Let a node end as Ctrl-C would, and at last for good."""
        process = self._processes.get(node)
        if process is None:
            return 0
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        if process.stdout is not None and (rest := process.stdout.read().decode().rstrip()):
            self._say(rest)
        return code
