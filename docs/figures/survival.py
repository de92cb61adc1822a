"""Print the survival table of docs/world.md: every single fault, at every drone, at several times.

python docs/figures/survival.py [most drones, default 8]
"""

from __future__ import annotations

import math
import sys

from colift import survival


def cell(row: dict) -> str:
    text = f"{row['survived']}/{row['flights']}"
    if row["survived"]:
        text += f" {100.0 * row['worst_error_m']:.0f} cm"
        if not math.isnan(row["least_angle_deg"]):
            text += f" {row['least_angle_deg']:.0f}°"
    if row["found"]:
        text += f" {1e3 * row['slowest_detection_s']:.0f} ms"
    return text


def main() -> None:
    counts = range(3, int(sys.argv[1]) + 1 if len(sys.argv) > 1 else 9)
    results = []
    for case in survival.cases(counts=counts):
        results.append(survival.fly(case))
        if len(results) % 50 == 0:
            print(f"{len(results)} flights", file=sys.stderr, flush=True)
    rows = {(row["fault"], row["drones"]): row for row in survival.summary(results)}
    print("| fault | " + " | ".join(f"n = {n}" for n in counts) + " |")
    print("|---" * (1 + len(counts)) + "|")
    for fault in survival.FAULTS:
        print(f"| {fault} | " + " | ".join(cell(rows[fault, n]) for n in counts) + " |")
    lost = [result for result in results if not result.survived]
    for result in lost[:40]:
        case = result.case
        print(
            f"- n = {case.mission.drones.count}, drone {case.drone} at {case.at:g} s, {case.fault}: "
            f"{result.outcome}; {100.0 * result.error:.0f} cm, {result.angle:.0f}°, "
            f"{result.innocent} others judged lost",
            file=sys.stderr,
        )


if __name__ == "__main__":
    main()
