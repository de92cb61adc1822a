"""One drone of a swarm: its own load controller on its own measurements, its own agent, its own questions to its own allocator."""

from __future__ import annotations

import argparse
import json
import socket
from typing import Any

import numpy as np

from colift.flight.swarm.protocol import END, HOST, Command, Tick, pack_command, tick_of
from colift.kernel.ports import PORTS
from colift.kernel.signals import MESSAGE
from colift.mission import load_mission
from colift.mission.mission import Mission
from colift.part import Part

SLOWEST = 30.0
"""Without a cycle for so long, a drone ends, s: its world is gone."""


class Drone:
    """What runs on one drone, apart from sockets.

    Parameters
    ----------
    mission : Mission
        Which part plays which role, the team and the plan.
    number : int
        The drone's.
    session : int
        1 to 15; the next after each restart.

    """

    def __init__(self, mission: Mission, number: int, session: int) -> None:
        team = mission.team
        self.number, self.n, self.dt = number, team.n, mission.timing.allocation
        self.mission = mission
        self._signals: dict[str, dict[str, Any]] = {}
        self._wires = {
            layer: self._wire(getattr(mission, layer))
            for layer in ("reference", "load_control", "agents", "allocation")
        }
        agent = self._signals["agents"]
        agent["number"][0], agent["members"][:], agent["evidence"][:] = (
            number,
            np.arange(team.n),
            1.0,
        )
        part = mission.agents
        part.layout().view(self._wires["agents"].memory, "session")[:] = session
        self._begun = False

    def _wire(self, part: Part) -> Any:
        port, team = PORTS[part.layer], self.mission.team
        signals = self._signals[part.layer] = port.signals(self.n)
        memory = part.memory(team)
        if part.layer == "agents":
            memory = memory[: memory.size // self.n].copy()
        return port.wire(type(part).kernel, part.params(team), memory, signals)

    def _call(self, layer: str, cycle: int, dt: float) -> int:
        status = PORTS[layer].invoke(self._wires[layer], cycle, cycle * self.dt, dt)
        return int(status or 0)

    def decide(self, tick: Tick, heard: dict[int, bytes]) -> tuple[Command, bytes]:
        """What to do in a cycle, and what to say, after what was heard of the others."""
        reference, control = self._signals["reference"], self._signals["load_control"]
        agent, allocation = self._signals["agents"], self._signals["allocation"]
        self._call("reference", tick.cycle, self.dt)
        control["estimated_load"][:] = np.reshape(tick.load, (2, 3))
        control["reference"][:] = reference["reference"]
        if self._begun:
            control["agreed_force"][:] = agent["agreed"]
        else:
            agent["tension"][0], agent["direction"][:] = tick.pull[0], tick.pull[1:]
            self._begun = True
        self._call("load_control", tick.cycle, self.dt)
        agent["wish"][:], agent["steady_wish"][:] = control["force"], control["steady_force"]
        agent["reference"][:], agent["felt"][:] = reference["reference"], tick.felt
        agent["heard"][:] = 0.0
        for other, text in heard.items():
            agent["inbox"][other], agent["heard"][other] = np.frombuffer(text, np.uint8), 1.0
        status = self._call("agents", tick.cycle, self.dt)
        if agent["asking"][0] > 0.0:
            allocation["force"][:], allocation["reference"][:] = (
                agent["asked_force"],
                reference["reference"],
            )
            for what in ("tensions", "directions"):
                allocation[f"desired_{what}"][:] = agent[f"team_{what}"]
            self._call("allocation", tick.cycle, float(agent["asking"][0]))
            for what in ("tensions", "directions"):
                agent[f"team_{what}"][:] = allocation[f"desired_{what}"]
        command = Command(
            tick.cycle, self.number, status, sum(1 << other for other in heard),
            float(agent["tension"][0]), tuple(agent["direction"].tolist()), tuple(agent["wish"].tolist()),
        )  # fmt: skip
        return command, agent["outbox"].tobytes()


def serve(drone: Drone, ports: list[int], world: int, loss: float, seed: int) -> None:
    """Answer cycles until the world ends them; of the others' messages the share ``loss`` is not heard."""
    rng = np.random.default_rng([seed, drone.number])
    numbers = {port: number for number, port in enumerate(ports)}
    heard: dict[int, bytes] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind((HOST, ports[drone.number]))
        line.settimeout(SLOWEST)
        while True:
            try:
                data, (_, port) = line.recvfrom(256)
            except TimeoutError:
                return
            except ConnectionError:  # somebody who is dead was spoken to
                continue
            other = numbers.get(port)
            if other is not None and len(data) == MESSAGE:
                if rng.random() >= loss:
                    heard[other] = data
            elif port == world and data == END:
                return
            elif port == world and (tick := tick_of(data)) is not None:
                command, said = drone.decide(tick, heard)
                heard = {}
                for number, there in enumerate(ports):
                    if number != drone.number:
                        line.sendto(said, (HOST, there))
                line.sendto(pack_command(command), (HOST, world))


def main() -> None:
    """``python -m colift.flight.swarm.agent``, as the world calls it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mission")
    parser.add_argument("--overrides", type=json.loads, default={})
    parser.add_argument("--number", type=int, required=True)
    parser.add_argument("--session", type=int, default=1)
    parser.add_argument("--ports", type=json.loads, required=True)
    parser.add_argument("--world", type=int, required=True)
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    mission = load_mission(given.mission, given.overrides)
    drone = Drone(mission, given.number, given.session)
    serve(drone, given.ports, given.world, given.loss, given.seed)


if __name__ == "__main__":
    main()
