"""How cables hold a rigid load, and what is told of it before the flight."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.mission.outlook import losses
from colift.mission.warnings import warnings_of
from colift.study.holding import judge
from colift.team import Body, Team
from colift.team.holding import holding
from colift.team.load import box_inertia
from colift.team.plan import plan, taken_over

SIZE = np.array([0.6, 0.4, 0.2])
BOX: dict[str, Any] = {
    "name": "box",
    "load": {"kind": "rigid", "mass": 0.5, "size": SIZE.tolist()},
    "reference": {"kind": "hover", "position": [0.0, 0.0, 1.5]},
    "timing": {"duration": 2.0},
}


def team_with(ends: Any, *, inertia: Any = None, lengths: float = 1.0) -> Team:
    ends = np.array(ends, dtype=float)
    body = Body(box_inertia(0.5, SIZE) if inertia is None else inertia, ends, size=SIZE)
    team = Team.uniform(len(ends), load_mass=0.5, mass=0.5, cable_length=lengths)
    return replace(team, body=body)


def test_a_bar_on_two_upright_cables_is_a_bifilar_pendulum() -> None:
    """Yaw at ``a sqrt(m g / (L J))``, sway across at ``sqrt(g / L)`` as long as it does not roll."""
    a, length, turning = 0.3, 1.5, 0.02
    team = team_with(
        [[a, 0.0, 0.0], [-a, 0.0, 0.0]], inertia=np.diag([1e-3, 0.02, turning]), lengths=length
    )
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    found = holding(team, down, np.full(2, 0.25 * 9.81))
    assert found.rank == 5
    assert found.condition == math.inf
    assert found.yaw_stiffness == pytest.approx(0.5 * 9.81 * a * a / length)
    yaw, sway = a * math.sqrt(0.5 * 9.81 / (length * turning)), math.sqrt(9.81 / length)
    # Free are sway along and across, yaw, and the roll that nothing turns back.
    assert found.swings == pytest.approx(sorted([0.0, sway, sway, yaw]), abs=1e-6)


def test_the_swing_below_drones_that_stand_is_that_of_the_plant() -> None:
    """A box on four cables below drones a thousand times as heavy, pushed a little: its slowest swing by zero crossings."""
    mission = load_mission({**BOX, "plant": {"kind": "rigid-cables"}})
    team = mission.team
    directions, tensions = mission.allocation.formation(team)
    slowest = holding(team, directions, tensions).swings[0]
    heavy = replace(team, masses=1e3 * team.masses, inertias=1e3 * team.inertias)
    flight = Flight(mission)
    part, wire = mission.plant, flight.wires.plant
    wire.params[:] = part.params(heavy)
    drones = wire.memory[13 : 13 + 13 * 4].reshape(4, 13)
    drones[:, 6:10] = [1.0, 0.0, 0.0, 0.0]  # level, so that nothing pulls them aside
    wire.memory[3:5] = [0.0, 0.02]  # the box: across its short side
    wire.sees.applied_thrusts[:] = heavy.masses * 9.81 - tensions * directions[:, 2]
    states = []
    for step in range(6000):
        type(part).kernel(*_now(step), wire.sees, wire.params, wire.memory, wire.writes)
        states.append(wire.memory[4])
    signs = np.sign(states)
    crossings = np.flatnonzero(signs[1:] != signs[:-1])
    period = 2.0 * np.mean(np.diff(crossings)) * 1e-3
    assert 2.0 * math.pi / period == pytest.approx(slowest, rel=0.1)


def _now(step: int) -> tuple[Any]:
    from colift.kernel.ports import Now

    return (Now(step, step * 1e-3, 1e-3, 0),)


def test_what_turns_the_load_away_or_tips_it_over_is_refused_by_name() -> None:
    below = [[0.3, 0.2, -0.3], [-0.3, 0.2, -0.3], [-0.3, -0.2, -0.3], [0.3, -0.2, -0.3]]
    load = {**BOX["load"], "attachments": [[x / 20.0, y / 20.0, z] for x, y, z in below]}
    with pytest.raises(MissionError, match=r"load\.attachments: pose stability: the load falls"):
        load_mission({**BOX, "load": load})
    team = team_with([[0.3, 0.2, 0.1], [-0.3, 0.2, 0.1], [-0.3, -0.2, 0.1], [0.3, -0.2, 0.1]])
    directions, tensions = plan(team)
    inward = directions * [-1.0, -1.0, 1.0]
    assert "yaw stiffness" in dict(holding(team, inward, tensions).problems())
    assert holding(team, directions, tensions).problems() == []


def test_ends_in_a_row_are_warned_of() -> None:
    row = [[x, 0.0, 0.1] for x in (0.3, 0.0, -0.3)]
    mission = load_mission(
        {**BOX, "load": {**BOX["load"], "attachments": row}, "drones": {"count": 3}}
    )
    assert any("rank: the cables make 5 of six" in str(each) for each in warnings_of(mission))


def test_cables_that_others_have_left_alone_stay_where_they_are():
    """The opposite corners bear nearly all of the load, and no cable is let go."""
    team = load_mission(BOX).team
    directions, _ = plan(team)
    rest = team.of([1, 2, 3])
    forces = taken_over(rest, directions[1:], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    pulls = np.linalg.norm(forces, axis=1)
    assert forces / pulls[:, None] == pytest.approx(directions[1:])
    assert pulls[1] == pytest.approx(0.1 / 3)
    assert pulls[0] == pytest.approx(pulls[2], rel=0.05)
    assert forces.sum(axis=0)[2] == pytest.approx(-1.0, abs=0.03)
    falling = taken_over(rest, directions[1:], [0.0, 0.0, -9.81], [1.0, 0.0, 0.0, 0.0])
    assert np.isfinite(falling).all()


def test_what_each_loss_costs_is_told_before_the_flight() -> None:
    four = losses(load_mission(BOX))
    assert all(
        each.carries and math.degrees(each.lean) == pytest.approx(10.0) for each in four.values()
    )
    assert "leaning by 10 degrees" in str(four[0])
    six = losses(load_mission({**BOX, "drones": {"count": 6}}))
    assert all(each.carries and each.lean == 0.0 for each in six.values())
    three = losses(load_mission({**BOX, "drones": {"count": 3}}))
    assert all(not each.carries for each in three.values())
    assert "2 cables do not hold the attitude" in str(three[1])


def test_a_report_says_how_far_the_cables_reach() -> None:
    found = judge(load_mission(BOX))
    assert found.holding.rank == 6
    # The weight's arm limits the moment about the long edge: more and the cables of one side are slack.
    assert 0.5 * 9.81 * 0.15 < found.reach["moment x"] < 0.5 * 9.81 * 0.2
    assert found.reach["force z"] < 0.5 * 9.81  # down: the load cannot be pushed
    bar = {**BOX, "drones": {"count": 2}, "load": {**BOX["load"], "size": [1.2, 0.1, 0.1]}}
    assert judge(load_mission(bar)).reach["moment x"] == 0.0


def test_feasibility_speaks_of_rigid_loads() -> None:
    from typer.testing import CliRunner

    from colift.cli import app

    told = CliRunner().invoke(app, ["feasibility", "box-figure-eight"])
    assert told.exit_code == 0
    assert "without drone 0: goes on leaning by 10" in " ".join(told.output.split())
    data = json.loads(CliRunner().invoke(app, ["feasibility", "box-figure-eight", "--json"]).stdout)
    assert data["feasible"]
    assert data["without"]["3"]["lean_deg"] == pytest.approx(10.0)
