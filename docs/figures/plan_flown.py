"""Write the tables of docs/plan.md on plans in the public benchmark's scenes, and how they are flown.

python docs/figures/plan_flown.py [--fly FOLDER]

From ``plan_flown.json`` beside this file, to which ``--fly`` adds what is missing, with the scenes of FOLDER, ``envs/quad3d_payload/benchmark_envs`` of
quimortiz/dynobench: it may be interrupted. No tuning saw these seeds.
"""

from __future__ import annotations

import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from pages import fill, stored, table

import colift
from colift.errors import PlanError
from colift.kernel.math import shares
from colift.plan import planner
from colift.plan.mission import mission_of
from colift.plan.scene import Scene, load_scene
from colift.record.recording import atomic_path

FIRST, SEEDS = 72_000, 10
SCENES, SIZES, MOST = ("empty", "window", "forest"), range(2, 9), 6
"""Kinds of scenes, numbers of drones; above so many the scene of 6 stands, with a cone for the larger team's."""
SECONDS = 2.8
"""Of one core for a plan."""
SPARE = planner.Limits(room=0.03, most=1.25)
"""For flights with noise: room and thrust for corrections."""
NOMINAL = {"actuation.kind": "ideal", "world.obstacles": [], "criteria": {}}
FULL = {"sensing.kind": "noisy", "truth.load_mass_factor": 1.2}
PUBLISHED = {
    "window": {2: (100, 2.0, 5.2), 3: (100, 2.0, 14), 4: (100, 2.1, 41), 5: (100, 2.1, 90), 6: (30, 2.8, 153)},
    "forest": {2: (100, 2.2, 23), 3: (80, 2.5, 86), 4: (70, 2.5, 64), 5: (0, None, None), 6: (10, 3.2, 227)},
}  # fmt: skip
"""Success, %, duration and time to plan, s, of Wahba, Ortiz de Haro, Toussaint and Hoenig's discontinuity-bounded search, in ten trials."""


def scene_of(folder: Path, kind: str, n: int) -> Scene:
    """A scene of the benchmark for so many drones."""
    found = load_scene(folder / f"{kind}_{min(n, MOST)}.yaml")
    if len(found.lengths) == n:
        return found
    return replace(found, directions=None, lengths=np.full(n, found.lengths[0]))


def errors(run: Any) -> tuple[float, float]:
    """Largest distances of the load and of the drones from the plan, m."""
    record, team, reference = run.recording, run.mission.team, run.mission.reference
    drones = 0.0
    for k in range(0, len(record.time), 5):
        told, _ = reference.call(team, np.zeros(0), time=float(record.time[k]))
        pulls = told.nominal_forces[:, 0]
        u = pulls / np.linalg.norm(pulls, axis=1, keepdims=True)
        x = told.reference[0] - team.cable_lengths[:, None] * u
        drones = max(drones, float(np.linalg.norm(record["positions"][k] - x, axis=1).max()))
    return run.metrics["tracking_max_m"], drones


def fly(folder: str, task: tuple[int, str, int]) -> dict[str, Any]:
    seed, kind, n = task
    scene = scene_of(Path(folder), kind, n)
    found: dict[str, Any] = {"scene": kind, "n": n, "seed": seed}
    search = partial(
        planner.plan, scene, seed=seed, attempts=100, seconds=SECONDS, clock=time.thread_time
    )
    planner.plan(scene, seed=0, attempts=1)  # compiles
    try:
        tight, spare = (search(limits) for limits in (planner.Limits(), SPARE))
    except PlanError as error:
        return {**found, "error": str(error)}
    found |= {
        "durations": [tight.duration, spare.duration],
        "first": tight.first,
        "total": tight.total,
    }
    nominal = colift.run(mission_of(tight), overrides=NOMINAL)
    found["nominal"] = [nominal.recording.outcome == "completed", *errors(nominal)]
    full = colift.run(mission_of(spare), overrides={**FULL, "seed": seed})
    clearance = full.metrics["min_clearance_m"]
    found["full"] = {
        "completed": full.recording.outcome == "completed",
        "load": full.metrics["tracking_max_m"],
        "clearance": clearance if np.isfinite(clearance) else None,
        "apart": full.metrics["min_drone_distance_m"],
    }
    return found


def measure() -> list[dict[str, Any]]:
    """Those of the file and those that are missing; the file is written after each."""
    folder = sys.argv[sys.argv.index("--fly") + 1]
    path = Path(__file__).with_suffix(".json")
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    done = {(each["seed"], each["scene"], each["n"]) for each in found}
    tasks = [
        task for task in product(range(FIRST, FIRST + SEEDS), SCENES, SIZES) if task not in done
    ]
    with ProcessPoolExecutor(2) as pool:
        for each in pool.map(partial(fly, folder), tasks):
            found.append(each)
            print(each, file=sys.stderr, flush=True)
            with atomic_path(path) as temporary:
                temporary.write_text(
                    json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8"
                )
    return found


def planned(kind: str, n: int, those: list[dict[str, Any]]) -> list[str]:
    """A row of the first table."""
    whole = [each for each in those if "error" not in each]
    durations = [each["durations"][0] for each in whole]
    share, lasts, search = PUBLISHED.get(kind, {}).get(n, (None, None, None))
    return [
        f"{kind}, {n}",
        shares.text(len(whole), len(those)),
        f"{median(durations):.2f}, {max(durations):.2f}" if whole else "-",
        f"{median(each['first'] for each in whole):.2f}" if whole else "-",
        f"{median(each['total'] for each in whole):.1f}" if whole else "-",
        "-" if share is None else f"{share} %",
        *("-" if value is None else f"{value:g}" for value in (lasts, search)),
    ]


def flown(name: str, those: list[dict[str, Any]]) -> list[str]:
    """A row of the second."""
    whole = [each for each in those if "error" not in each]
    nominal, full = ([each[which] for each in whole] for which in ("nominal", "full"))
    longer = [100.0 * (each["durations"][1] / each["durations"][0] - 1.0) for each in whole]
    clear = [each["clearance"] for each in full if each["clearance"] is not None]
    off = sorted(each["load"] for each in full)
    return [
        name,
        f"{100.0 * max(each[1] for each in nominal):.2f}, {100.0 * max(each[2] for each in nominal):.2f}",
        f"{median(longer):.1f}",
        shares.text(sum(each["completed"] for each in full), len(full)),
        f"{100.0 * median(off):.1f}, {100.0 * off[-1]:.1f}",
        f"{100.0 * min(clear):.1f}" if clear else "-",
    ]


def main() -> None:
    found = stored(__file__, measure)
    rows = []
    for kind, n in product(SCENES, SIZES):
        those = [each for each in found if (each["scene"], each["n"]) == (kind, n)]
        rows.append(planned(kind, n, those))
    header = [
        "scene, drones", "planned", "duration, median and longest, s", "first plan after, s", "last after, s", "published: planned",
        "duration, s", "planning, s",
    ]  # fmt: skip
    fill("plan.md", "plan-published", table(header, rows))
    lines = [flown(kind, [each for each in found if each["scene"] == kind]) for kind in SCENES]
    lines.append(flown("all", found))
    header = [
        "scene, 2 to 8 drones", "nominal: load, drones off by at most, cm", "spare: longer by, %", "without contact",
        "load off by, median and most, cm", "least clearance, cm",
    ]  # fmt: skip
    fill("plan.md", "plan-flown", table(header, lines))


if __name__ == "__main__":
    main()
