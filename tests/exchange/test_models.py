"""Teams as models for other simulators: opened by these, and in MuJoCo flown beside our own plant."""

from __future__ import annotations

import math
import shutil
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest

from colift.deploy.models import model, start_of
from colift.flight.flight import Flight, start_state
from colift.mission import load_mission
from colift.record.exchange.sdf import SHARE
from colift.team.geometry import matrix_of
from terminal import colift

NAMES = ["paper-spiral", "crazyflie-trio", "agile-box", "two-drones-bar"]


@pytest.mark.parametrize("name", NAMES)
def test_mujoco_has_the_team_where_it_begins(name):
    mujoco = pytest.importorskip("mujoco")
    mission = load_mission(name)
    found = mujoco.MjModel.from_xml_string(model(mission, "mjcf"))
    data, team = mujoco.MjData(found), mission.team
    mujoco.mj_forward(found, data)
    load, drones = start_of(mission)
    assert found.opt.gravity[2] == pytest.approx(-team.gravity)
    assert found.body("load").mass[0] == pytest.approx(team.load_mass)
    np.testing.assert_allclose(data.body("load").xpos, load.position, atol=1e-9)
    for i, body in enumerate(drones):
        place = data.body(f"drone_{i}")
        np.testing.assert_allclose(place.xpos, body.position, atol=1e-9)
        np.testing.assert_allclose(place.xmat.reshape(3, 3), matrix_of(body.attitude), atol=1e-9)
        assert found.body(f"drone_{i}").mass[0] == pytest.approx(team.masses[i])
        np.testing.assert_allclose(
            np.sort(found.body(f"drone_{i}").inertia), np.sort(team.inertias[i])
        )
        assert found.tendon_range[i, 1] == pytest.approx(team.cable_lengths[i])
        assert data.ten_length[i] <= team.cable_lengths[i] + 1e-9
    assert found.nu == 4 * team.n


@pytest.mark.parametrize("name", ["paper-spiral", "agile-box"])
def test_mujoco_moves_it_as_our_own_plant_does(name):
    """With the thrusts of hover, a push and a turn, in the open loop for 0.4 s: two physics of different kinds, which part slowly."""
    mujoco = pytest.importorskip("mujoco")
    driven = {"attitude_control": {"kind": "external"}, "actuation": {"kind": "external"}}
    still = {"disturbance": [], "fault": [], "sensing": {"kind": "ideal"}, "plant": {"kind": "rigid-cables"}, "truth": {}}  # fmt: skip
    mission = load_mission(name, {**driven, **still, "timing.duration": 1.0, "start.on_ground": False})  # fmt: skip
    _, hover = start_state(mission)
    thrusts = hover * np.linspace(0.98, 1.06, mission.team.n)
    torques = np.zeros((mission.team.n, 3))
    torques[0] = 0.02 * mission.team.inertias[0] * [3.0, -4.0, 20.0]
    flight = Flight(mission)
    flight.act("actuation", applied_thrusts=thrusts, applied_torques=torques)
    flight.advance(0.4)
    found = mujoco.MjModel.from_xml_string(model(mission, "mjcf"))
    data = mujoco.MjData(found)
    for i in range(mission.team.n):
        for motor, value in zip(("thrust", "roll", "pitch", "yaw"), [thrusts[i], *torques[i]], strict=True):  # fmt: skip
            data.actuator(f"drone_{i}_{motor}").ctrl = value
    mujoco.mj_step(found, data, nstep=round(0.4 / found.opt.timestep))
    bus = flight.bus
    moved = np.linalg.norm(bus.load[0] - start_of(mission)[0].position)
    assert moved > 0.01
    assert np.linalg.norm(data.body("load").xpos - bus.load[0]) < 0.03 * moved
    for i in range(mission.team.n):
        assert np.linalg.norm(data.body(f"drone_{i}").xpos - bus.positions[i]) < 0.05 * moved
        turn = data.body(f"drone_{i}").xmat.reshape(3, 3).T @ matrix_of(bus.attitudes[i])
        assert math.acos(min(1.0, 0.5 * (np.trace(turn) - 1.0))) < 0.005


