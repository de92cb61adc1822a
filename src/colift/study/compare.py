"""The campaign behind ``colift compare``: allocators, or agents, x missions x seeds, and a sweep of each allocator's spread."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from colift.errors import ColiftError
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.mission.schema import Bound
from colift.part import answering, find
from colift.record.verdict import criteria_of
from colift.study.campaign.plan import HEADING, OFFSET, Case, Source, without_seed

MISSIONS = ("hover", "paper-spiral", "figure-eight", "point-to-point", "four-to-three")
"""Missions of a comparison unless others are asked for."""

AGENTS_MISSIONS = ("leaderless", *MISSIONS)
"""Missions of a comparison of agents."""

QUICK_MISSIONS = ("hover", "figure-eight")
"""Missions of a quick one."""

COLUMN = {"allocation": "allocator", "agents": "agents"}
"""By layer that is compared the column in which its parts are named."""

RADIO: dict[str, Any] = {"kind": "radio", "loss": 0.2, "delay": 0.01, "jitter": 0.02}
"""What a mission without a radio of its own is given in a comparison of agents: s and share of messages."""

PERIOD = 0.01
"""Period at which every contestant allocates, s: what the slowest of them can keep on a desktop."""

LEAST_ANGLE = 30.0
"""Least angle between two cables where the mission asks for none, degrees: what the paper calls safe."""

LEAST_DISTANCE = 2.0 * math.sin(math.radians(0.5 * LEAST_ANGLE))
"""Least distance between two drones on a rigid load, over the shortest cable: what that angle leaves them on a point."""

MOST_LOST = 0.999
"""Largest share of what central tells that is lost, where others may hear nothing at all."""

CONTEST, SPREAD = "contest", "spread"
"""The two studies: who flies how well, and what separation costs."""


def contestants(
    wanted: Sequence[str] | None,
    own: Sequence[str] = (),
    layer: str = "allocation",
    missions: Sequence[str] = (),
) -> tuple[list[str], list[str]]:
    """Allocators, or parts of another layer, that can fly here, and a sentence for each that cannot.

    ``wanted`` None stands for all, but for agents that none of the ``missions`` is for; ``own`` are always among them.
    """
    able, missing = [], []
    teams = [load_mission(name).team for name in missions] if layer == "agents" else []
    for name in dict.fromkeys([*(answering(layer) if wanted is None else wanted), *own]):
        part = find(layer, name)
        why = part.missing()
        if not why and wanted is None and name not in own:
            refused = [found for team in teams if (found := part().check(team))]
            if refused and len(refused) == len(teams):
                why = refused[0][0][1]
        if not why:
            able.append(name)
        elif wanted is None:
            missing.append(f"{name} {why}")
        else:
            raise ColiftError(f"{COLUMN[layer]} {name} {why}")
    return able, missing


def cases(
    names: Sequence[str],
    missions: Sequence[str],
    seeds: Iterable[int],
    changes: Mapping[str, Any] | None = None,
    *,
    spread: bool = True,
    as_in_mission: bool = False,
    layer: str = "allocation",
) -> list[Case]:
    """Every flight of a comparison of allocators, or, with ``layer`` "agents", of who decides.

    Each contestant flies with its own default settings in place of the mission's section of that ``layer`` (with
    ``as_in_mission``, the one that a mission names keeps that section), and allocates every :data:`PERIOD`. Agents have the same
    radio, see :func:`radio`.
    ``changes`` come last; one such as ``"safe.mu"`` is made for that contestant only. All are judged by
    the criteria of the mission as it is, see :func:`bounds`. The spread of those that declare a
    :attr:`~colift.control.allocation.base.AllocatorPart.spread_setting` is swept on the first mission.
    """
    changes, seeds = without_seed(changes), list(seeds)
    if layer in changes or f"{layer}.kind" in changes:
        option = {"allocation": "--allocators", "agents": "--schemes"}[layer]
        raise ColiftError(f"{layer}.kind is what compare varies; name contestants with {option}")
    loaded = {mission: load_mission(mission) for mission in missions}
    asked = {name: bounds(mission) for name, mission in loaded.items()}
    heard = {name: radio(name, changes) if layer == "agents" else {} for name in missions}

    def case(study: str, name: str, mission: str, seed: int, **setting: Any) -> Case:
        labels = {"study": study, COLUMN[layer]: name, "mission": mission, "seed": seed, **setting}
        given = {"criteria": asked[mission], "timing.allocation": PERIOD, **heard[mission]}
        if not (as_in_mission and loaded[mission].kinds[layer] == name):
            given[layer] = {"kind": name}
        swept = {f"{layer}.{setting['setting']}": setting["value"]} if setting else {}
        own = _own(changes, name, names, layer)
        return Case(labels, mission, layered(given, own, swept), seed)

    found = [
        case(CONTEST, name, mission, seed)
        for seed in seeds
        for mission in missions
        for name in names
    ]
    for name in names if spread else ():
        setting, values = getattr(find(layer, name), "spread_setting", None) or ("", ())
        found += [
            case(SPREAD, name, missions[0], seeds[0], setting=setting, value=value)
            for value in values
        ]
    return found


def radio(name: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """What all agents hear each other by in a mission, and the link by which one allocator tells all: delay, jitter and loss are the same.

    It is the mission's network, changed by ``changes``; where that is perfect the mission's link, or :data:`RADIO`.
    """
    given = {path: value for path, value in changes.items() if path.partition(".")[0] == "network"}
    loaded = load_mission(name)
    if loaded.kinds["network"] == "perfect":
        told = loaded.link.model_dump() if loaded.kinds["link"] == "radio" else RADIO
        given = layered(
            {"network": {key: told[key] for key in RADIO if key in told} | {"kind": "radio"}}, given
        )
    network = load_mission(name, given).network.model_dump()
    if "loss" not in network:
        return {**given, "link": {"kind": "perfect"}}
    most = np.minimum(network["loss"], MOST_LOST).tolist()
    link = {"kind": "radio", "loss": most, **{key: network[key] for key in ("delay", "jitter")}}
    return {**given, "link": link}


def _own(changes: Mapping[str, Any], name: str, names: Sequence[str], layer: str) -> dict[str, Any]:
    """The changes that concern one contestant, as those of the mission that it flies."""
    found: dict[str, Any] = {}
    for path, value in changes.items():
        head, _, setting = path.partition(".")
        if head == name and setting:
            found = layered(found, {f"{layer}.{setting}": value})
        elif head not in names:
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
    layer: str = "allocation",
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
    if layer == "agents":
        said = [
            f"All agents have {settings} and decide every {1e3 * period:g} ms; allocator, reference, controllers, drones and plant "
            "are the mission's. All hear each other by the mission's network, where that is perfect by one that loses "
            f"{RADIO['loss']:.0%} of messages and takes {1e3 * RADIO['delay']:g} to {1e3 * (RADIO['delay'] + RADIO['jitter']):g} ms; "
            "what central tells the drones is as late and lost as often. Times are of all drones together."
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


def usual_missions(layer: str, *, quick: bool) -> tuple[str, ...]:
    """What is flown where nobody names missions, for parts of a layer."""
    if quick:
        return QUICK_MISSIONS
    return AGENTS_MISSIONS if layer == "agents" else MISSIONS


def own_parts(sources: Sequence[Source], layer: str = "allocation") -> list[str]:
    """Names of the allocators, or parts of another layer, in a user's files, which are registered by this."""
    return [source.name for source in sources for part in source.load() if part.layer == layer]
