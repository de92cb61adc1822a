"""Team and load as URDF, and the frames that move it."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from colift.mission import load_mission
from colift.record.exchange.messages import Body, frames, rotated
from colift.record.exchange.urdf import urdf


@pytest.mark.parametrize("name", ["paper-spiral", "crazyflie-trio", "agile-box", "two-drones-bar"])
def test_it_is_a_tree_of_all_bodies_with_their_masses(name):
    team = load_mission(name).team
    robot = ElementTree.fromstring(urdf(team, name))
    links = {link.get("name"): link for link in robot.findall("link")}
    drones = [f"drone_{i}" for i in range(team.n)]
    assert [*links] == ["world", "load", *drones, *(f"cable_{i}" for i in range(team.n))]
    joints = robot.findall("joint")
    assert [joint.find("child").get("link") for joint in joints] == [*links][1:]
    assert {joint.find("parent").get("link") for joint in joints} == {"world"}
    masses = {
        name: float(link.find("inertial/mass").get("value"))
        for name, link in links.items()
        if link.find("inertial") is not None
    }
    assert masses["load"] == pytest.approx(team.load_mass)
    assert [masses[drone] for drone in drones] == pytest.approx(list(team.masses))
    lengths = [links[f"cable_{i}"].find(".//cylinder").get("length") for i in range(team.n)]
    assert [float(length) for length in lengths] == pytest.approx(
        list(team.cable_lengths), rel=1e-5
    )
    if team.body is not None:
        size = links["load"].find(".//box").get("size").split()
        assert [float(s) for s in size] == pytest.approx(np.maximum(team.body.size, 0.01), rel=1e-5)


def test_a_cable_s_frame_points_from_its_end_to_the_drone():
    still, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    ends = np.array([[0.1, 0.0, 1.0], [-0.1, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    away = np.array([[0.3, 0.4, 0.8], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [np.nan, 0.0, 0.0]])
    drones = [Body(end + d, still, level, still) for end, d in zip(ends, away, strict=True)]
    found = frames(1_500_000_000, Body(still, still, level, still), drones, ends)
    by_name = {each["child_frame_id"]: each for each in found}
    assert {*by_name} == {
        "load",
        *(f"{kind}_{i}" for kind in ("drone", "cable") for i in range(3)),
        "cable_3",
    }
    for i in range(3):
        transform = by_name[f"cable_{i}"]["transform"]
        q = np.array([transform["rotation"][axis] for axis in "wxyz"])
        along = away[i] / np.linalg.norm(away[i])
        assert rotated(q, [0.0, 0.0, 1.0]) == pytest.approx(along, abs=1e-9)
        assert [transform["translation"][axis] for axis in "xyz"] == pytest.approx(ends[i])
    assert by_name["load"]["header"] == {
        "stamp": {"sec": 1, "nanosec": 500_000_000},
        "frame_id": "world",
    }
