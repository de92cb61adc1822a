"""Write the tables of docs/theory/control.md on what is told wrongly: lengths, delays, ropes; and on better sensors.

python docs/figures/told_wrong.py [--fly] [--seeds 12]

From ``told_wrong.json`` beside this file, which ``--fly`` makes first. No tuning saw these seeds.
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
from colift.world.sensing.base import SENSORS

Overrides = dict[str, Any]
FIRST = 52_000
"""The first seed."""

CALM: Overrides = {"disturbance": [], "truth.load_mass_factor": 1.0}


def late(delay: float) -> Overrides:
    """All measurements come this late, s; 20 ms are told."""
    return {f"sensing.{sensor}_delay": delay for sensor in SENSORS}


WRONG: dict[str, Overrides] = {
    "nothing": {},
    "cables 10 % longer than told": {"truth.cable_length_factor": 1.1},
    "cables 10 % shorter": {"truth.cable_length_factor": 0.9},
    "each cable otherwise": {"truth.cable_length_factor": [1.1, 0.9, 1.05, 0.95]},
    "10 ms later than told": late(0.03),
    "10 ms earlier": late(0.01),
}
BELIEVED = {"observation.learning": 0.0, "estimation.delay_from": "told"}
WAYS: dict[str, Overrides] = {
    "calm, found in flight": CALM,
    "calm, told values believed": {**CALM, **BELIEVED},
    "all at once, found in flight": {},
    "all at once, told values believed": BELIEVED,
}

LIGHT: Overrides = {"truth.load_mass_factor": 0.5}
EXACT = {f"sensing.{name}": value for name, value in stress.EXACT.items()}
BETTER: dict[str, Overrides] = {
    "as they are": {},
    "exact": EXACT,
}
"""Whether better sensors would serve the observers."""

ROPES: Overrides = {
    **CALM, "plant.kind": "bead-cables", "plant.drag_coefficient": 0.0, "detection.kind": "none",
}  # fmt: skip
"""Ropes in calm air, which does not blow on them either."""


def fly(overrides: Overrides, seeds: Iterable[int]) -> str:
    """Median and largest distance from the path over the seeds, and the share that passed."""
    far, passed, flown = [], 0, 0
    for seed in seeds:
        run = colift.run("real-world", seed=seed, overrides=overrides)
        far.append(100.0 * run.metrics["tracking_max_m"])
        flown += 1
        passed += run.recording.outcome == "completed" and run.verdict.ok
    return f"{np.median(far):.1f} cm, {max(far):.1f} cm; {shares.text(passed, flown)}"


def hang(density: float, told: float) -> list[str]:
    """A flight with ropes of one density (kg/m), another told: distance from the path, what observers make up for."""
    run = colift.run(
        "real-world", seed=FIRST, overrides={**ROPES, "plant.density": density, "drones.cable_density": told}
    )  # fmt: skip
    r = run.recording
    late = r.time > 2.0
    off = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
    start = float(100.0 * off[r.time < 2.0].max())
    made_up = float(np.abs(r["estimated_forces"][late].sum(axis=1)[:, 2].mean()))
    return [f"{start:.2f} cm", f"{100.0 * off[late].max():.2f} cm", f"{made_up:.2f} N"]


def measure(seeds: Iterable[int]) -> dict[str, list[list[str]]]:
    """Header and lines of each table."""
    return {
        "told-wrong": [
            ["wrong is", *WAYS],
            *(
                [name, *(fly({**way, **wrong}, seeds) for way in WAYS.values())]
                for name, wrong in WRONG.items()
            ),
        ],
        "told-sensors": [
            ["sensors", "load +50 %", "load -50 %"],
            *(
                [name, *(fly({**change, **load}, seeds) for load in ({}, LIGHT))]
                for name, change in BETTER.items()
            ),
        ],
        "told-ropes": [
            ["ropes, kg/m", "told", "largest error, first 2 s", "afterwards", "made up for by observers"],
            *(
                [f"{density:g}", f"{told:g}", *hang(density, told)]
                for density in (0.01, 0.03, 0.06)
                for told in (0.0, density)
            ),
        ],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--seeds", type=int, default=12)
    count = parser.parse_known_args()[0].seeds
    found = stored(__file__, lambda: measure(range(FIRST, FIRST + count)))
    for name, (header, *lines) in found.items():
        fill("theory/control.md", name, table(header, lines))


if __name__ == "__main__":
    main()
