"""Lifts from the ground to the ground, one after another: ``python docs/figures/lifts.py --fly`` measures, without it only writes the tables of ``ground.md``.

Names of parts after ``--fly`` (``cases``, ``vehicles``, ``gusts``, ``mujoco``) measure these alone; the last takes minutes a flight.
"""

import json
import math
import sys
from pathlib import Path

from pages import fill, stored, table

import colift
from colift.kernel.math.shares import interval
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


G = 9.81
CARRY = "pick-up-and-place"
VEHICLES = {
    "crazyflie-2.1": (0.012, 0.027, 0.5),
    "x500": (1.0, 2.064, 2.0),
    "s500": (1.0, 1.7, 2.0),
    "hexacopter-3kg": (1.5, 2.69, 2.0),
    "heavy-lift-25kg": (15.0, 24.5, 5.0),
}
"""Masses of the load and of each of four drones, kg, and the cables' length, m."""
PLANTS = ("slack-cables", "elastic-cables")
GUSTS, UNSEEN = 40, 1100
"""Flights of each vehicle in gusts, and the first of their seeds: those below it were seen while the lift was made."""
AIR = 5.0
"""Speed of the air at which a body is pushed with the share of its weight that is asked for, m/s."""


def carry(vehicle, plant="slack-cables"):
    """The mission `pick-up-and-place` at the size of a vehicle."""
    load, _, L = VEHICLES[vehicle]
    return {
        "drones.vehicle": vehicle, "drones.cable_length": L, "load.mass": load, "plant.kind": plant,
        "reference.points": [[0.0, 0.0, 0.5 * L], [L, 0.0, 0.6 * L]],
        "supervision.set_down": [L, 0.5 * L], "timing.duration": 40.0 + 14.0 * L,
    }  # fmt: skip


def gusts(vehicle, share, seed):
    """Gusts that push drones and load with up to a share of their weight, along three directions, at random times and sizes."""
    load, drone, _ = VEHICLES[vehicle]
    trains = ((0.0, 0.3, 2.0, 3.0), (90.0, -0.3, 1.0, 2.0), (225.0, 0.0, 3.0, 5.0))
    air = [
        {
            "kind": "gust", "at": 0.0, "duration": duration, "every": every,
            "peak": [AIR * math.cos(math.radians(a)), AIR * math.sin(math.radians(a)), AIR * up],
        }
        for a, up, duration, every in trains
    ]  # fmt: skip
    none = dict.fromkeys(("drone_area", "load_area", "cable_diameter", "rotor_drag"), 0.0)
    drag = {"drone_linear": share * drone * G / AIR, "load_linear": share * load * G / AIR}
    free = {
        name: {"max": 9.0}
        for name in (
            "lift_peak",
            "touch_peak",
            "touch_speed_mps",
            "drone_touch_speed_mps",
            "placement_m",
        )
    }
    return {
        **carry(vehicle), "disturbance": [*air, {"kind": "drag", **none, **drag}], "seed": seed,
        **{f"criteria.{name}": bound for name, bound in free.items()},
    }  # fmt: skip


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
CALM = (
    "vehicle", "plant", "all targets", "peak at take-off (weights)", "peak at touch-down",
    "load, drones touch with (m/s)", "placed within (mm)",
)  # fmt: skip
GUSTY = (
    "vehicle", "good", "95 % interval", "landed", "false alarms", "hooked anew or given up",
    "placed within (mm)", "told at (mm)",
)  # fmt: skip
KEPT = (
    "lift_peak", "touch_peak", "touch_speed_mps", "drone_touch_speed_mps", "dragged_m", "touch_height_m",
    "placement_m",
)  # fmt: skip


def measure():
    """Of each line the number of good flights and the worst of each number; None where a flight has none."""
    return [
        [name, *of([colift.run(m, overrides=changes) for m, changes in flights])]
        for name, flights in FLOWN
    ]


def done(run):
    """Whether all stand on the ground in the end."""
    return bool(run.recording["phase"][-1, 0] == Phase.DONE)


