"""Lifts from the ground to the ground, one after another: ``python docs/figures/lifts.py --fly`` measures, without it only writes the table of ``ground.md``."""

from pages import fill, stored, table

import colift
from colift.kernel.phase import Phase

NOISY = {"timing.delay": 0.02, "sensing.kind": "noisy", "estimation.kind": "predictor"}
SEEDS = 4


def push(share):
    """A lasting push on the load, of a share of the weight of 0.225 kg."""
    return {"disturbance": [{"kind": "push", "force": [share * 2.207, 0.0, 0.0], "duration": 1e3}]}


def wind(speed, seed):
    """Wind with its turbulence on drones, cables and load."""
    air = [{"kind": kind, "speed": speed, "heading_deg": 30.0} for kind in ("wind", "dryden")]
    return {"disturbance": [*air, {"kind": "drag"}], "seed": seed}


BASE = "take-off-and-land"
FLOWN = [
    ("as shipped", [(BASE, {})]),
    ("`pick-up-and-place`", [("pick-up-and-place", {})]),
    ("`crazyflie-trio`", [("crazyflie-trio", {})]),
    ("`heavy-lift`", [("heavy-lift", {})]),
    ("1 drone", [(BASE, {"drones.count": 1, "criteria.lift_peak": {"max": 1.1}})]),
    ("2 drones", [(BASE, {"drones.count": 2})]),
    ("8 drones, 0.6 kg", [(BASE, {"drones.count": 8, "load.mass": 0.6})]),
    ("3 drones, 0.6 kg", [(BASE, {"drones.count": 3, "load.mass": 0.6})]),
    ("load -50 %, +50 %", [(BASE, {"truth.load_mass_factor": f}) for f in (0.5, 1.5)]),
    ("cables -5 %, +5 %", [(BASE, {"truth.cable_length_factor": f}) for f in (0.95, 1.05)]),
    ("drones +10, 0, -5, +5 %", [(BASE, {"truth.drone_mass_factor": [1.1, 1.0, 0.95, 1.05]})]),
    ("noise, 20 ms late", [(BASE, {**NOISY, "seed": seed}) for seed in range(SEEDS)]),
    ("push of 5 % of the weight", [(BASE, push(0.05))]),
    ("elastic cables", [(BASE, {"plant.kind": "elastic-cables"})]),
    ("cables of beads", [(BASE, {"plant.kind": "bead-cables"})]),
    *(
        (f"{speed:g} m/s of wind, gusts", [(BASE, wind(speed, seed)) for seed in range(SEEDS)])
        for speed in (2.0, 4.0, 6.0)
    ),
]  # fmt: skip

HEADER = (
    "`take-off-and-land`, but", "verdict ok", "peak at take-off, at touch-down (weights)",
    "load, drones touch with (m/s)", "dragged (mm)", "told at (mm)", "placed within (mm)",
    "weighed / true",
)  # fmt: skip
KEPT = (
    "lift_peak", "touch_peak", "touch_speed_mps", "drone_touch_speed_mps", "dragged_m", "touch_height_m",
    "placement_m",
)  # fmt: skip


def measure():
    """Of each line the number of good flights and the worst of each number; None where a flight has none."""
    found = []
    for name, flights in FLOWN:
        runs = [colift.run(mission, overrides=changes) for mission, changes in flights]
        worst = {}
        for key in KEPT:
            values = [abs(run.metrics[key]) for run in runs]
            worst[key] = max(values) if all(v == v for v in values) else None
        shares = [r.metrics["weighed_mass_kg"] / r.mission.true_team.load_mass for r in runs]
        done = [bool(run.recording["phase"][-1, 0] == Phase.DONE) for run in runs]
        ok = sum(run.verdict.ok and end for run, end in zip(runs, done, strict=True))
        found.append([name, ok, len(runs), worst, [min(shares), max(shares)]])
    return found


def shown(value, scale=1.0, digits=2):
    """A number in a cell."""
    return "-" if value is None else f"{scale * value:.{digits}f}"


def main():
    rows = []
    for name, ok, count, worst, (low, high) in stored(__file__, measure):
        rows.append(
            [
                name,
                f"{ok} of {count}",
                f"{shown(worst['lift_peak'])}, {shown(worst['touch_peak'])}",
                f"{shown(worst['touch_speed_mps'], digits=3)}, {shown(worst['drone_touch_speed_mps'], digits=3)}",
                shown(worst["dragged_m"], 1e3, 1),
                shown(worst["touch_height_m"], 1e3, 1),
                shown(worst["placement_m"], 1e3, 1),
                f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f}",
            ]
        )
    fill("ground.md", "lifts", table(HEADER, rows))


if __name__ == "__main__":
    main()
