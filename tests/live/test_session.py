"""What a session does, without a network and by a clock that stands still unless the test turns it."""

from __future__ import annotations

import itertools
import threading
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.mission.load import load_mission
from colift.record import metrics
from colift.record.recording import Recording
from colift.show.live import session as module
from colift.show.live.pilot import Pilot
from colift.team.geometry import matrix_of, pairwise_angles


def last(hand):
    return hand.session.rows(0)[0][-1].signals


def marks(hand, kind="command"):
    return [mark["text"] for mark in hand.session.events(0)[0] if mark["kind"] == kind]


# ---------------------------------------------------------------- the clock


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_it_flies_with_the_clock(start, speed):
    hand = start(speed=speed)
    hand.fly(3.0)
    assert hand.session.flight.time == pytest.approx(3.0 * speed, abs=0.05)
    assert hand.session.state["speed"] == pytest.approx(speed, rel=0.05)
    assert hand.session.state["lag"] == 0.0


def test_a_tick_flies_one_stretch_at_most(start):
    hand = start()
    for k in range(50):
        hand.session.tick(100.0 + 7.0 * k)
    assert hand.session.flight.time == pytest.approx(50 * module.STRETCH)


def test_a_delay_is_made_up_for_only_so_far_and_reported(start):
    hand = start()
    hand.fly(1.0)
    flown = hand.session.flight.time
    hand.now += 60.0  # the machine slept
    hand.session.tick(hand.now)
    assert 0.2 < hand.session.state["lag"] <= module.MOST_LAG
    hand.fly(1.0)
    assert hand.session.flight.time - flown == pytest.approx(1.0 + module.MOST_LAG, abs=0.06)
    assert hand.session.state["lag"] == 0.0


def test_a_loop_that_is_too_slow_says_so(start):
    hand = start()
    for _ in range(100):
        hand.session.tick(hand.now)
        hand.now += 4.0 * module.STRETCH  # each stretch takes four times as long as it may
    assert hand.session.state["speed"] == pytest.approx(0.25, rel=0.1)
    assert hand.session.state["lag"] > 0.0


def test_it_goes_on_past_the_end_of_the_mission(start):
    hand = start(timing__duration=0.5)
    hand.fly(2.0)
    assert hand.session.flight.time > 1.9


def test_pause_stops_the_flight_and_resume_goes_on_without_catching_up(start):
    hand = start()
    hand.fly(1.0)
    hand.do(lambda s: s.pause(), seconds=5.0)
    flown = hand.session.flight.time
    assert flown == pytest.approx(1.0, abs=0.03)
    assert hand.session.state["paused"]
    hand.do(lambda s: s.resume(), seconds=1.0)
    assert hand.session.flight.time - flown == pytest.approx(1.0, abs=0.06)
    assert not hand.session.state["paused"]


# ---------------------------------------------------------------- knobs and choices


def test_mu_reaches_the_running_allocator(start):
    hand = start("paper-spiral")
    hand.fly(0.5)
    hand.do(lambda s: s.turn("allocation.mu", 0.37))
    assert hand.session.flight.wires.allocation.params[0] == 0.37
    assert hand.session.state["values"]["allocation.mu"] == 0.37
    assert hand.refusals == []


def test_a_gain_is_turned_as_a_whole(start):
    hand = start(load_control__k_p=[4.0, 4.0, 8.0])
    assert hand.session.state["values"]["load_control.k_p"] == 8.0
    hand.do(lambda s: s.turn("load_control.k_p", 16.0))
    assert hand.session.flight.parts["load_control"].k_p == (8.0, 8.0, 16.0)


def test_the_load_grows_heavier_and_the_cables_carry_it(start):
    hand = start()
    hand.do(lambda s: s.turn("load.mass", 0.3), seconds=6.0)
    assert last(hand)["tensions"].sum() > 0.3 * 9.81
    assert hand.session.flight.parts["allocation"].check(hand.session.mission.team) == []


def test_the_least_angle_is_kept_once_it_is_turned_up(start):
    hand = start()
    hand.do(lambda s: s.turn("allocation.min_angle_deg", 50.0), seconds=5.0)
    assert np.degrees(pairwise_angles(last(hand)["desired_directions"])).min() > 49.9


