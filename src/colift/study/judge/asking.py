"""Allocators on the force commands of flights: what each would have wanted, beside what flew.

The force that a flight's load controller asked for goes through each allocator, row by row; nothing is
simulated, so an allocator does not answer for what its answers would have led to. All see the same
forces and times and start from the directions that the cables had.

An allocator's settings are meant for a team: newtons for its load, metres for its cables. So
each flight is scaled to the paper's size instead of the settings to the flight: forces by ``c`` so that a
cable's share of the mean force is the paper's share of its load (0.55 N), lengths so that cables are 1 m.
The problem is invariant: ``(F, mu, T) -> (c F, c^2 mu, c T)`` has the same directions. The answers are scaled
back. One setting depends on the number of cables as well: ``mu`` becomes ``4/n`` of its value, for then the
closed-form optimum ``mu a^2 (3a - n) = W^2`` (theory of the paper's objective) has the cone of the paper's
four cables, and is as far from collapse, for every n.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from colift.control.allocation.base import Allocator, AllocatorPart, Status
from colift.control.allocation.limits.distance import distances
from colift.errors import ColiftError, MissionError, Problem
from colift.flight.flight import Progress
from colift.part import answering, find
from colift.record.importing import Assumed, import_flight
from colift.record.metrics import mean
from colift.record.recording import Recording
from colift.team import Team
from colift.team.geometry import pairwise_angles
from colift.team.scaling import PAPER_MU, scaled_load, scaled_mu

Array = NDArray[np.float64]

PAPER = Team.uniform(4)
ON_BOARD, ACTUAL = "on board", "actual"
"""Rows that no allocator of ours made: what was wanted in flight, and what the cables did."""
PAIRED = 200_000
"""Pairs of cables whose distances are computed at a time."""
WARM_UP = 20
"""Calls before the clock counts."""


@dataclass(frozen=True)
class Quantity:
    """One number of a row: header in tables, unit and meaning."""

    header: str
    unit: str
    meaning: str


QUANTITIES = {
    "min_angle_deg": Quantity("angle", "deg", "smallest angle between two cables at any time"),
    "min_drone_distance_m": Quantity("drones", "m", "smallest distance of two drones on such cables at any time"),
    "min_cable_distance_m": Quantity("cable", "m", "smallest distance of a drone from another's cable at any time"),
    "tension_ratio": Quantity("T/F", "1", "mean sum of tensions over mean force"),
    "mean_total_tension_N": Quantity("mean T", "N", "time average of the sum of tensions"),
    "peak_total_tension_N": Quantity("peak T", "N", "largest simultaneous sum of tensions"),
    "turn_rms_deg_s": Quantity("turn", "deg/s", "RMS rate at which the directions turn"),
    "turn_max_deg_s": Quantity("max", "deg/s", "fastest turn of a direction between two rows"),
    "residual_rms_N": Quantity("residual", "N", "RMS of the force that the tensions leave out"),
    "residual_max_N": Quantity("worst residual", "N", "largest force that the tensions leave out"),
    "not_ok": Quantity("not ok", "1", "allocations whose status is not CONVERGED"),
    "median_us": Quantity("median", "us", "median duration of an allocation"),
    "p99_us": Quantity("99 %", "us", "99th percentile of the duration"),
    "max_us": Quantity("worst", "us", "longest allocation"),
}  # fmt: skip
"""Every number of a row, by name; NaN where it does not apply."""


@dataclass(frozen=True)
class Answers:
    """What one allocator wanted in one flight, at the flight's own size."""

    allocator: str
    settings: Mapping[str, Any]
    time: Array
    force: Array
    tensions: Array
    directions: Array
    statuses: tuple[Status, ...] = ()
    durations: Array | None = None
    lengths: Array | None = None
    """Of the flight's cables (n,), m."""

    @cached_property
    def smallest_angles(self) -> Array:
        """Smallest angle between two cables (rows,), deg; NaN where one is unknown, or for one cable."""
        angles = pairwise_angles(self.directions)
        if not angles.shape[1]:
            return np.full(len(angles), np.nan)
        return np.asarray(np.degrees(angles.min(axis=1)))

    @cached_property
    def nearest(self) -> tuple[float, float]:
        """Smallest distance of two drones, and of a drone from another's cable, m; NaN where they are not known."""
        n = self.directions.shape[1]
        if self.lengths is None or n < 2:
            return math.nan, math.nan
        least = np.full(2, np.inf)
        size = max(1, PAIRED // n**2)
        for begin in range(0, len(self.directions), size):
            found = distances(self.lengths, self.directions[begin : begin + size])
            least = np.minimum(least, [np.nanmin(each, initial=np.inf) for each in found])
        return float(least[0]), float(least[1])

    @cached_property
    def numbers(self) -> dict[str, float]:
        """The :data:`QUANTITIES` by name."""
        total = self.tensions.sum(axis=1)
        pull = np.einsum("ti,tik->tk", self.tensions, self.directions)
        left = np.linalg.norm(pull + self.force, axis=1)
        spans = np.diff(self.time)
        ahead, behind = self.directions[1:], self.directions[:-1]
        sine = np.linalg.norm(np.cross(ahead, behind), axis=-1)
        turns = np.degrees(np.arctan2(sine, np.sum(ahead * behind, axis=-1))) / spans[:, None]
        weights = np.where(np.isnan(turns), 0.0, spans[:, None])
        mean_total = float(mean(total, self.time))
        found = {
            "min_angle_deg": _extreme(self.smallest_angles, np.min),
            "min_drone_distance_m": self.nearest[0],
            "min_cable_distance_m": self.nearest[1],
            "tension_ratio": mean_total
            / float(mean(np.linalg.norm(self.force, axis=1), self.time)),
            "mean_total_tension_N": mean_total,
            "peak_total_tension_N": _extreme(total, np.max),
            "turn_rms_deg_s": float(
                np.sqrt(np.sum(weights * np.nan_to_num(turns) ** 2) / max(weights.sum(), 1e-12))
            ),
            "turn_max_deg_s": _extreme(turns, np.max),
            "residual_rms_N": float(np.sqrt(mean(left**2, self.time))),
            "residual_max_N": _extreme(left, np.max),
        }
        if self.durations is not None:
            us = 1e6 * self.durations
            found |= {
                "not_ok": float(sum(not status.ok for status in self.statuses)),
                "median_us": float(np.median(us)),
                "p99_us": float(np.percentile(us, 99)),
                "max_us": float(us.max()),
            }
        return {name: found.get(name, float("nan")) for name in QUANTITIES}

    @property
    def status_counts(self) -> dict[str, int]:
        """How often each status came, the most frequent first."""
        return {status.name: count for status, count in Counter(self.statuses).most_common()}


def _extreme(values: Array, which: Any) -> float:
    known = values[~np.isnan(values)]
    return float(which(known)) if known.size else float("nan")


@dataclass(frozen=True)
class Judged:
    """One flight: the answers of what flew and of every allocator asked."""

    flight: str
    n: int
    scale: float
    """Factor ``c`` from the flight's forces to those that the allocators saw."""
    answers: tuple[Answers, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain data: one row an allocator."""
        return {
            "flight": self.flight,
            "drones": self.n,
            "duration_s": float(self.answers[0].time[-1]),
            "force_scale": self.scale,
            "rows": [
                {
                    "allocator": a.allocator,
                    "settings": dict(a.settings),
                    **a.numbers,
                    "statuses": a.status_counts,
                }
                for a in self.answers
            ],
        }


def open_flight(path: Path, assumed: Assumed | None = None) -> Recording:
    """A recording from its file, or from a log that can be imported."""
    import h5py

    is_recording = path.is_file() and h5py.is_hdf5(path)
    return Recording.load(path) if is_recording else import_flight([path], assumed)


def choose(wanted: Sequence[str] | None = None) -> tuple[list[str], dict[str, str]]:
    """The allocators that can be asked, and why the others of ``wanted`` (default: all) cannot."""
    kinds = list(wanted) if wanted is not None else answering("allocation")
    missing = {kind: find("allocation", kind).missing() for kind in kinds}
    usable = [kind for kind in kinds if not missing[kind]]
    return usable, {kind: why for kind, why in missing.items() if why}


def parts_for(
    n: int, kinds: Sequence[str], settings: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, AllocatorPart]:
    """The allocators with their own defaults, ``mu`` for n cables, and the settings given by name.

    Raises
    ------
    MissionError
        For a setting that an allocator does not have or allow.

    """
    parts: dict[str, AllocatorPart] = {}
    problems = []
    for kind in kinds:
        part = find("allocation", kind)
        fields = dict((settings or {}).get(kind, {}))
        if "mu" in part.model_fields:
            fields.setdefault("mu", scaled_mu(n, part.model_fields["mu"].default or PAPER_MU))
        try:
            made = part.model_validate(fields)
        except ValidationError as error:
            problems += [
                Problem(f"{kind}.{e['loc'][0] if e['loc'] else ''}", repr(e["input"]), e["msg"])
                for e in error.errors()
            ]
            continue
        assert isinstance(made, AllocatorPart)
        parts[kind] = made
    if problems:
        raise MissionError("--set", problems)
    return parts


def judge(
    recording: Recording,
    kinds: Sequence[str],
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    progress: Progress | None = None,
) -> Judged:
    """Ask allocators what they would have wanted in a flight.

    Parameters
    ----------
    recording : Recording
        With the force commands and the directions of all cables.
    kinds : sequence of str
        Names of allocators, as from :func:`choose`.
    settings : mapping, optional
        Settings by allocator and field, at the paper's size (see the module).
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    ColiftError
        If the load is rigid, if the recording lacks forces or directions, or a limit cannot be held with such a team.

    """
    name = recording.mission.name
    if recording.mission.load.kind == "rigid":
        raise ColiftError(
            f"{name}: load.kind: carries a rigid load, whose cables share a moment, too, and end apart; only forces are judged here"
        )
    known = np.isfinite(recording["directions"]).all(axis=(1, 2))
    if not known.all() and (recording.source == "simulation" or not known.any()):
        raise ColiftError(f"{name}: needs the directions of all cables throughout the flight")
    rows = np.isfinite(recording["force"]).all(axis=1) & known  # without the gaps of a log
    time, force = recording.time[rows], recording["force"][rows]
    if len(time) < 2 or not force.any():
        raise ColiftError(f"{name}: holds no force commands to judge by")
    team, scale = twin(recording.mission.team, float(mean(np.linalg.norm(force, axis=1), time)))
    whole, lengths = recording.complete(), recording.mission.team.cable_lengths
    names = ("desired_tensions", "desired_directions", "tensions", "directions")
    arrays = {key: whole[key][rows] for key in names}
    answers = [
        Answers(
            ON_BOARD, {}, time, force, arrays["desired_tensions"], arrays["desired_directions"],
            lengths=lengths,
        ),
        Answers(ACTUAL, {}, time, force, arrays["tensions"], arrays["directions"], lengths=lengths),
    ]  # fmt: skip
    for k, (kind, part) in enumerate(parts_for(recording.n, kinds, settings).items()):
        if conflicts := part.check(team) + part.conflicts(team):
            raise ColiftError(
                f"{name}: {kind}: " + "; ".join(f"{f} {text}" for f, text in conflicts)
            )

        def tick(done: float, begin: int = k) -> None:
            if progress is not None:
                progress((begin + done) / len(kinds))

        asked = ask(kind, part, team, scale, time, force, arrays["directions"][0], tick)
        answers.append(replace(asked, lengths=lengths))
    return Judged(name, recording.n, scale, tuple(answers))


def twin(team: Team, mean_force: float) -> tuple[Team, float]:
    """The same team at the paper's size, and the factor from its forces, N, to the twin's.

    By the mean force and not by the load's mass, which a log does not tell; in hover they agree.
    """
    load_mass = scaled_load(team.n)
    scale = load_mass * PAPER.gravity / mean_force
    longer = float(PAPER.cable_lengths.mean() / team.cable_lengths.mean())
    return replace(
        team,
        load_mass=load_mass,
        masses=scale * team.masses,
        inertias=scale * longer**2 * team.inertias,
        max_thrusts=scale * team.max_thrusts,
        cable_lengths=longer * team.cable_lengths,
        arms=longer * team.arms,
        radii=longer * team.radii,
        rotor_radii=longer * team.rotor_radii,
    ), scale


def ask(
    kind: str,
    part: AllocatorPart,
    team: Team,
    scale: float,
    time: Array,
    force: Array,
    start: Array,
    tick: Progress,
) -> Answers:
    """The answers of one allocator to forces (rows, 3), N, from the directions ``start`` (n, 3)."""
    warm = Allocator(part, team)
    for row in force[:WARM_UP]:
        warm.allocate(scale * row)
    allocator = Allocator(part, team)
    allocator.reset(directions=start)
    tensions = np.empty((len(time), team.n))
    directions = np.empty((len(time), team.n, 3))
    durations, statuses = np.empty(len(time)), []
    spans = np.diff(time, prepend=time[0] - np.median(np.diff(time)))
    for k, (row, span) in enumerate(zip(force, spans, strict=True)):
        allocator.dt = float(span)
        answer = allocator.allocate(scale * row)
        tensions[k], directions[k] = answer.tensions / scale, answer.directions
        durations[k] = answer.solve_time
        statuses.append(answer.status)
        if k % 100 == 99:
            tick((k + 1) / len(time))
    settings = part.model_dump(mode="json", exclude_none=True)
    return Answers(kind, settings, time, force, tensions, directions, tuple(statuses), durations)
