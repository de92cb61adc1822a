"""How a flight went, in one verdict: judged from its recording and its criteria, and by nothing else.

Terminal, report, replay, live page, campaigns and exit codes all show this one. A mission may name bounds for any
metric (``[criteria]``); what it does not name has the defaults of :func:`criteria_of`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from colift.mission.schema import Bound, Described
from colift.record.recording import Recording

Level = Literal["pass", "warn", "fail", "lost"]

LEVELS: tuple[Level, ...] = ("pass", "warn", "fail", "lost")
"""From good to bad: all is well; something to look at; a criterion missed; load or team lost."""

NEAR = 0.5
"""Largest distance of the load from its reference unless the mission says another, m."""

TURNED = 20.0
"""Largest angle of a rigid load from its wanted attitude unless the mission says another, degrees."""

UPRIGHT = 90.0
"""Tilt beyond which a drone is turned over, degrees."""

LEAST_LOST = 2.0
"""A load nearer to its reference than this, or than three of the longest cable, is late but not lost, m."""

LIFTED = 0.05
"""Height to which a load that is to be lifted has to come at least, m: a team that never lifts it keeps all other criteria."""

PRESSED = 0.02
"""How far below the ground's surface a load may press itself, m."""

SOFT = 0.3
"""Speed up to which a load that nothing holds any more was set down, and not dropped, m/s."""

SUNK = 0.5
"""Depth below the lowest height allowed from which on a load is lost, m."""


@dataclass(frozen=True)
class Judgement:
    """One criterion: the metric, its value, the bound in words, and whether it holds.

    ``asked`` tells whether the mission names the bound, or it is a default.
    """

    metric: str
    value: float
    bound: str
    holds: bool
    asked: bool = True

    def __str__(self) -> str:
        return f"{self.metric} is {self.value:.4g}, not {self.bound}"


@dataclass(frozen=True)
class Verdict:
    """How a flight went.

    Attributes
    ----------
    level : str
        One of :data:`LEVELS`.
    reasons : list of str
        What is wrong or to be looked at, the worst first; empty for a flight without blemish.
    judged : tuple of Judgement
        Every criterion that applies, missed or not.
    summary : str
        What went well, in a few words.

    """

    level: Level
    reasons: list[str]
    judged: tuple[Judgement, ...] = ()
    summary: str = ""

    @property
    def ok(self) -> bool:
        """Whether nothing was lost and no criterion missed."""
        return self.level in {"pass", "warn"}

    @property
    def said(self) -> list[str]:
        """The reasons and, where nothing is missed, what went well."""
        return [*self.reasons, *([self.summary] if self.ok and self.summary else [])]

    @property
    def sentence(self) -> str:
        """The whole verdict in one line."""
        text = "; ".join(self.said)
        return f"{self.level[:1].upper() + self.level[1:]}: {text or 'nothing to judge'}."


@dataclass(frozen=True)
class Limits:
    """What a flight was to keep; None where nothing was asked for."""

    angle_deg: float | None = None
    """Least angle between two cables, degrees."""
    distance_m: float | None = None
    """Least distance between two drones, m."""


def limits(mission: Described) -> Limits:
    """The least angle and distance that a mission's criteria, or else its allocator, ask for."""
    bounds = criteria_of(mission)
    least = {name: bound.min for name, bound in bounds.items() if bound.min is not None}
    return Limits(least.get("min_angle_deg"), least.get("min_drone_distance_m"))


def criteria_of(mission: Described) -> dict[str, Bound]:
    """The bounds of a mission by metric: its own, and a default for what it does not name.

    By default the load stays within :data:`NEAR` of its reference, a rigid one within :data:`TURNED` of its attitude, and above
    the ground, one that is to be lifted comes off it, no drone turns over, and
    every actual angle and distance is at least what the allocator was asked for; where the allocator changes in
    flight, the least that it was asked for. A real flight, whose frame and allocator are not ours, has no defaults.
    """
    own = dict(mission.criteria)
    if not mission.kinds:
        return own
    default = {
        "tracking_max_m": Bound(max=NEAR),
        "min_height_m": Bound(
            min=0.0 if mission.ground is None else mission.ground.height - PRESSED
        ),
        "max_tilt_deg": Bound(max=UPRIGHT),
    }
    if mission.kinds.get("supervision") == "lift":
        default["lifted_m"] = Bound(min=LIFTED)
    if mission.load.kind == "rigid":
        default["attitude_max_deg"] = Bound(max=TURNED)
    for metric, setting in _ASKED.items():
        asked = _least_asked(mission, setting)
        if asked:
            default[metric] = Bound(min=asked)
    return {**{name: bound for name, bound in default.items() if name not in own}, **own}


_ASKED = {
    "min_angle_deg": "min_angle_deg",
    "min_drone_distance_m": "min_distance",
    "min_downwash_distance_m": "min_distance",
    "min_cable_distance_m": "cable_distance",
}
"""Settings of an allocator that ask for separation, by the metric that shows it; what follows from the drones' radii asks for none."""


def _least_asked(mission: Described, setting: str) -> float | None:
    """Least value that the allocators of the flight are given for a setting; None if one has none."""
    asked = [mission.resolved().get("allocation", {}).get(setting)]
    for event in mission.events:
        if event.field == f"allocation.{setting}":
            asked.append(event.value)
        elif event.field in {"allocation", "allocation.kind"}:
            table = event.value if isinstance(event.value, dict) else {}
            asked.append(table.get(setting))
    return None if None in asked else min(float(np.min(each)) for each in asked)


