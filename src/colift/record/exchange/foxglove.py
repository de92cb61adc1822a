"""A layout of panels for Foxglove, and for Lichtblick, which opens the same: for what a bag says (:mod:`colift.record.exchange.bag`).

The team in space; load beside reference; what cables carry; what drones push; the allocator's status. A panel without a topic is left out.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

from colift.record.exchange.topics import DIAGNOSTICS, LOAD, TOPICS, WORLD
from colift.record.recording import atomic_path

SUFFIX = ".foxglove.json"
VIEW = {
    "perspective": True, "distance": 6.0, "phi": 65.0, "thetaOffset": 45.0, "fovy": 45.0, "near": 0.1, "far": 1000.0,
    "target": [0.0, 0.0, 0.0], "targetOffset": [0.0, 0.0, 0.5], "targetOrientation": [0.0, 0.0, 0.0, 1.0],
}  # fmt: skip
"""Where the camera is: m from the load, degrees from the vertical and around it."""


def layout(topics: Collection[str], n: int) -> dict[str, Any]:
    """Panels for these topics of ``n`` drones."""

    def series(key: str, field: str, label: str) -> list[tuple[str, str]]:
        """Label and path of a field of each message of a topic's."""
        names = enumerate(TOPICS[key].names(n))
        return [(label.format(i=i), f"{name}.{field}") for i, name in names if name in topics]

    up = "wrench.force.z"
    plots = {
        "Load and reference (m)": [
            each
            for axis in "xyz"
            for key in ("load", "reference")
            for each in series(key, f"pose.pose.position.{axis}", f"{key} {axis}")
        ],
        "Cables: force upwards on the load (N)": series("cable", up, "cable {i}") + series("cable_command", up, "wanted {i}"),
        "Drones: thrust over mass (m/s^2)": series("setpoint", "linear_acceleration.z", "drone {i}"),
    }  # fmt: skip
    panels: dict[str, Any] = {"3D!team": _space(topics, n)}
    for title, paths in plots.items():
        if paths:
            panels[f"Plot!{title.split()[0].strip(':').lower()}"] = _plot(title, paths)
    if DIAGNOSTICS in topics:
        panels["DiagnosticSummary!status"] = {
            "topicToRender": DIAGNOSTICS, "minLevel": 0, "pinnedIds": [], "hardwareIdFilter": "",
        }  # fmt: skip
    return {
        "configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1.0},
        "layout": _beside(list(panels), "row", 55.0),
    }  # fmt: skip


def _space(topics: Collection[str], n: int) -> dict[str, Any]:
    """The team in space: its model, moved by the frames, on a grid."""
    shown = {name: {"visible": False} for key in ("load", "drone") for name in TOPICS[key].names(n) if name in topics}  # fmt: skip
    grid = {"layerId": "foxglove.Grid", "instanceId": "grid", "label": "Ground", "visible": True, "frameLocked": True, "frameId": WORLD, "size": 20.0, "divisions": 20, "lineWidth": 1.0, "color": "#808080a0", "position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0], "order": 1}  # fmt: skip
    model = {"layerId": "foxglove.Urdf", "instanceId": "team", "label": "Team", "visible": True, "frameLocked": True, "sourceType": "topic", "topic": TOPICS["description"].names(n)[0], "framePrefix": "", "displayMode": "visual", "order": 2}  # fmt: skip
    return {
        "cameraState": VIEW, "followMode": "follow-position", "followTf": LOAD, "fixedFrame": WORLD, "scene": {"transforms": {"axisScale": 0.3, "showLabel": False}},
        "transforms": {}, "topics": shown, "layers": {"grid": grid, "team": model}, "publish": {}, "imageMode": {},
    }  # fmt: skip


def _plot(title: str, paths: list[tuple[str, str]]) -> dict[str, Any]:
    series = [{"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"} for label, path in paths]  # fmt: skip
    return {
        "foxglovePanelTitle": title, "paths": series, "xAxisVal": "timestamp", "isSynced": True, "showLegend": True,
        "legendDisplay": "floating", "showPlotValuesInLegend": False, "showXAxisLabels": True, "showYAxisLabels": True,
    }  # fmt: skip


def _beside(panels: list[str], direction: str, share: float) -> Any:
    """The first panel with this share (%), the others one below the other."""
    if len(panels) == 1:
        return panels[0]
    rest = _beside(panels[1:], "column", 100.0 / max(len(panels) - 1, 2))
    return {"direction": direction, "first": panels[0], "second": rest, "splitPercentage": share}


def write_layout(topics: Collection[str], n: int, bag: Path) -> Path:
    """Write the layout of a bag beside it, whole or not at all."""
    path = bag.with_name(f"{bag.name.removesuffix('.mcap')}{SUFFIX}")
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(layout(topics, n), indent=1) + "\n", encoding="utf-8")
    return path
