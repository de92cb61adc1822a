"""Write the table of docs/sitl.md: missions with simulated autopilots, and the same with our own attitude law.

python docs/figures/sitl.py [--fly [FLIGHT ...]]

From ``sitl.json`` beside this file, which ``--fly`` makes first, all of it or the flights that are named; that needs the extra sitl.
"""

from __future__ import annotations

from typing import Any

from pages import fill, stored_parts, table

import colift
from colift.deploy.sitl.team import Kill, SitlFlight, for_autopilots
from colift.mission import load_mission

SEEDS = (301, 302, 303)
"""That nothing was tuned on."""
ALONE = {
    "allocation.kind": "safe", "allocation.min_angle_deg": 30.0, "position_control.kind": "feed-forward",
    "plant.kind": "slack-cables",
}  # fmt: skip
"""What the spiral needs for one drone less."""
BREEZE = {"disturbance.0.speed": 5.0, "disturbance.1.speed": 5.0}
CASES: dict[str, tuple[str, dict[str, Any], tuple[Kill, ...]]] = {
    "hover": ("hover", {}, ()),
    "the paper's spiral": ("paper-spiral", {}, ()),
    "figure eight": ("figure-eight", {}, ()),
    "spiral in 5 m/s of wind, turbulence and gusts": ("windy-spiral", BREEZE, ()),
    "four drones, one leaves": ("four-to-three", {}, ()),
    "three drones, one joins": ("three-to-four", {}, ()),
    "a cable breaks and nobody is told; noise, radio, wind": ("cut-in-flight", {}, ()),
    "a process is killed in the spiral": ("paper-spiral", ALONE, (Kill(8.0, 1),)),
    "three Crazyflies": ("crazyflie-trio", {}, ()),
    "two drones": ("two-drones", {}, ()),
    "10 m/s of wind, 20 ms of delay, half as much load again": ("real-world", {}, ()),
    "from the ground and back": ("take-off-and-land", {}, ()),
}


def _numbers(run: colift.Run) -> dict[str, Any]:
    return {
        "level": run.verdict.level,
        "outcome": run.recording.outcome,
        **{name: run.metrics[name] for name in ("tracking_rms_m", "tracking_max_m", "lost_drones")},
    }


def measure(titles: list[str]) -> dict[str, Any]:
    """Cases with each seed, by autopilots and by our own law with the same gains outside of it."""
    result = {}
    for title in titles:
        name, overrides, kills = CASES[title]
        flown: dict[str, list[Any]] = {"autopilots": [], "own": []}
        for seed in SEEDS:
            seeded = {**overrides, "seed": seed}
            mission, motors, _ = for_autopilots(name, seeded)
            flown["autopilots"].append(_numbers(SitlFlight(mission, motors, kills).run()))
            if not kills:
                asked = load_mission(name, seeded).resolved()
                same = {**mission.resolved(), "attitude_control": asked["attitude_control"]}
                same["actuation"] = {"kind": "motors"}
                flown["own"].append(_numbers(colift.run(same)))
            print(f"{title}, seed {seed}: {flown['autopilots'][-1]}", flush=True)
        result[title] = flown
    return result


def _row(title: str, flown: dict[str, list[Any]]) -> list[str]:
    def span(flights: list[Any], name: str) -> str:
        if not flights:
            return "–"
        values = sorted(100.0 * each[name] for each in flights)
        low, high = f"{values[0]:.2g}", f"{values[-1]:.2g}"
        return low if low == high else f"{low} to {high}"

    flights = flown["autopilots"]
    levels = [each["level"] for each in flights]
    told = ", ".join(f"{levels.count(level)} {level}" for level in dict.fromkeys(levels))
    return [
        title,
        f"`{CASES[title][0]}`",
        span(flights, "tracking_rms_m"),
        span(flights, "tracking_max_m"),
        told,
        span(flown["own"], "tracking_rms_m"),
    ]


def main() -> None:
    found = stored_parts(__file__, CASES, measure)
    header = ["flight", "mission", "RMS, cm", "most, cm", "verdicts", "RMS with our own law, cm"]
    fill("sitl.md", "flights", table(header, [_row(*item) for item in found.items()]))


if __name__ == "__main__":
    main()
