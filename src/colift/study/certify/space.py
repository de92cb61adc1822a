"""What differs by chance between the flights of a mission: the probability space of a certificate."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colift.errors import MissionError, Problem
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.study.campaign.plan import varied, without_seed

WALL_TIME = "_us"
"""End of the names of metrics that are another time in each run: no flight is repeated by them."""
_DRAWN = 1
"""Beside the seed, of the numbers that ``vary`` asks for."""


@dataclass(frozen=True)
class Space:
    """A mission, and the ranges of what in it is drawn anew for each flight.

    A seed decides all: noise, wind and faults as in any flight of the mission; the start, a little off (:func:`colift.study.campaign.plan.varied`);
    and each number of ``vary``, evenly between its bounds and independent of the others.

    Attributes
    ----------
    mission : dict
        Resolved, without its seed.
    vary : mapping
        Low and high by path, such as ``truth.load_mass_factor``.

    """

    mission: dict[str, Any]
    vary: Mapping[str, tuple[float, float]]

    @classmethod
    def of(
        cls,
        mission: str | Path,
        changes: Mapping[str, Any] | None = None,
        vary: Mapping[str, tuple[float, float]] | None = None,
    ) -> Space:
        """The space of a mission with changes.

        Raises
        ------
        MissionError
            For a mission that cannot be flown, bounds between which it cannot, or criteria that are another in each run.

        """
        loaded = load_mission(mission, without_seed(changes))
        found = [
            Problem(f"criteria.{name}", "", "is wall time, which no seed repeats; leave it out")
            for name in loaded.criteria
            if name.endswith(WALL_TIME)
        ]
        for path, (low, high) in (vary or {}).items():
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                message = "must be LOW:HIGH, two finite numbers, the lower one first"
                found.append(Problem(f"--vary {path}", f"{low:g}:{high:g}", message))
        if found:
            raise MissionError(str(mission), found)
        table = loaded.resolved()
        table.pop("seed", None)
        space = cls(table, {path: (float(a), float(b)) for path, (a, b) in (vary or {}).items()})
        for end in (0, 1):
            load_mission(space.mission, {path: ends[end] for path, ends in space.vary.items()})
        return space

    def draw(self, seed: int) -> dict[str, float]:
        """What a seed draws of the numbers that vary."""
        random = np.random.default_rng([seed, _DRAWN])
        return {path: float(random.uniform(*ends)) for path, ends in self.vary.items()}

    def mission_of(self, seed: int) -> Mission:
        """The mission that a seed flies, from 1 on."""
        return varied(load_mission(self.mission, layered(self.draw(seed))), seed)

    @property
    def digest(self) -> str:
        """SHA-256 of the mission and of what varies; the same wherever it is computed."""
        content = {"mission": self.mission, "vary": {k: list(v) for k, v in self.vary.items()}}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()
