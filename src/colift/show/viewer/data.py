"""Recordings as the page takes them: thinned rows as base64, events, numbers and the mission's text."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from colift.mission.criteria import METRICS
from colift.mission.schema import Described
from colift.record.metrics import attitude_error, compute, tracking_error
from colift.record.moments import angle_pairs
from colift.record.recording import Recording
from colift.record.verdict import judge, limits
from colift.team.geometry import pairwise_angles

Array = NDArray[np.float64]

RATE = 50.0
"""Most rows a second of flight, Hz."""

LEAST_RATE = 10.0
"""Fewest rows a second, however many drones there are, Hz."""

BUDGET = 1_100_000
"""Bytes that the rows of all flights of a page may take, unless that would go below :data:`LEAST_RATE`."""

SHOWN = (
    "reference",
    "load",
    "force",
    "external",
    "positions",
    "attitudes",
    "directions",
    "tensions",
    "desired_tensions",
    "thrusts",
    "reeled",
    "load_attitude",
    "reference_attitude",
)
"""Signals of the page that are rows of the recording; ``external`` is the force on the load,
``reeled`` only how much cable winches have paid out."""


def payload(
    recordings: Sequence[Recording], metrics: Sequence[Mapping[str, float]], labels: Sequence[str]
) -> dict[str, Any]:
    """Everything that the page shows of these flights, ready for JSON.

    Parameters
    ----------
    recordings : sequence of Recording
        Shown side by side. Signals may be NaN where unknown; times may be uneven.
    metrics : sequence of mapping
        Of each recording, as from :func:`colift.record.metrics.compute`.
    labels : sequence of str
        What tells the flights apart.

    """
    share = BUDGET / len(recordings)
    return {
        "format": 1,
        "flights": [
            _flight(recording.complete(), numbers, label, share)
            for recording, numbers, label in zip(recordings, metrics, labels, strict=True)
        ],
    }


def _flight(
    recording: Recording, metrics: Mapping[str, float], label: str, budget: float
) -> dict[str, Any]:
    mission = recording.mission
    moments = recording.moments
    signals = _signals(recording)
    rows = _rows(recording, [moment.time for moment in moments], signals, budget)
    verdict = judge(recording, metrics)
    return {
        "name": mission.name,
        "label": label,
        "description": mission.description,
        "level": verdict.level,
        "reasons": verdict.reasons,
        "summary": verdict.summary if verdict.ok else "",
        "n": recording.n,
        "cable_lengths": mission.team.cable_lengths.tolist(),
        "radii": [_number(radius) for radius in mission.team.radii],
        "ground": None if mission.ground is None else mission.ground.height,
        "obstacles": mission.world.rows().tolist(),
        "body": body_of(mission),
        "safe_angle_deg": limits(mission).angle_deg,
        "safe_distance": limits(mission).distance_m,
        "weight": mission.load.mass * mission.world.gravity,
        "thrust": (mission.load.mass + mission.team.masses.sum())
        * mission.world.gravity
        / recording.n,
        "facts": {
            "allocator": mission.kinds.get("allocation", "on board"),
            "reference": mission.kinds.get("reference", "recorded"),
            "drones": f"{recording.n}",
            "load": f"{mission.load.mass:g} kg",
            "seed": f"{mission.seed}",
            "colift": recording.versions.get("colift", "?"),
        },
        "legend": {
            name: {"unit": signal.unit, "meaning": signal.meaning}
            for name in recording
            for signal in [recording.signal(name)]
        },
        "metrics": [
            {
                "name": metric.name,
                "meaning": metric.meaning,
                "unit": metric.unit,
                "value": _number(metrics[metric.name]),
            }
            for metric in METRICS
            if metric.name in metrics
        ],
        "mission": tomli_w.dumps(mission.resolved()),
        "events": [moment._asdict() for moment in moments],
        "end": float(recording.time[-1]),
        "time": _packed(recording.time[rows], "<f8"),
        "signals": {
            **{name: _packed(values[rows], "<f4") for name, values in signals.items()},
            **_cycles(recording, rows),
        },
    }


def body_of(mission: Described) -> dict[str, Any] | None:
    """Size (3) of a rigid load and where the cables end on it (n, 3), in its frame, m; None of a point."""
    body = mission.true_team.body
    if body is None:
        return None
    return {"size": body.size.tolist(), "attachments": body.attachments.tolist()}


def _signals(recording: Recording) -> dict[str, Array]:
    """The shown signals at every row of the recording; positions only of ``load`` and ``reference``."""
    special = {
        "reference": recording["reference"][:, 0],
        "load": recording["load"][:, 0],
        "external": recording["external_forces"][:, -1],
        "reeled": recording["reeled"][:, :, 0],
    }
    return {name: special[name] if name in special else recording[name] for name in SHOWN}


def _rows(
    recording: Recording, moments: Sequence[float], signals: Mapping[str, Array], budget: float
) -> NDArray[np.intp]:
    """Rows to keep: evenly in time, and those of events, extremes and both ends."""
    time = recording.time
    length = float(time[-1] - time[0])
    width = sum(values[0].size for values in signals.values()) + 4
    affordable = budget / (width * 4 * 4 / 3)
    count = min(RATE * length, max(affordable - len(moments), LEAST_RATE * length)) + 1
    kept = [np.linspace(time[0], time[-1], max(2, int(count))), np.asarray(moments, dtype=float)]
    wanted = np.concatenate(kept)
    nearest = np.searchsorted((time[1:] + time[:-1]) / 2.0, wanted)
    return np.unique(np.concatenate([nearest, _extremes(recording), [0, len(time) - 1]]))


def _extremes(recording: Recording) -> list[int]:
    """Rows of the largest errors, the largest and smallest tension, the smallest angle, and of a rigid load the smallest distance."""
    directions = recording["directions"]
    curves = [
        -np.linalg.norm(tracking_error(recording), axis=1),
        -recording["tensions"],
        recording["tensions"],
    ]
    if angle_pairs(recording.n):
        curves.append(pairwise_angles(directions))
    if recording.mission.load.kind == "rigid":
        curves.append(-np.linalg.norm(attitude_error(recording), axis=1))
        one, other = np.triu_indices(recording.n, k=1)
        apart = recording["positions"][:, one] - recording["positions"][:, other]
        curves += [np.linalg.norm(apart, axis=2)] * angle_pairs(recording.n)
    found = []
    for curve in curves:
        filled = np.where(np.isfinite(curve), curve, np.inf).reshape(len(curve), -1)
        found.append(int(filled.min(axis=1).argmin()))
    return found


def _cycles(recording: Recording, rows: NDArray[np.intp]) -> dict[str, Any]:
    """Longest solve time and worst status of the allocations since the row before."""
    cycles = recording.cycle_time
    result = {}
    for name, source in (("solve_time", "allocator_time"), ("status", "allocator_status")):
        values = np.full(len(rows), np.nan)
        if len(cycles):
            ends = np.searchsorted(cycles, recording.time[rows], side="right")
            begins = np.concatenate([[0], ends[:-1]])
            some = np.flatnonzero(ends > begins)
            values[some] = (
                np.fmax.reduceat(recording[source][: ends[some[-1]]], begins[some])
                if len(some)
                else values[some]
            )
        result[name] = _packed(values, "<f4")
    return result


def _packed(values: Array, kind: str) -> dict[str, Any]:
    with np.errstate(over="ignore"):
        data = values.astype(kind).tobytes()
    return {"shape": list(values.shape), "data": base64.b64encode(data).decode()}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def load_payload(paths: Sequence[Path]) -> dict[str, Any]:
    """:func:`payload` of recordings in files, each told apart by its allocator, or by its file.

    Raises
    ------
    colift.errors.RecordingError
        If a file cannot be read.

    """
    recordings = [Recording.load(path) for path in paths]
    labels = [recording.mission.kinds.get("allocation", "on board") for recording in recordings]
    if len(set(labels)) < len(labels):
        labels = [
            path.name
            if path.is_dir()
            else path.parent.name
            if path.stem == "recording"
            else path.stem
            for path in paths
        ]
    return payload(recordings, [compute(recording) for recording in recordings], labels)
