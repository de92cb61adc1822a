"""The mission that flies a plan."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from colift.mission.scenes import obstacle_of
from colift.plan.planner import Plan
from colift.record.recording import atomic_path

VEHICLE = "crazyflie-2.1"
"""What the benchmark's robots are, heavier by a deck. Its motors give more than plans ask for: the rest is for corrections."""
PERIOD = 0.002
"""Of all controllers: so small drones turn in hundredths of a second, s."""
TRACKED = 0.1
"""Distance from the plan within which the load is to stay, m."""
TILT = 85.0
"""Most tilt of a drone, and of the force on the load, degrees: plans lean further than the controllers would by themselves."""
DIGITS = 12
"""Decimals of control points."""
HOLD, AFTER = 1.0, 2.0
"""Rest before the plan and after it, s."""


def mission_of(plan: Plan) -> dict[str, Any]:
    """A mission, as plain data, whose team is the plan's and whose reference is the plan itself."""
    scene, limits = plan.scene, plan.limits
    forces = plan.sample(1)["forces"][0, :, 0]
    directions = -forces / np.linalg.norm(forces, axis=1, keepdims=True)
    controllers = dict.fromkeys(
        ("load_control", "allocation", "position_control", "attitude_control"), PERIOD
    )
    return {
        "name": scene.name,
        "description": f"A plan of {plan.duration:.3f} s for {len(scene.lengths)} drones through the scene {scene.name}.",
        "world": {
            "gravity": limits.gravity,
            "ground": "none",
            "obstacles": [obstacle_of(row) for row in scene.obstacles.tolist()],
        },
        "load": {"mass": limits.load_mass},
        "drones": {
            "count": len(scene.lengths),
            "vehicle": VEHICLE,
            "mass": limits.drone_mass,
            "cable_length": scene.lengths.tolist(),
            "radius": limits.radius,
            "rotor_drag": 0.0,  # plans know of none
        },
        "start": {"directions": directions.tolist()},
        "timing": {
            "duration": round(HOLD + plan.duration + AFTER, 1),
            "recording": PERIOD,
            **controllers,
        },
        "criteria": {
            "tracking_max_m": {"max": TRACKED},
            **({"min_clearance_m": {"min": 0.0}} if len(scene.obstacles) else {}),
            "min_height_m": {"min": float(plan.load_points[:, 2].min()) - TRACKED},
        },
        "plant": {"kind": "slack-cables"},
        "load_control": {"kind": "balance", "max_lean_deg": TILT},
        "allocation": {"kind": "planned"},
        "position_control": {"kind": "formation", "max_tilt_deg": TILT},
        "reference": {
            "kind": "plan",
            "hold": HOLD,
            "duration": plan.duration,
            "load_points": plan.load_points.round(DIGITS).tolist(),
            "pull_points": plan.cable_points.round(DIGITS).tolist(),
        },
    }


def write(plan: Plan, file: Path) -> Path:
    """Write the mission, whole or not at all."""
    import tomli_w

    table = mission_of(plan)
    points = {name: table["reference"].pop(name) for name in ("load_points", "pull_points")}
    text = tomli_w.dumps(table)  # the reference is its last table
    for name, rows in points.items():
        text += f"{name} = [\n" + "".join(f"    {json.dumps(row)},\n" for row in rows) + "]\n"
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return file