def test_wind_leans_the_formation_into_it(start):
    hand = start()
    (wind,) = [name for name in hand.session.knobs if name.endswith(".speed")]
    hand.do(lambda s: s.turn(wind, 8.0), seconds=4.0)
    assert last(hand)["external"][0] > 0.01
    assert last(hand)["force"][0] < -0.01


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("allocation.mu", 1e4, "between"),
        ("allocation.mu", -1.0, "between"),
        ("allocation.mu", float("nan"), "between"),
        ("plant.step", 0.1, "no knob"),
        ("__class__.mu", 0.1, "no knob"),
        ("allocation.min_angle_deg", 60.0, "conflicts with max_cone_deg"),
    ],
)
def test_a_wrong_turn_is_refused_and_changes_nothing(start, name, value, says):
    hand = start("eight-drones")
    before = dict(hand.session.flight.parts)
    hand.do(lambda s: s.turn(name, value))
    assert len(hand.refusals) == 1
    assert says in hand.refusals[0]
    assert hand.session.flight.parts == before
    assert hand.session.flight.time > 0.1


def test_another_allocator_brings_its_knobs_and_keeps_what_it_shares(start):
    hand = start("paper-spiral")
    generation = hand.session.generation
    assert "allocation.min_angle_deg" not in hand.session.knobs
    hand.do(lambda s: s.turn("allocation.mu", 0.25))
    hand.do(lambda s: s.choose("allocation.kind", "safe"), seconds=0.5)
    assert hand.session.generation > generation
    assert "allocation.min_angle_deg" in hand.session.knobs
    assert hand.session.state["values"]["allocation.kind"] == "safe"
    assert hand.session.flight.parts["allocation"].mu == 0.25
    hand.do(lambda s: s.choose("allocation.kind", "ring"), seconds=0.5)
    assert not [name for name in hand.session.knobs if name.startswith("allocation.")]


@pytest.mark.parametrize(
    "choice", [("allocation.kind", "no-such"), ("plant.kind", "safe"), ("x", "safe")]
)
def test_a_choice_that_is_not_there_is_refused(start, choice):
    hand = start()
    hand.do(lambda s: s.choose(*choice))
    assert "no choice" in hand.refusals[0]


def test_an_allocator_that_the_mission_puts_in_place_brings_its_knobs_too(start):
    events = [{"at": 0.5, "field": "allocation.kind", "value": "sqp"}]
    hand = start(events=events)
    hand.fly(1.0)
    assert hand.session.state["values"]["allocation.kind"] == "sqp"
    assert "allocation.min_angle_deg" not in hand.session.knobs


# ---------------------------------------------------------------- the load and the drones


def test_a_push_moves_the_load_and_it_comes_back(start):
    hand = start()
    hand.fly(1.0)
    hand.do(lambda s: s.push((1.0, 0.0, 0.0), 0.5), seconds=0.4)
    assert last(hand)["external"][0] == pytest.approx(1.0, abs=1e-3)
    hand.fly(8.0)
    rows = hand.session.rows(0)[0]
    away = [row.signals["load"][0] - row.signals["reference"][0] for row in rows]
    assert max(away) > 0.02
    assert abs(away[-1]) < 0.01
    assert last(hand)["external"] == pytest.approx(np.zeros(3), abs=1e-3)


def test_when_a_cable_is_cut_the_others_take_over(start):
    hand = start()
    hand.fly(1.0)
    before = last(hand)["tensions"]
    hand.do(lambda s: s.cut(2), seconds=5.0)
    after = last(hand)
    assert list(np.isnan(after["tensions"])) == [False, False, True, False]
    assert np.isnan(after["positions"][2]).all()
    assert np.nansum(after["tensions"]) == pytest.approx(before.sum(), rel=0.15)
    left = after["directions"][[0, 1, 3]]
    assert np.degrees(pairwise_angles(left)).min() > 35.0
    for drone, says in ((2, "does not fly"), (9, "does not fly")):
        hand.do(lambda s, drone=drone: s.cut(drone))
        assert says in hand.refusals[-1]


def test_the_last_cable_holds(start):
    hand = start()
    hand.do(lambda s: [s.flight.regroup([1])])
    hand.do(lambda s: s.cut(1))
    assert "last cable" in hand.refusals[-1]


