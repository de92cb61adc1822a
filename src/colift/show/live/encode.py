"""What the server says, as text."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from colift.kernel.signals import LEGEND
from colift.record.verdict import limits
from colift.show.live import protocol
from colift.show.live.session import Row, Session
from colift.show.viewer.data import body_of

PER_DRONE = {
    "positions", "attitudes", "directions", "desired_directions",
    "tensions", "desired_tensions", "thrusts",
}  # fmt: skip
"""Signals with an entry per drone, which is null for one that has left."""

_LEGEND_OF = {"external": "external_forces", "solve_time": "allocator_time", "status": "allocator_status"}  # fmt: skip
_DIGITS = {"solve_time": 9}


def text(message: dict[str, Any]) -> str:
    """A message; numbers that are not finite are null."""
    return json.dumps(_plain(message), separators=(",", ":"), allow_nan=False)


def hello(session: Session, role: str) -> str:
    """Who flies, what can be turned and chosen."""
    mission, values = session.mission, session.state["values"]
    return text(
        {
            "type": "hello",
            "protocol": protocol.VERSION,
            "role": role,
            "name": mission.name,
            "n": mission.drones.count,
            "cable_lengths": mission.team.cable_lengths.tolist(),
            "radii": [
                float(radius) if math.isfinite(radius) else None for radius in mission.team.radii
            ],
            "body": body_of(mission),
            "safe_angle_deg": limits(mission).angle_deg,
            "safe_distance": limits(mission).distance_m,
            "ground": None if mission.ground is None else mission.ground.height,
            "obstacles": mission.world.rows().tolist(),
            "legend": _legend(),
            "knobs": [
                {**vars(knob), "value": values.get(name)} for name, knob in session.knobs.items()
            ],
            "choices": [
                {
                    "name": "allocation.kind",
                    "label": "Allocator",
                    "options": session.allocators,
                    "value": values.get("allocation.kind"),
                }
            ],
        }
    )


def rows(found: Sequence[Row], seq: int) -> str:
    """Rows, one list per signal."""
    signals = {}
    for name in found[0].signals:
        values = np.stack([row.signals[name] for row in found])
        listed = np.round(values, _DIGITS.get(name, 5)).tolist()
        if name in PER_DRONE:
            gone = np.isnan(values.reshape(*values.shape[:2], -1)).any(axis=2)
            for k, i in zip(*np.nonzero(gone), strict=True):
                listed[k][i] = None
        signals[name] = listed if np.isfinite(values).all() else _plain(listed)
    times = [round(row.time, 6) for row in found]
    return text({"type": "rows", "seq": seq, "time": times, "signals": signals})


def _legend() -> dict[str, dict[str, str]]:
    names = ("load", "reference", "force", "external", *sorted(PER_DRONE), "solve_time", "status")
    found = {name: LEGEND[_LEGEND_OF.get(name, name)] for name in names}
    legend = {name: {"unit": s.unit, "meaning": s.meaning} for name, s in found.items()}
    for name, meaning in (("load", "load position"), ("reference", "wanted load position")):
        legend[name] = {"unit": "m", "meaning": meaning}
    legend["external"]["meaning"] = "disturbing force on the load"
    legend["error"] = {"unit": "m", "meaning": "distance of the load from its reference"}
    return legend


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value
