"""Contact with the ground: what it must keep on every plant, against closed forms, and against MuJoCo."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from plant_rig import DOWN, Rig, rotation, slack_rig

import colift
from colift import part
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.team import Ground, Team
from colift.world.plant._chain import level_arc
from colift.world.plant._contact import ANCHORS, RATE, damping_ratio, feet
from colift.world.plant.mujoco import Mujoco

SETTINGS = {"bead-cables": {"drag_coefficient": 0.0, "beads": 2}}
G = 9.81


PLANTS = [kind for kind in part.names("plant") if kind != "external"]  # which moves nothing


@pytest.fixture(params=PLANTS)
def plant(request):
    found = part.find("plant", request.param)
    if message := found.missing():
        pytest.skip(message)
    return found(**SETTINGS.get(request.param, {}))


@pytest.fixture(params=[kind for kind in PLANTS if kind != "mujoco"])
def own(request):
    """The plants whose contact is ours."""
    return part.find("plant", request.param)(**SETTINGS.get(request.param, {}))


def on_ground(team=None, **ground):
    return replace(team or Team.uniform(1), ground=Ground(**ground))


def apart(team, plant, height=0.0):
    """Load and drones over the ground at this height, cut from each other, drones 1 m and more aside."""
    rig = Rig(team, np.tile(DOWN, (team.n, 1)), plant)
    rig.attached[:] = 0.0
    rig.load[0] = [0.0, 0.0, height]
    rig.drones[:, :3] = [[2.0 + i, 0.0, height] for i in range(team.n)]
    if rig.beads.size:  # cut at the load's end, beads lie beside their drone
        rig.beads[:, :, :3] = rig.drones[:, None, :3] + [0.0, 0.01, 0.0]
    rig.beads[:, :, 3:] = 0.0
    let_go(rig)
    return rig


def let_go(rig):
    """Put the anchors below bodies that were moved by hand."""
    if rig.part.anchored:
        anchors = rig.memory[-ANCHORS.size(rig.n) :]
        ANCHORS.view(anchors, "load")[:2] = rig.load[0, :2]
        ANCHORS.view(anchors, "drone")[:] = rig.drones[:, :2]


def contact_energy(rig):
    """Of the springs that press and of those that hold, J."""
    w, height = RATE, rig.team.ground.height
    own = rig.memory[-ANCHORS.size(rig.n) :]
    anchors = np.vstack([ANCHORS.view(own, "load")[:2], ANCHORS.view(own, "drone")])
    places = np.vstack([rig.load[0, :2], rig.drones[:, :2]])
    masses = np.append(rig.team.load_mass, rig.team.masses)
    total = 0.5 * w**2 * masses @ np.sum((places - anchors) ** 2, axis=1)
    total += 0.5 * rig.team.load_mass * w**2 * max(0.0, height - rig.load[0, 2]) ** 2
    if rig.beads.size:
        masses, x, _ = rig.points()
        beads = slice(1 + rig.n, None)
        total += 0.5 * w**2 * masses[beads] @ np.maximum(0.0, height - x[beads, 2]) ** 2
    q0, q1, q2, q3 = rig.drones[
        :, 6:10
    ].T  # heights of the feet: r times entries of the rotation's last row
    rises = feet(rig.team) * 2.0 * np.array([q1 * q3 - q0 * q2, q2 * q3 + q0 * q1])
    depths = np.maximum(0.0, height - rig.drones[:, 2] - np.concatenate([rises, -rises]))
    total += 0.125 * w**2 * rig.team.masses @ np.sum(depths**2, axis=0)
    return total


def energy(rig):
    turning = 0.5 * np.sum(rig.team.inertias * rig.drones[:, 10:13] ** 2)
    return rig.energy() + turning + contact_energy(rig)


def test_a_body_falls_touches_with_its_speed_and_rests(plant):
    rig = apart(on_ground(), plant, height=0.2)
    fastest = np.zeros(2)
    for _ in range(1500):
        rig.touch_speeds[:] = 0.0
        rig.step()
        fastest = np.maximum(fastest, rig.touch_speeds)
    np.testing.assert_allclose(fastest, np.sqrt(2.0 * G * 0.2), atol=0.01)
    sag = (
        0.0 if isinstance(plant, Mujoco) else G / RATE**2
    )  # its constraint holds weight without a stretch
    np.testing.assert_allclose(rig.load[0, 2], -sag, atol=2e-5)
    np.testing.assert_allclose(rig.drones[:, 2], -G / RATE**2, atol=2e-4)
    assert np.abs(rig.load[1]).max() < 1e-6
    assert np.abs(rig.drones[:, 3:6]).max() < 1e-5
    weights = G * np.append(rig.team.masses, rig.team.load_mass)
    np.testing.assert_allclose(
        rig.ground_forces[:, 2], weights, rtol=2e-2 if rig.beads.size else 1e-3
    )
    np.testing.assert_allclose(rig.ground_forces[:, :2], 0.0, atol=1e-3)


@pytest.mark.parametrize("speed", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("mu", [0.3, 0.8])
def test_what_slides_comes_to_rest_where_friction_says(own, speed, mu):
    rig = apart(on_ground(friction=mu), own, height=-G / RATE**2)
    rig.load[1, 0] = speed
    rig.drones[0, 4] = speed
    start = rig.load[0, 0], rig.drones[0, 1]
    rig.step(count=3000)
    wanted = speed**2 / (2.0 * mu * G)
    assert rig.load[0, 0] - start[0] == pytest.approx(wanted, rel=0.01)
    if not rig.beads.size:  # a rope drags on the drone
        assert rig.drones[0, 1] - start[1] == pytest.approx(wanted, rel=0.01)


def test_a_push_below_friction_moves_nothing(own):
    rig = apart(on_ground(friction=0.5), own, height=-G / RATE**2)
    rig.external[:, 0] = 0.45 * G * np.append(rig.team.masses, rig.team.load_mass)
    rig.step(count=200)
    before = rig.load[0].copy(), rig.drones[0, :3].copy()
    rig.step(count=5000)
    assert np.linalg.norm(rig.load[0] - before[0]) < 1e-7
    assert np.linalg.norm(rig.drones[0, :3] - before[1]) < 1e-7
    assert rig.load[0, 0] < 1e-4


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9])
def test_restitution_is_the_share_of_speed_that_comes_back(e):
    plant = part.find("plant", "slack-cables")()
    rig = apart(on_ground(Team.uniform(1, gravity=1e-9), restitution=e), plant, height=0.01)
    rig.load[1, 2] = -1.0
    rig.step(count=100)
    assert rig.load[1, 2] == pytest.approx(e, abs=0.02)
    assert damping_ratio(0.0) == 1.0


@pytest.mark.parametrize("seed", range(20))
def test_energy_never_rises(own, seed):
    """Thrown onto the ground with any attitude and spin."""
    rng = np.random.default_rng(seed)
    team = on_ground(
        Team.uniform(3), friction=rng.uniform(0.0, 1.5), restitution=rng.uniform(0, 0.9)
    )
    rig = apart(team, own)
    rig.load[:] = [[0.0, 0.0, rng.uniform(0.01, 0.5)], rng.normal(size=3) * 2.0]
    rig.drones[:, 2] = rng.uniform(0.3, 0.8, 3)
    rig.drones[:, 3:6] = 2.0 * rng.normal(size=(3, 3))
    turned = rng.normal(size=(3, 4))
    rig.drones[:, 6:10] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    rig.drones[:, 10:13] = 3.0 * rng.normal(size=(3, 3))
    if rig.beads.size:
        rig.beads[:, :, :3] = rig.drones[:, None, :3] + [0.0, 0.01, 0.0]
    let_go(rig)
    first = before = energy(rig)
    rise = 0.0
    for _ in range(1500):
        rig.step()
        after = energy(rig)
        rise = max(rise, after - before)
        before = after
    assert rise < 1e-5 * first


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_sliding_is_that_of_mujoco(own, speed):
    """And creep under a steady push is not: MuJoCo's friction yields."""
    if message := Mujoco.missing():
        pytest.skip(message)
    assert np.abs(slid(own, speed) - slid_in_mujoco(speed)).max() < 1e-3