def test_the_load_flies_to_a_target_without_a_jump_of_the_reference(start):
    hand = start("paper-spiral", timing__recording=0.001)
    hand.fly(4.0)
    hand.do(lambda s: s.target((0.5, -1.0, 2.0)), seconds=1.0)
    hand.do(lambda s: s.target((1.5, 0.5, 1.5)), seconds=12.0)
    r = hand.session.flight.recording()
    np.testing.assert_allclose(r["load"][-1, 0], (1.5, 0.5, 1.5), atol=0.02)
    # Every row is the integral of the next: position, velocity and acceleration do not jump.
    for row in range(3):
        steps = np.diff(r["reference"][:, row], axis=0)
        mean = 0.5 * (r["reference"][1:, row + 1] + r["reference"][:-1, row + 1])
        np.testing.assert_allclose(steps, 0.001 * mean, atol=2e-5)


def test_steering_ends_by_itself(start):
    hand = start()
    for _ in range(20):
        hand.do(lambda s: s.steer((0.8, 0.0, 0.0)), seconds=0.1)
    assert last(hand)["load"][0] > 0.3
    assert hand.session.flight.bus.reference[1, 0] > 0.5
    hand.fly(6.0)  # nothing more is said
    assert hand.session.flight.bus.reference[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert len([text for text in marks(hand) if text.startswith("Steer")]) == 1


def test_reset_begins_anew_with_what_was_turned(start):
    hand = start("paper-spiral")
    hand.do(lambda s: s.choose("allocation.kind", "safe"))
    hand.do(lambda s: s.turn("allocation.mu", 0.4))
    hand.do(lambda s: s.turn("load.mass", 0.25))
    hand.do(lambda s: s.cut(0))
    hand.do(lambda s: s.target((0.0, 0.0, 3.0)))
    epoch = hand.session.epoch
    hand.do(lambda s: s.reset(), seconds=0.5)
    flight = hand.session.flight
    assert hand.session.epoch == epoch + 1
    assert flight.drones == [0, 1, 2, 3]
    assert flight.time < 0.6
    assert flight.parts["allocation"].mu == 0.4
    assert flight.load_mass == pytest.approx(0.25)
    assert flight.parts["reference"] == hand.session.mission.reference
    assert hand.session.rows(0)[0][0].time < 0.1
    assert marks(hand) == []


def test_a_flight_that_ends_waits_for_a_reset(start):
    wild = {"at": 1.0, "field": "attitude_control.k_d", "value": [500.0] * 3}
    hand = start(events=[wild])
    hand.fly(3.0)
    assert hand.session.flight.outcome != "completed"
    assert hand.session.state["paused"]
    assert any("iverged" in text for text in marks(hand, "outcome"))
    hand.do(lambda s: s.push((1.0, 0.0, 0.0), 0.5))
    assert "reset it" in hand.refusals[0]
    hand.do(lambda s: s.reset(), seconds=0.2)
    assert hand.session.flight.outcome == "completed"


# ---------------------------------------------------------------- what is told, kept and saved


def test_whoever_reads_slowly_misses_rows_and_the_loop_does_not_notice(start):
    quick, slow = start(), start()
    seen = 0
    for hand in (quick, slow):
        for _ in range(200):
            hand.fly(0.02)
            if hand is quick:
                rows, seen = hand.session.rows(seen)
                assert len(rows) <= 2
    assert quick.session.flight.time == slow.session.flight.time
    rows, made = slow.session.rows(0)
    assert len(rows) == made


def test_memory_is_bounded(start, monkeypatch):
    monkeypatch.setattr(module, "KEPT", 2.0)
    hand = start()
    hand.fly(10.0)
    flight = hand.session.flight
    assert flight.time - flight.recording().time[0] < 2.1
    assert sum(len(stretches) for _, _, stretches in flight.snapshot().legs) <= 102
    hand.do(lambda s: s.turn("load.mass", 0.25), seconds=3.0)
    assert hand.session.recording().mission.events[-1].field == "load.mass"


def test_changes_in_quick_succession_are_one_mark(start):
    hand = start()
    for value in np.linspace(0.1, 0.5, 20):
        hand.do(lambda s, value=value: s.turn("allocation.mu", value), seconds=0.05)
    hand.fly(1.0)
    assert marks(hand) == ["Alignment penalty mu 0.5 N^2"]
    assert len(hand.session.recording().mission.events) == 20


def test_commands_wait_in_a_bounded_queue(start):
    hand = start()
    for _ in range(300):
        hand.session.submit(lambda s: s.pause(), hand.refusals.append)
    assert len(hand.refusals) == 300 - 256
    assert set(hand.refusals) == {"too many commands are waiting"}


# ---------------------------------------------------------------- a rigid load


def tilted(hand):
    """Angle between the load's attitude and the wanted one, rad."""
    row = last(hand)
    return 2.0 * np.arccos(min(1.0, abs(row["load_attitude"] @ row["reference_attitude"])))


def test_only_a_rigid_load_has_knobs_that_turn_it(start):
    assert not [name for name in start().session.knobs if name.startswith("reference.")]
    hand = start("box-figure-eight")
    names = [name for name in hand.session.knobs if name.startswith("reference.")]
    assert names == ["reference.roll", "reference.pitch", "reference.yaw"]


def test_a_box_turns_to_the_pose_that_is_asked_for_without_a_jump(start):
    hand = start("box-figure-eight", timing__recording=0.001)
    hand.fly(6.5)  # full speed, rolled, pitched and turned
    hand.do(lambda s: s.turn("reference.yaw", 60.0), seconds=0.5)
    hand.do(lambda s: s.turn("reference.roll", 10.0), seconds=0.5)
    hand.do(lambda s: s.target((0.5, 0.5, 1.2)), seconds=0.5)
    hand.do(lambda s: s.turn("reference.pitch", -8.0), seconds=9.0)
    assert hand.refusals == []
    row = last(hand)
    wanted = Rotation.from_euler("ZYX", [60.0, -8.0, 10.0], degrees=True).as_matrix()
    np.testing.assert_allclose(matrix_of(row["reference_attitude"]), wanted, atol=1e-9)
    assert np.degrees(tilted(hand)) < 0.5
    np.testing.assert_allclose(row["load"], (0.5, 0.5, 1.2), atol=0.01)
    values = hand.session.state["values"]
    assert [values[f"reference.{name}"] for name in ("roll", "pitch", "yaw")] == pytest.approx(
        [10.0, -8.0, 60.0]
    )
    r = hand.session.flight.recording()
    q, rates = r["reference_attitude"], r["reference_rates"]
    turned = 2.0 * np.sqrt(np.maximum(0.0, 1.0 - np.sum(q[1:] * q[:-1], axis=1) ** 2))
    assert turned.max() < 0.001 * np.radians(80.0)  # at full speed the eight turns at 60 deg/s
    for k in range(2):
        steps = np.diff(rates[:, k], axis=0)
        mean = 0.5 * (rates[1:, k + 1] + rates[:-1, k + 1])
        np.testing.assert_allclose(steps, 0.001 * mean, atol=2e-5)


@pytest.mark.parametrize("when", [1.0, 6.8, 8.4, 10.0])
def test_a_box_in_any_motion_is_taken_over_gently(start, when):
    hand = start("box-figure-eight", timing__duration=100.0)
    hand.fly(when)
    hand.do(lambda s: s.turn("reference.yaw", 60.0), seconds=0.5)
    hand.do(lambda s: s.turn("reference.roll", 12.0), seconds=8.0)
    r = hand.session.flight.recording()
    assert np.degrees(np.linalg.norm(metrics.attitude_error(r), axis=1)).max() < 2.0
    assert np.linalg.norm(metrics.tracking_error(r), axis=1).max() < 0.03
    assert r["slack_times"].max() == 0.0


def test_yaw_goes_the_shorter_way_round(start):
    hand = start("box-figure-eight")
    hand.fly(0.5)
    for value in (170.0, -170.0):
        hand.do(lambda s, value=value: s.turn("reference.yaw", value), seconds=9.0)
    wanted = hand.session.flight.parts["reference"].attitude_deg
    assert wanted[2] == pytest.approx(190.0)
    assert hand.session.state["values"]["reference.yaw"] == pytest.approx(-170.0)


def test_a_box_that_loses_a_drone_by_hand_leans_and_goes_on_without_roll(start):
    hand = start("box-through-poses", timing__duration=100.0)
    hand.do(lambda s: s.turn("reference.roll", 0.0), seconds=4.0)
    hand.do(lambda s: s.cut(1), seconds=8.0)
    assert np.degrees(hand.session.flight.membership.outlook.lean) == pytest.approx(10.0, abs=0.5)
    assert np.isnan(last(hand)["tensions"][1])
    assert np.degrees(tilted(hand)) < 2.0
    assert any("leaning by 10 degrees" in text for text in marks(hand, "change"))
    hand.do(lambda s: s.turn("reference.yaw", 20.0), seconds=6.0)
    assert hand.refusals == []
    assert np.degrees(tilted(hand)) < 2.0


def test_a_box_flown_by_hand_flies_again_exactly_as_it_was_flown(start):
    hand = start("box-figure-eight")
    for command in (
        lambda s: s.turn("reference.yaw", -30.0),
        lambda s: s.steer((0.3, 0.0, 0.0)),
        lambda s: s.turn("reference.pitch", 5.0),
        lambda s: s.target((0.2, 0.1, 1.1)),
    ):
        hand.do(command, seconds=0.7)
    saved = hand.session.recording()
    again = Flight(load_mission(saved.mission.resolved())).run()
    for name in ("load", "load_attitude", "reference_attitude", "tensions"):
        np.testing.assert_array_equal(again[name], saved[name], err_msg=name)


COMMANDS = (
    lambda s: s.turn("allocation.mu", 0.3),
    lambda s: s.push((0.5, 0.2, 0.0), 0.4),
    lambda s: s.choose("allocation.kind", "safe"),
    lambda s: s.steer((0.4, 0.0, 0.1)),
    lambda s: s.turn("load.mass", 0.26),
    lambda s: s.target((1.0, 1.0, 1.8)),
    lambda s: s.turn("position_control.k_p", 50.0),
    lambda s: s.cut(3),
)


def test_a_saved_flight_flies_again_exactly_as_it_was_flown(start, tmp_path):
    hand = start("paper-spiral")
    for command in COMMANDS:
        hand.do(command, seconds=0.7)
    hand.fly(1.0)
    hand.do(lambda s: s.save())
    said = hand.session.end(save=False)
    assert hand.refusals == []
    saved = Recording.load(said.removeprefix("Saved "))
    assert [text for _, text in saved.commands][:2] == [
        "Alignment penalty mu 0.3 N^2", "Push of 0.539 N for 0.4 s",
    ]  # fmt: skip
    times = [time for time, _ in saved.commands]
    assert times == sorted(times)
    again = Flight(load_mission(saved.mission.resolved())).run()
    assert len(again.time) == len(saved.time) > 1000
    for name in ("load", "reference", "tensions", "attitudes", "allocator_iterations"):
        np.testing.assert_array_equal(again[name], saved[name], err_msg=name)


def test_faults_at_a_random_time_stay_where_they_were_drawn(start):
    hand = start(fault=[{"kind": "cable-cut"}], timing__duration=2.0)
    hand.fly(4.0)
    saved = hand.session.recording()
    again = Flight(load_mission(saved.mission.resolved())).run()
    assert saved.mission.timing.duration > 3.5
    assert saved["attached"].min() == 0.0
    np.testing.assert_array_equal(again["attached"], saved["attached"])


def test_nothing_is_saved_before_something_was_flown(start):
    hand = start()
    with pytest.raises(ColiftError, match="nothing to save"):
        hand.session.recording()


@pytest.mark.timeout(60)
def test_a_disk_that_is_full_does_not_end_the_flight(start):
    def full(recording):
        raise OSError("No space left on device")

    hand = start(write=full)
    hand.fly(1.0)
    hand.do(lambda s: s.save())
    while not marks(hand, "fault"):
        time.sleep(0.01)
    assert any("No space left" in text for text in marks(hand, "fault"))
    hand.fly(0.5)
    assert hand.session.flight.time > 1.5


# ---------------------------------------------------------------- the thread


class Ticks:
    """Stands in for a session: counts its ticks and then does what it is told."""

    def __init__(self, then):
        self.count = itertools.count(1)
        self.then = then
        self.ticks = 0

    def tick(self, now):
        self.ticks = next(self.count)
        if self.ticks == 5:
            self.then()
        return 0.0


def test_the_thread_keeps_an_error_and_says_that_it_has_ended():
    ended = threading.Event()

    def fail():
        raise RuntimeError("a part broke")

    pilot = Pilot(Ticks(fail), ended.set)
    pilot.start()
    assert ended.wait(30.0)
    pilot.stop()
    assert str(pilot.error) == "a part broke"


def test_the_thread_stops_when_it_is_told():
    flying, ended = threading.Event(), []
    session = Ticks(flying.set)
    pilot = Pilot(session, lambda: ended.append(True))
    pilot.start()
    assert flying.wait(30.0)
    assert ended == []
    pilot.stop()
    seen = session.ticks
    time.sleep(0.05)
    assert session.ticks == seen >= 5
    assert (ended, pilot.error) == ([True], None)
