"""The campaign behind ``colift stress``: what can go wrong x allocators x plants x seeds, against criteria."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colift.errors import ColiftError, UnknownNameError
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.part import LAYERS
from colift.study.campaign.judge import fate, held
from colift.study.campaign.plan import Case, Labels, without_seed
from colift.study.survival import FAULTS, WHOLE_TEAM
from colift.world.actuation.motors import Motors
from colift.world.sensing.base import SENSORS

Overrides = dict[str, Any]
Row = Mapping[str, Any]

UNTOUCHED: Overrides = {
    "truth": {}, "sensing": {"kind": "ideal"}, "link": {"kind": "ideal"}, "disturbance": [], "fault": [],
}  # fmt: skip
"""A world in which nothing goes wrong. Every condition is this with something changed."""

ROTOR_DRAG = 0.02
"""Of the drones in every wind, s/m: 4 % of the thrust at 2 m/s, a fifth at 10 m/s."""

WIND = [
    {"kind": "wind", "speed": 10.0, "heading_deg": 30.0},
    {"kind": "dryden", "speed": 10.0, "heading_deg": 30.0},
    {"kind": "gust", "peak": [4.0, 3.0, 1.0], "at": 3.0, "every": 3.0},
    {"kind": "drag", "rotor_drag": ROTOR_DRAG},
]
LATE = {f"{sensor}_delay": 0.02 for sensor in SENSORS}
EXACT = {
    **dict.fromkeys(
        ("load_position_noise", "load_velocity_noise", "position_noise", "velocity_noise"), 0.0
    ),
    "rates_noise": 0.0, "attitude_noise_deg": 0.0, "attitude_bias": 0.0,
    "specific_force_noise": 0.0, "specific_force_bias": 0.0,
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

    The condition replaces the mission's truth, sensing, link, disturbances and faults, and ideal rotors by
    real ones, see :func:`motors`; ``changes`` come last. The allocator that the mission names keeps its
    settings there. Judged is by the mission's criteria and the defaults of every verdict.
    """
    changes = without_seed(changes)
    for layer, several in (("allocation", allocators), ("plant", plants)):
        if several and changes.keys() & {layer, f"{layer}.kind"}:
            option = {"allocation": "--allocators", "plant": "--plants"}[layer]
            raise ColiftError(f"{layer}.kind is what {option} varies; change fields of it by name")
    own = {path: value for path, value in changes.items() if path.partition(".")[0] in _MISSIONS}
    loaded = load_mission(mission, own)
    found = []
    for seed in seeds:
        for condition in conditions:
            around = world(condition, seed, loaded.drones.count) | motors(loaded) | {"seed": seed}
            most = loaded.criteria["lost_drones"].max if "lost_drones" in loaded.criteria else None
            if most is not None and _parts(condition)[0]:
                around["criteria.lost_drones.max"] = max(most, 1.0)  # the one that breaks may leave
            for allocator in allocators or [loaded.kinds["allocation"]]:
                for plant in plants or [loaded.kinds["plant"]]:
                    kinds = {"allocation.kind": allocator, "plant.kind": plant}
                    labels: Labels = {
                        "condition": condition, "allocator": allocator, "plant": plant, "seed": seed
                    }  # fmt: skip
                    found.append(Case(labels, mission, layered(around, kinds, changes)))
    return found


def motors(mission: Mission) -> Overrides:
    """Real motors in place of ideal rotors, their lag told to every controller that asks for one.

    A mission that has motors keeps them, and what its controllers are told of them.
    """
    if type(mission.actuation).has_motors:
        return {}
    real = Motors().filled(mission.team)
    told = {
        f"{layer}.lag": real.motor_lag()
        for layer in LAYERS
        if getattr(getattr(mission, layer), "lag", None) == 0.0
    }
    return {"actuation": {"kind": "motors"}, **told}


_MISSIONS = ("allocation", "plant", "drones")
"""Sections that a condition leaves alone and that decide which flights there are."""


def reason(row: Row) -> str:
    """Why a flight did not pass, in words; empty where it did."""
    return "" if held(row) else str(row.get("error") or row["reasons"])


@dataclass(frozen=True)
class Cell:
    """All seeds of one condition, allocator and plant."""

    passed: int
    lost: int
    """Flights that lost the load or the team, or ended in an error."""
    flown: int
    worst_m: float
    """Largest distance of the load from its reference in any of the others; NaN without others."""
    least_deg: float
    """Smallest angle between two cables in any of the others."""
    slack_s: float
    """Longest time without tension, summed over the cables, in any of the others."""
    turned_deg: float = math.nan
    """Largest angle of a rigid load from its wanted attitude in any of the others; NaN of a point."""


def matrix(rows: Sequence[Row]) -> dict[str, dict[tuple[str, str], Cell]]:
    """Cells by condition, then by allocator and plant, in the order in which they were asked for."""
    groups: dict[str, dict[tuple[str, str], list[Row]]] = {}
    for row in rows:
        cells = groups.setdefault(str(row["condition"]), {})
        cells.setdefault((str(row["allocator"]), str(row["plant"])), []).append(row)
    return {
        condition: {place: _cell(each) for place, each in cells.items()}
        for condition, cells in groups.items()
    }


def _cell(group: Sequence[Row]) -> Cell:
    ended = [row for row in group if fate(row) in ("held", "missed")]

    def most(name: str, sign: float = 1.0) -> float:
        values = [
            sign * float(row[name]) for row in ended if not math.isnan(row.get(name, math.nan))
        ]
        return sign * max(values) if values else math.nan

    return Cell(
        passed=sum(map(held, group)),
        lost=len(group) - len(ended),
        flown=len(group),
        worst_m=most("tracking_max_m"),
        least_deg=most("min_angle_deg", -1.0),
        slack_s=most("slack_time_s"),
        turned_deg=most("attitude_max_deg"),
    )
