"""Print the tables of docs/theory/control.md: what each part buys, alone and together.

python docs/figures/coping.py [seeds, default 5]
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

import colift
from colift.campaign import stress

Overrides = dict[str, Any]

LAG = 0.02
MOTORS: Overrides = {"actuation.kind": "motors", "actuation.time_constant": LAG}
LAYERS = ("attitude_control", "position_control", "load_control", "estimation")

CASES: dict[str, Overrides] = {
    name: {**stress.UNTOUCHED, **stress.WEATHER[name], "detection.kind": "none"}
    for name in stress.WEATHER
    if name != "radio"
} | {
    "all and motors, +50 %": MOTORS,
    "all and motors, -50 %": {**MOTORS, "truth.load_mass_factor": 0.5},
}
PAPER: Overrides = {
    "estimation.kind": "none",
    "load_control.kind": "pid",
    "position_control.kind": "pid",
}
CONTROLLERS: dict[str, Overrides] = {
    "chosen": {},
    "paper's laws, gains for the delay": {
        **PAPER, "attitude_control.kind": "manifold", "attitude_control.rho": [10.0] * 3,
        "attitude_control.k_d": [0.7] * 3, "attitude_control.beta": [0.01] * 3,
        "position_control.k_p": [10.0] * 3, "position_control.k_d": [5.0] * 3,
        "position_control.k_i": [1.0] * 3, "load_control.k_p": [4.0] * 3,
        "load_control.k_d": [2.0] * 3, "load_control.k_i": [1.0] * 3,
    },
    "paper's, its gains": {**PAPER, "attitude_control.kind": "manifold"},
}  # fmt: skip
WITHOUT: dict[str, Overrides] = {
    "nothing left out": {},
    "without the predictor": {"estimation.kind": "none"},
    "without prediction of the attitude": {"attitude_control.predicted": False},
    "with the PID of the load": {"load_control.kind": "pid"},
    "without the wind observer": {"position_control.observer_limit": 0.0},
    "load found from the cables": {"estimation.load_from": "cables"},
}


def fly(overrides: Overrides, seeds: Iterable[int]) -> str:
    """Largest distance from the path and smallest angle over the seeds, and how many went to the end."""
    told = overrides
    if overrides.get("actuation.kind") == "motors" and "attitude_control.kind" not in overrides:
        told = {
            **overrides,
            **{f"{layer}.lag": LAG for layer in LAYERS if f"{layer}.kind" not in overrides},
        }
    metrics, flown = [], 0
    for seed in seeds:
        run = colift.run("real-world", seed=seed, overrides=told)
        flown += 1
        if run.recording.outcome == "completed" and run.metrics["tracking_max_m"] < 1.0:
            metrics.append(run.metrics)
    if not metrics:
        return "lost"
    far = 100.0 * max(m["tracking_max_m"] for m in metrics)
    near = min(m["min_angle_deg"] for m in metrics)
    kept = "" if len(metrics) == flown else f", {len(metrics)} of {flown}"
    return f"{far:.1f} cm, {near:.0f}°{kept}"


def lose(kind: str, overrides: Overrides) -> str:
    """One drone lost at 3, 6.5 or 10 s: flights held, and of those the distance from the path 3 s later."""
    held, flown = [], 0
    for at in (3.0, 6.5, 10.0):
        for drone in range(4):
            fault = [{"kind": kind, "at": at, "drone": drone}]
            run = colift.run("real-world", seed=flown, overrides={**overrides, "fault": fault})
            flown += 1
            r = run.recording
            error = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
            if r.outcome == "completed" and run.metrics["lost_drones"] == 1.0:
                held.append((float(error[r.time >= at + 3.0].max()), run.metrics["min_angle_deg"]))
    if not held:
        return f"0 of {flown}"
    far, near = max(f for f, _ in held), min(a for _, a in held)
    return f"{len(held)} of {flown}, {100.0 * far:.0f} cm, {near:.0f}°"


def main() -> None:
    seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
    print("| | " + " | ".join(CONTROLLERS) + " |")
    print("|---" * (1 + len(CONTROLLERS)) + "|")
    for name, case in CASES.items():
        cells = [fly({**case, **controller}, seeds) for controller in CONTROLLERS.values()]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print("\n| all at once | load +50 % | load -50 % |\n|---|---|---|")
    for name, change in WITHOUT.items():
        cells = [fly({**change, "truth.load_mass_factor": f}, seeds) for f in (1.5, 0.5)]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print("\n| all at once, then one is lost | load +50 % | load as told |\n|---|---|---|")
    for kind in ("cable-cut", "drone-lost"):
        cells = [lose(kind, {"truth.load_mass_factor": factor}) for factor in (1.5, 1.0)]
        print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
