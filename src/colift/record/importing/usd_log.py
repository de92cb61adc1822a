"""Crazyflie logs from the micro-SD card, one file a drone.

Format, little-endian, as documented by Bitcraze with the firmware (micro-SD card deck,
bitcraze.io/documentation/repository/crazyflie-firmware/master/userguides/decks/micro-sd-card-deck, and the
writer ``src/deck/drivers/src/usddeck.c``)::

    uint8 0xBC, uint16 version (1 or 2), uint16 number of event types
    each event type: uint16 id, text name, uint16 number of variables, texts "group.name(type)"
    each event: uint16 id, time stamp (version 1: uint32 ms; version 2: uint64 us), the variables
    uint32 CRC-32 of all bytes before it

Texts end with a zero byte; types are one of ``b B h H i I e f``: integers of 8, 16 and 32 bits, half and single
precision. The flight is read from the event type ``fixedFrequency``, or from the only one that has the positions.

A log that was not closed, since the drone lost power, ends without a checksum, in the middle of an event or in
zeros: what stands before is read, and said to be damaged. A log that was closed and does not fit its checksum is refused.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.errors import FlightDataError
from colift.record.importing.base import DRONE_COLUMNS, Array, Finding, Log, Reading

MAGIC = 0xBC
PERIODIC = "fixedFrequency"

_TYPES = {
    "b": "i1",
    "B": "u1",
    "h": "<i2",
    "H": "<u2",
    "i": "<i4",
    "I": "<u4",
    "e": "<f2",
    "f": "<f4",
}
_STAMPS = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}  # type and seconds
LEAP = 600.0
"""Longest pause between two events of a type that is believed of a log without a checksum, s."""
_ID, _TIME = "#id", "#time"  # no variable has such a name

_VECTORS: dict[str, tuple[tuple[str, float], ...]] = {
    "load": (("stateEstimateZ.p{xyz}", 1e-3), ("stateEstimate.p{xyz}", 1.0)),
    "load_velocity": (("stateEstimateZ.pv{xyz}", 1e-3), ("stateEstimate.pv{xyz}", 1.0)),
    "reference": (("ctrltargetZ.{xyz}", 1e-3), ("ctrltarget.{xyz}", 1.0)),
    "reference_velocity": (("ctrltargetZ.v{xyz}", 1e-3), ("ctrltarget.v{xyz}", 1.0)),
    "positions": (("stateEstimateZ.{xyz}", 1e-3), ("stateEstimate.{xyz}", 1.0)),
    "velocities": (("stateEstimateZ.v{xyz}", 1e-3), ("stateEstimate.v{xyz}", 1.0)),
    "attitudes": (("stateEstimate.q{wxyz}", 1.0),),
    "rates": (("gyro.{xyz}", float(np.pi / 180.0)),),
    "drone_forces": (("ctrlLeeP.u{xyz}", 1.0),),
    "commands": (("ctrlLeeP.Fd{xyz}", 1.0),),
    "shares": (("ctrlLeeP.desVirtInp{xyz}", 1.0),),
}
"""Variables of each vector and the factor to SI units, the first choice first.

