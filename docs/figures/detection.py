"""Write the table of docs/world.md on detection: ``python docs/figures/detection.py [--fly]``.

Times to detect, and false alarms, over 40 seeds; from ``detection.json`` beside this file, which ``--fly`` makes first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pages import fill, stored, table

from colift import survival
from colift.mission import load_mission
from colift.simulation.flight import Flight

SEEDS = range(1000, 1040)
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


def fly() -> dict[str, Any]:
    """Each fault in each wind over the seeds, and flights without one."""
    faults, calm = [], []
    for name in FAULTS:
        for wind in WINDS:
            own, others = [], 0
            for seed in SEEDS:
                at = 3.0 + 5.0 * (seed - SEEDS[0]) / len(SEEDS)
                fault = {**survival.FAULTS[name], "at": at, "drone": seed % 4}
                for when, drone in flight(seed, wind, at + 3.0, fault).found:
                    if drone == seed % 4 and when >= at:
                        own.append(1e3 * (when - at))
                    else:
                        others += 1
            faults.append({"fault": name, "wind": wind, "found_ms": own, "others": others})
    for wind in WINDS:
        alarms = sum(len(flight(seed, wind, 20.0).found) for seed in SEEDS)
        calm.append({"wind": wind, "alarms": alarms})
    return {"flights": len(SEEDS), "faults": faults, "calm": calm}


def main() -> None:
    found = stored(__file__, fly)
    rows = []
    for each in found["faults"]:
        own = each["found_ms"]
        middle, slowest = (f"{np.median(own):.0f}", f"{max(own):.0f}") if own else ("-", "-")
        count = f"{len(own)} of {found['flights']}"
        wind, others = f"{each['wind']:g}", str(each["others"])
        rows.append([each["fault"], wind, count, middle, slowest, others])
    header = ["fault", "wind, m/s", "found", "median, ms", "slowest, ms", "others judged lost"]
    calm = "\n".join(
        f"- no fault, {each['wind']:g} m/s: {each['alarms']} alarms in {found['flights']} flights of 20 s"
        for each in found["calm"]
    )
    fill("world.md", "detection", f"{table(header, rows)}\n\n{calm}")


if __name__ == "__main__":
    main()
