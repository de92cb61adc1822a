"""Which single faults a team survives: every fault, at every drone, at several times of the flight."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from colift.control.allocation.limits.feasibility import spread_formation
from colift.flight.flight import Flight
from colift.kernel.math import shares
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.record import metrics
from colift.record.recording import Recording
from colift.team.scaling import scaled_load, scaled_mu

FAULTS: dict[str, dict[str, Any]] = {
    "cable cut": {"kind": "cable-cut"},
    "drone dead, on its cable": {"kind": "drone-lost"},
    "drone dead, cable cut": {"kind": "drone-lost", "with_cable": False},
    "one motor dead": {"kind": "motor-degraded", "health": 0.0},
    "one motor at half": {"kind": "motor-degraded", "health": 0.5},
    "battery down to 70 %": {"kind": "battery-low", "health": 0.7, "duration": 2.0},
    "drone's sensors stuck, 0.2 s": {"kind": "sensor-stuck", "duration": 0.2},
    "drone's sensors stuck for good": {"kind": "sensor-stuck", "duration": 1e3},
    "load's sensors stuck, 0.1 s": {"kind": "sensor-stuck", "body": "load", "duration": 0.1},
    "allocator silent, 0.3 s": {"kind": "allocator-silent", "duration": 0.3},
}
"""Single faults by name, as entries of a mission's ``fault`` list."""

WHOLE_TEAM = ("load's sensors stuck, 0.1 s", "allocator silent, 0.3 s")
"""Those that are the same whichever drone is named."""

CALM = 3.0
"""Time after the fault from when the load must be back on its path, s."""
ERROR = 0.15
"""Distance from its path that it must keep from then on, m."""
ANGLE = 20.0
"""Angle that every pair of cables must keep all the time, degrees."""


@dataclass(frozen=True)
class Case:
    """One flight with one fault."""

    fault: str
    drone: int
    at: float
    mission: Mission


@dataclass(frozen=True)
class Survival:
    """How such a flight went.

    Attributes
    ----------
    case : Case
    outcome : str
        As in the recording.
    delay : float
        Time from the fault until a drone was judged lost, s; NaN if none was.
    innocent : int
        Drones other than the broken one that were judged lost.
    error : float
        Largest distance of the load from its path from ``CALM`` after the fault, m.
    angle : float
        Smallest angle between two cables, degrees.
    height : float
        Least height of the load, m.

    """

    case: Case
    outcome: str
    delay: float
    innocent: int
    error: float
    angle: float
    height: float

    @property
    def survived(self) -> bool:
        """Whether the load is still flown along its path, with the cables apart."""
        flown = self.outcome == "completed" and not self.innocent
        return flown and self.error <= ERROR and not self.angle < ANGLE


def team_table(source: str | Mapping[str, Any], n: int) -> dict[str, Any]:
    """The mission with n drones that each carry the share that each of its own drones carries.

    Load, load controller and alignment penalty grow with the number; the start is a formation within the
    allocator's limits.
    """
    mission = load_mission(source)
    table = mission.resolved()
    count = table["drones"]["count"]
    growth = n / count
    table["drones"]["count"] = n
    table["load"]["mass"] = scaled_load(n, table["load"]["mass"], count)
    for gain in ("k_p", "k_d", "k_i"):
        table["load_control"][gain] = [growth * value for value in table["load_control"][gain]]
    limits = table["allocation"]
    limits["mu"] = scaled_mu(n, limits["mu"], count, keep="mu over squared weight")
    cone = max(mission.start_cone, np.radians(0.7 * limits["max_cone_deg"]))
    apart = np.radians(limits["min_angle_deg"] + 2.0)
    table["start"]["directions"] = spread_formation(n, cone, apart).tolist()
    return table


def cases(
    source: str | Mapping[str, Any] = "cut-in-flight",
    counts: Iterable[int] = range(3, 9),
    times: Sequence[float] = (3.0, 6.5, 10.0),
    faults: Mapping[str, Mapping[str, Any]] = FAULTS,
    after: float = 6.0,
) -> Iterator[Case]:
    """Every fault at every drone at every time (s), with a seed of its own, flown until ``after`` s later."""
    seed = 0
    for n in counts:
        table = team_table(source, n)
        for name, fault in faults.items():
            for drone in range(1 if name in WHOLE_TEAM else n):
                for at in times:
                    changes = {"seed": seed, "timing.duration": at + after}
                    broken = {**table, "fault": [{**fault, "at": at, "drone": drone}]}
                    yield Case(name, drone, at, load_mission(broken, changes))
                    seed += 1


def fly(case: Case) -> Survival:
    """Fly one case and judge it."""
    flight = Flight(case.mission)
    recording = flight.run()
    values = metrics.compute(recording)
    own = [when - case.at for when, drone in flight.membership.found if drone == case.drone]
    return Survival(
        case=case,
        outcome=recording.outcome,
        delay=own[0] if own else float("nan"),
        innocent=len(flight.membership.found) - len(own),
        error=_error_after(recording, case.at + CALM),
        angle=values["min_angle_deg"],
        height=values["min_height_m"],
    )


def _error_after(recording: Recording, begin: float) -> float:
    """Largest distance of the load from its path from a time on, m; infinite if the flight ends before."""
    late = metrics.tracking_error(recording)[recording.time >= begin]
    return float(np.linalg.norm(late, axis=1).max()) if len(late) else float("inf")


def summary(results: Iterable[Survival]) -> list[dict[str, Any]]:
    """One row for each fault and number of drones: how many survive, and the worst numbers of those."""
    groups: dict[tuple[str, int], list[Survival]] = {}
    for result in results:
        key = result.case.fault, result.case.mission.drones.count
        groups.setdefault(key, []).append(result)
    rows = []
    for (fault, n), group in groups.items():
        alive = [result for result in group if result.survived]
        delays = [result.delay for result in group if np.isfinite(result.delay)]
        rows.append(
            {
                "fault": fault,
                "drones": n,
                "flights": len(group),
                "survived": len(alive),
                "interval": shares.interval(len(alive), len(group)),
                "descended": sum(result.outcome.startswith("descended") for result in group),
                "found": len(delays),
                "slowest_detection_s": max(delays, default=float("nan")),
                "worst_error_m": max((result.error for result in alive), default=float("nan")),
                "least_angle_deg": min((result.angle for result in alive), default=float("nan")),
            }
        )
    return rows
