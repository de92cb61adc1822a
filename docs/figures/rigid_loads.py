"""How boxes fly: ``python docs/figures/rigid_loads.py`` writes the table of docs/rigid-loads.md, with ``--fly`` flown anew first."""

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from pages import fill, stored, table

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics

SEEDS = range(71_000, 71_010)
LAYERS = ("load_control", "allocation", "position_control", "attitude_control")
HARDER = {
    "sensing.kind": "noisy",
    "timing.delay": 0.02,
    **{f"timing.{layer}": 0.01 for layer in LAYERS},
}
"""Noise, delay, and layers at 100 Hz."""
CASES = {
    "ideal motors": {"actuation.kind": "ideal"},
    "motors with lag and limits": {},
    "the same on elastic cables": {"plant.kind": "elastic-cables"},
    "the same in MuJoCo": {"plant.kind": "mujoco"},
    "noise, 20 ms of delay, 100 Hz": {},
    "the same, attachments 1 cm wrong": {},
}
NOISY = ("noise, 20 ms of delay, 100 Hz", "the same, attachments 1 cm wrong")
PERIODS = {3: 6.4, 4: 5.4, 6: 6.4}
"""Of the eight, s: with three and six drones the faster one asks more of their rotors than they give."""
LATE = 6.0
"""From when on errors count, s: when the eight has come up to speed."""


def displaced(n, seed):
    """Attachments of n cables that are 1 cm off, each in a direction of its own."""
    away = np.random.default_rng(seed).normal(size=(n, 3))
    away *= 0.01 / np.linalg.norm(away, axis=1, keepdims=True)
    return {"truth.attachment_offset": away.tolist()}


def mission_of(name, n, seed):
    """The shipped mission under the conditions of a case."""
    overrides = {"drones.count": n, "seed": seed, "reference.period": PERIODS[n], **CASES[name]}
    if name in NOISY:
        overrides |= HARDER
    if name == NOISY[1]:
        overrides |= displaced(n, seed)
    return load_mission("box-figure-eight", overrides)


def fly(job):
    """Errors of place (cm) and attitude (degrees): root mean square and largest."""
    name, n, seed = job
    recording = Flight(mission_of(name, n, seed)).run()
    late = recording.time >= LATE
    place = 100.0 * np.linalg.norm(metrics.tracking_error(recording)[late], axis=1)
    turn = np.degrees(np.linalg.norm(metrics.attitude_error(recording)[late], axis=1))
    sizes = [float(f(each)) for each in (place, turn) for f in (rms, np.max)]
    return {"case": name, "n": n, "seed": seed, "sizes": sizes, "outcome": recording.outcome}


def rms(values):
    return math.sqrt(float(np.mean(values**2)))


def measure():
    """All cases; those with noise with each seed."""
    jobs = [
        (name, n, seed)
        for name in CASES
        for n in PERIODS
        for seed in (SEEDS if name in NOISY else SEEDS[:1])
    ]
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(fly, jobs))


def main():
    flown = stored(__file__, measure)
    rows = []
    for name in CASES:
        for n in sorted({each["n"] for each in flown}):
            found = [each for each in flown if each["case"] == name and each["n"] == n]
            worst = np.max([each["sizes"] for each in found], axis=0)
            whole = sum(each["outcome"] == "completed" for each in found)
            most = 1.5 * (2.0 * math.pi / PERIODS[n]) ** 2
            sizes = (f"{size:.2f}" for size in worst)
            rows.append([name, f"{n}", f"{most:.1f}", f"{whole}/{len(found)}", *sizes])
    header = [
        "conditions",
        "drones",
        "m/s²",
        "flown to the end",
        "RMS, cm",
        "most, cm",
        "RMS, deg",
        "most, deg",
    ]
    fill("rigid-loads.md", "flown", table(header, rows))


if __name__ == "__main__":
    main()
