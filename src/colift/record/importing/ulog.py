"""Logs of PX4 (ULog), one a drone.

Read are ``vehicle_local_position``, ``vehicle_attitude`` and ``vehicle_angular_velocity``; and of ``debug_vect``, which holds what MAVLink's
DEBUG_VECT told the vehicle, ``load`` and ``load_v`` (place and velocity of the load in the same axes, north, east, down), ``share`` and
``force`` (wanted forces of this cable and of all cables on the load, N): `colift offboard` tells them.
Needs the package pyulog (extra ``logs``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from colift.record.importing._autopilot import read_with
from colift.record.importing.base import Array, Log, Reading

MAGIC = b"ULog\x01\x12\x35"
TOPICS = {
    "position": ("vehicle_local_position", ("x", "y", "z")),
    "velocity": ("vehicle_local_position", ("vx", "vy", "vz")),
    "attitude": ("vehicle_attitude", tuple(f"q[{k}]" for k in range(4))),
    "rates": ("vehicle_angular_velocity", tuple(f"xyz[{k}]" for k in range(3))),
}
TOLD = {"load": "load", "load_v": "load_velocity", "share": "share", "force": "force"}
"""Names of what is told by DEBUG_VECT."""
HINTS = {"position": "topic vehicle_local_position", "load": 'debug_vect with the name "load"'}


def recognises(head: bytes, path: Path) -> bool:
    """Whether it begins as a ULog does."""
    return head.startswith(MAGIC)


def read(path: Path, told: Reading) -> Log:
    """Read one file (:func:`colift.record.importing._autopilot.read_with`)."""
    return read_with(_series, path, "PX4", "pyulog", HINTS)


def _series(path: Path) -> dict[str, tuple[Array, Array]]:
    from pyulog import ULog

    topics = {each.name: each.data for each in ULog(str(path)).data_list if each.multi_id == 0}
    found = {}
    for name, (topic, fields) in TOPICS.items():
        if topic in topics:
            data = topics[topic]
            found[name] = _times(data), np.stack([data[field] for field in fields], axis=1).astype(float)  # fmt: skip
    if "debug_vect" in topics:
        data = topics["debug_vect"]
        letters = np.stack([data[f"name[{k}]"] for k in range(10)], axis=1).astype(np.uint8)
        names = np.array([bytes(row).split(b"\0")[0].decode(errors="replace") for row in letters])
        values = np.stack([data[axis] for axis in "xyz"], axis=1).astype(float)
        for said, name in TOLD.items():
            rows = names == said
            found[name] = _times(data)[rows], values[rows]
    return found


def _times(data: Any) -> Array:
    return np.asarray(data["timestamp"], dtype=float) * 1e-6
