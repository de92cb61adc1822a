"""What a lost drone costs a box: ``python docs/figures/rigid_losses.py`` writes the table of docs/rigid-loads.md, with ``--fly`` flown anew first.

Each drone of each team is lost at three times, in wind with gusts and with noisy, delayed sensors; a cable that is cut and a drone that stops are found by
``residuals``.
"""

from concurrent.futures import ProcessPoolExecutor

import numpy as np
from pages import fill, stored, table

from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission import load_mission
from colift.mission.outlook import losses
from colift.record import metrics

TEAMS = {
    "box-figure-eight, slower, 4": ("box-figure-eight", {"reference.period": 7.6}),
    "the same, 5": ("box-figure-eight", {"reference.period": 7.6, "drones.count": 5}),
    "the same, 6": ("box-figure-eight", {"reference.period": 7.6, "drones.count": 6}),
    "the same, 3": ("box-figure-eight", {"reference.period": 7.6, "drones.count": 3}),
    "box-figure-eight, 4": ("box-figure-eight", {}),
    "box-through-poses": ("box-through-poses", {}),
}
TIMES = (0.25, 0.45, 0.6)
"""When, over the duration of the flight."""
KINDS = ("cable-cut", "drone-lost")
SEED = 79_000
CONDITIONS = {
    "sensing.kind": "noisy",
    "timing.load_control": 0.01,
    "timing.allocation": 0.01,
    "timing.position_control": 0.01,
    "timing.attitude_control": 0.01,
    "timing.delay": 0.02,
    "detection.kind": "residuals",
}
WIND = [
    {"kind": "wind", "speed": 5.0, "heading_deg": 30.0},
    {"kind": "dryden", "speed": 5.0, "heading_deg": 30.0},
    {"kind": "drag"},
]
END, PLACE, TURN = 2.0, 0.3, 15.0
"""A team has survived that in the last so many seconds keeps place (m) and attitude (degrees) within this, and touches nothing; it has been brought
down where it keeps that place, which sinks by then, with the load hanging as it likes."""


def fly(job):
    """How one flight ends, and how far it strays after the loss."""
    name, drone, kind, when, seed = job
    mission, overrides = TEAMS[name]
    duration = load_mission(mission, overrides).timing.duration
    fault = [{"kind": kind, "at": when * duration, "drone": drone}]
    loaded = load_mission(
        mission, {**overrides, **CONDITIONS, "seed": seed, "fault": fault, "disturbance": WIND}
    )
    told = losses(loaded)[drone]
    recording = Flight(loaded).run()
    place = np.linalg.norm(metrics.tracking_error(recording), axis=1)
    turn = np.degrees(np.linalg.norm(metrics.attitude_error(recording), axis=1))
    late, after = recording.time >= recording.time[-1] - END, recording.time >= when * duration
    return {
        "team": name, "drone": drone, "kind": kind, "at": when, "told": told.carries, "outcome": recording.outcome,
        "end": [float(place[late].max()), float(turn[late].max())], "most": [float(place[after].max()), float(turn[after].max())],
    }  # fmt: skip


def measure():
    """Every drone of every team, at every time."""
    jobs, seed = [], SEED
    for name, (mission, overrides) in TEAMS.items():
        for drone in range(load_mission(mission, overrides).drones.count):
            for kind in KINDS:
                for when in TIMES:
                    jobs.append((name, drone, kind, when, seed))
                    seed += 1
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(fly, jobs, chunksize=4))


def brought_down(flight):
    """Whether those that cannot go on come down, or are on their way, where they are told to."""
    return flight["outcome"].startswith("descended") and flight["end"][0] <= PLACE


def survived(flight):
    """Whether the load is held to the end where that was told."""
    place, turn = flight["end"]
    return flight["outcome"] == "completed" and place <= PLACE and turn <= TURN


def main():
    flown = stored(__file__, measure)
    rows = []
    for name in TEAMS:
        found = [each for each in flown if each["team"] == name]
        held = [each for each in found if each["told"]]
        whole = sum(map(survived, held))
        most = np.array([each["most"] for each in held]) if held else np.full((1, 2), np.nan)
        median, worst = np.median(most, axis=0), most.max(axis=0)
        sizes = [f"{100 * median[0]:.0f}, {100 * worst[0]:.0f}", f"{median[1]:.0f}, {worst[1]:.0f}"]
        said = (
            f"{whole}/{len(held)} ({shares.percent(*shares.interval(whole, len(held)), 0)})"
            if held
            else "-"
        )
        rows.append(
            [
                name,
                said,
                *(sizes if held else ["-", "-"]),
                f"{sum(map(brought_down, found))}/{len(found)}",
            ]
        )
    header = ["flight", "told to go on: survived", "most off, cm: median, worst", "most turned, deg", "brought down"]  # fmt: skip
    fill("rigid-loads.md", "losses", table(header, rows))


if __name__ == "__main__":
    main()