def slid(plant, speed):
    """Path (100, 3) of the load in the first second, every 10 ms."""
    rig = apart(on_ground(friction=0.5), plant, height=0.0)
    rig.load[1, 0] = rig.drones[0, 4] = speed
    return np.array([rig.step(count=10).load[0].copy() for _ in range(100)])


@cache
def slid_in_mujoco(speed):
    """The same for all that are compared with it."""
    return slid(Mujoco(), speed)


@cache
def put_down(kind):
    """Led down onto the ground at 0.1 m/s, cut loose there at 5 s."""
    table = {
        "name": "put-down", "reference": {"kind": "descent", "position": [0.0, 0.0, 0.3], "rate": 0.1, "height": 0.0},
        "timing": {"duration": 6.0}, "allocation": {"kind": "safe", "min_angle_deg": 30.0},
        "start": {"load_offset": [0.02, 0.0, 0.0]}, "plant": {"kind": kind},
        "fault": [{"kind": "load-released", "at": 5.0}],
    }  # fmt: skip
    return colift.run(table)


@pytest.mark.parametrize("kind", ["mujoco", "elastic-cables", "bead-cables", "rigid-cables"])
def test_a_load_is_put_down_the_same_on_every_plant(kind):
    if message := part.find("plant", kind).missing():
        pytest.skip(message)
    one, other = put_down("slack-cables").recording, put_down(kind).recording
    assert one["ground_forces"][-1, -1, 2] == pytest.approx(0.225 * G, rel=1e-3)
    apart = np.linalg.norm(one["load"][:, 0] - other["load"][:, 0], axis=1)
    assert apart.max() < 1e-3
    assert other["touch_speeds"][:, -1].max() < 0.15


