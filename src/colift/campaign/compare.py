"""The campaign behind ``colift compare``: allocators x missions x seeds, and a sweep of each one's spread."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from colift.campaign.plan import HEADING, OFFSET, Case, Source, without_seed
from colift.errors import ColiftError
from colift.mission.load import layered
from colift.part import find, names

MISSIONS = ("hover", "paper-spiral", "figure-eight", "point-to-point", "four-to-three")
"""Missions of a comparison unless others are asked for."""

QUICK_MISSIONS = ("hover", "figure-eight")
"""Missions of a quick one."""

PERIOD = 0.01
"""Period at which every contestant allocates, s: what the slowest of them can keep on a desktop."""

CONTEST, SPREAD = "contest", "spread"
"""The two studies: who flies how well, and what separation costs."""


def contestants(
    wanted: Sequence[str] | None, own: Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """Allocators that can fly here, and a sentence for each that cannot.

    ``wanted`` None stands for all; ``own`` are always among them.
    """
    able, missing = [], []
    for name in dict.fromkeys([*(names("allocation") if wanted is None else wanted), *own]):
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
) -> list[Case]:
    """Every flight of a comparison.

    Each contestant flies with its own default settings in place of the mission's allocation section, and
    allocates every :data:`PERIOD`; ``changes`` come last. The spread of those that declare a
    :attr:`~colift.allocation.base.AllocatorPart.spread_setting` is swept on the first mission.
    """
    changes, seeds = without_seed(changes), list(seeds)
    if "allocation.kind" in changes:
        raise ColiftError(
            "allocation.kind is what compare varies; name contestants with --allocators"
        )

    def case(study: str, name: str, mission: str, seed: int, **setting: Any) -> Case:
        labels = {"study": study, "allocator": name, "mission": mission, "seed": seed, **setting}
        section = {"kind": name, **({setting["setting"]: setting["value"]} if setting else {})}
        given = {"allocation": section, "timing.allocation": PERIOD}
        return Case(labels, mission, layered(given, changes), seed)

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


def protocol(seeds: int, changes: Mapping[str, Any]) -> list[str]:
    """How the flights were made, in sentences."""
    period = float(changes.get("timing.allocation", PERIOD))
    said = [
        f"Every allocator has its own default settings and is called every {1e3 * period:g} ms, so that "
        "slow ones can take part; reference, controllers, drones and plant are the mission's."
    ]
    if seeds > 1:
        said.append(
            f"Seed 0 starts as the mission says; each other seed turns the start by up to {HEADING:g} "
            f"degrees and moves the load by up to {100 * OFFSET:g} cm along each axis."
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
