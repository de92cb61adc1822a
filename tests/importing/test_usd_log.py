"""Micro-SD logs: what the documented layout holds is read back, what is damaged is refused."""

from __future__ import annotations

import contextlib
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_flights import flight_columns, usd_bytes, usd_log

from colift.errors import FlightDataError
from colift.record.importing import read
from colift.record.importing.usd_log import decode

TIME = np.arange(300) * 0.01
RANGES = {"b": (-128, 127), "B": (0, 255), "h": (-(2**15), 2**15 - 1), "H": (0, 2**16 - 1),
          "i": (-(2**31), 2**31 - 1), "I": (0, 2**32 - 1)}  # fmt: skip


def sealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


@settings(deadline=None)
@given(data=st.data(), version=st.sampled_from([1, 2]), other=st.booleans())
def test_every_type_comes_back(data: st.DataObject, version: int, other: bool) -> None:
    kinds = data.draw(st.lists(st.sampled_from("bBhHiIef"), min_size=1, max_size=9))
    value = {k: st.integers(*RANGES[k]) if k in RANGES else st.floats(width=16 if k == "e" else 32, allow_nan=False) for k in kinds}  # fmt: skip
    rows = [
        (stamp, [data.draw(value[k]) for k in kinds])
        for stamp in data.draw(st.lists(st.integers(0, 2**32 - 1), max_size=4))
    ]
    variables = [(f"group.v{k}", kind) for k, kind in enumerate(kinds)]
    events, damage = decode(usd_bytes(variables, rows, version=version, other=other), "log")
    assert not damage
    found = events["fixedFrequency"]
    assert len(found) == len(rows)
    for event, (stamp, values) in zip(found, rows, strict=True):
        assert event["#time"] == pytest.approx(stamp * (1e-3 if version == 1 else 1e-6), rel=1e-15)
        assert [event[name] for name, _ in variables] == values
    assert ("solved" in events) == other
    if other:
        assert events["solved"]["us"].tolist() == [42] * len(rows)


def test_units_become_si(tmp_path: Path) -> None:
    columns = flight_columns(2, TIME)
    file = tmp_path / "cf2_01"
    file.write_bytes(usd_log(columns, 1, clock=20.0))
    name, log = read(file)
    assert name == "usd-log"
    assert log.time == pytest.approx(TIME + 20.0)
    for k, axis in enumerate("xyz"):
        assert log.load[:, 0, k] == pytest.approx(columns[f"load_{axis}"], abs=5.1e-4)
        assert log.reference[:, 1, k] == pytest.approx(columns[f"ref_v{axis}"], abs=5.1e-4)
        assert log.drones["positions"][:, 0, k] == pytest.approx(
            columns[f"uav1_{axis}"], abs=5.1e-4
        )
        assert log.drones["shares"][:, 0, k] == pytest.approx(columns[f"uav1_mu{axis}"], abs=1e-8)
    assert log.drones["rates"][5, 0] == pytest.approx([0.0, 0.0, np.pi / 2])
    assert log.drones["attitudes"][5, 0] == pytest.approx([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    assert np.isnan(log.drones["drone_forces"]).all()


WHOLE = usd_bytes(
    [("a.b", "f"), ("a.c", "h")], [(k, [0.1 * k, 300 + k]) for k in range(1, 10)], other=True
)
HEADER = WHOLE.index(b"us(H)\0") + 6


@settings(deadline=None)
@given(size=st.integers(HEADER, len(WHOLE) - 1), zeros=st.integers(0, 600))
def test_what_stands_before_the_end_of_a_log_that_was_not_closed_is_read(
    size: int, zeros: int
) -> None:
    """Cut anywhere, filled up with zeros or not: each row read is one of the whole log's, bit by bit."""
    found, whole = decode(WHOLE[:size] + bytes(zeros), "log"), decode(WHOLE, "log")
    for name, rows in found.events.items():
        assert rows.tobytes() == whole.events[name][: len(rows)].tobytes()
    pairs, rest = divmod(size - HEADER, 16 + 12)  # an event of each type
    assert len(found.events["fixedFrequency"]) == min(9, pairs + (rest >= 16))
    assert "not closed" in found.damage


@settings(deadline=None)
@given(size=st.integers(0, HEADER), zeros=st.integers(0, 600))
def test_a_log_cut_within_its_header_is_refused(
    size: int, zeros: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("cut") / "cf2_01"
    path.write_bytes(WHOLE[:size] + bytes(zeros))
    with pytest.raises(FlightDataError, match="cf2_01"):
        read(path)


@pytest.mark.parametrize("bit", range(8))
def test_a_closed_log_that_was_altered_is_refused(bit: int) -> None:
    for at in range(HEADER + 10, len(WHOLE), 28):  # values of each row of the first type
        damaged = bytearray(WHOLE)
        damaged[at] ^= 1 << bit
        with pytest.raises(FlightDataError, match="log: checksum"):
            decode(bytes(damaged), "log")


@settings(deadline=None)
@given(data=st.data())
def test_altered_bits_give_our_error_or_fewer_rows(data: st.DataObject) -> None:
    damaged = bytearray(WHOLE)
    for at in data.draw(st.lists(st.integers(0, len(WHOLE) - 1), min_size=1, max_size=4)):
        damaged[at] ^= 1 << data.draw(st.integers(0, 7))
    with contextlib.suppress(FlightDataError):
        decode(bytes(damaged), "log")


@settings(deadline=None)
@given(body=st.binary(max_size=200))
def test_noise_with_a_valid_checksum_raises_nothing_but_our_error(body: bytes) -> None:
    with contextlib.suppress(FlightDataError):
        assert not any(len(rows) for rows in decode(sealed(b"\xbc" + body), "log").events.values())


HEAD = struct.pack("<BHH", 0xBC, 2, 1) + struct.pack("<H", 3)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is not a micro-SD log"),
        (sealed(struct.pack("<BHHH", 0xBC, 9, 0, 0)), "version 9 is not known"),
        (sealed(HEAD + b"e\0" + struct.pack("<H", 1) + b"a.b(q)\0"), "'a.b(q)' has no known type"),
        (sealed(HEAD + b"e\0" + struct.pack("<H", 2) + b"a.b(f)\0"), "the header is not that"),
        (sealed(HEAD + b"e\0" + struct.pack("<HH", 0, 4)), "no event has the number 4"),
        (sealed(HEAD + b"e\0" + struct.pack("<HH", 0, 3)), "the last event is cut short"),
    ],
)
def test_the_error_says_what_is_wrong(data: bytes, message: str) -> None:
    with pytest.raises(FlightDataError) as caught:
        decode(data, "cf2_01")
    assert message in str(caught.value)
    assert str(caught.value).startswith("cf2_01: ")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (usd_bytes([("gyro.x", "f")], [(0, [1.0]), (1, [1.0])]), "load not recorded"),
        (usd_bytes([("gyro.x", "f")], [(1, [1.0]), (1, [1.0])]), "times do not increase"),
        (
            sealed(HEAD + b"other\0" + struct.pack("<H", 0)),
            "no events 'fixedFrequency'; there are other",
        ),
    ],
)
def test_a_log_without_a_flight_is_refused(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "cf2_01").write_bytes(data)
    with pytest.raises(FlightDataError, match=message):
        read(tmp_path / "cf2_01")
