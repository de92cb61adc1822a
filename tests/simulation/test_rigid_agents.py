"""Teams without a leader on a rigid load: the wrench is agreed on, drones and cables stay apart whatever is lost, liars and the dead are left out."""

from __future__ import annotations

import math

import numpy as np
import pytest

import colift
from colift.control.agents import _message as message
from colift.control.agents.base import Status
from colift.control.agents.leaderless_wrench import MEMORY, LeaderlessWrench
from colift.control.allocation.base import Allocator
from colift.control.allocation.safe_wrench import SafeWrench
from colift.errors import MissionError
from colift.kernel.math import message as numbers
from colift.kernel.signals import MESSAGE
from colift.mission import load_mission
from colift.study.rehearsal import DT
from colift.study.rigid_rehearsal import (
    Motion,
    distances,
    missing,
    places,
    rehearse,
    team_of,
    turned,
    wanted,
)
from colift.team import Team
from colift.team.plan import plan
from colift.world.network.hostile import Hostile
from colift.world.network.perfect import Perfect
from colift.world.network.radio import Radio

HELD = int(Status.HOLDING)


def wild(team: Team, rows: int, seed: int) -> Motion:
    """Wishes that step and rock, and sometimes are no numbers."""
    rng, n = np.random.default_rng([seed, team.n]), team.n
    weight = team.load_mass * team.gravity

    def steps(size: float, every: int, *shape: int) -> np.ndarray:
        found = rng.uniform(-size, size, (rows // every + 1, *shape))
        return np.repeat(found, every, axis=0)[:rows]

    forces = steps(1.5 * weight, 37, n, 3) + [0.0, 0.0, weight]
    moments = steps(0.5, 29, n, 3) + 0.1 * rng.standard_normal((rows, n, 3))
    forces[rng.random((rows, n)) < 0.002] = np.nan
    moments[rng.random((rows, n)) < 0.002] = np.inf
    t = np.arange(rows)[:, None] * DT
    turn = np.hstack([0.3 * np.sin(3.0 * t), 0.3 * np.cos(2.0 * t), 0.8 * t])
    attitude = turned(turn)
    return Motion(forces, 0.7 * forces, moments, 0.5 * moments, steps(5.0, 50, 3), attitude)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_who_wants_the_same_gives_it_exactly_as_the_safe_allocator_where_nothing_limits(n):
    team, rows = team_of(n), 200
    what = wanted(team, rows, 1)
    agent = LeaderlessWrench(max_rate=100.0)
    pulls, status = rehearse(agent, Perfect(), team, plan(team)[0], what)
    force, moment = missing(team, what, pulls)
    assert force[20:].max() < 5e-4  # what 16 bits round
    assert moment[20:].max() < 5e-4  # 13
    assert not status[20:].any()
    allocator = Allocator(SafeWrench(max_rate=100.0), team, dt=DT)
    for k in range(rows):
        answer = allocator.allocate(
            what.forces[k, 0], what.acceleration[k], moment=what.moments[k, 0],
            attitude=what.attitude[k], wanted_attitude=what.attitude[k],
        )  # fmt: skip
    expected = answer.tensions[:, None] * answer.directions
    assert np.abs(pulls[-1] - expected).max() < 2e-3


def test_what_all_have_learned_is_meant_whatever_is_lost():
    team = team_of(4)
    what = wanted(team, 600, 2, spread=0.02)
    for network in (Perfect(), Radio(loss=0.6, delay=0.01, jitter=0.02)):
        pulls, _ = rehearse(LeaderlessWrench(), network, team, plan(team)[0], what, key=3)
        force, moment = missing(team, what, pulls)
        assert force[300:].max() < 2e-3
        assert moment[300:].max() < 1e-3


def least_gap(team: Team, what: Motion, pulls: np.ndarray) -> float:
    """Least distance between two cables, by points along them."""
    ends = places(team, what.attitude)
    along = pulls / np.linalg.norm(pulls, axis=2)[..., None]
    share = np.linspace(0.0, 1.0, 9)[:, None, None, None]
    points = ends - share * team.cable_lengths[:, None] * along
    i, j = np.triu_indices(team.n, k=1)
    apart = points[:, None, :, i] - points[None, :, :, j]
    return float(np.linalg.norm(apart, axis=-1).min())


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.parametrize(("n", "distance"), [(2, 0.5), (4, 0.5), (8, 0.3)])
def test_drones_and_cables_stay_metres_apart_whatever_is_lost(n, distance):
    team, agent = team_of(n), LeaderlessWrench(min_distance=distance)
    for seed in range(2):
        rng, what = np.random.default_rng(seed), wild(team, 1000, seed)

        def restart(cycle, _bus, memory, rng=rng):
            if cycle > 50 and rng.random() < 0.003:
                drone = rng.integers(n)
                session = memory[drone, MEMORY.at.session]
                memory[drone] = 0.0
                memory[drone, MEMORY.at.session] = session % 15.0 + 1.0

        start = plan(team, distance=distance)[0]
        pulls, _ = rehearse(agent, Hostile(), team, start, what, key=seed + 1, meddle=restart)
        assert np.isfinite(pulls).all()
        assert distances(team, what, pulls).min() >= distance + agent.buffer - 1e-9
        assert least_gap(team, what, pulls) >= agent.cable_gap - 1e-9
        along = pulls / np.linalg.norm(pulls, axis=2)[..., None]
        assert np.arccos(np.clip((along[0] * along[-1]).sum(axis=1), -1.0, 1.0)).max() > 0.1


def test_the_moment_fits_into_what_is_left_of_a_message():
    text = np.zeros(MESSAGE, np.uint8)
    values = (-4095.0, 17.0, 4095.0)
    for k, value in enumerate(values):
        message.put_moment(text, k, value)
    assert [message.get_moment(text, k) for k in range(3)] == [*values]
    assert not text[: message.MOMENT].any()
    assert not text[message.SEAL :].any()
    message.put_moment(text, 1, math.nan)
    assert message.get_moment(text, 1) == 0.0
    message.put_moment(text, 1, math.inf)
    assert [message.get_moment(text, k) for k in range(3)] == [-4095.0, 4095.0, 4095.0]
    text[:] = 255
    assert all(abs(message.get_moment(text, k)) <= message.LARGEST for k in range(3))


def shown(team: Team, dead: int = -1, lies: int = -1, at: int = 300):
    """How the load feels, measured by each, where one falls silent and pulls no more, or says more than it pulls."""

    def meddle(cycle, bus, _memory):
        pulls = bus.desired_tensions[:, None] * bus.desired_directions
        if cycle >= at and dead >= 0:
            pulls[dead] = 0.0
            bus.heard[:, dead] = 0.0
        bus.felt_forces[:] = -pulls.sum(axis=0)
        if cycle == 0:
            bus.felt_forces[:] = [0.0, 0.0, team.load_mass * team.gravity]
        if cycle >= at and lies >= 0:
            for i in range(team.n):
                text = bus.inboxes[i, lies]
                numbers.put(text, message.SHARE, numbers.get(text, message.SHARE) + 0.2 * 32767)
                message.seal(text, 0, 0, 0)

    return meddle


@pytest.mark.parametrize("how", ["dead", "lies"])
def test_who_is_silent_and_missing_or_lies_is_left_out_and_nobody_else(how):
    team, n = team_of(4), 4
    what = wanted(team, 600, 4)
    seen: list[np.ndarray] = []
    change = shown(team, **{how: 1})

    def meddle(cycle, bus, memory):
        change(cycle, bus, memory)
        seen.append(bus.views.copy())

    pulls, _ = rehearse(LeaderlessWrench(), Perfect(), team, plan(team)[0], what, meddle=meddle)
    others = [0, 2, 3]
    assert np.all(seen[299] == 1.0)
    late = seen[330]
    assert not late[others, 1].any()
    assert np.all(late[np.ix_(others, others)] == 1.0)
    assert np.isfinite(pulls).all()
    assert pulls.shape[1] == n
    if how == "dead":  # three cables bear what four did
        bearing = np.delete(pulls[400:], 1, axis=1)
        lacks = bearing.sum(axis=1) + what.forces[400:].mean(axis=1)
        assert np.linalg.norm(lacks, axis=1).max() < 0.35 * team.load_mass * team.gravity


def test_who_begins_anew_is_at_its_place_again():
    team = team_of(4)
    what = wanted(team, 500, 5)

    def restart(cycle, _bus, memory):
        if cycle == 250:
            memory[2] = 0.0
            memory[2, MEMORY.at.session] = 2.0

    pulls, status = rehearse(
        LeaderlessWrench(), Perfect(), team, plan(team)[0], what, meddle=restart
    )
    force, moment = missing(team, what, pulls)
    assert status[251].astype(int).any()
    assert force[300:].max() < 1e-3
    assert moment[300:].max() < 1e-3


def test_the_shipped_mission_is_flown_within_its_criteria_and_after_a_loss():
    run = colift.run("leaderless-box", overrides={"timing.duration": 16.0}, seed=31)
    assert run.verdict.level == "pass", run.verdict
    fault = {"kind": "drone-lost", "at": 8.0, "drone": 1}
    run = colift.run("leaderless-box", overrides={"fault": [fault], "drones.count": 5, "reference.period": 9.0}, seed=32)  # fmt: skip
    assert run.recording.outcome == "completed"
    assert run.metrics["attitude_max_deg"] < 20.0


def test_points_and_rigid_loads_are_refused_where_they_do_not_belong():
    with pytest.raises(MissionError, match="leaderless-wrench"):
        load_mission("box-figure-eight", {"agents.kind": "leaderless"})
    with pytest.raises(MissionError, match='needs "leaderless"'):
        load_mission("hover", {"agents.kind": "leaderless-wrench"})
