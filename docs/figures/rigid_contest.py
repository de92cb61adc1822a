"""How a box flies with each allocator: ``python docs/figures/rigid_contest.py [--fly]`` writes a table of docs/rigid-loads.md."""

from pages import fill, stored, table

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.study.compare import PERIOD

FIELD = {
    "`safe-wrench`": {},
    "`safe-wrench`, `cone_deg` = 15": {"allocation.cone_deg": 15.0},
    "`wrench-min-norm`": {"allocation.kind": "wrench-min-norm"},
    "`internal-force-wrench`": {"allocation.kind": "internal-force-wrench"},
    "`sqp-wrench`": {"allocation.kind": "sqp-wrench"},
    "`wahba-hoenig-wrench`": {"allocation.kind": "wahba-hoenig-wrench"},
}
SPEEDS = (5.4, 12.0)
"""Of the eight, s: as it is shipped, and a fifth of its acceleration."""
SHOWN = {
    "tracking_rms_m": ("RMS, cm", 100.0), "tracking_max_m": ("most, cm", 100.0), "attitude_rms_deg": ("RMS, deg", 1.0),
    "attitude_max_deg": ("most, deg", 1.0), "min_drone_distance_m": ("drones apart, m", 1.0), "slack_time_s": ("slack, s", 1.0),
    "tension_integral_Ns": ("tension, N s", 1.0),
}  # fmt: skip


def fly(name: str, period: float) -> dict[str, object]:
    """Numbers of one flight."""
    asked = {"reference.period": period, "timing.allocation": PERIOD, **FIELD[name]}
    found = metrics.compute(Flight(load_mission("box-figure-eight", asked)).run())
    return {"name": name, "period": period, **{metric: found[metric] for metric in SHOWN}}


def measure() -> list[dict[str, object]]:
    return [fly(name, period) for period in SPEEDS for name in FIELD]


def main() -> None:
    rows = [
        [
            row["name"], f"{row['period']:g}",
            *(f"{scale * row[metric]:.2f}" for metric, (_, scale) in SHOWN.items()),
        ]
        for row in stored(__file__, measure)
    ]  # fmt: skip
    header = ["allocator", "period, s", *(title for title, _ in SHOWN.values())]
    fill("rigid-loads.md", "contest", table(header, rows))


if __name__ == "__main__":
    main()
