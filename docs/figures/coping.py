"""Write the tables of docs/theory/control.md: what each part buys, alone and together.

python docs/figures/coping.py [--fly] [--seeds 5]

From ``coping.json`` beside this file, which ``--fly`` makes first.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any

import numpy as np
from pages import fill, stored, table

import colift
from colift.kernel.math import shares
from colift.study import stress

Overrides = dict[str, Any]

CASES: dict[str, Overrides] = {
    name: {**stress.UNTOUCHED, **stress.WEATHER[name], "detection.kind": "none"}
    for name in stress.WEATHER
    if name != "radio"
}
IDEAL = {"actuation": {"kind": "ideal"}, "disturbance.3.rotor_drag": 0.0}
"""Rotors that do at once what they are told, and do not drag."""
LAYERS = ("attitude_control", "position_control", "load_control", "estimation")
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
    "without the motors' lag told": {f"{layer}.lag": 0.0 for layer in LAYERS},
    "on ideal rotors": {**IDEAL, **{f"{layer}.lag": 0.0 for layer in LAYERS}},
}


def fly(overrides: Overrides, seeds: Iterable[int]) -> str:
    """Largest distance from the path and smallest angle over the seeds, and how many went to the end."""
    metrics, flown = [], 0
    for seed in seeds:
        run = colift.run("real-world-adaptive", seed=seed, overrides=overrides)
        flown += 1
        if run.recording.outcome == "completed" and run.metrics["tracking_max_m"] < 1.0:
            metrics.append(run.metrics)
    if not metrics:
        return "lost"
    far = 100.0 * max(m["tracking_max_m"] for m in metrics)
    near = min(m["min_angle_deg"] for m in metrics)
    kept = "" if len(metrics) == flown else f", {shares.text(len(metrics), flown)}"
    return f"{far:.1f} cm, {near:.0f}°{kept}"


def lose(kind: str, overrides: Overrides) -> str:
    """One drone lost at 3, 6.5 or 10 s: flights held, and of those the distance from the path 3 s later."""
    held, flown = [], 0
    for at in (3.0, 6.5, 10.0):
        for drone in range(4):
            fault = [{"kind": kind, "at": at, "drone": drone}]
            run = colift.run(
                "real-world-adaptive", seed=1000 + flown, overrides={**overrides, "fault": fault}
            )
            flown += 1
            r = run.recording
            error = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
            if r.outcome == "completed" and run.metrics["lost_drones"] == 1.0:
                held.append((float(error[r.time >= at + 3.0].max()), run.metrics["min_angle_deg"]))
    if not held:
        return shares.text(0, flown)
    far, near = max(f for f, _ in held), min(a for _, a in held)
    return f"{shares.text(len(held), flown)}, {100.0 * far:.0f} cm, {near:.0f}°"


def measure(seeds: Iterable[int]) -> dict[str, list[list[str]]]:
    """Header and lines of each table."""
    return {
        "coping": [
            ["", *CONTROLLERS],
            *(
                [name, *(fly({**case, **controller}, seeds) for controller in CONTROLLERS.values())]
                for name, case in CASES.items()
            ),
        ],
        "without": [
            ["all at once", "load +50 %", "load -50 %"],
            *(
                [name, *(fly({**change, "truth.load_mass_factor": f}, seeds) for f in (1.5, 0.5))]
                for name, change in WITHOUT.items()
            ),
        ],
        "losses": [
            ["all at once, then one is lost", "load +50 %", "load as told"],
            *(
                [kind, *(lose(kind, {"truth.load_mass_factor": factor}) for factor in (1.5, 1.0))]
                for kind in ("cable-cut", "drone-lost")
            ),
        ],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--seeds", type=int, default=5)
    count = parser.parse_known_args()[0].seeds
    for name, (header, *lines) in stored(
        __file__, lambda: measure(range(1000, 1000 + count))
    ).items():
        fill("theory/control.md", name, table(header, lines))


if __name__ == "__main__":
    main()