@pytest.mark.parametrize("step", [1e-4, 2e-3, 1e-2])
def test_a_longer_step_makes_the_ground_softer_and_nothing_else(own, step):
    rig = apart(on_ground(), own, height=0.1)
    rig.step(step, round(2.0 / step))
    w = min(RATE, 0.3 / step)  # springs that step finer by themselves stand on harder ground
    assert -1.5 * G / w**2 < rig.load[0, 2] < -0.5 * G / RATE**2
    assert np.abs(rig.load[1]).max() < 1e-6
    assert rig.ground_forces[-1, 2] == pytest.approx(rig.team.load_mass * G, rel=1e-3)


@pytest.mark.parametrize("tilt", [0.3, 1.2, 2.6])
def test_a_drone_that_comes_down_aslant_ends_flat(plant, tilt):
    rig = apart(on_ground(), plant, height=0.5)
    rig.drones[0, 6:10] = [np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    rig.step(count=4000)
    upright = abs(rotation(rig.drones[0, 6:10])[2, 2])
    assert upright == pytest.approx(1.0, abs=1e-4)
    assert rig.drones[0, 2] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(rig.drones[0, 3:6]).max() < 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_hostile_throws_stay_finite(plant, seed):
    """Fast, deep, spinning, with cables that catch, and pushed into the ground."""
    rng = np.random.default_rng(seed)
    rig, _ = slack_rig(seed, 3, plant, speed=30.0)
    rig.team = replace(
        rig.team,
        ground=Ground(height=-0.5, friction=rng.uniform(0, 3), restitution=rng.uniform(0, 1)),
    )
    rig.params = plant.params(rig.team)
    rig.load[0] = [0.0, 0.0, -0.6]
    rig.drones[:, 10:13] = rng.normal(size=(3, 3)) * 50.0
    rig.external[:] = rng.normal(size=(4, 3)) * [3.0, 3.0, 20.0]
    rig.thrusts[:] = rng.uniform(0.0, 10.0, 3)
    rig.step(count=1000)
    assert np.isfinite(rig.memory).all()
    assert np.isfinite(rig.ground_forces).all()
    assert rig.load[0, 2] > -2.0


def test_rest_is_rest_and_the_same_again(plant):
    ends = []
    for _ in range(2):
        rig = apart(on_ground(Team.uniform(3)), plant, height=0.05)
        rig.drones[:, 3:5] = 0.3
        rig.step(count=2000)
        before = rig.state.copy()
        rig.step(count=2000)
        assert np.abs(rig.state - before).max() < (1e-4 if rig.beads.size else 1e-9)
        ends.append(rig.state.copy())
    np.testing.assert_array_equal(*ends)


def test_far_above_the_ground_nothing_changes(plant):
    """Bit for bit."""
    states = []
    for ground in (None, Ground(height=-50.0)):
        rig, _ = slack_rig(3, 3, plant)
        rig.params = plant.params(replace(rig.team, ground=ground))
        rig.step(count=300)
        states.append(rig.state.copy())
    np.testing.assert_array_equal(*states)


# ---------------------------------------------------------------- starts

STANDING = {
    "name": "standing", "reference": {"kind": "hover"}, "timing": {"duration": 0.3},
    "start": {"on_ground": True},
    "position_control": {"kind": "external"}, "attitude_control": {"kind": "external"},
}  # fmt: skip


@pytest.mark.parametrize("kind", [kind for kind in PLANTS if kind != "rigid-cables"])
def test_a_team_stands_on_the_ground_with_slack_cables(kind):
    if message := part.find("plant", kind).missing():
        pytest.skip(message)
    r = Flight(load_mission(STANDING, {"plant.kind": kind})).run()
    assert r.outcome == "completed"
    np.testing.assert_allclose(np.linalg.norm(r["positions"][0] - r["load"][0, 0], axis=1), 0.7)
    np.testing.assert_allclose(r["positions"][..., 2], 0.0, atol=2e-3)
    np.testing.assert_allclose(r["load"][:, 0], [[0.0, 0.0, 0.0]] * len(r.time), atol=2e-3)
    assert r["tensions"].max() < (0.1 if kind == "bead-cables" else 1e-12)
    weight = np.array([0.5 * G] * 4 + [0.225 * G])
    np.testing.assert_allclose(r["ground_forces"][-1, :, 2], weight, rtol=2e-2)


def test_a_slack_chain_has_its_length():
    for length, beads, b in (
        (1.0, 3, [0.7, 0.0, 0.0]),
        (2.0, 8, [0.0, 0.0, 0.1]),
        (1.0, 2, [0.0] * 3),
    ):
        a, b = np.array([0.1, 0.2, 0.0]), np.array([0.1, 0.2, 0.0]) + b
        points = np.vstack([a, level_arc(a, b, length, beads), b])
        spans = np.linalg.norm(np.diff(points, axis=0), axis=1)
        np.testing.assert_allclose(spans, length / (beads + 1), rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "path", "said"),
    [
        ({"reference.position": [0.0, 0.0, -0.1]}, "start.load_offset", "world.ground.height = 0 m"),
        ({"world.ground": {"height": 2.0}}, "start.load_offset", 'set world.ground = "none"'),
        ({"start.load_offset": [0.0, 0.0, -1.2]}, "start.load_offset", "z = -0.2 m at t = 0"),
        (
            {"reference": {"kind": "waypoints", "points": [[0, 0, 1], [0, 0, -1]]}},
            "reference", "the load's height must be at least",
        ),
        ({"world.ground.friction": -1.0}, "world.ground.friction", "greater than or equal to 0"),
        ({"world.ground.restitution": 1.5}, "world.ground.restitution", "less than or equal to 1"),
        ({"world.ground": "grass"}, "world.ground", "'none'"),
        ({"world.ground": {"heigth": 1.0}}, "world.ground.heigth", "did you mean 'height'?"),
        ({"start.on_ground": True, "world.ground": "none"}, "start.on_ground", "needs a ground"),
        ({"start.on_ground": True, "plant.kind": "rigid-cables"}, "start.on_ground", "are rods"),
        ({"start.positions": [[0.0, 0.0, 0.0]]}, "start.positions", "must be drones.count = 4"),
        ({"start.positions": [[0, 0, 1.2], [2, 0, 1], [0, 0.1, 1], [0, 0.2, 1]]}, "start.positions.1", "farther than drone 1's cable"),
        ({"start.positions": [[0, 0, 1.2], [0, 0, -0.1], [0, 0.1, 1], [0, 0.2, 1]], "drones.cable_length": 3.0}, "start.positions.1", "below the ground"),
    ],
)  # fmt: skip
def test_what_the_ground_does_not_allow_is_refused(change, path, said):
    table = {"name": "x", "reference": {"kind": "hover"}, "timing": {"duration": 8.0}}
    with pytest.raises(MissionError) as caught:
        load_mission(table, change)
    found = {problem.path: str(problem) for problem in caught.value.problems}
    assert said in found[path], found


def test_the_ground_of_a_mission_survives_its_file():
    table = {"name": "x", "reference": {"kind": "hover"}}
    for ground in ("none", {"height": -1.0, "friction": 0.3, "restitution": 0.5}):
        mission = load_mission(table, {"world.ground": ground})
        assert load_mission(mission.resolved()).resolved() == mission.resolved()
        assert mission.resolved()["world"]["ground"] == ground
    assert load_mission(table).ground == Ground()
    assert load_mission(table, {"world.ground": "none"}).ground is None


def test_drones_that_leave_and_join_find_the_ground_as_it_is(plant):
    if not plant.slackens:
        pytest.skip("rods hold the drones up")
    name = part.kind_of(type(plant))
    events = [
        {"at": 0.1, "field": "drones.lose", "value": 0},
        {"at": 0.2, "field": "drones.join", "value": 0},
    ]
    mission = load_mission(
        STANDING | {"events": events}, {"plant.kind": name, "timing.duration": 0.4}
    )
    r = Flight(mission).run()
    assert r.outcome == "completed"
    np.testing.assert_allclose(r["positions"][-1, 1:, 2], 0.0, atol=2e-3)
