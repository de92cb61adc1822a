"""The nodes as real processes that talk on the loopback address."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2's rclpy is not installed (extra ros)")

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParametersAtomically
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_team import LONGEST, Listener, Nodes
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from colift.record import metrics
from colift.record.recording import Recording
from colift.study.judge import judge, open_flight

FLIGHT = ("figure-eight", "--set", "timing.duration=4")
LONG = ("figure-eight", "--set", "timing.duration=3000", "--set", "timing.recording=0.02")
OK, WARN, ERROR, STALE = range(4)


def double(name, value):
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
    return Parameter(name=name, value=value)


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
    assert found["tracking_max_m"] < 0.005
    assert found["min_angle_deg"] > 46.0


@pytest.mark.slow
def test_drones_hold_the_last_forces_when_the_allocator_is_killed_and_go_on_when_it_is_back(
    tmp_path,
):
    with Nodes(tmp_path) as nodes, Listener(nodes) as listener:
        clock = listener.listen("/clock", Clock)
        listener.listen("/diagnostics", DiagnosticArray)

        def at():
            return clock[-1].clock.sec + 1e-9 * clock[-1].clock.nanosec if clock else 0.0

        nodes.start("allocator", *LONG)
        nodes.start("cascade", *LONG)
        simulator = nodes.start("simulator", *LONG, "--record", "flight.h5")
        listener.until(lambda: at() > 3.0)
        nodes.kill("allocator")
        killed = at()
        listener.until(lambda: listener.told("cascade")[0] == ERROR)
        assert "the allocator is silent: forces are held" in listener.told("cascade")[1]
        listener.until(lambda: at() > killed + 5.0)
        nodes.start("allocator", *LONG)
        listener.until(lambda: listener.told("cascade")[0] == OK)
        back = at()
        listener.until(lambda: at() > back + 6.0)
        assert int(listener.told("cascade")[2]["silences of the allocator"]) >= 1
        simulator.send_signal(signal.SIGINT)
        assert simulator.wait(LONGEST) == 0, nodes.said("simulator")
    recording = Recording.load(tmp_path / "flight.h5")
    speed = np.linalg.norm(recording["load"][:, 1], axis=1)
    time = recording.time
    assert speed[time < killed].max() > 0.3
    assert speed[(time > killed + 3.5) & (time < killed + 5.0)].max() < 0.02
    assert speed[time > back + 3.0].max() > 0.3
    found = metrics.compute(recording)
    assert found["tracking_max_m"] < 0.05
    assert found["min_angle_deg"] > 30.0  # which the mission's allocator promises


def test_who_comes_later_gets_the_description_of_the_team(tmp_path):
    with Nodes(tmp_path) as nodes, Listener(nodes) as listener:
        listener.listen("/diagnostics", DiagnosticArray)
        nodes.start("simulator", "hover", "--takes", "cables")
        listener.until(lambda: listener.told("simulator")[0] == WARN)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        heard = listener.listen("/colift/robot_description", String, latched)
        listener.until(lambda: heard)
        assert ElementTree.fromstring(heard[0].data).get("name") == "hover"


def test_a_node_that_dies_is_started_again_by_its_launch(tmp_path):
    with Nodes(tmp_path) as nodes, Listener(nodes) as listener:
        clock = listener.listen("/clock", Clock)
        flight = ("figure-eight", "--set", "timing.duration=20")
        launch = nodes.start("launch", *flight, "--record", "flight.h5")
        listener.until(lambda: clock and clock[-1].clock.sec >= 1)
        children = Path(f"/proc/{launch.pid}/task/{launch.pid}/children").read_text().split()
        (allocator,) = [
            int(child)
            for child in children
            if b"allocator" in Path(f"/proc/{child}/cmdline").read_bytes()
        ]
        os.kill(allocator, signal.SIGKILL)
        assert launch.wait(LONGEST) == 0, nodes.said("launch")
        assert "allocator ended with -9; it is started again" in nodes.said("launch")
    assert Recording.load(tmp_path / "flight.h5").time[-1] > 19.9


def test_a_launch_of_what_cannot_start_ends(tmp_path):
    with Nodes(tmp_path) as nodes:
        wrong = ("--", "--ros-args", "-p", "allocation.mu:=-2.0")
        launch = nodes.start("launch", "hover", "--takes", "cables", *wrong)
        assert launch.wait(LONGEST) == 1
        assert "allocator ended with 1 again and again" in nodes.said("launch")


def test_settings_are_parameters_with_ranges_and_changes_are_checked(tmp_path):
    with Nodes(tmp_path) as nodes, Listener(nodes) as listener:
        nodes.start("allocator", "hover", "--", "--ros-args", "-p", "allocation.mu:=0.2")
        name = "/colift/allocator"

        def describe(parameter):
            (found,) = listener.call(
                DescribeParameters, f"{name}/describe_parameters", names=[parameter]
            ).descriptors
            return found

        def value(parameter):
            (found,) = listener.call(
                GetParameters, f"{name}/get_parameters", names=[parameter]
            ).values
            return found.double_value

        def change(*parameters):
            answer = listener.call(
                SetParametersAtomically, f"{name}/set_parameters_atomically", parameters=parameters
            )
            return answer.result

        assert value("allocation.mu") == 0.2
        (range_,) = describe("allocation.min_angle_deg").floating_point_range
        assert (range_.from_value, range_.to_value) == (5e-324, np.nextafter(150.0, 0.0))
        assert "degrees" in describe("allocation.min_angle_deg").description
        assert "N^2" in describe("allocation.mu").description
        assert change(double("allocation.mu", 0.3)).successful
        assert value("allocation.mu") == 0.3
        assert not change(double("allocation.mu", -1.0)).successful
        refused = change(double("allocation.mu", 0.4), double("allocation.min_angle_deg", 175.0))
        assert not refused.successful
        assert "allocation.min_angle_deg" in refused.reason
        assert value("allocation.mu") == 0.3  # all or none


def test_a_wrong_parameter_at_the_start_is_refused_by_name(tmp_path):
    with Nodes(tmp_path) as nodes:
        started = nodes.start("allocator", "hover", "--", "--ros-args", "-p", "allocation.mu:=-2.0")
        assert started.wait(LONGEST) == 1
        assert "allocation.mu" in nodes.said("allocator")
        assert "Traceback" not in nodes.said("allocator")


def test_a_node_is_configured_activated_and_silenced_by_its_lifecycle(tmp_path):
    with Nodes(tmp_path) as nodes, Listener(nodes) as listener:
        listener.listen("/diagnostics", DiagnosticArray)
        nodes.start("allocator", *LONG, "--inactive")
        nodes.start("simulator", *LONG, "--takes", "cables")

        def state():
            return listener.call(GetState, "/colift/allocator/get_state").current_state.label

        def go(transition):
            change = Transition(id=transition)
            return listener.call(
                ChangeState, "/colift/allocator/change_state", transition=change
            ).success

        assert state() == "unconfigured"
        listener.until(lambda: listener.told("simulator")[0] >= 0)
        assert listener.told("simulator")[:2] == (WARN, "waits for who steers")
        assert go(Transition.TRANSITION_CONFIGURE)
        assert go(Transition.TRANSITION_ACTIVATE)
        assert state() == "active"
        listener.until(lambda: int(listener.told("allocator")[2].get("status CONVERGED", 0)) > 90)
        assert listener.told("allocator")[0] == OK
        assert go(Transition.TRANSITION_DEACTIVATE)
        listener.until(lambda: "silent" in listener.told("simulator")[1])
        assert listener.told("simulator")[0] == ERROR
        assert go(Transition.TRANSITION_ACTIVATE)
        listener.until(lambda: listener.told("simulator")[0] == OK)
        assert go(Transition.TRANSITION_ACTIVE_SHUTDOWN)
        assert nodes.processes["allocator"].wait(LONGEST) == 0


def test_a_bag_of_the_live_nodes_is_judged(tmp_path):
    pytest.importorskip("rosbags", reason="the package rosbags is not installed (extra bags)")
    with Nodes(tmp_path) as nodes:
        launch = nodes.start("launch", *FLIGHT, "--record", "flight.mcap")
        assert launch.wait(LONGEST) == 0, nodes.said("launch")
    recording = open_flight(tmp_path / "flight.mcap")
    assert recording.time[-1] > 3.8  # the others find each other no later than the recorder
    assert metrics.compute(recording)["tracking_max_m"] < 0.005
    answers = judge(recording, ["safe"], {}).answers
    flew, _, asked = (each.numbers for each in answers)
    assert asked["min_angle_deg"] == pytest.approx(flew["min_angle_deg"], abs=1.0)
    assert asked["not_ok"] == 0.0
