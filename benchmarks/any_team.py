"""Random teams of which only the bodies are given: ``python benchmarks/any_team.py --missions 400``.

Draws drones of 27 g to 25 kg, 1 to 8 of them and not always equal, cables of 0.3 to 15 m, a load of 5 to 150 % of a drone's
mass within what they lift, a hover or figure-eight, wind or none, ideal or real motors, ideal sensors or noise and
delay. Nothing else is set: gains, limits and start are colift's. A mission is refused, or flies 40 s; it flies well when its
load is where it should be in the second half, within a tenth of a metre or of the cables' length, nobody is lost and no two cables come
within 15 degrees. ``--unasked`` flies the refused ones as well, to find false alarms.
"""

import argparse
import json
import math
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission import load_mission
from colift.record import metrics
from colift.study.size import flaw_of

DURATION = 40.0
SEED = 100_000


def draw(seed):
    """A mission of a random team, as the table of a file."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    n, base = int(rng.integers(1, 9)), between(0.027, 25.0)
    unequal = n > 1 and rng.random() < 0.3
    m = base * (rng.uniform(0.8, 1.25, n) if unequal else np.ones(n))
    arm = 0.2 * (m / 0.5) ** (1.0 / 3.0) * rng.uniform(0.8, 1.25)
    length = max(between(0.3, 15.0), 2.5 * float(arm.max()))
    lengths = length * (rng.uniform(0.9, 1.1, n) if unequal else np.ones(n))
    J = np.outer(m * arm**2 * rng.uniform(0.2, 0.5), [1.0, rng.uniform(0.9, 1.1), 1.8])
    thrust = m * 9.81 * rng.uniform(1.7, 3.0)
    lag = float(np.clip(0.02 * (base / 0.5) ** (1.0 / 3.0) * rng.uniform(0.8, 1.5), 0.01, 0.08))
    lifts = 0.75 * float(np.sum(0.8 * thrust - 9.81 * m)) / 9.81
    load = min(base * between(0.05, 1.5), lifts)
    drones = {
        "count": n, "mass": m.tolist(), "inertia": J.tolist(), "arm": arm.tolist(),
        "max_thrust": thrust.tolist(), "motor_lag": lag, "cable_length": lengths.tolist(),
    }  # fmt: skip
    mission = {
        "name": f"team {seed}", "seed": seed, "load": {"mass": load}, "drones": drones,
        "timing": {"duration": DURATION},
        "reference": {"kind": str(rng.choice(["hover", "figure-eight"]))},
    }  # fmt: skip
    if rng.random() < 0.25:
        mission["actuation"] = {"kind": "ideal"}
    if rng.random() < 0.6:
        periods = ("load_control", "allocation", "position_control", "attitude_control")
        mission["timing"] |= dict.fromkeys(periods, 0.01) | {"delay": 0.02}
        mission["sensing"] = {"kind": "noisy"}
    wind = float(rng.choice([0.0, 0.0, 3.0, 6.0]))
    if wind:
        blows = {"speed": wind, "heading_deg": 30.0}
        mission["disturbance"] = [{"kind": kind, **blows} for kind in ("wind", "dryden")]
        mission["disturbance"].append({"kind": "drag"})
    return mission


def fly(job):
    """Fly one mission; what became of it, and its numbers."""
    seed, unasked = job
    table = draw(seed)
    found = {
        "seed": seed, "n": table["drones"]["count"], "mass": table["drones"]["mass"][0],
        "length": table["drones"]["cable_length"][0], "load": table["load"]["mass"] / table["drones"]["mass"][0],
        "thrust": table["drones"]["max_thrust"][0] / table["drones"]["mass"][0] / 9.81,
        "reference": table["reference"]["kind"], "motors": "actuation" not in table, "noisy": "sensing" in table,
        "wind": table["disturbance"][0]["speed"] if "disturbance" in table else 0.0, "refused": "",
    }  # fmt: skip
    try:
        mission = load_mission(table)
    except MissionError as error:
        found["refused"] = "; ".join(str(each) for each in error.problems)
        if not unasked:
            return found
        try:
            mission = load_mission(table, must_fly=False)
        except MissionError:
            return found
    recording = Flight(mission).run()
    numbers = metrics.compute(recording)
    flaw, worst = flaw_of(recording)
    return found | {
        "good": not flaw, "flaw": flaw, "worst": worst, "slack": float(numbers["slack_time_s"]),
        "saturated": float(numbers["saturated_time_s"]),
    }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--missions", type=int, default=400)
    parser.add_argument("--seed", type=int, default=SEED, help="of the first mission")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--unasked", action="store_true", help="fly refused missions, too")
    parser.add_argument("--out", type=Path, help="write all results to this JSON file")
    asked = parser.parse_args()
    jobs = [(asked.seed + k, asked.unasked) for k in range(asked.missions)]
    began, found = time.time(), []
    with ProcessPoolExecutor(asked.jobs) as pool:
        for each in pool.map(fly, jobs):
            found.append(each)
            if not each["refused"] and not each["good"]:
                shown = {k: round(v, 3) if isinstance(v, float) else v for k, v in each.items()}
                print(shown, flush=True)
            elif each["refused"]:
                flown = {True: "flies", False: "fails", None: "not flown"}[each.get("good")]
                print(f"{each['seed']} refused ({flown}): {each['refused'][:220]}", flush=True)
            if len(found) % 50 == 0:
                print(
                    f"{len(found)} of {len(jobs)} in {time.time() - began:.0f} s", file=sys.stderr
                )
    flown = [each for each in found if not each["refused"]]
    good = sum(each["good"] for each in flown)
    low, high = shares.interval(good, max(len(flown), 1))
    verdicts = Counter((bool(e["refused"]), e.get("good")) for e in found)
    print(f"{len(found)} missions: {len(found) - len(flown)} refused; of {len(flown)} flown {good} well "
          f"({100 * good / max(len(flown), 1):.1f} %, 95 %: {100 * low:.1f} to {100 * high:.1f})")  # fmt: skip
    for (refused, well), count in sorted(verdicts.items(), key=str):
        print(
            f"  {'refused' if refused else 'let fly'}, {'not flown' if well is None else 'well' if well else 'badly'}: {count}"
        )
    if asked.out:
        asked.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
