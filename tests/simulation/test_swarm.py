"""Agents as processes of their own: any of them is killed, and the others bear its share."""

from __future__ import annotations

import json
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest

from colift.control.agents._message import SHARE, seal
from colift.control.agents._pairs import WIDTH, Q
from colift.control.agents.leaderless import MEMORY
from colift.errors import ColiftError
from colift.flight.swarm import protocol, world
from colift.flight.swarm.agent import Drone
from colift.flight.swarm.protocol import Command, Tick
from colift.kernel.math import message
from colift.mission import load_mission
from colift.show.live.hearing import HearingPage
from terminal import colift

NAME = "paper-spiral"
SETTINGS = {"agents.kind": "leaderless", "allocation.kind": "safe", "timing.allocation": 0.01}
PATIENCE, ALLOWED = 0.15, 0.15


def swarm(loss: float = 0.2) -> world.Swarm:
    return world.Swarm(load_mission(NAME, SETTINGS), NAME, SETTINGS, loss=loss)


@pytest.mark.parametrize("drone", range(4))
def test_whichever_process_is_killed_the_force_is_whole_again_soon(drone):
    team = swarm()
    flown = team.run(6.0, [world.Stroke(4.0, drone)], waits=True)
    weight = team.mission.team.load_mass * team.mission.team.gravity
    first = round(4.0 / flown.dt)
    assert flown.missing[first : first + 30].max() > 0.2 * weight
    assert flown.settled(4.0, world.WHOLE, weight) <= PATIENCE + ALLOWED
    behind = np.linalg.norm(np.sum(flown.pulls, axis=1) - flown.asked, axis=1)
    assert behind[first + 30 : first + 200].max() < 0.05 * weight
    away = np.linalg.norm(np.array(flown.load) - np.array(flown.wanted), axis=1)
    assert away.max() < 0.1
    assert all(row[drone] == -1 for row in flown.status[first + 1 :])
    others = [i for i in range(4) if i != drone]
    assert all(flown.status[-1][i] >= 0 for i in others)
    assert all(process is None or process.poll() is not None for process in team.processes)


def test_an_agent_that_is_started_again_bears_its_share_again():
    team = swarm(loss=0.0)
    back: list[int] = []

    def until_it_is_back(cycle, now):
        if cycle * now.dt > 3.0 and now.flown.status[-1][1] >= 0:
            back.append(cycle)

    flown = team.run(
        20.0, [world.Stroke(2.0, 1), world.Stroke(3.0, 1, restart=True)], waits=True, watch=until_it_is_back
    )  # fmt: skip
    assert back
    weight = team.mission.team.load_mass * team.mission.team.gravity
    tensions = np.linalg.norm(np.array(flown.pulls), axis=2)
    assert tensions[back[0] - 2, 1] < 0.02 * weight
    assert tensions[-100:, 1].min() > 0.15 * weight
    assert flown.missing[-100:].max() < world.WHOLE * weight
    assert team.sessions == [1, 2, 1, 1]


class Ground:
    """Four drones in one process, with a load that does what they pull."""

    def __init__(self) -> None:
        mission = load_mission("hover", {**SETTINGS, "load_control.kind": "pid"})
        self.team = mission.team
        self.drones = [Drone(mission, i, 1) for i in range(self.team.n)]
        self.directions = mission.start_directions()
        self.commands: list[Command] = []
        self.said: dict[int, bytes] = {}
        self.cycle = 0

    def run(
        self, cycles: int, dumb: int = -1, dead: int = -1, idle: int = -1, lies: int = -1
    ) -> None:
        """Nobody hears who is ``dumb``; who is ``dead`` neither speaks nor pulls, who is ``idle`` speaks only, and who ``lies`` says more than it does."""
        weight = self.team.load_mass * self.team.gravity
        for _ in range(cycles):
            pulls = [
                -np.array(each.direction) * (0.0 if each.number in (dead, idle) else each.tension)
                for each in self.commands
            ]
            felt = tuple(np.sum(pulls, axis=0)) if pulls else (0.0, 0.0, weight)
            self.missing = float(np.linalg.norm(felt - np.array([0.0, 0.0, weight]))) / weight
            if lies >= 0:
                text = np.frombuffer(self.said[lies], np.uint8).copy()
                share = message.get(text, SHARE) + 0.3 * 32767
                message.put(text, SHARE, share)
                seal(text, 0, 0, 0)
                self.said[lies] = text.tobytes()
            load = (
                *self.drones[0].mission.reference.sample(np.zeros(1), self.team)[0, 0],
                0.0,
                0.0,
                0.0,
            )
            answers = []
            for drone in self.drones:
                i = drone.number
                tick = Tick(self.cycle, load, felt, (0.0, *self.directions[i]))
                heard = {j: text for j, text in self.said.items() if j not in (i, dumb, dead)}
                answers.append(drone.decide(tick, heard))
            self.commands = [command for command, _ in answers]
            self.said = {command.number: text for command, text in answers}
            self.cycle += 1

    def inside(self, of: int, peer: int) -> bool:
        memory = self.drones[of]._wires["agents"].memory
        return bool(memory[MEMORY.at.peers + WIDTH * peer + Q.inside])