def judge(recording: Recording, values: Mapping[str, float]) -> Verdict:
    """The verdict of a flight.

    Parameters
    ----------
    recording : Recording
        Any: simulated, live, imported.
    values : mapping
        Its metrics, from :func:`colift.record.metrics.compute`.

    """
    mission = recording.mission
    judged = tuple(judgements(mission, values))
    lost = _lost(recording, values)
    missed = [str(each) for each in judged if not each.holds]
    if recording.outcome != "completed" and not lost:
        missed.insert(0, recording.outcome)
    seen = _seen(recording, values)
    level: Level = "lost" if lost else "fail" if missed else "warn" if seen else "pass"
    return Verdict(level, [*lost, *missed, *seen], judged, _summary(values))


def judgements(mission: Described, values: Mapping[str, float]) -> list[Judgement]:
    """Every criterion; a default one only where its metric applies."""
    found = []
    for name, bound in criteria_of(mission).items():
        value, asked = float(values.get(name, math.nan)), name in mission.criteria
        if asked or not math.isnan(value):
            found.append(Judgement(name, value, str(bound), bound.holds(value), asked))
    return found


def _lost(recording: Recording, values: Mapping[str, float]) -> list[str]:
    """Why load or team are lost; empty when they are not."""
    mission, outcome = recording.mission, recording.outcome
    found = []
    if outcome != "completed" and not outcome.startswith(DESCENDED):
        found.append(outcome)
    if not mission.kinds:
        return found
    if "attached" in recording and len(recording.time):
        holding = np.any(np.nan_to_num(recording["attached"]) > 0.0, axis=1)
        if not holding[-1]:
            found += _let_go(recording, int(np.flatnonzero(holding)[-1]) if holding.any() else 0)
    far = values.get("tracking_max_m", math.nan)
    bounds = criteria_of(mission)
    allowed = max(LEAST_LOST, 3.0 * float(mission.team.cable_lengths.max()))
    if far > max(allowed, 2.0 * (bounds["tracking_max_m"].max or 0.0)):
        found.append(f"the load was {far:.4g} m off its reference")
    low, floor = values.get("min_height_m", math.nan), bounds["min_height_m"].min
    if floor is not None and low < floor - SUNK:
        default = "min_height_m" not in mission.criteria
        where = (
            "underground" if default or floor == 0.0 else f"below the lowest height of {floor:g} m"
        )
        found.append(f"the load was {floor - low:.4g} m {where}")
    return found


def _let_go(recording: Recording, held: int) -> list[str]:
    """Why a load that no cable holds after row ``held`` is lost; empty where it was set down."""
    said = "no cable holds the load at the end"
    if "touch_speeds" not in recording or "ground_forces" not in recording:
        return [said]
    speed = float(np.max(recording["touch_speeds"][held:, -1]))
    if recording["ground_forces"][-1, -1, 2] > 0.0:
        return [said, f"the load fell onto the ground with {speed:.3g} m/s"] if speed > SOFT else []
    return [said]


DESCENDED = "descended"
"""How the outcome of a flight begins that brought its load down because its drones could not carry it on."""


MOST_FINDINGS = 3
"""So many things that are wrong with a real flight's log are told, the others counted."""


def _seen(recording: Recording, values: Mapping[str, float]) -> list[str]:
    """What misses no criterion but is worth a look."""
    wrong = [str(each.get("text")) for each in recording.provenance.get("findings", [])]
    found = [f"log: {text}" for text in wrong[:MOST_FINDINGS]]
    if len(wrong) > MOST_FINDINGS:
        found.append(f"log: {len(wrong) - MOST_FINDINGS} more findings")
    slack = values.get("slack_time_s", math.nan)
    if slack > 0.0:
        rods = recording.mission.kinds.get("plant") == "rigid-cables"
        found.append(
            f"cables pushed like rods for {slack:.3g} s, which no cable does: fly on slack-cables"
            if rods
            else f"cables slack for {slack:.3g} s"
        )
    failures = values.get("allocator_failures", math.nan)
    if failures > 0:
        found.append(f"{failures:.0f} allocation{'s' if failures != 1.0 else ''} not ok")
    silent = values.get("allocator_silent", math.nan)
    if silent > 0:
        found.append(f"the allocator was silent in {silent:.0f} cycles")
    reduced = values.get("allocator_limited", math.nan)
    if reduced > 0:
        found.append(f"in {reduced:.0f} allocations the force gave way to limits")
    return found


def _summary(values: Mapping[str, float]) -> str:
    words, turned = [], values.get("attitude_max_deg", math.nan)
    error = values.get("tracking_max_m", math.nan)
    if math.isfinite(error):
        distance = f"{error:.2g} m" if error >= 1.0 else f"{100.0 * error:.2g} cm"
        angle = f" and {turned:.2g} deg" if math.isfinite(turned) else ""
        words.append(f"load within {distance}{angle} of its reference")
    least, apart = (
        values.get("min_angle_deg", math.nan),
        values.get("min_drone_distance_m", math.nan),
    )
    if math.isfinite(turned) and math.isfinite(apart):  # cables that end apart may be parallel
        words.append(f"drones {apart:.2f} m apart at least")
    elif math.isfinite(least):
        words.append(f"smallest angle {least:.1f} deg")
    return "; ".join(words)