``stateEstimateZ`` is in mm and mm/s, ``stateEstimate`` in m and m/s, ``gyro`` in degrees/s (firmware documentation,
log groups). The payload (``p``) and ``ctrlLeeP`` come from the payload controller of the flights' authors (IMRCLab/col-trans):
``Fd`` is the total wanted force on the load, ``desVirtInp`` what the QP gave to this drone's own cable,
``u`` the drone's wanted thrust vector.
"""
_NEEDED = ("load", "positions")


@dataclass(frozen=True)
class _EventType:
    name: str
    layout: np.dtype[Any]
    stamp: int
    """Bytes of the time stamp."""


def recognises(head: bytes, path: Path) -> bool:
    """Whether the file starts as such a log does."""
    return len(head) >= 3 and head[0] == MAGIC and head[2] == 0 and head[1] < 16


def read(path: Path, told: Reading) -> Log:
    """Read one drone's log.

    Raises
    ------
    FlightDataError
        For a damaged file, and one that lacks the positions of drone or load.

    """
    for option, value in (("--unit", told.unit), ("--time-unit", told.time_unit)):
        if value is not None:
            raise FlightDataError(f"{path}: such a log states its units; leave out {option}")
    events, damage = decode(path.read_bytes(), str(path))
    rows = events.get(PERIODIC)
    if rows is None:
        fitting = [name for name in events if all(_choice(events[name], v) for v in _NEEDED)]
        if len(fitting) != 1:
            raise FlightDataError(
                f"{path}: holds no events {PERIODIC!r}; there are {', '.join(events) or 'none'}"
            )
        rows = events[fitting[0]]
    time = rows[_TIME].astype(float)
    if len(rows) < 2 or np.any(np.diff(time) <= 0.0):
        raise FlightDataError(
            f"{path}: events {PERIODIC!r}: times do not increase, or fewer than two"
            + (f" ({damage})" if damage else "")
        )
    for name in _NEEDED:
        if _choice(rows, name) is None:
            choices = " or ".join(choice for choice, _ in _VECTORS[name])
            raise FlightDataError(f"{path}: {name} not recorded (variables {choices})")
    vectors = {name: _vectors(rows, name) for name in _VECTORS}
    return Log(
        time=time,
        load=np.stack([vectors["load"], vectors["load_velocity"]], axis=1),
        reference=np.stack([vectors["reference"], vectors["reference_velocity"]], axis=1),
        drones={name: vectors[name][:, None] for name in DRONE_COLUMNS},
        findings=[
            Finding("damage", path.name, len(time), float(time[0]), float(time[-1]), damage)
        ] if damage else [],
    )  # fmt: skip


class Decoded(NamedTuple):
    """Events by type, structured arrays with a field a variable and the time (s); why there are no more, if so."""

    events: dict[str, NDArray[Any]]
    damage: str


def decode(data: bytes, label: str) -> Decoded:
    """All events of a log, or those before it was cut off.

    Raises
    ------
    FlightDataError
        If the data are no log of a known version, or altered; ``label`` names them.

    """
    if len(data) < 9 or data[0] != MAGIC:
        raise FlightDataError(f"{label}: is not a micro-SD log of a Crazyflie")
    version, count = struct.unpack_from("<HH", data, 1)
    if version not in _STAMPS:
        raise FlightDataError(f"{label}: version {version} is not known; 1 and 2 are")
    body, stored = data[:-4], int.from_bytes(data[-4:], "little")
    closed = zlib.crc32(body) == stored
    content = body if closed else data
    try:
        types, start = _header(content, count, _STAMPS[version][0], label)
        return _events(content, start, types, _STAMPS[version][1], closed, label)
    except (struct.error, ValueError, IndexError) as error:
        raise FlightDataError(f"{label}: the header is not that of a log: {error}") from error


def _header(body: bytes, count: int, stamp: str, label: str) -> tuple[dict[int, _EventType], int]:
    at = 5
    types = {}
    for _ in range(count):
        (number,) = struct.unpack_from("<H", body, at)
        name, at = _text(body, at + 2)
        if not name:
            raise ValueError("an event without a name")
        (size,) = struct.unpack_from("<H", body, at)
        at += 2
        fields = [(_ID, "<u2"), (_TIME, stamp)]
        for _ in range(size):
            variable, at = _text(body, at)
            kind = variable[-2:-1]
            if variable[-3:] != f"({kind})" or kind not in _TYPES:
                raise FlightDataError(
                    f"{label}: event {name!r}: variable {variable!r} has no known type"
                )
            fields.append((variable[:-3], _TYPES[kind]))
        types[number] = _EventType(name, np.dtype(fields), np.dtype(stamp).itemsize)
    return types, at


def _text(body: bytes, at: int) -> tuple[str, int]:
    end = body.index(0, at)
    return body[at:end].decode("ascii"), end + 1


def _events(
    body: bytes, at: int, types: dict[int, _EventType], second: float, closed: bool, label: str
) -> Decoded:
    parts: dict[int, list[bytes]] = defaultdict(list)
    latest: dict[int, int] = {}
    damage, last = "", -1
    while at < len(body):
        number = int.from_bytes(body[at : at + 2], "little")
        found = types.get(number)
        end = at + (found.layout.itemsize if found else 0)
        if found is None:
            damage = f"byte {at}: no event has the number {number}"
        elif end > len(body):
            damage = f"byte {at}: the last event is cut short"
        else:
            stamp = int.from_bytes(body[at + 2 : at + 2 + found.stamp], "little")
            before = latest.get(number, stamp - 1)
            if not closed and not before < stamp <= before + LEAP / second:
                damage = f"byte {at}: time goes back, or leaps"
            latest[number] = stamp
        if damage:
            break
        parts[number].append(body[at:end])
        last, at = number, end
    rest = body[at:]
    if closed and damage:
        raise FlightDataError(f"{label}: {damage}")
    sealed = zlib.crc32(body[:at]) == int.from_bytes(rest[:4], "little") and len(rest) >= 4
    if sealed and not any(rest[4:]):
        damage = ""  # closed, and filled up with zeros after that
    elif not closed:
        # What is left of a log that was closed is a checksum, which is no event's number but by rare chance.
        if len(rest) == 4 and int.from_bytes(rest[:2], "little") not in types and any(rest):
            raise FlightDataError(
                f"{label}: checksum {int.from_bytes(rest, 'little'):08x} does not fit the content "
                f"({zlib.crc32(body[:at]):08x}): the file is damaged"
            )
        left = f"{len(rest)} bytes after that are no events" if rest else "it ends there"
        if not any(rest) and _fills_up(parts[last]):
            parts[last].pop()
        what = "only zeros follow" if rest and not any(rest) else (damage or "nothing follows")
        damage = (
            f"not closed before the drone was switched off, and without a checksum; {left} ({what})"
        )
    events = {}
    for number, kind in types.items():
        rows = np.frombuffer(b"".join(parts[number]), kind.layout)
        seconds = [*kind.layout.descr[:1], (_TIME, "<f8"), *kind.layout.descr[2:]]
        converted = rows.astype(np.dtype(seconds))
        converted[_TIME] *= second
        events[kind.name] = converted
    return Decoded(events, damage)


def _fills_up(events: list[bytes]) -> bool:
    """Whether the last event ends in more zeros than any before: those after it may begin in it."""
    zeros = [len(event) - len(event.rstrip(b"\0")) for event in events]
    return bool(zeros) and zeros[-1] > max(zeros[:-1], default=0)


def _choice(rows: NDArray[Any], name: str) -> tuple[list[str], float] | None:
    """Variables of a vector and their factor to SI units, by the first choice that is there."""
    for pattern, factor in _VECTORS[name]:
        head, _, axes = pattern.rstrip("}").partition("{")
        variables = [head + axis for axis in axes]
        if all(variable in (rows.dtype.names or ()) for variable in variables):
            return variables, factor
    return None


def _vectors(rows: NDArray[Any], name: str) -> Array:
    """One vector (rows, k) in SI units; NaN where it was not recorded."""
    choice = _choice(rows, name)
    if choice is None:
        return np.full((len(rows), DRONE_COLUMNS.get(name, 3)), np.nan)
    variables, factor = choice
    values = factor * np.stack([rows[v].astype(float) for v in variables], axis=-1)
    return np.where(np.isfinite(values), values, np.nan)
