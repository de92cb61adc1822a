"""From cases to jobs: a job is named by the hash of everything that decides its flight."""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import colift
from colift.errors import ColiftError, MissionError, Problem
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.part import LAYERS, LISTS, Part, load_file

Label = str | int | float
Labels = dict[str, Label]
"""What a case is called in tables: column name to value."""

NOT_FLOWN = ("cli", "show", "study")
"""Folders of this package that cannot change the numbers of a flight."""

HEADING, OFFSET = 5.0, 0.02
"""Largest change of the start that a seed makes: heading, degrees, and each coordinate of the load, m."""


@dataclass(frozen=True)
class Case:
    """One flight that is asked for: how it is called, a mission and what to change in it.

    With a ``seed`` it starts a little off, see :func:`varied`.
    """

    labels: Labels
    mission: str | Path
    overrides: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None

    def load(self) -> Mission:
        """The mission to be flown.

        Raises
        ------
        MissionError
            With every mistake in it.

        """
        mission = load_mission(self.mission, self.overrides)
        return mission if self.seed is None else varied(mission, self.seed)


@dataclass(frozen=True)
class Source:
    """A Python file with a user's parts, as it travels to workers."""

    path: str
    text: str

    @classmethod
    def read(cls, path: str | Path) -> Source:
        try:
            return cls(str(Path(path).resolve()), Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ColiftError(f"{path}: not a Python file ({error})") from error

    @property
    def name(self) -> str:
        """Under which its parts are known."""
        return Path(self.path).stem.replace("_", "-")

    def load(self) -> list[type[Part]]:
        """Register its parts in this process: from the file itself, or from a copy where it is another."""
        text, parts = _loaded.get(self.path, ("", []))
        if not parts or text != self.text:
            path = Path(self.path)
            if not path.is_file() or path.read_text(encoding="utf-8") != self.text:
                path = Path(tempfile.mkdtemp(prefix="colift-with-")) / path.name
                path.write_text(self.text, encoding="utf-8")
            parts = load_file(path)
            _loaded[self.path] = (self.text, parts)
        return parts


_loaded: dict[str, tuple[str, list[type[Part]]]] = {}


@dataclass(frozen=True)
class Job:
    """A flight as workers get it: ``mission`` is resolved, ``code`` is the colift that was asked."""

    key: str
    mission: dict[str, Any]
    code: str
    sources: tuple[Source, ...] = ()
    keep: bool = False
    """Whether the recording is wanted as well."""

    @property
    def kind(self) -> str:
        """Flights of a kind last about equally long for each simulated second."""
        return str(self.mission["allocation"]["kind"])

    @property
    def duration(self) -> float:
        """Simulated time, s."""
        return float(self.mission["timing"]["duration"])


Plan = list[tuple[Labels, Job]]
"""Every case, resolved."""


@dataclass(frozen=True)
class Refused:
    """A case that cannot be flown, and why."""

    labels: Labels
    problems: tuple[Problem, ...]

    @property
    def row(self) -> dict[str, Any]:
        """As a row among those of the flights."""
        error = "; ".join(map(str, self.problems))
        return {
            **self.labels,
            "key": "",
            "status": REFUSED,
            "level": "",
            "reasons": "",
            "error": error,
        }


REFUSED = "refused"
"""Status of a case that cannot be flown."""


def plan(cases: Sequence[Case], sources: Sequence[Source] = ()) -> Plan:
    """Resolve every case; equal flights become equal jobs.

    Raises
    ------
    MissionError
        With the problems of all cases; each problem is named once, with the first case that has it.

    """
    planned, refused = sift(cases, sources)
    if refused:
        raise MissionError("campaign (nothing was flown)", problems(refused))
    return planned


def sift(cases: Sequence[Case], sources: Sequence[Source] = ()) -> tuple[Plan, list[Refused]]:
    """Resolve every case that can be flown, and say of the others why not.

    Raises
    ------
    MissionError
        If none can be flown.

    """
    for source in sources:
        source.load()
    code = code_digest()
    planned: Plan = []
    refused: list[Refused] = []
    for case in cases:
        try:
            mission = case.load()
        except MissionError as error:
            refused.append(Refused(case.labels, error.problems))
        else:
            key = mission_key(mission, code)
            planned.append((case.labels, Job(key, mission.resolved(), code, tuple(sources))))
    if refused and not planned:
        raise MissionError("campaign (nothing was flown)", problems(refused))
    return planned, refused


def problems(refused: Iterable[Refused]) -> list[Problem]:
    """Every problem once, with the first case that has it."""
    found: dict[Problem, list[Labels]] = {}
    for each in refused:
        for problem in each.problems:
            found.setdefault(problem, []).append(each.labels)
    return list(map(_located, found, found.values()))


def _located(problem: Problem, cases: list[Labels]) -> Problem:
    first = ", ".join(f"{name} {value}" for name, value in cases[0].items())
    others = f" and {len(cases) - 1} more" if len(cases) > 1 else ""
    return Problem(f"[{first}{others}] {problem.path}", problem.value, problem.message)


def mission_key(mission: Mission, code: str) -> str:
    """SHA-256 of the resolved mission, seed included, of colift, and of parts that are not colift's."""
    content = {"mission": mission.resolved(), "colift": code, "parts": _foreign_parts(mission)}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _foreign_parts(mission: Mission) -> dict[str, str]:
    """Digest of the file of each part that comes from elsewhere, by layer."""
    found = {}
    parts = {layer: getattr(mission, layer) for layer in LAYERS}
    for name in LISTS:
        parts |= {f"{name}.{i}": part for i, part in enumerate(getattr(mission, name))}
    for place, part in parts.items():
        module = type(part).__module__
        path = getattr(sys.modules[module], "__file__", None)
        if path is not None and not module.startswith("colift."):
            found[place] = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return found


@cache
def code_digest() -> str:
    """Short SHA-256 of colift's own sources, without what cannot change the numbers of a flight."""
    package = Path(str(colift.__file__)).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0] not in NOT_FLOWN:
            digest.update(name.as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def varied(mission: Mission, seed: int) -> Mission:
    """The mission with this seed, and started a little off unless the seed is 0.

    The start formation is turned by up to :data:`HEADING` and the load moved by up to :data:`OFFSET` along
    each axis, uniformly, so that flights without anything random differ as well.
    """
    if seed == 0:
        return mission.model_copy(update={"seed": 0})
    random = np.random.default_rng(seed)
    offset = np.add(mission.start.load_offset, random.uniform(-OFFSET, OFFSET, 3))
    heading = mission.start.heading_deg + random.uniform(-HEADING, HEADING)
    start = {"load_offset": tuple(offset.tolist()), "heading_deg": heading}
    return mission.model_copy(
        update={"seed": seed, "start": mission.start.model_copy(update=start)}
    )


def without_seed(changes: Mapping[str, Any] | None) -> dict[str, Any]:
    """The changes to every flight of a study, whose seeds are its own to choose.

    Raises
    ------
    ColiftError
        If they change the seed.

    """
    if "seed" in (changes or {}):
        raise ColiftError("seed is what a study varies; choose with --seeds and --first-seed")
    return dict(changes or {})


def unique(jobs: Iterable[Job]) -> list[Job]:
    """Each job once, in the order of first mention."""
    return list({job.key: job for job in jobs}.values())
