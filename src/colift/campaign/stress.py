"""The campaign behind ``colift stress``: what can go wrong x allocators x plants x seeds, against criteria."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colift.campaign.plan import Case, Labels, without_seed
from colift.errors import ColiftError, UnknownNameError
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.mission.schema import Bound
from colift.survival import FAULTS, WHOLE_TEAM
from colift.verdict import Judgement, judgements

Overrides = dict[str, Any]
Row = Mapping[str, Any]

UNTOUCHED: Overrides = {
    "truth": {}, "sensing": {"kind": "ideal"}, "link": {"kind": "ideal"},
    "actuation": {"kind": "ideal"}, "disturbance": [], "fault": [],
}  # fmt: skip
"""A world in which nothing goes wrong. Every condition is this with something changed."""

WIND = [
    {"kind": "wind", "speed": 10.0, "heading_deg": 30.0},
    {"kind": "dryden", "speed": 10.0, "heading_deg": 30.0},
    {"kind": "gust", "peak": [4.0, 3.0, 1.0], "at": 3.0, "every": 3.0},
    {"kind": "drag"},
]
LATE = {f"{sensor}_delay": 0.02 for sensor in ("load", "tracking", "attitude", "rates")}
EXACT = {
    **dict.fromkeys(
        ("load_position_noise", "load_velocity_noise", "position_noise", "velocity_noise"), 0.0
    ),
    "rates_noise": 0.0, "attitude_noise_deg": 0.0, "attitude_bias": 0.0,
}  # fmt: skip
NOISY = {"kind": "noisy", **LATE}

WEATHER: dict[str, Overrides] = {
    "calm": {},
    "delay": {"sensing": {**NOISY, **EXACT}},
    "noise": {"sensing": NOISY},
    "wind": {"disturbance": WIND, "sensing": {**NOISY, **EXACT}},
    "radio": {"link": {"kind": "radio"}, "sensing": NOISY},
    "load +50 %": {"truth": {"load_mass_factor": 1.5}, "sensing": NOISY},
    "load -50 %": {"truth": {"load_mass_factor": 0.5}, "sensing": NOISY},
    "all, load +50 %": {"truth": {"load_mass_factor": 1.5}, "sensing": NOISY, "disturbance": WIND},
    "all, load -50 %": {"truth": {"load_mass_factor": 0.5}, "sensing": NOISY, "disturbance": WIND},
}
"""Conditions without a fault; delay and noise are those of ``noisy`` sensors, 20 ms late."""

FAULT_AT = 6.0
"""When the fault of a condition happens, s; at the drone of the seed's number."""

DEFAULT_CRITERIA: dict[str, dict[str, float]] = {
    "tracking_max_m": {"max": 0.15},
    "min_angle_deg": {"min": 20.0},
    "min_height_m": {"min": 0.0},
}
"""For a mission that has no criteria of its own."""


def condition_names() -> list[str]:
    """Every condition, those without a fault first."""
    return [*WEATHER, *FAULTS]


def expand(text: str) -> list[str]:
    """Conditions from one text, separated by semicolons; ``* in wind`` is every fault in that weather."""
    found = []
    for condition in text.split(";"):
        fault, _, weather = condition.strip().partition(" in ")
        every = fault == "*" and weather
        found += [f"{name} in {weather}" for name in FAULTS] if every else [condition.strip()]
    return found


def _parts(condition: str) -> tuple[str, str]:
    """Fault and weather of a condition; no fault is an empty name."""
    if condition in WEATHER:
        return "", condition
    fault, found, weather = condition.partition(" in ")
    if fault not in FAULTS:
        raise UnknownNameError("condition", fault, list(FAULTS) if found else condition_names())
    if found and weather not in WEATHER:
        raise UnknownNameError("condition", weather, list(WEATHER))
    return fault, weather or "noise"


def world(condition: str, seed: int, n: int) -> Overrides:
    """What a condition makes of a mission's world.

    A fault comes with delay and noise, or with the weather that is named behind it: ``"cable cut in wind"``.

    Raises
    ------
    UnknownNameError
        If there is no such condition.

    """
    fault, weather = _parts(condition)
    found = {**UNTOUCHED, **WEATHER[weather]}
    if fault:
        drone = 0 if fault in WHOLE_TEAM else seed % n
        found["fault"] = [{**FAULTS[fault], "at": FAULT_AT, "drone": drone}]
    return found


