"""The published agile tests flown: ``python docs/figures/agile_box.py`` writes their table in docs/rigid-loads.md, with ``--fly`` flown anew first."""

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from pages import fill, stored, table

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics

SEEDS = range(72_000, 72_010)
TESTS = ((1.0, 0.5), (2.0, 2.0), (2.0, 4.0), (5.0, 8.0))
"""Most speed and acceleration, m/s and m/s^2."""
STEEPEST = 2.125
"""Most acceleration of an eight half as wide as long, over half its length and the rate squared."""
LEVEL = {"reference.lean": 0.0}
WIDER = {"allocation.cone_deg": 40.0}
WAYS = {"level": LEVEL, "level, cables planned at 40°": {**LEVEL, **WIDER}, "leaning": {}}
NAMES = (
    "tracking_rms_m",
    "attitude_rms_deg",
    "min_drone_distance_m",
    "min_downwash_distance_m",
    "peak_thrust_fraction",
    "max_tilt_deg",
    "slack_time_s",
    "allocator_limited",
)


def mission_of(speed, acceleration, way, seed):
    """The shipped mission on another eight."""
    rate = math.sqrt(2.0) * acceleration / STEEPEST / speed
    length = speed / math.sqrt(2.0) / rate
    eight = {
        "reference.length": length,
        "reference.width": 0.5 * length,
        "reference.period": 2.0 * math.pi / rate,
        "timing.duration": round(8.0 + 4.0 * math.pi / rate, 1),
    }
    return load_mission("agile-box", {**eight, **WAYS[way], "seed": seed})


def fly(job):
    """What the flight reached, and how well."""
    speed, acceleration, way, seed = job
    told = {"speed": speed, "acceleration": acceleration, "way": way, "seed": seed}
    try:
        recording = Flight(mission_of(*job)).run()
    except MissionError as error:
        return {**told, "outcome": f"refused: {error}"}
    found = metrics.compute(recording)
    reached = np.linalg.norm(recording["reference"], axis=2).max(axis=0)[1:3]
    numbers = {name: float(found[name]) for name in NAMES}
    return {**told, **numbers, "outcome": recording.outcome, "reached": reached.tolist()}


def measure():
    """All tests, each way, with each seed."""
    jobs = [(*test, way, seed) for test in TESTS for way in WAYS for seed in SEEDS]
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(fly, jobs))


def main():
    flown = stored(__file__, measure)
    rows = []
    for speed, acceleration in TESTS:
        for way in WAYS:
            asked = [speed, acceleration, way]
            all_seeds = [
                each
                for each in flown
                if [each[k] for k in ("speed", "acceleration", "way")] == asked
            ]
            found = [each for each in all_seeds if each["outcome"] == "completed"]
            row = [f"{speed:g}", f"{acceleration:g}", way, f"{len(found)}/{len(all_seeds)}"]
            most, least = (
                {name: pick(each[name] for each in found) for name in NAMES} if found else {}
                for pick in (max, min)
            )
            if found:
                row += [
                    f"{100.0 * most['tracking_rms_m']:.2f}",
                    f"{most['attitude_rms_deg']:.2f}",
                    f"{least['min_drone_distance_m']:.2f}",
                    f"{100.0 * most['peak_thrust_fraction']:.0f} %",
                    f"{most['max_tilt_deg']:.0f}",
                    f"{most['allocator_limited']:.0f}",
                ]
            rows.append(row + ["-"] * (10 - len(row)))
    header = [
        "m/s",
        "m/s²",
        "the box is",
        "flown to the end",
        "RMS, cm",
        "RMS, deg",
        "least distance, m",
        "peak thrust",
        "most tilt, deg",
        "cycles at a limit",
    ]
    fill("rigid-loads.md", "agile", table(header, rows))


if __name__ == "__main__":
    main()
