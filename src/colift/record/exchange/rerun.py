"""A flight as a Rerun recording (``.rrd``): bodies, cables and paths in space, forces and errors over time.

Needs the package rerun-sdk (extra ``rerun``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from colift.record.ends import cable_ends
from colift.record.exchange.tables import Progress, package
from colift.record.exchange.topics import LOAD, WORLD, cable, drone
from colift.record.exchange.urdf import ARM, COLOURS
from colift.record.recording import Array, Recording, atomic_path

TIME = "flight"
"""Name of the timeline."""
POINT = 0.05
"""Edge of a load that is a point, as it is drawn, m."""


def write_rerun(recording: Recording, path: Path, progress: Progress | None = None) -> list[Path]:
    """Write one file.

    Raises
    ------
    MissingExtraError
        Without rerun-sdk.

    """
    rr = package("rerun", "rerun")
    stream = rr.RecordingStream("colift", recording_id=recording.mission.name)
    with atomic_path(path) as temporary:
        stream.save(temporary)
        _fill(rr, stream, recording.complete())
        stream.flush()
        stream.disconnect()
    return [path]


def _fill(rr: Any, stream: Any, of: Recording) -> None:
    def series(name: str, *parts: Any, rows: Any = None) -> None:
        time = of.time if rows is None else of.time[rows]
        stream.send_columns(
            name, [rr.TimeColumn(TIME, duration=time)], [c for p in parts for c in p]
        )

    def scalars(name: str, values: Array) -> None:
        if known := np.flatnonzero(np.isfinite(values)).tolist():
            series(name, rr.Scalars.columns(scalars=values[known]), rows=np.array(known))

    def moves(name: str, position: Array, attitude: Array | None) -> None:
        told = position if attitude is None else np.concatenate([position, attitude], axis=1)
        rows = np.flatnonzero(np.isfinite(told).all(axis=1))
        turned = {} if attitude is None else {"quaternion": attitude[rows][:, [1, 2, 3, 0]]}
        if len(rows):
            series(name, rr.Transform3D.columns(translation=position[rows], **turned), rows=rows)

    stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    team = of.mission.team
    size = np.full(3, POINT) if team.body is None else np.maximum(team.body.size, 0.01)
    box = rr.Boxes3D(half_sizes=[0.5 * size], colors=[_colour("load")])
    stream.log(f"{WORLD}/{LOAD}", box, static=True)
    attitude = of["load_attitude"] if of.measured("load_attitude") else None
    moves(f"{WORLD}/{LOAD}", of["load"][:, 0], attitude)
    path = of["reference"][:, 0]
    stream.log(
        f"{WORLD}/reference", rr.LineStrips3D([path[np.isfinite(path).all(axis=1)]]), static=True
    )
    ends, turned = cable_ends(of)[:, :, 0], of.measured("attitudes")
    for i in range(of.n):
        name, arm = f"{WORLD}/{drone(i)}", float(np.nan_to_num(team.arms[i], nan=ARM))
        hull = rr.Boxes3D(half_sizes=[[arm, arm, 0.15 * arm]], colors=[_colour("hull")])
        stream.log(name, hull, static=True)
        moves(name, of["positions"][:, i], of["attitudes"][:, i] if turned else None)
        lines = np.stack([ends[:, i], of["positions"][:, i]], axis=1)
        rows = np.flatnonzero(np.isfinite(lines).all(axis=(1, 2)))
        strips = rr.LineStrips3D.columns(strips=lines[rows].astype(np.float32))
        if len(rows):
            series(f"{WORLD}/{cable(i)}", strips.partition([1] * len(rows)), rows=rows)
        scalars(f"tension/{cable(i)}", of["tensions"][:, i])
        scalars(f"wanted_tension/{cable(i)}", of["desired_tensions"][:, i])
        scalars(f"thrust/{drone(i)}", of["thrusts"][:, i])
    scalars("error", np.linalg.norm(of["load"][:, 0] - of["reference"][:, 0], axis=1))
    for moment in of.moments:
        stream.set_time(TIME, duration=moment.time)
        stream.log("moments", rr.TextLog(moment.text))


def _colour(name: str) -> list[int]:
    return [round(255 * each) for each in COLOURS[name]]