def test_silence_is_not_death_but_a_missing_pull_is():
    ground = Ground()
    ground.run(200)
    ground.run(300, dumb=1)
    assert all(ground.inside(i, 1) for i in (0, 2, 3))
    ground.run(100)
    before = np.array([each.tension for each in ground.commands])
    ground.run(40, dead=1)
    assert not any(ground.inside(i, 1) for i in (0, 2, 3))
    assert all(ground.inside(i, j) for i in (0, 2, 3) for j in (0, 2, 3) if i != j)
    after = np.array([each.tension for each in ground.commands])
    assert (after[[0, 2, 3]] > before[[0, 2, 3]]).any()
    ground.run(100)  # it pulls and speaks again
    assert all(ground.inside(i, 1) for i in (0, 2, 3))


def test_who_speaks_and_does_not_pull_is_left_out():
    ground = Ground()
    ground.run(300)
    assert ground.missing < 0.01
    ground.run(15, idle=1)
    assert not any(ground.inside(i, 1) for i in (0, 2, 3))
    ground.run(60, idle=1)
    assert ground.missing < 0.05
    assert all(ground.inside(i, j) for i in (0, 2, 3) for j in (0, 2, 3) if i != j)


def test_who_lies_about_its_pull_is_left_out_and_nobody_else():
    ground = Ground()
    ground.run(300)
    ground.run(15, lies=1)
    assert not any(ground.inside(i, 1) for i in (0, 2, 3))
    ground.run(200, lies=1)
    assert not any(ground.inside(i, 1) for i in (0, 2, 3))
    assert all(ground.inside(i, j) for i in (0, 2, 3) for j in (0, 2, 3) if i != j)


def test_what_goes_over_the_wire_comes_back():
    tick = Tick(7, (1.0, 2.0, 3.0, 0.5, 0.25, 0.0), (0.0, 0.0, 2.0), (0.5, 0.0, 0.0, -1.0))
    command = Command(2**40, 3, 2, 0b1011, 0.75, (0.0, 0.6, -0.8), (0.0, 0.25, 2.0))
    assert protocol.tick_of(protocol.pack_tick(tick)) == tick
    assert protocol.command_of(protocol.pack_command(command)) == command
    for data in (b"", b"CLT1", bytes(72), bytes(76), protocol.pack_tick(tick)[:-1]):
        assert protocol.tick_of(data) is None
        assert protocol.command_of(data) is None


def test_what_a_swarm_cannot_fly_is_refused():
    for settings, field in (
        ({}, "agents.kind"),
        ({**SETTINGS, "load_control.kind": "balance"}, "load_control.kind"),
        ({**SETTINGS, "events": [{"at": 2.0, "field": "drones.join", "value": 3}]}, "drones.join"),
    ):
        with pytest.raises(ColiftError, match=field):
            world.Swarm(load_mission(NAME, settings), NAME, settings)


def test_what_a_mission_has_and_the_world_of_a_swarm_has_not_is_told():
    assert "left out: disturbance" in world.for_agents("real-world", {})[1]
    assert not any("left out" in note for note in world.for_agents(NAME, {})[1])


def test_a_force_that_is_not_whole_again_has_not_settled():
    flown = world.Flown(0.01)
    for row in range(400):
        flown.pulls.append(
            np.array([[0.0, 0.0, 1.0 if not 100 <= row < 130 and row < 250 else 0.0]])
        )
        flown.wished.append(np.array([0.0, 0.0, 1.0]))
    assert flown.settled(1.0, world.WHOLE, 1.0) is None  # it is missing again after 2.5 s
    assert flown.settled(0.4, world.WHOLE, 1.0) == pytest.approx(0.9)
    assert flown.settled(2.5, world.WHOLE, 1.0) is None
    assert flown.settled(5.0, world.WHOLE, 1.0) is None


def test_a_force_that_nobody_bears_is_missing():
    team = swarm()
    flown = team.run(1.0, [world.Stroke(0.5, i) for i in range(4)], waits=True)
    weight = team.mission.team.load_mass * team.mission.team.gravity
    assert flown.missing[-1] == pytest.approx(weight, rel=0.2)
    assert flown.settled(0.5, world.WHOLE, weight) is None


def test_a_page_says_who_hears_whom():
    page = HearingPage()
    try:
        page.say(
            time=1.5,
            missing=0.0,
            weight=2.0,
            hears=[[0.0, 0.5], [1.0, 0.0]],
            alive=[True, False],
            pulls=[1.0, 0.0],
        )
        with urlopen(page.address + "state") as answer:
            assert json.load(answer)["hears"] == [[0.0, 0.5], [1.0, 0.0]]
        with urlopen(page.address) as answer:
            assert "Who hears whom" in answer.read().decode()
        with pytest.raises(HTTPError):
            urlopen(page.address + "elsewhere")
    finally:
        page.close()


def test_the_command_flies_kills_and_says_what_came_of_it():
    result = colift("swarm", "--seconds", "3", "--kill", "2@2", "--wait", "--json")
    found = json.loads(result.stdout)
    assert found["tracking_max_m"] < 0.1
    assert found["killed"][0]["drone"] == 2
    assert found["killed"][0]["settled"] <= PATIENCE + ALLOWED
    assert "there is no drone 7" in colift("swarm", "--kill", "7@2").stderr
    assert "ends at 3 s" in colift("swarm", "--seconds", "3", "--kill", "1@3").stderr
    assert "DRONE@TIME" in colift("swarm", "--restart", "7").stderr
