"""Recordings as bags of ROS 2, and back."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from colift.errors import ColiftError, FlightDataError, MissingExtraError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record.exchange import bag
from colift.record.exchange.foxglove import layout, write_layout
from colift.record.importing import import_flight
from colift.study.judge import judge, open_flight
from terminal import colift

pytest.importorskip("rosbags", reason="the package rosbags is not installed (extra bags)")

from rosbags.highlevel import AnyReader

SAME = ("load", "positions", "velocities", "attitudes", "rates", "force", "desired_tensions", "desired_directions", "directions")  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    return Flight(load_mission("noisy-spiral", {"timing.duration": 3.0})).run()


@pytest.fixture(scope="module")
def written(flown, tmp_path_factory):
    return bag.write_bag(flown, tmp_path_factory.mktemp("bags") / "spiral.mcap")


@pytest.mark.parametrize("name", ["flight.mcap", "flight"])
def test_what_is_written_is_read_back(name, flown, tmp_path):
    path = bag.write_bag(flown, tmp_path / name)
    assert (path / "metadata.yaml").is_file() == path.is_dir() == (name == "flight")
    assert [each.name for each in tmp_path.iterdir()] == [name]
    found = import_flight([path])
    assert found.provenance["files"][0]["format"] == "mcap"
    assert found.provenance["findings"] == []
    assert found.time == pytest.approx(flown.time, abs=1e-9)
    for signal in SAME:
        assert found[signal] == pytest.approx(flown[signal], abs=1e-9), signal
    assert found["reference"][:, :2] == pytest.approx(flown["reference"][:, :2], abs=1e-9)


def test_allocators_answer_a_bag_as_they_answer_its_recording(flown, written):
    of_bag = judge(open_flight(written), ["sqp"], {})
    of_recording = judge(flown, ["sqp"], {})
    assert [row.allocator for row in of_bag.answers] == ["on board", "actual", "sqp"]
    for row, known in zip(of_bag.answers, of_recording.answers, strict=True):
        if row.allocator == "actual":  # real cables have no sensors
            continue
        for each in ("min_angle_deg", "tension_ratio", "peak_total_tension_N"):
            assert row.numbers[each] == pytest.approx(known.numbers[each], rel=1e-6)


def test_messages_bring_their_definitions_and_come_in_the_order_of_time(flown, written):
    with AnyReader([written]) as reader:  # knows no definition but those in the bag
        kinds = {each.topic: each.msgtype for each in reader.connections}
        assert kinds["/colift/load/odometry"] == "nav_msgs/msg/Odometry"
        assert kinds["/colift/drone_3/setpoint"] == "sensor_msgs/msg/Imu"
        assert kinds["/tf"] == "tf2_msgs/msg/TFMessage"
        counts = {each.topic: each.msgcount for each in reader.connections}
        assert counts["/tf"] == counts["/colift/drone_0/cable_command"] == len(flown.time)
        assert counts["/colift/robot_description"] == 1
        (frames,) = (each for each in reader.connections if each.topic == "/tf")
        _, at, data = list(reader.messages([frames]))[100]
        message = reader.deserialize(data, frames.msgtype)
        places = {each.child_frame_id: each.transform.translation for each in message.transforms}
        assert at == round(flown.time[100] * 1e9)
        place = places["drone_2"]
        assert [place.x, place.y, place.z] == pytest.approx(flown["positions"][100, 2])
        end = places["cable_2"]
        assert [end.x, end.y, end.z] == pytest.approx(flown["load"][100, 0])
    offsets = [each[0] for each in chunks(written)]
    assert offsets == sorted(offsets)


def test_another_reader_finds_schemas_and_an_index(flown, written):
    reader = pytest.importorskip("mcap.reader", reason="the package mcap is not installed")
    with written.open("rb") as file:
        summary = reader.make_reader(file).get_summary()
    assert {each.encoding for each in summary.schemas.values()} == {"ros2msg"}
    assert all(each.data for each in summary.schemas.values())
    assert {each.message_encoding for each in summary.channels.values()} == {"cdr"}
    assert summary.statistics.message_end_time == round(flown.time[-1] * 1e9)
    assert summary.chunk_indexes


def chunks(path):
    """First and last time of each chunk of a file of MCAP."""
    from rosbags.rosbag2 import Reader

    with Reader(path) as reader:
        return [(c.message_start_time, c.message_end_time) for c in reader.storage.chunks]


def test_a_drone_that_has_left_says_nothing_any_more(tmp_path):
    recording = Flight(load_mission("four-to-three", {"timing.duration": 8.0})).run()
    gone = np.isnan(recording["positions"][:, :, 0])
    assert gone.any()
    found = import_flight([bag.write_bag(recording, tmp_path / "lost.mcap")])
    assert (np.isnan(found["positions"][:, :, 0]) == gone).mean() > 0.99
    assert found["load"] == pytest.approx(recording["load"], abs=1e-9)


def say(path, *topics, frame="world"):
    """A bag with odometry of these topics, at these times each."""
    with bag.writing(path) as writer:
        for name, times in topics:
            for k, time in enumerate(times):
                at = round(time * 1e9)
                stamp = {"sec": at // 10**9, "nanosec": at % 10**9}
                fields = {
                    "header": {"stamp": stamp, "frame_id": frame},
                    "pose": {
                        "pose": {
                            "position": {
                                "x": time,
                                "y": float(name.split("/")[2][-1] == "1"),
                                "z": float("drone" in name),
                            },
                            "orientation": {"w": 1.0},
                        }
                    },
                    "twist": {"twist": {"linear": {"x": 1.0}}},
                }
                writer.say(name, "nav_msgs/msg/Odometry", k * 10**8, fields)
    return path


def test_topics_of_other_namespaces_frames_and_rates_are_read(tmp_path):
    slow, fast = np.arange(0.0, 2.0, 0.1), np.arange(0.0, 2.0, 0.05)
    path = say(
        tmp_path / "field.mcap",
        ("/team_7/load/odometry", fast), ("/team_7/drone_0/odometry", slow), ("/team_7/drone_1/odometry", slow[:10]),
        frame="map",
    )  # fmt: skip
    found = import_flight([path])
    assert found.n == 2
    assert found["load"][:, 0, 0] == pytest.approx(fast)
    assert found["positions"][:, 0, 0] == pytest.approx(np.repeat(slow, 2))
    known = ~np.isnan(found["positions"][:, 1, 0])
    assert found.time[known].max() == pytest.approx(0.9 + 0.15)  # 1.5 periods after the last word


def test_bags_without_a_flight_are_refused(tmp_path, written):
    times = np.arange(0.0, 1.0, 0.01)
    bad = say(tmp_path / "load.mcap", ("/colift/load/odometry", times))
    with pytest.raises(
        FlightDataError, match=r"load\.mcap: has no topic that ends in drone_0/odometry"
    ):
        import_flight([bad])
    other = say(tmp_path / "other.mcap", ("/robot/odom", times))
    with pytest.raises(
        FlightDataError, match=r"other\.mcap: has no topic of a team; there are /robot/odom"
    ):
        import_flight([other])
    both = [0.0, 0.1, 0.2, 0.0, 0.1]
    twice = say(tmp_path / "twice.mcap", ("/a/load/odometry", both), ("/a/drone_0/odometry", both))
    with pytest.raises(FlightDataError, match=r"twice\.mcap: time goes back to 0\.000 s"):
        import_flight([twice])
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(written.read_bytes()[:-5000])
    with pytest.raises(FlightDataError, match=r"cut\.mcap: cannot be read as a bag"):
        import_flight([cut])
    named = tmp_path / "named.bin"
    named.write_bytes(written.read_bytes())
    with pytest.raises(
        FlightDataError, match=r"named\.bin: the name of a bag's file must end in \.mcap"
    ):
        import_flight([named])


def test_a_bag_is_whole_or_not_there(flown, written, tmp_path, monkeypatch):
    with pytest.raises(ColiftError, match="is there already"):
        bag.write_bag(flown, written)
    calls = 0

    def interrupt(_: float) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bag.write_bag(flown, tmp_path / "half.mcap", interrupt)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(MissingExtraError, match=r"the extra bags; run: .*pip install"):
        bag.write_bag(flown, tmp_path / "none.mcap")


def test_a_layout_asks_for_what_the_bag_has(flown, written, tmp_path):
    """Each path of a panel leads to a number in a message of the bag, each topic and frame is there."""
    path = write_layout(bag.topics_of(flown), flown.n, tmp_path / "spiral.mcap")
    assert path.name == "spiral.foxglove.json"
    made = json.loads(path.read_text())
    panels = made["configById"]
    placed, todo = set(), [made["layout"]]
    while todo:
        each = todo.pop()
        if isinstance(each, str):
            placed.add(each)
        else:
            assert each["direction"] in ("row", "column")
            todo += [each["first"], each["second"]]
    assert placed == set(panels)
    assert [name.split("!")[0] for name in panels] == ["3D"] + ["Plot"] * 3 + ["DiagnosticSummary"]
    with AnyReader([written]) as reader:
        assert {each.topic for each in reader.connections} == bag.topics_of(flown)
        first = {}
        for connection, _, data in reader.messages():
            if connection.topic not in first:
                first[connection.topic] = reader.deserialize(data, connection.msgtype)
    space = panels["3D!team"]
    assert {space["layers"]["team"]["topic"], *space["topics"]} <= set(first)
    frames = {each.child_frame_id for each in first["/tf"].transforms}
    assert space["followTf"] in frames
    assert {each.header.frame_id for each in first["/tf"].transforms} == {space["fixedFrame"]}
    paths = [each["value"] for panel in panels.values() for each in panel.get("paths", ())]
    assert len(paths) == 6 + 3 * flown.n
    for value in paths:
        topic, _, names = value.partition(".")
        found = first[topic]
        for name in names.split("."):
            found = getattr(found, name)
        assert isinstance(found, float)


def test_a_layout_leaves_out_panels_without_topics():
    made = layout({"/colift/load/odometry", "/tf"}, 2)
    assert list(made["configById"]) == ["3D!team", "Plot!load"]
    assert len(made["configById"]["Plot!load"]["paths"]) == 3
    assert layout({"/tf"}, 2)["layout"] == "3D!team"


def test_the_commands(flown, tmp_path):
    recording = flown.save(tmp_path / "flight.h5")
    done = colift("export", "bag", str(recording), "--json", folder=tmp_path, check=True)
    assert json.loads(done.stdout)["files"] == ["flight.mcap", "flight.foxglove.json"]
    assert json.loads((tmp_path / "flight.foxglove.json").read_text())["configById"]
    judged = colift(
        "judge", "flight.mcap", "--allocators", "sqp", "--out", "judged", "--no-report", folder=tmp_path, check=True
    )  # fmt: skip
    assert "flight: 4 drones, 3.0 s" in judged.stdout
    assert Path(tmp_path / "judged" / "judgement.json").is_file()
