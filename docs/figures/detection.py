"""Print the figures of docs/world.md on detection: times to detect, and false alarms, over many seeds.

python docs/figures/detection.py [seeds, default 40]
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from colift import survival
from colift.mission import load_mission
from colift.simulation.flight import Flight

WINDS = (0.0, 5.0, 10.0)
FAULTS = ("cable cut", "drone dead, on its cable", "drone dead, cable cut", "one motor dead")


def flight(seed: int, wind: float, duration: float, fault: dict[str, Any] | None = None) -> Flight:
    """The mission cut-in-flight with this mean wind, as much turbulence, and this fault."""
    table = load_mission("cut-in-flight").resolved()
    table["seed"], table["timing"]["duration"] = seed, duration
    table["fault"] = [fault] if fault else []
    table["disturbance"][0]["speed"] = table["disturbance"][1]["speed"] = wind
    flown = Flight(load_mission(table))
    flown.run()
    return flown


def main() -> None:
    seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    print("| fault | wind, m/s | found | median, ms | slowest, ms | others judged lost |")
    print("|---|---|---|---|---|---|")
    for name in FAULTS:
        for wind in WINDS:
            own, others = [], 0
            for seed in seeds:
                at = 3.0 + 5.0 * seed / len(seeds)
                fault = {**survival.FAULTS[name], "at": at, "drone": seed % 4}
                for when, drone in flight(seed, wind, at + 3.0, fault).found:
                    if drone == seed % 4 and when >= at:
                        own.append(1e3 * (when - at))
                    else:
                        others += 1
            middle, slowest = (np.median(own), max(own)) if own else (np.nan, np.nan)
            found = f"{len(own)} of {len(seeds)}"
            print(f"| {name} | {wind:g} | {found} | {middle:.0f} | {slowest:.0f} | {others} |")
    for wind in WINDS:
        alarms = sum(len(flight(seed, wind, 20.0).found) for seed in seeds)
        print(f"- no fault, {wind:g} m/s: {alarms} alarms in {len(seeds)} flights of 20 s")


if __name__ == "__main__":
    main()
