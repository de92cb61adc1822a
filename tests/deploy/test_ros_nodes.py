"""The nodes as real processes that talk on the loopback address."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2's rclpy is not installed (extra ros)")

from ros_team import LONGEST, Nodes

from colift.record import metrics
from colift.record.recording import Recording

FLIGHT = ("figure-eight", "--set", "timing.duration=4")


@pytest.mark.parametrize("takes", ["cables", "setpoints"])
def test_a_team_of_nodes_flies(takes, tmp_path):
    with Nodes(tmp_path) as nodes:
        nodes.start("allocator", *FLIGHT)
        if takes == "setpoints":
            nodes.start("cascade", *FLIGHT)
        simulator = nodes.start("simulator", *FLIGHT, "--takes", takes, "--record", "flight.h5")
        assert simulator.wait(LONGEST) == 0, nodes.said("simulator")
        assert "completed: 4.00 s" in nodes.said("simulator")
    recording = Recording.load(tmp_path / "flight.h5")
    found = metrics.compute(recording)
    assert found["tracking_max_m"] < 0.025
    assert found["min_angle_deg"] > 46.0
