"""Logs of PX4 and ArduPilot, written as the formats are documented and read by way of their own readers."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from colift.deploy.mavlink import frames
from colift.errors import FlightDataError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record.importing import import_flight
from colift.study.judge import judge, open_flight
from terminal import colift


@pytest.fixture(scope="module")
def flown():
    return Flight(load_mission("paper-spiral", {"timing.duration": 6.0})).run()


def _told(of, i):
    """What the autopilot of a drone knows, in its axes, by the importer's names."""
    return {
        "position": frames.world(of["positions"][:, i]), "velocity": frames.world(of["velocities"][:, i]),
        "attitude": frames.attitude(of["attitudes"][:, i]), "rates": frames.body(of["rates"][:, i]),
        "load": frames.world(of["load"][:, 0]), "load_v": frames.world(of["load"][:, 1]),
        "share": frames.world(-of["desired_tensions"][:, i, None] * of["desired_directions"][:, i]),
        "force": frames.world(of["force"]),
    }  # fmt: skip


def write_ulog(path, of, i, *, leave_out=()):
    """As docs.px4.io documents the file: header, formats, subscriptions, data."""

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    topics = {
        "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;",
        "vehicle_attitude": "float[4] q;",
        "vehicle_angular_velocity": "float[3] xyz;",
        "debug_vect": "float x;float y;float z;char[10] name;uint8_t[2] _padding0;",
    }  # fmt: skip
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    out += [
        message("F", f"{name}:uint64_t timestamp;{fields}".encode())
        for name, fields in topics.items()
    ]
    out += [message("A", struct.pack("<BH", 0, k) + name.encode()) for k, name in enumerate(topics)]
    told = _told(of, i)
    begin = 5_000_000 + 1_234_000 * i  # every vehicle has been on for another time
    for row, time in enumerate(of.time):
        at = begin + round(1e6 * time)
        rows = [
            (0, struct.pack("<6f", *told["position"][row], *told["velocity"][row])),
            (1, struct.pack("<4f", *told["attitude"][row])),
            (2, struct.pack("<3f", *told["rates"][row])),
        ]  # fmt: skip
        rows += [
            (3, struct.pack("<3f10s", *told[name][row], name.encode()))
            for name in ("load", "load_v", "share", "force") if row % 4 == 0 and name not in leave_out
        ]  # fmt: skip
        out += [message("D", struct.pack("<HQ", k, at) + body) for k, body in rows]
    path.write_bytes(b"".join(out))
    return path