@pytest.mark.parametrize("name", NAMES)
def test_urdf_is_read_by_yourdfpy(name, tmp_path):
    yourdfpy = pytest.importorskip("yourdfpy")
    mission = load_mission(name)
    path = tmp_path / "team.urdf"
    path.write_text(model(mission, "urdf"))
    found = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False)
    assert found.validate()
    links = found.link_map
    assert links["load"].inertial.mass == pytest.approx(mission.team.load_mass)
    assert len(links) == 2 + 2 * mission.team.n
    for i in range(mission.team.n):
        np.testing.assert_allclose(np.diag(links[f"drone_{i}"].inertial.inertia), mission.team.inertias[i])  # fmt: skip


READER = r"""
#include <sdf/sdf.hh>
#include <cstdio>
int main(int, char **argv) {
  sdf::Root root;
  for (const auto &error : root.Load(argv[1])) { std::fprintf(stderr, "%s\n", error.Message().c_str()); return 1; }
  const sdf::Model *model = root.Model();
  for (uint64_t k = 0; k < model->LinkCount(); ++k) {
    const sdf::Link *link = model->LinkByIndex(k);
    ignition::math::Pose3d pose;
    if (!link->SemanticPose().Resolve(pose, "__model__").empty()) return 2;
    std::printf("%s %.12g %.12g %.12g %.12g\n", link->Name().c_str(), link->Inertial().MassMatrix().Mass(), pose.Pos().X(), pose.Pos().Y(), pose.Pos().Z());
  }
  std::printf("joints %d\n", (int)model->JointCount());
}
"""


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """A program that opens a model with libsdformat, the reader of Gazebo."""
    if not (shutil.which("g++") and shutil.which("pkg-config")):
        pytest.skip("no g++ or pkg-config")
    told = subprocess.run(["pkg-config", "--cflags", "--libs", "sdformat12"], capture_output=True, text=True)  # fmt: skip
    if told.returncode:
        pytest.skip("libsdformat is not installed (Debian: libsdformat-dev)")
    folder = tmp_path_factory.mktemp("reader")
    (folder / "reader.cc").write_text(READER)
    subprocess.run(["g++", "-std=c++17", "reader.cc", "-o", "reader", *told.stdout.split()], cwd=folder, check=True)  # fmt: skip
    return folder / "reader"


@pytest.mark.parametrize("name", NAMES)
def test_gazebo_s_reader_opens_sdf(name, reader, tmp_path):
    mission = load_mission(name)
    path = tmp_path / "team.sdf"
    path.write_text(model(mission, "sdf"))
    done = subprocess.run([reader, path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    links = {line[0]: [float(each) for each in line[1:]] for line in lines if len(line) == 5}
    assert lines[-1] == ["joints", str(2 * mission.team.n)]
    load, drones = start_of(mission)
    np.testing.assert_allclose(links["load"], [mission.team.load_mass, *load.position], atol=1e-9)
    for i, body in enumerate(drones):
        mass = mission.team.masses[i]
        np.testing.assert_allclose(links[f"drone_{i}"], [(1.0 - SHARE) * mass, *body.position], atol=1e-9)  # fmt: skip
        assert links[f"cable_{i}"][0] == pytest.approx(SHARE * mass)


@pytest.mark.parametrize("name", NAMES)
def test_sdf_s_rods_reach_from_load_to_drones(name):
    mission = load_mission(name)
    root = ElementTree.fromstring(model(mission, "sdf"))
    _, drones = start_of(mission)
    for i, body in enumerate(drones):
        rod = next(link for link in root.iter("link") if link.get("name") == f"cable_{i}")
        x, y, z, roll, pitch, yaw = map(float, rod.find("pose").text.split())
        length = float(rod.find(".//cylinder/length").text)
        up = [
            math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll),
            math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll),
            math.cos(pitch) * math.cos(roll),
        ]
        np.testing.assert_allclose(np.array([x, y, z]) + length * np.array(up), body.position, atol=1e-9)  # fmt: skip


def test_the_command(tmp_path):
    colift("export", "mjcf", "hover", "--set", "drones.count=3", folder=tmp_path, check=True)
    bodies = ElementTree.parse(tmp_path / "hover.xml").iter("body")
    assert [each.get("name") for each in bodies] == ["load", "drone_0", "drone_1", "drone_2"]
    wrong = colift("export", "sdf", "hoover", folder=tmp_path)
    assert wrong.returncode != 0
    assert "did you mean" in wrong.stderr