def cases(
    mission: str,
    conditions: Sequence[str],
    allocators: Sequence[str],
    plants: Sequence[str],
    seeds: Iterable[int],
    changes: Mapping[str, Any] | None = None,
) -> list[Case]:
    """Every flight; an empty list of allocators or plants stands for the mission's own.

    The condition replaces the mission's truth, sensing, link, actuation, disturbances and faults; ``changes``
    come last. The allocator that the mission names keeps its settings there.
    """
    changes = without_seed(changes)
    for layer, several in (("allocation", allocators), ("plant", plants)):
        if several and changes.keys() & {layer, f"{layer}.kind"}:
            option = {"allocation": "--allocators", "plant": "--plants"}[layer]
            raise ColiftError(f"{layer}.kind is what {option} varies; change fields of it by name")
    own = {path: value for path, value in changes.items() if path.partition(".")[0] in _MISSIONS}
    loaded = load_mission(mission, own)
    criteria = loaded.criteria or DEFAULT_CRITERIA
    found = []
    for seed in seeds:
        for condition in conditions:
            around = world(condition, seed, loaded.drones.count) | {"seed": seed}
            around["criteria"] = {
                name: _bound(name, bound, condition) for name, bound in criteria.items()
            }
            for allocator in allocators or [loaded.kinds["allocation"]]:
                for plant in plants or [loaded.kinds["plant"]]:
                    kinds = {"allocation.kind": allocator, "plant.kind": plant}
                    labels: Labels = {
                        "condition": condition, "allocator": allocator, "plant": plant, "seed": seed
                    }  # fmt: skip
                    found.append(Case(labels, mission, layered(around, kinds, changes)))
    return found


_MISSIONS = ("allocation", "plant", "drones")
"""Sections that a condition leaves alone and that decide which flights there are."""


def _bound(name: str, bound: Bound | dict[str, float], condition: str) -> dict[str, Any]:
    plain = bound.model_dump(exclude_none=True) if isinstance(bound, Bound) else dict(bound)
    if name == "lost_drones" and _parts(condition)[0] and "max" in plain:
        plain["max"] = max(plain["max"], 1.0)  # the one that breaks may leave
    return plain


@dataclass(frozen=True)
class Verdict:
    """How one flight stands against its criteria.

    Attributes
    ----------
    row : mapping
        The flight, as the campaign keeps it.
    mission : Mission
        As flown.
    judged : list of Judgement
        The criteria; empty for a flight that ended in an error.

    """

    row: Row
    mission: Mission
    judged: list[Judgement]

    @property
    def passed(self) -> bool:
        ended = self.row["status"] == "flown" and self.row["outcome"] == "completed"
        return ended and all(each.holds for each in self.judged)

    @property
    def reason(self) -> str:
        """Why it failed, in words; empty where it passed."""
        if self.row["status"] != "flown":
            return str(self.row["error"])
        ended = [] if self.row["outcome"] == "completed" else [str(self.row["outcome"])]
        return "; ".join([*ended, *(str(each) for each in self.judged if not each.holds)])


def verdicts(rows: Iterable[Row], missions: Mapping[str, Mapping[str, Any]]) -> list[Verdict]:
    """Judge rows; ``missions`` has the resolved mission of each key."""
    found = []
    for row in rows:
        mission = load_mission(missions[row["key"]])
        judged = judgements(mission, row) if row["status"] == "flown" else []
        found.append(Verdict(row, mission, judged))
    return found


@dataclass(frozen=True)
class Cell:
    """All seeds of one condition, allocator and plant."""

    passed: int
    flown: int
    worst_m: float
    """Largest distance of the load from its reference in any of them; infinite if one did not end well."""
    least_deg: float
    """Smallest angle between two cables in any of them."""


def matrix(found: Sequence[Verdict]) -> dict[str, dict[tuple[str, str], Cell]]:
    """Cells by condition, then by allocator and plant, in the order in which they were asked for."""
    groups: dict[str, dict[tuple[str, str], list[Verdict]]] = {}
    for verdict in found:
        row = verdict.row
        cell = groups.setdefault(str(row["condition"]), {})
        cell.setdefault((str(row["allocator"]), str(row["plant"])), []).append(verdict)
    return {
        condition: {place: _cell(each) for place, each in cells.items()}
        for condition, cells in groups.items()
    }


def _cell(group: Sequence[Verdict]) -> Cell:
    def value(verdict: Verdict, name: str) -> float:
        flown = verdict.row["status"] == "flown" and verdict.row["outcome"] == "completed"
        return float(verdict.row[name]) if flown else math.nan

    errors = [value(verdict, "tracking_max_m") for verdict in group]
    angles = [value(verdict, "min_angle_deg") for verdict in group]
    return Cell(
        passed=sum(verdict.passed for verdict in group),
        flown=len(group),
        worst_m=math.inf if any(map(math.isnan, errors)) else max(errors),
        least_deg=min((angle for angle in angles if not math.isnan(angle)), default=math.nan),
    )
