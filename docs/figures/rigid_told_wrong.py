"""Rigid loads that are told wrong: ``python docs/figures/rigid_told_wrong.py`` writes the table of docs/rigid-loads.md, with ``--fly`` flown anew first."""

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from pages import fill, stored, table
from rigid_loads import HARDER, displaced

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics

SEEDS = range(73_000, 73_010)
LAWS = ("pose", "pose-robust", "pose-adaptive")
WRONG = {
    "nothing": {},
    "centre of mass 3 cm along": {"truth.centre_of_mass_offset": [0.03, 0.0, 0.0]},
    "centre of mass 3 cm across": {"truth.centre_of_mass_offset": [0.0, 0.03, 0.0]},
    "centre of mass 3 cm higher": {"truth.centre_of_mass_offset": [0.0, 0.0, 0.03]},
    "mass, by a fifth": {"truth.load_mass_factor": 1.2},
    "inertia, by a half": {"truth.load_inertia_factor": 1.5},
    "attachments, by 1 cm": {},
    "wind of 5 m/s, turbulent": {
        "disturbance": [
            {"kind": "wind", "speed": 5.0},
            {"kind": "dryden", "speed": 5.0},
            {"kind": "drag"},
        ]
    },
}
CALM = {"reference.period": 7.0, "timing.duration": 45.0, **HARDER}
"""A slower eight: the shipped one goes slack with a centre of mass 3 cm aside, however well it is known."""
LATE = 25.0
"""From when on errors count, s."""


def fly(job):
    """Errors of place (cm) and attitude (degrees), root mean square, before and after that time."""
    wrong, law, seed = job
    overrides = {**CALM, **WRONG[wrong], "load_control.kind": law, "seed": seed}
    if wrong.startswith("attachments"):
        overrides |= displaced(4, seed)
    recording = Flight(load_mission("box-figure-eight", overrides)).run()
    late = recording.time >= LATE
    place = 100.0 * np.linalg.norm(metrics.tracking_error(recording), axis=1)
    turn = np.degrees(np.linalg.norm(metrics.attitude_error(recording), axis=1))
    sizes = [
        math.sqrt(float(np.mean(each[when] ** 2)))
        for each in (place, turn)
        for when in (~late, late)
    ]
    told = {"wrong": wrong, "law": law, "seed": seed, "outcome": recording.outcome}
    return {**told, "sizes": sizes, "slack": float(recording["slack_times"][-1].sum())}


def measure():
    """All that is told wrong, with each law and each seed."""
    jobs = [(wrong, law, seed) for wrong in WRONG for law in LAWS for seed in SEEDS]
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(fly, jobs))


def main():
    flown = stored(__file__, measure)
    rows = []
    for wrong in WRONG:
        for law in LAWS:
            found = [each for each in flown if each["wrong"] == wrong and each["law"] == law]
            whole = sum(each["outcome"] == "completed" and each["slack"] == 0.0 for each in found)
            worst = np.max([each["sizes"] for each in found], axis=0)
            rows.append([wrong, f"`{law}`", f"{whole}/{len(found)}", *(f"{x:.2f}" for x in worst)])
    header = [
        "told wrong",
        "law",
        "flown, never slack",
        "cm, to 25 s",
        "cm, later",
        "deg, to 25 s",
        "deg, later",
    ]
    fill("rigid-loads.md", "told_wrong", table(header, rows))


if __name__ == "__main__":
    main()
