"""Off-board control over MAVLink: frames, set-points, and flights of simulated vehicles over UDP on this machine."""

from __future__ import annotations

import importlib
import json
import math
import socket
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colift.deploy.mavlink import frames
from colift.deploy.mavlink.setpoints import (
    CONVENTIONS,
    attitude_target,
    newtons,
    normalised,
    position_target,
)
from colift.errors import ColiftError, MissingExtraError
from colift.mission import load_mission
from colift.team.geometry import matrix_of
from terminal import colift

numbers = st.floats(-1e3, 1e3)
vectors = st.tuples(numbers, numbers, numbers)
SEA = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From east, north, up to north, east, down."""
DOWN = np.diag([1.0, -1.0, -1.0])
"""From forward, left, up to forward, right, down."""


@given(vectors)
def test_vectors_are_turned_exactly_and_come_back_in_every_bit(v):
    assert np.array_equal(frames.world(v), SEA @ v)
    assert np.array_equal(frames.body(v), DOWN @ v)
    assert np.array_equal(frames.world(frames.world(v)), v)
    assert np.array_equal(frames.body(frames.body(v)), v)


@given(st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_attitudes_turn_the_same_vectors(q):
    q = np.array(q) / np.linalg.norm(q)
    there = frames.attitude(q)
    assert there[0] >= 0.0
    # A vector of their body, in their world: by way of our axes, or by their attitude.
    np.testing.assert_allclose(matrix_of(there), SEA @ matrix_of(q) @ DOWN, atol=1e-12)
    np.testing.assert_allclose(matrix_of(frames.attitude(there)), matrix_of(q), atol=1e-12)


def test_level_and_eastward_is_a_heading_of_90_degrees():
    np.testing.assert_allclose(frames.attitude([1.0, 0.0, 0.0, 0.0]), np.sqrt([0.5, 0, 0, 0.5]))
    assert frames.yaw(0.0) == pytest.approx(0.5 * math.pi)
    assert frames.yaw(0.5 * math.pi) == 0.0


@given(st.floats(-10.0, 10.0))
def test_headings_come_back_within_half_a_turn(angle):
    assert abs(frames.yaw(angle)) <= math.pi
    assert math.remainder(frames.yaw(frames.yaw(angle)) - angle, math.tau) == pytest.approx(
        0.0, abs=1e-9
    )


@pytest.mark.parametrize("convention", CONVENTIONS.values(), ids=CONVENTIONS)
def test_a_thrust_of_its_own_weight_is_where_it_hovers(convention):
    assert normalised(4.9, 4.9, convention.hover) == convention.hover
    assert newtons(convention.hover, 4.9, convention.hover) == pytest.approx(4.9)
    assert normalised(-1.0, 4.9, 0.5) == 0.0
    assert normalised(99.0, 4.9, 0.5) == 1.0


def test_an_attitude_target_has_no_rates():
    told = attitude_target(1.5, [1.0, 0.0, 0.0, 0.0], 0.4)
    assert told["type_mask"] == 0b111
    assert (told["time_boot_ms"], told["thrust"]) == (1500, 0.4)


@pytest.mark.parametrize(
    ("given_of", "mask"),
    [
        (("position", "velocity", "acceleration"), 0b1000_0000_0000),
        (("position", "velocity"), 0b1001_1100_0000),
        (("position",), 0b1001_1111_1000),
        (("velocity",), 0b1001_1100_0111),
        (("acceleration",), 0b1000_0011_1111),
    ],
)
def test_a_position_target_says_what_is_left_out(given_of, mask):
    told = position_target(0.0, 0.0, **{name: [1.0, 2.0, 3.0] for name in given_of})
    assert told["type_mask"] == mask
    assert told["coordinate_frame"] == 1
    if "position" in given_of:
        assert (told["x"], told["y"], told["z"]) == (2.0, 1.0, -3.0)
    assert told["yaw"] == pytest.approx(0.5 * math.pi)


mavlink = pytest.importorskip("pymavlink.dialects.v20.common", reason="needs the extra mavlink")


def test_masks_and_modes_are_those_of_the_protocol():
    every = (
        mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
        | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
        | mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
    )
    assert attitude_target(0.0, [1.0, 0.0, 0.0, 0.0], 0.5)["type_mask"] == every
    only_yaw_rate = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    whole = position_target(0.0, 0.0, np.zeros(3), np.zeros(3), np.zeros(3))
    assert whole["type_mask"] == only_yaw_rate
    assert whole["coordinate_frame"] == mavlink.MAV_FRAME_LOCAL_NED
    assert CONVENTIONS["px4"].autopilot == mavlink.MAV_AUTOPILOT_PX4
    assert CONVENTIONS["ardupilot"].autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert mavlink.MAV_CMD_DO_SET_MODE == 176


class _Flight:
    """A station and simulated vehicles, cycle by cycle."""

    def __init__(self, name="hover", autopilot="px4", target="position", **overrides):
        from colift.deploy.mavlink import peer, station

        self.period = station.PERIOD
        mission, _ = station.for_vehicles(name, overrides)
        self.station = station.over_udp(
            mission, CONVENTIONS[autopilot], "127.0.0.1", 0, target=target
        )
        self.world = peer.World(
            load_mission(name, overrides), self.station.addresses, CONVENTIONS[autopilot]
        )
        self.cycle = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.station.close()
        self.world.close()

    def step(self):
        self.cycle += 1
        self.world.step(self.cycle * self.period, self.period)
        return self.station.step(self.cycle * self.period)

    def fly(self, until=math.inf):
        while self.station.flight.time < until and self.step():
            pass
        return self.station.flight

    def away(self):
        bus = self.station.flight.bus
        return float(np.linalg.norm(bus.load[0] - bus.reference[0]))


DEFAULT = {
    "allocation": {"kind": "safe", "min_angle_deg": 30.0},
    "load_control": {"kind": "balance"},
    "position_control": {"kind": "formation"},
    "observation": {"kind": "momentum"},
    "timing.load_control": 0.01, "timing.allocation": 0.01, "timing.position_control": 0.01,
}  # fmt: skip


@pytest.mark.parametrize("autopilot", CONVENTIONS)
@pytest.mark.parametrize("target", ["position", "attitude"])
def test_vehicles_carry_the_load_by_set_points(autopilot, target):
    with _Flight(
        autopilot=autopilot, target=target, **DEFAULT, **{"timing.duration": 5.0}
    ) as flown:
        flight = flown.fly()
        assert flight.outcome == "completed"
        assert flight.drones == [0, 1, 2, 3]
        assert flown.away() < 0.02
        flown.world.step(1e3, flown.period)
        assert not any(peer.obeys for peer in flown.world.peers)  # each holds its place by itself


def test_a_vehicle_follows_only_after_a_second_of_set_points():
    with _Flight() as flown:
        while not any(peer.obeys for peer in flown.world.peers):
            flown.step()
        assert flown.cycle * flown.period > 1.0
        assert not flown.station.flying


def test_a_vehicle_that_is_not_heard_any_more_is_left_to_itself_and_the_others_carry_on():
    with _Flight(**DEFAULT, **{"timing.duration": 12.0}) as flown:
        flown.fly(until=3.0)
        silent = flown.world.peers[1]
        silent.silent = True
        flight = flown.fly(until=5.0)
        assert flight.drones == [0, 2, 3]
        ((at, drone),) = flight.membership.found
        assert drone == 1
        assert at == pytest.approx(3.5, abs=0.1)
        assert not silent.obeys  # nobody tells it anything: it holds
        assert silent.armed
        assert flight.outcome == "completed"


def test_a_load_that_is_not_tracked_any_more_ends_the_flight_and_all_hold():
    with _Flight() as flown:
        flown.fly(until=1.0)
        flown.world.tracked = False
        flight = flown.fly(until=3.0)
        assert flight.outcome.startswith("the load was not tracked any more at t = 1.")
        flown.world.step(1e3, flown.period)
        assert not any(peer.obeys for peer in flown.world.peers)


def test_a_station_that_was_held_up_hands_all_back():
    with _Flight() as flown:
        flown.fly(until=1.0)
        flown.cycle += 40
        assert not flown.step()
        assert flown.station.flight.outcome.startswith("the station was held up for 0.8")


def test_nobody_arms_who_is_not_at_its_place():
    with _Flight() as flown:
        position, *rest = flown.world._state[2]
        flown.world._state[2] = (position + [0.0, 1.0, 0.0], *rest)
        with pytest.raises(ColiftError, match=r"not at their places.*drone 2 is at"):
            flown.fly()
        assert not any(peer.armed for peer in flown.world.peers)


def test_who_is_not_heard_is_named():
    with _Flight() as flown:
        flown.world.peers[3].silent = True
        with pytest.raises(ColiftError, match="nothing was heard of drone 3 within 30 s"):
            flown.fly()


def test_noise_on_the_port_changes_nothing():
    with (
        _Flight(**{"timing.duration": 1.0}) as flown,
        socket.socket(type=socket.SOCK_DGRAM) as other,
    ):
        noise = np.random.default_rng(3)
        while flown.step():
            for address in flown.station.addresses:
                other.sendto(noise.bytes(40), address)
        assert flown.station.flight.outcome == "completed"
        assert flown.away() < 0.06


def test_a_port_in_use_is_told():
    from colift.deploy.mavlink import station

    mission, _ = station.for_vehicles("hover", {})
    with socket.socket(type=socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(ColiftError, match=f"UDP port {port}"):
            station.over_udp(mission, CONVENTIONS["px4"], "127.0.0.1", port)


def test_the_command_flies_simulated_vehicles(tmp_path):
    done = colift(
        "offboard", "hover", "--simulate", "--set", "timing.duration=1", "--no-report", "--out", "flown", "--json", folder=tmp_path, check=True,
    )  # fmt: skip
    assert json.loads(done.stdout)["outcome"] == "completed"
    assert (tmp_path / "flown" / "recording.h5").is_file()
    refused = colift("offboard", "take-off", "--simulate", folder=tmp_path)
    assert refused.returncode == 2


def test_without_the_package_it_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    monkeypatch.delitem(sys.modules, "colift.deploy.mavlink.link", raising=False)
    with pytest.raises(MissingExtraError, match=r"pymavlink.*pip install"):
        importlib.import_module("colift.deploy.mavlink.link")