def of(runs):
    """How many of the flights are good, how many there are, the worst of their numbers, and what was weighed."""
    worst = {}
    for key in KEPT:
        values = [abs(run.metrics[key]) for run in runs]
        worst[key] = max(values) if all(v == v for v in values) else None
    shares = [r.metrics["weighed_mass_kg"] / r.mission.true_team.load_mass for r in runs]
    ok = sum(run.verdict.ok and done(run) for run in runs)
    shares = [share for share in shares if share == share] or [0.0]  # who gives up weighs nothing
    return ok, len(runs), worst, [min(shares), max(shares)]


def measure_vehicles(plants=PLANTS):
    """Each vehicle on each plant, in calm air."""
    return [
        [vehicle, plant, *of([colift.run(CARRY, overrides=carry(vehicle, plant))])]
        for plant in plants
        for vehicle in VEHICLES
    ]


def in_gusts(run):
    """What a flight in gusts is judged by."""
    found = run.metrics
    return {
        "landed": done(run),
        "placed": done(run) and found["placement_m"] <= 0.1 and found["weighed_mass_kg"] > 0.0,
        "told": abs(found["touch_height_m"]) <= 5e-3,
        "alarm": found["lost_drones"] > 0.0,
        "setbacks": found["setbacks"],
        **{
            key: None if math.isnan(found[key]) else abs(found[key])
            for key in ("placement_m", "touch_height_m")
        },
    }


def measure_gusts():
    """Flights of each vehicle in gusts of a twentieth of the weight."""
    found = {}
    for vehicle in VEHICLES:
        flights = [
            in_gusts(colift.run(CARRY, overrides=gusts(vehicle, 0.05, seed)))
            for seed in range(UNSEEN, UNSEEN + GUSTS)
        ]
        found[vehicle] = flights
        print(
            vehicle,
            sum(f["placed"] and f["told"] and not f["alarm"] for f in flights),
            "of",
            len(flights),
            flush=True,
        )
    return found


PARTS = {
    "cases": measure, "vehicles": measure_vehicles, "gusts": measure_gusts,
    "mujoco": lambda: measure_vehicles(("mujoco",)),
}  # fmt: skip


def measure_parts():
    """What was asked for anew, the rest as it is kept."""
    asked = [name for name in sys.argv[1:] if name in PARTS] or list(PARTS)
    path = Path(__file__).with_suffix(".json")
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return {
        name: PARTS[name]() if name in asked else kept[name]
        for name in PARTS
        if name in asked or name in kept
    }


def shown(value, scale=1.0, digits=2):
    """A number in a cell."""
    return "-" if value is None else f"{scale * value:.{digits}f}"


def main():
    found = stored(__file__, measure_parts)
    rows = []
    for name, ok, count, worst, (low, high) in found["cases"]:
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
    rows = []
    for vehicle, plant, ok, _, worst, _ in [*found["vehicles"], *found.get("mujoco", [])]:
        rows.append(
            [
                f"`{vehicle}`",
                f"`{plant}`",
                "yes" if ok else "no",
                shown(worst["lift_peak"]),
                shown(worst["touch_peak"]),
                f"{shown(worst['touch_speed_mps'], digits=3)}, {shown(worst['drone_touch_speed_mps'], digits=3)}",
                shown(worst["placement_m"], 1e3, 1),
            ]
        )
    fill("ground.md", "calm-vehicles", table(CALM, rows))
    rows, every = [], []
    for vehicle, flights in [*found["gusts"].items(), ("all", every)]:
        every += flights if vehicle != "all" else []
        good = sum(f["placed"] and f["told"] and not f["alarm"] for f in flights)
        low, high = interval(good, len(flights))
        rows.append(
            [
                vehicle if vehicle == "all" else f"`{vehicle}`",
                f"{good} of {len(flights)}",
                f"{100 * low:.0f} to {100 * high:.0f} %",
                str(sum(f["landed"] for f in flights)),
                str(sum(f["alarm"] for f in flights)),
                str(int(sum(f["setbacks"] for f in flights))),
                shown(max(f["placement_m"] or 0.0 for f in flights), 1e3, 1),
                shown(max(f["touch_height_m"] or 0.0 for f in flights), 1e3, 1),
            ]
        )
    fill("ground.md", "gusts", table(GUSTY, rows))


if __name__ == "__main__":
    main()
