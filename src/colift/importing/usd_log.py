"""Crazyflie logs from the micro-SD card, one file a drone.

Format, little-endian, as documented by Bitcraze with the firmware (micro-SD card deck,
bitcraze.io/documentation/repository/crazyflie-firmware/master/userguides/decks/micro-sd-card-deck, and the
writer ``src/deck/drivers/src/usddeck.c``)::

    uint8 0xBC, uint16 version (1 or 2), uint16 number of event types
    each event type: uint16 id, text name, uint16 number of variables, texts "group.name(type)"
    each event: uint16 id, time stamp (version 1: uint32 ms; version 2: uint64 us), the variables
    uint32 CRC-32 of all bytes before it

Texts end with a zero byte; types are one of ``b B h H i I e f``: integers of 8, 16 and 32 bits, half and single
precision. The flight is read from the event type ``fixedFrequency``.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import FlightDataError
from colift.importing.base import DRONE_COLUMNS, Array, Log

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
_ID, _TIME = "#id", "#time"  # no variable has such a name

_VECTORS: dict[str, tuple[tuple[str, float], ...]] = {
    "load": (("stateEstimateZ.p{xyz}", 1e-3),),
    "load_velocity": (("stateEstimateZ.pv{xyz}", 1e-3),),
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

``stateEstimateZ`` is in mm and mm/s, ``gyro`` in degrees/s (firmware documentation, log groups). The payload
(``p``) and ``ctrlLeeP`` come from the payload controller of the flights' authors (IMRCLab/col-trans):
``Fd`` is the total wanted force on the load, ``desVirtInp`` what the QP gave to this drone's own cable,
``u`` the drone's wanted thrust vector.
"""
_NEEDED = ("load", "positions")


@dataclass(frozen=True)
class _EventType:
    name: str
    layout: np.dtype[Any]


def recognises(head: bytes, path: Path) -> bool:
    """Whether the file starts as such a log does."""
    return len(head) >= 3 and head[0] == MAGIC and head[2] == 0 and head[1] < 16


def read(path: Path) -> Log:
    """Read one drone's log.

    Raises
    ------
    FlightDataError
        For a damaged file, and one that lacks the positions of drone or load.

    """
    events = decode(path.read_bytes(), str(path))
    if PERIODIC not in events:
        raise FlightDataError(
            f"{path}: holds no events {PERIODIC!r}; there are {', '.join(events) or 'none'}"
        )
    rows = events[PERIODIC]
    time = rows[_TIME].astype(float)
    if len(rows) < 2 or np.any(np.diff(time) <= 0.0):
        raise FlightDataError(
            f"{path}: events {PERIODIC!r}: times do not increase, or fewer than two"
        )
    vectors = {name: _vectors(rows, name) for name in _VECTORS}
    for name in _NEEDED:
        if not np.isfinite(vectors[name]).all():
            choices = " or ".join(choice for choice, _ in _VECTORS[name])
            raise FlightDataError(f"{path}: {name} not recorded throughout (variables {choices})")
    return Log(
        time=time,
        load=np.stack([vectors["load"], vectors["load_velocity"]], axis=1),
        reference=np.stack([vectors["reference"], vectors["reference_velocity"]], axis=1),
        drones={name: vectors[name][:, None] for name in DRONE_COLUMNS},
    )


def decode(data: bytes, label: str) -> dict[str, NDArray[Any]]:
    """All events by type: structured arrays with a field a variable, and the time, s.

    Raises
    ------
    FlightDataError
        If the data are no log of a known version, cut short or altered; ``label`` names them.

    """
    if len(data) < 9 or data[0] != MAGIC:
        raise FlightDataError(f"{label}: is not a micro-SD log of a Crazyflie")
    body, stored = data[:-4], int.from_bytes(data[-4:], "little")
    if zlib.crc32(body) != stored:
        raise FlightDataError(
            f"{label}: checksum {stored:08x} does not fit the content ({zlib.crc32(body):08x}): the "
            "file is damaged, or was not closed before the drone was switched off"
        )
    version, count = struct.unpack_from("<HH", body, 1)
    if version not in _STAMPS:
        raise FlightDataError(f"{label}: version {version} is not known; 1 and 2 are")
    try:
        types, start = _header(body, count, _STAMPS[version][0], label)
        return _events(body, start, types, _STAMPS[version][1], label)
    except (struct.error, ValueError, IndexError) as error:
        raise FlightDataError(f"{label}: the header is not that of a log: {error}") from error


def _header(body: bytes, count: int, stamp: str, label: str) -> tuple[dict[int, _EventType], int]:
    at = 5
    types = {}
    for _ in range(count):
        (number,) = struct.unpack_from("<H", body, at)
        name, at = _text(body, at + 2)
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
        types[number] = _EventType(name, np.dtype(fields))
    return types, at


def _text(body: bytes, at: int) -> tuple[str, int]:
    end = body.index(0, at)
    return body[at:end].decode("ascii"), end + 1


def _events(
    body: bytes, at: int, types: dict[int, _EventType], second: float, label: str
) -> dict[str, NDArray[Any]]:
    parts: dict[int, list[bytes]] = defaultdict(list)
    while at < len(body):
        number = int.from_bytes(body[at : at + 2], "little")
        if number not in types:
            raise FlightDataError(f"{label}: byte {at}: no event has the number {number}")
        end = at + types[number].layout.itemsize
        if end > len(body):
            raise FlightDataError(f"{label}: byte {at}: the last event is cut short")
        parts[number].append(body[at:end])
        at = end
    found = {}
    for number, kind in types.items():
        rows = np.frombuffer(b"".join(parts[number]), kind.layout)
        seconds = [*kind.layout.descr[:1], (_TIME, "<f8"), *kind.layout.descr[2:]]
        converted = rows.astype(np.dtype(seconds))
        converted[_TIME] *= second
        found[kind.name] = converted
    return found


def _vectors(rows: NDArray[Any], name: str) -> Array:
    """One vector (rows, k) in SI units, by its first choice of variables that is there; or NaN."""
    for pattern, factor in _VECTORS[name]:
        head, _, axes = pattern.rstrip("}").partition("{")
        variables = [head + axis for axis in axes]
        if all(variable in (rows.dtype.names or ()) for variable in variables):
            return factor * np.stack([rows[v].astype(float) for v in variables], axis=-1)
    return np.full((len(rows), DRONE_COLUMNS.get(name, 3)), np.nan)
