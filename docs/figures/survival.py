"""Write the survival table of docs/world.md: every single fault, at every drone, at several times.

python docs/figures/survival.py [--fly] [--most 8]

From ``survival.json`` beside this file, which ``--fly`` makes first (ten minutes).
"""

import argparse
import json
import sys
from pathlib import Path

from pages import fill, table

from colift.kernel.math import shares
from colift.study import survival

RESULTS = Path(__file__).with_suffix(".json")


def fly(most):
    """Fly every case; keep the summary, and say what was not survived."""
    results = []
    for case in survival.cases(counts=range(3, most + 1)):
        results.append(survival.fly(case))
        if len(results) % 50 == 0:
            print(f"{len(results)} flights", file=sys.stderr, flush=True)
    for result in [result for result in results if not result.survived][:40]:
        case = result.case
        print(
            f"- n = {case.mission.drones.count}, drone {case.drone} at {case.at:g} s, {case.fault}: "
            f"{result.outcome}; {100.0 * result.error:.0f} cm, {result.angle:.0f}°, "
            f"{result.innocent} others judged lost",
            file=sys.stderr,
        )
    rows = survival.summary(results)
    plain = [{k: None if v != v else v for k, v in row.items()} for row in rows]
    RESULTS.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n")


def cell(row):
    text = shares.text(row["survived"], row["flights"])
    if row["survived"]:
        text += f" {100.0 * row['worst_error_m']:.0f} cm"
        if row["least_angle_deg"] is not None:
            text += f" {row['least_angle_deg']:.0f}°"
    if row["found"]:
        text += f" {1e3 * row['slowest_detection_s']:.0f} ms"
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fly", action="store_true")
    parser.add_argument("--most", type=int, default=8)
    given = parser.parse_args()
    if given.fly:
        fly(given.most)
    rows = {(row["fault"], row["drones"]): row for row in json.loads(RESULTS.read_text())}
    counts = sorted({drones for _, drones in rows})
    lines = [
        [fault, *(cell(rows[fault, n]) for n in counts)]
        for fault in dict.fromkeys(fault for fault, _ in rows)
    ]
    fill("world.md", "survival", table(["fault", *(f"n = {n}" for n in counts)], lines))


if __name__ == "__main__":
    main()
