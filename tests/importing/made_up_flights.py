"""Flights with known geometry, written as the log formats describe them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from colift.record.importing.base import Array

SPREAD = np.radians(25.0)
"""Half-angle between each cable of the made-up flight and the vertical."""
LENGTH = 0.5
WEIGHT = 0.1


def load_path(time: Array) -> Array:
    """Where the load of the made-up flight is (rows, 3): it starts slowly and never repeats itself."""
    return np.column_stack(
        [
            0.5 * np.sin(0.9 * time) + 0.05 * time,
            0.3 * np.cos(1.7 * time),
            0.5 + 0.1 * np.sin(0.5 * time),
        ]
    )


def cables(n: int) -> Array:
    """Unit directions (n, 3) from drone to load of the made-up flight, evenly about the vertical."""
    azimuth = 2.0 * np.pi * np.arange(n) / n
    outward = np.sin(SPREAD) * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    return np.column_stack([outward, np.full(n, -np.cos(SPREAD))])


def flight_columns(n: int, time: Array) -> dict[str, Array]:
    """Columns of the made-up flight: the drones hold their directions, the shares balance the weight."""
    load = load_path(time)
    velocity = np.gradient(load, time, axis=0)
    columns = {"t": time}
    force = np.tile([0.0, 0.0, WEIGHT], (len(time), 1))
    tension = WEIGHT / (n * np.cos(SPREAD))

    def put(prefix: str, values: Array) -> None:
        columns.update({prefix + axis: values[:, k] for k, axis in enumerate("xyz")})

    put("load_", load)
    put("load_v", velocity)
    put("ref_", load + [0.03, 0.0, -0.04])
    put("ref_v", velocity)
    for k, alpha in enumerate(cables(n)):
        put(f"uav{k}_", load - LENGTH * alpha)
        put(f"uav{k}_v", velocity)
        put(f"uav{k}_fd", force)
        put(f"uav{k}_mu", np.tile(-tension * alpha, (len(time), 1)))
    return columns


def write_csv(path: Path, columns: Mapping[str, Array]) -> Path:
    rows = [",".join(columns)]
    rows += [",".join(repr(float(v)) for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(rows) + "\n")
    return path


def usd_bytes(
    variables: Sequence[tuple[str, str]],
    rows: Sequence[tuple[int, Sequence[float]]],
    *,
    version: int = 2,
    other: bool = False,
) -> bytes:
    """A log in the documented layout: names and types of the variables, rows of time stamp and values.

    With ``other``, an event of another type stands between any two rows.
    """
    events = [(0xFFFF, b"fixedFrequency", variables)] + [(7, b"solved", [("us", "H")])] * other
    data = struct.pack("<BHH", 0xBC, version, len(events))
    for number, name, declared in events:
        data += struct.pack("<H", number) + name + b"\0" + struct.pack("<H", len(declared))
        for variable, kind in declared:
            data += f"{variable}({kind})".encode() + b"\0"
    stamp = "<HI" if version == 1 else "<HQ"
    layout = "<" + "".join(kind for _, kind in variables)
    for time, values in rows:
        data += struct.pack(stamp, 0xFFFF, time) + struct.pack(layout, *values)
        if other:
            data += struct.pack(stamp, 7, time) + struct.pack("<H", 42)
    return data + struct.pack("<I", zlib.crc32(data))


def usd_log(columns: Mapping[str, Array], drone: int, clock: float) -> bytes:
    """The micro-SD log of one drone of a flight in CSV columns; its clock shows ``clock`` s at t = 0."""
    sources = {
        "stateEstimateZ.p": ("load_", "h"), "stateEstimateZ.pv": ("load_v", "h"),
        "ctrltargetZ.": ("ref_", "h"), "ctrltargetZ.v": ("ref_v", "h"),
        "stateEstimateZ.": (f"uav{drone}_", "h"), "stateEstimateZ.v": (f"uav{drone}_v", "h"),
        "ctrlLeeP.Fd": (f"uav{drone}_fd", "f"), "ctrlLeeP.desVirtInp": (f"uav{drone}_mu", "f"),
    }  # fmt: skip
    variables, values = [], []
    for prefix, (column, kind) in sources.items():
        for axis in "xyz":
            variables.append((prefix + axis, kind))
            found = columns[column + axis]
            values.append(np.round(1000.0 * found).astype(int) if kind == "h" else found)
    half_turn = np.full(len(columns["t"]), np.sqrt(0.5))
    for axis in "wxyz":
        variables.append((f"stateEstimate.q{axis}", "f"))
        values.append(half_turn if axis in "wz" else 0.0 * half_turn)
    for axis in "xyz":
        variables.append((f"gyro.{axis}", "f"))
        values.append(np.full(len(half_turn), 90.0 if axis == "z" else 0.0))
    stamps = np.round(1e6 * (columns["t"] + clock)).astype(int)
    rows = list(zip(stamps.tolist(), zip(*values, strict=True), strict=True))
    return usd_bytes(variables, rows, other=True)