FORMATS = {
    "XKF1": (60, "QBffffff", "TimeUS,C,PN,PE,PD,VN,VE,VD"),
    "XKQ": (61, "QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "ATT": (62, "Qfff", "TimeUS,Roll,Pitch,Yaw"),
    "IMU": (63, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ"),
    "LOAD": (64, "Qffffff", "TimeUS,N,E,D,VN,VE,VD"),
    "SHAR": (65, "Qfff", "TimeUS,N,E,D"),
    "FORC": (66, "Qfff", "TimeUS,N,E,D"),
}


def write_bin(path, of, i, *, leave_out=()):
    """DataFlash: messages that begin with A3 95 and their type; FMT (128) says what each holds."""

    def described(kind, length, name, layout, labels):
        return b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", kind, length, name.encode(), layout.encode(), labels.encode()
        )

    def size(layout):
        return 3 + struct.calcsize("<" + layout)

    out = [described(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    out += [
        described(k, size(layout), name, layout, labels)
        for name, (k, layout, labels) in FORMATS.items()
    ]
    told = _told(of, i)
    for row, time in enumerate(of.time):
        at = 9_000_000 + 777_000 * i + round(1e6 * time)
        w, x, y, z = told["attitude"][row]
        angles = np.degrees(
            [
                np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                np.arcsin(2 * (w * y - z * x)),
                np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
            ]
        )
        values = {
            "XKF1": [0, *told["position"][row], *told["velocity"][row]], "XKQ": [0, *told["attitude"][row]], "ATT": angles,
            "IMU": [0, *told["rates"][row]], "LOAD": [*told["load"][row], *told["load_v"][row]], "SHAR": told["share"][row], "FORC": told["force"][row],
        }  # fmt: skip
        for name, row_of in values.items():
            kind, layout, _ = FORMATS[name]
            if name not in leave_out:
                out.append(b"\xa3\x95" + bytes([kind]) + struct.pack("<" + layout, at, *row_of))
            if name == "XKF1":  # a second core that thinks otherwise
                out.append(
                    b"\xa3\x95" + bytes([kind]) + struct.pack("<" + layout, at, 1, *[9.0] * 6)
                )
    path.write_bytes(b"".join(out))
    return path


@pytest.mark.parametrize(
    ("write", "suffix", "needs", "kind"),
    [(write_ulog, "ulg", "pyulog", "ulog"), (write_bin, "bin", "pymavlink", "ardupilot")],
)  # fmt: skip
def test_a_flight_comes_back_from_the_logs_of_its_drones(
    write, suffix, needs, kind, flown, tmp_path
):
    pytest.importorskip(needs, reason=f"the package {needs} is not installed (extra logs)")
    paths = [write(tmp_path / f"drone_{i}.{suffix}", flown, i) for i in range(4)]
    found = import_flight(paths)
    assert found.n == 4
    assert [each["format"] for each in found.provenance["files"]] == [kind] * 4
    middle = np.argmin(np.linalg.norm(flown["load"][:, 0] - found["load"][600, 0], axis=1))
    rows = np.arange(len(found.time)) + middle - 600  # the first rows are not in all logs
    assert 0 <= rows[0] < 3
    for name, off in (("positions", 2e-3), ("velocities", 5e-3), ("attitudes", 5e-3), ("rates", 0.03), ("load", 2e-3), ("directions", 5e-3)):  # fmt: skip
        apart = np.abs(found[name] - flown[name][rows])
        assert np.nanmax(apart) < off, name
        assert np.isnan(apart).mean() < 0.01, name
    assert np.nanmax(np.abs(found["force"] - flown["force"][rows])) < 0.05
    assert np.nanmax(np.abs(found["desired_tensions"] - flown["desired_tensions"][rows])) < 0.02
    answers = {row.allocator: row.numbers for row in judge(found, ["sqp"], {}).answers}
    known = {row.allocator: row.numbers for row in judge(flown, ["sqp"], {}).answers}
    for name in ("on board", "sqp"):
        assert answers[name]["min_angle_deg"] == pytest.approx(known[name]["min_angle_deg"], abs=0.5)  # fmt: skip


def test_angles_do_where_there_is_no_quaternion(flown, tmp_path):
    pytest.importorskip("pymavlink")
    whole = import_flight([write_bin(tmp_path / "whole.bin", flown, 0)])
    angles = import_flight([write_bin(tmp_path / "angles.bin", flown, 0, leave_out=("XKQ",))])
    np.testing.assert_allclose(angles["attitudes"], whole["attitudes"], atol=1e-5)


def test_what_is_missing_is_named(flown, tmp_path):
    pytest.importorskip("pymavlink")
    pytest.importorskip("pyulog")
    path = write_ulog(tmp_path / "a.ulg", flown, 0, leave_out=("load",))
    with pytest.raises(FlightDataError, match=r'a\.ulg: tells no place of the load: there is no debug_vect with the name "load"'):  # fmt: skip
        import_flight([path])
    path = write_bin(tmp_path / "b.bin", flown, 0, leave_out=("LOAD",))
    with pytest.raises(FlightDataError, match=r"b\.bin: tells no place of the load: there is no message LOAD"):  # fmt: skip
        import_flight([path])
    torn = tmp_path / "torn.ulg"
    torn.write_bytes(path.with_name("a.ulg").read_bytes()[:30])
    with pytest.raises(FlightDataError, match=r"torn\.ulg: "):
        import_flight([torn])


def test_the_command_judges_them(flown, tmp_path):
    pytest.importorskip("pyulog")
    path = write_ulog(tmp_path / "alone.ulg", flown, 0)
    assert open_flight(path).n == 1
    done = colift("import", "alone.ulg", "--out", "flight.h5", folder=tmp_path, check=True)
    assert "1 drones" in done.stdout
