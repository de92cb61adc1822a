"""Boxes whose pose nobody measures: ``python docs/figures/rigid_blind.py`` writes the table of docs/rigid-loads.md, with ``--fly`` flown anew first."""

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from pages import fill, stored, table
from rigid_loads import HARDER, LATE, PERIODS, displaced, rms

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.team.load import from_to

SEEDS = range(74_000, 74_010)
CABLES = {"estimation.load_from": "cables"}
WIND = [
    {"kind": "wind", "speed": 5.0},
    {"kind": "dryden", "speed": 5.0},
    {"kind": "drag"},
]
CASES = {
    "its own tracking": {},
    "drones and cables": CABLES,
    "the same, a fifth heavier than told": {**CABLES, "truth.load_mass_factor": 1.2},
    "the same, attachments 1 cm wrong": CABLES,
    "the same, in 5 m/s of turbulent wind": {**CABLES, "disturbance": WIND},
    "tracking that is lost at 8 s": {
        "fault": [{"kind": "sensor-stuck", "body": "load", "at": 8.0, "duration": 1e3}]
    },
}


def mission_of(name, n, seed):
    """The shipped eight with noise, delay and layers at 100 Hz."""
    overrides = {
        "drones.count": n, "seed": seed, "reference.period": PERIODS[n], **HARDER, **CASES[name],
    }  # fmt: skip
    if "attachments" in name:
        overrides |= displaced(n, seed)
    return load_mission("box-figure-eight", overrides)


def fly(job):
    """Root mean squares (cm, degrees): of the flight's errors, and of those of what is known of the load."""
    name, n, seed = job
    recording = Flight(mission_of(name, n, seed)).run()
    late = recording.time >= LATE
    known = (recording["estimated_load"] - recording["load"])[late, 0]
    pairs = zip(recording["load_attitude"], recording["estimated_load_attitude"], strict=True)
    turned = np.array([np.linalg.norm(from_to(*pair)[1:]) for pair in pairs])[late]
    sizes = [
        100.0 * rms(np.linalg.norm(metrics.tracking_error(recording)[late], axis=1)),
        math.degrees(rms(np.linalg.norm(metrics.attitude_error(recording)[late], axis=1))),
        100.0 * rms(np.linalg.norm(known, axis=1)),
        math.degrees(rms(2.0 * np.arcsin(np.minimum(turned, 1.0)))),
    ]
    return {"case": name, "n": n, "seed": seed, "sizes": sizes, "outcome": recording.outcome}


def foretold(n):
    """Deviations of place (cm) and turn (degrees) that the filter expects in hover."""
    mission = mission_of("drones and cables", n, 0)
    sizes = np.diag(mission.estimation.covariance(mission.team))
    return [100.0 * math.sqrt(sizes[:3].sum()), math.degrees(math.sqrt(sizes[3:].sum()))]


def measure():
    """All cases with each seed."""
    jobs = [(name, n, seed) for name in CASES for n in PERIODS for seed in SEEDS]
    with ProcessPoolExecutor(2) as pool:
        flown = list(pool.map(fly, jobs))
    return {"flown": flown, "foretold": {str(n): foretold(n) for n in PERIODS}}


def main():
    found = stored(__file__, measure)
    rows = []
    for name in CASES:
        for n in PERIODS:
            flights = [each for each in found["flown"] if each["case"] == name and each["n"] == n]
            worst = np.max([each["sizes"] for each in flights], axis=0)
            whole = sum(each["outcome"] == "completed" for each in flights)
            told = found["foretold"][str(n)] if name == "drones and cables" else []
            before = " / ".join(f"{each:.2f}" for each in told) or "-"
            rows.append(
                [name, f"{n}", f"{whole}/{len(flights)}", *(f"{x:.2f}" for x in worst), before]
            )
    header = [
        "the load is known from", "drones", "flown to the end", "off, cm", "turned, deg", "known to, cm", "known to, deg",
        "foretold in hover, cm / deg",
    ]  # fmt: skip
    fill("rigid-loads.md", "blind", table(header, rows))


if __name__ == "__main__":
    main()
