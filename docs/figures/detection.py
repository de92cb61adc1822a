"""Write the tables of docs/world.md on detection: ``python docs/figures/detection.py [--fly]``.

Times to detect, and false alarms, over 40 seeds; then false alarms of ``real-world`` in 10 m/s of wind with gusts, over
340 seeds with each mass of the load. From ``detection.json`` beside this file, which ``--fly`` makes first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pages import fill, stored, table

from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission import load_mission
from colift.study import survival

SEEDS = range(1000, 1040)
WINDS = (0.0, 5.0, 10.0)
FAULTS = ("cable cut", "drone dead, on its cable", "drone dead, cable cut", "one motor dead")
MANY = range(1000, 1340)
LOADS = {"as told": 1.0, "+50 %": 1.5, "-50 %": 0.5}


def windy(seed: int, wind: float, fault: dict[str, Any]) -> Flight:
    """The mission cut-in-flight with this mean wind, as much turbulence, and this fault."""
    table = load_mission("cut-in-flight").resolved()
    table["seed"], table["timing"]["duration"] = seed, fault["at"] + 3.0
    table["fault"] = [fault]
    table["disturbance"][0]["speed"] = table["disturbance"][1]["speed"] = wind
    flown = Flight(load_mission(table))
    flown.run()
    return flown


def gusty(seed: int, load: float, fault: dict[str, Any] | None = None) -> Flight:
    """The mission real-world with this share of the believed mass of the load: 10 m/s, gusts, rotors that drag."""
    changes: dict[str, Any] = {"seed": seed, "truth.load_mass_factor": load}
    if fault:
        changes |= {"fault": [fault], "timing.duration": fault["at"] + 3.0}
    flown = Flight(load_mission("real-world", changes))
    flown.run()
    return flown


def faulty(name: str, fly_one: Callable[[int, dict[str, Any]], Flight]) -> dict[str, Any]:
    """What is found of a fault in flights over the seeds, and who else is judged lost."""
    own, others = [], 0
    for seed in SEEDS:
        at = 3.0 + 5.0 * (seed - SEEDS[0]) / len(SEEDS)
        fault = {**survival.FAULTS[name], "at": at, "drone": seed % 4}
        for when, drone in fly_one(seed, fault).membership.found:
            if drone == seed % 4 and when >= at:
                own.append(1e3 * (when - at))
            else:
                others += 1
    return {"fault": name, "found_ms": own, "others": others}


def fly_faults() -> list[dict[str, Any]]:
    """Each fault in each wind, and in gusts with each load."""
    found = []
    for name in FAULTS:
        for wind in WINDS:
            one = faulty(name, lambda seed, fault, w=wind: windy(seed, w, fault))
            found.append({"where": f"{wind:g} m/s", **one})
        for load, factor in LOADS.items():
            one = faulty(name, lambda seed, fault, f=factor: gusty(seed, f, fault))
            found.append({"where": f"10 m/s, gusts, load {load}", **one})
    return found


def fly_many(load: float) -> dict[str, Any]:
    """Without a fault, in gusts: seeds and judgements of the flights with an alarm."""
    alarms = {seed: found for seed in MANY if (found := gusty(seed, load).membership.found)}
    return {"flights": len(MANY), "alarms": alarms}


def fly() -> dict[str, Any]:
    """All of it."""
    many = {load: fly_many(factor) for load, factor in LOADS.items()}
    return {"flights": len(SEEDS), "faults": fly_faults(), "many": many}


def main() -> None:
    found = stored(__file__, fly)
    rows = []
    for each in found["faults"]:
        own = each["found_ms"]
        middle, slowest = (f"{np.median(own):.0f}", f"{max(own):.0f}") if own else ("-", "-")
        count = shares.text(len(own), found["flights"])
        rows.append([each["fault"], each["where"], count, middle, slowest, str(each["others"])])
    header = ["fault", "wind", "found (95 %)", "median, ms", "slowest, ms", "others judged lost"]
    many = {load: (len(each["alarms"]), each["flights"]) for load, each in found["many"].items()}
    many["all"] = tuple(np.sum(list(many.values()), axis=0).tolist())
    calm = [
        [load, str(flights), str(alarms), shares.percent(*shares.interval(alarms, flights), 2)]
        for load, (alarms, flights) in many.items()
    ]
    tables = (
        table(header, rows),
        table(["no fault, 10 m/s, gusts, load", "flights", "with alarms", "95 %"], calm),
    )
    fill("world.md", "detection", "\n\n".join(tables))


if __name__ == "__main__":
    main()
