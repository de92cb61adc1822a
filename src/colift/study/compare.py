"""The campaign behind ``colift compare``: allocators x missions x seeds, and a sweep of each one's spread."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from colift.errors import ColiftError
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.mission.schema import Bound
from colift.part import answering, find
from colift.record.verdict import criteria_of
from colift.study.campaign.plan import HEADING, OFFSET, Case, Source, without_seed

MISSIONS = ("hover", "paper-spiral", "figure-eight", "point-to-point", "four-to-three")
"""Missions of a comparison unless others are asked for."""

QUICK_MISSIONS = ("hover", "figure-eight")
"""Missions of a quick one."""

PERIOD = 0.01
"""Period at which every contestant allocates, s: what the slowest of them can keep on a desktop."""

LEAST_ANGLE = 30.0
"""Least angle between two cables where the mission asks for none, degrees: what the paper calls safe."""

LEAST_DISTANCE = 2.0 * math.sin(math.radians(0.5 * LEAST_ANGLE))
"""Least distance between two drones on a rigid load, over the shortest cable: what that angle leaves them on a point."""

CONTEST, SPREAD = "contest", "spread"
"""The two studies: who flies how well, and what separation costs."""


def contestants(
    wanted: Sequence[str] | None, own: Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """Allocators that can fly here, and a sentence for each that cannot.

    ``wanted`` None stands for all; ``own`` are always among them.
    """
    able, missing = [], []
    for name in dict.fromkeys([*(answering("allocation") if wanted is None else wanted), *own]):
        why = find("allocation", name).missing()
        if not why:
            able.append(name)
        elif wanted is None:
            missing.append(f"{name} {why}")
        else:
            raise ColiftError(f"allocator {name} {why}")
    return able, missing


def cases(
    allocators: Sequence[str],
    missions: Sequence[str],
    seeds: Iterable[int],
    changes: Mapping[str, Any] | None = None,
    *,
    spread: bool = True,
    as_in_mission: bool = False,
) -> list[Case]:
    """Every flight of a comparison.

    Each contestant flies with its own default settings in place of the mission's allocation section (with
    ``as_in_mission``, the one that a mission names keeps that section), and allocates every :data:`PERIOD`.
    ``changes`` come last; one such as ``"safe.mu"`` is made for that contestant only. All are judged by
    the criteria of the mission as it is, see :func:`bounds`. The spread of those that declare a
    :attr:`~colift.control.allocation.base.AllocatorPart.spread_setting` is swept on the first mission.
    """
    changes, seeds = without_seed(changes), list(seeds)
    if "allocation" in changes or "allocation.kind" in changes:
        raise ColiftError(
            "allocation.kind is what compare varies; name contestants with --allocators"
        )
    loaded = {mission: load_mission(mission) for mission in missions}
    asked = {name: bounds(mission) for name, mission in loaded.items()}

    def case(study: str, name: str, mission: str, seed: int, **setting: Any) -> Case:
        labels = {"study": study, "allocator": name, "mission": mission, "seed": seed, **setting}
        given = {"criteria": asked[mission], "timing.allocation": PERIOD}
        if not (as_in_mission and loaded[mission].kinds["allocation"] == name):
            given["allocation"] = {"kind": name}
        swept = {f"allocation.{setting['setting']}": setting["value"]} if setting else {}
        own = _own(changes, name, allocators)
        return Case(labels, mission, layered(given, own, swept), seed)

    found = [
        case(CONTEST, name, mission, seed)
        for seed in seeds
        for mission in missions
        for name in allocators
    ]
    for name in allocators if spread else ():
        setting, values = find("allocation", name).spread_setting or ("", ())  # type: ignore[attr-defined]
        found += [
            case(SPREAD, name, missions[0], seeds[0], setting=setting, value=value)
            for value in values
        ]
    return found


def _own(changes: Mapping[str, Any], name: str, allocators: Sequence[str]) -> dict[str, Any]:
    """The changes that concern one contestant, as those of the mission that it flies."""
    found: dict[str, Any] = {}
    for path, value in changes.items():
        head, _, setting = path.partition(".")
        if head == name and setting:
            found = layered(found, {f"allocation.{setting}": value})
        elif head not in allocators:
            found = layered(found, {path: value})
    return found


def bounds(mission: Mission) -> dict[str, dict[str, float]]:
    """What every contestant is judged by: the mission's own criteria, those that its own allocator brings included.

    Where these name no angle between the cables, it is :data:`LEAST_ANGLE`: a contest in which the
    drones may meet is none. Cables on a rigid load may be parallel: there it is a distance, :data:`LEAST_DISTANCE`.
    """
    found = {
        name: bound.model_dump(exclude_none=True) for name, bound in criteria_of(mission).items()
    }
    if mission.drones.count > 1 and mission.load.kind == "rigid":
        least = LEAST_DISTANCE * float(mission.team.cable_lengths.min())
        found.setdefault("min_drone_distance_m", {"min": round(least, 3)})
    elif mission.drones.count > 1:
        found.setdefault("min_angle_deg", {"min": LEAST_ANGLE})
    return found


def protocol(
    missions: Sequence[str],
    seeds: Iterable[int],
    changes: Mapping[str, Any],
    *,
    as_in_mission: bool = False,
) -> list[str]:
    """How the flights were made and judged, in sentences."""
    period, seeds = float(changes.get("timing.allocation", PERIOD)), list(seeds)
    settings = "its own default settings"
    if as_in_mission:
        settings += " (the one that a mission names: the mission's)"
    said = [
        f"Every allocator has {settings} and is called every {1e3 * period:g} ms, so that "
        "slow ones can take part; reference, controllers, drones and plant are the mission's."
    ]
    groups: dict[str, list[str]] = {}
    for mission in missions:
        asked = bounds(load_mission(mission))
        words = ", ".join(f"{name} {Bound(**bound)}" for name, bound in asked.items())
        groups.setdefault(words, []).append(mission)
    every = len(groups) == 1
    said += [
        f"Held{'' if every else ' in ' + ', '.join(names)} means to the end with {words}."
        for words, names in groups.items()
    ]
    if seeds != [0]:
        said.append(
            f"Seeds {seeds[0]} to {seeds[-1]}: seed 0 starts as the mission says; each other seed turns "
            f"the start by up to {HEADING:g} degrees and moves the load by up to {100 * OFFSET:g} cm "
            "along each axis."
        )
    others = {path: value for path, value in changes.items() if path != "timing.allocation"}
    if others:
        said.append(
            "Changed: " + ", ".join(f"{path} = {value}" for path, value in others.items()) + "."
        )
    return said


def own_allocators(sources: Sequence[Source]) -> list[str]:
    """Names of the allocators in a user's files, which are registered by this."""
    return [
        source.name for source in sources for part in source.load() if part.layer == "allocation"
    ]
