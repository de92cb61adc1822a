"""Logs of ArduPilot (DataFlash, ``.bin``), one a drone.

Read are XKF1 (place and velocity), XKQ or, without it, ATT (attitude) and IMU (rates), each of the first core or sensor; and of messages that a script
on board writes, ``LOAD`` (fields N, E, D, VN, VE, VD: place and velocity of the load in the same axes, m, m/s), ``SHAR`` and ``FORC`` (N, E, D: wanted forces
of this cable and of all cables on the load, N).
Needs the package pymavlink (extra ``logs``).
"""

from __future__ import annotations

import contextlib
import io
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from colift.record.importing._autopilot import read_with
from colift.record.importing.base import Array, Log, Reading

MAGIC = b"\xa3\x95"
FIELDS: dict[str, dict[str, tuple[str, ...]]] = {
    "XKF1": {"position": ("PN", "PE", "PD"), "velocity": ("VN", "VE", "VD")},
    "XKQ": {"attitude": ("Q1", "Q2", "Q3", "Q4")},
    "ATT": {"angles": ("Roll", "Pitch", "Yaw")},
    "IMU": {"rates": ("GyrX", "GyrY", "GyrZ")},
    "LOAD": {"load": ("N", "E", "D"), "load_velocity": ("VN", "VE", "VD")},
    "SHAR": {"share": ("N", "E", "D")},
    "FORC": {"force": ("N", "E", "D")},
}
"""Messages, and what is read of each."""
HINTS = {"position": "message XKF1", "load": "message LOAD, which a script on board writes"}


def recognises(head: bytes, path: Path) -> bool:
    """Whether it begins as a DataFlash log does."""
    return head.startswith(MAGIC)


def read(path: Path, told: Reading) -> Log:
    """Read one file (:func:`colift.record.importing._autopilot.read_with`)."""
    return read_with(_series, path, "ArduPilot", "pymavlink", HINTS)


def _series(path: Path) -> dict[str, tuple[Array, Array]]:
    from pymavlink.DFReader import DFReader_binary

    with contextlib.redirect_stderr(io.StringIO()):  # it counts what it skips
        return _read(DFReader_binary(str(path)))


def _read(reader: Any) -> dict[str, tuple[Array, Array]]:
    rows: dict[str, list[list[float]]] = defaultdict(list)
    while (message := reader.recv_match(type=list(FIELDS))) is not None:
        if getattr(message, "C", 0) or getattr(message, "I", 0):  # of another core or sensor
            continue
        for name, fields in FIELDS[message.get_type()].items():
            values = [float(getattr(message, field, np.nan)) for field in fields]
            rows[name].append([1e-6 * message.TimeUS, *values])
    found = {name: (table[:, 0], table[:, 1:]) for name, each in rows.items() if (table := np.array(each)).size}  # fmt: skip
    if "attitude" not in found and "angles" in found:
        time, degrees = found["angles"]
        found["attitude"] = time, _quaternions(np.radians(degrees))
    return found


def _quaternions(angles: Array) -> Array:
    """Of roll, pitch and yaw (rows, 3), rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(0.5 * angles).T, np.sin(0.5 * angles).T
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=1,
    )
