"""Moments of a flight worth a mark: slack cables, fallbacks, faults, angles below the limit, commands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.allocation import Status
from colift.geometry import pairwise_angles
from colift.mission.schema import Event
from colift.recording import Recording
from colift.verdict import limits

PAUSE = 0.25
"""Two stretches of the same kind closer than this are one, s."""

MOST_PAIRED = 64
"""Above so many drones no pair is looked at."""


def angle_pairs(n: int) -> bool:
    """Whether angles between pairs of n cables are looked at."""
    return 2 <= n <= MOST_PAIRED


def find_events(recording: Recording) -> list[dict[str, Any]]:
    """Events in order of time, each with ``time`` (s), ``kind``, ``text`` and ``drone`` (from 0) or none.

    A kind is ``slack``, ``fallback``, ``fault``, ``angle`` or ``command``.
    """
    found = [*_slack(recording), *_fallback(recording), *_angle(recording)]
    found += [
        _planned(event) for event in recording.mission.events if event.at <= recording.time[-1]
    ]
    if recording.outcome != "completed":
        outcome = recording.outcome[:1].upper() + recording.outcome[1:]
        found.append(_event(recording.time[-1], "fault", outcome))
    return sorted(found, key=lambda event: float(event["time"]))


def _event(time: float, kind: str, text: str, drone: int | None = None) -> dict[str, Any]:
    return {"time": float(time), "kind": kind, "text": text, "drone": drone}


def _stretches(time: NDArray[np.float64], where: Any) -> list[tuple[int, int]]:
    """First and last row of each stretch in which ``where`` holds; short pauses do not end one."""
    rows = np.flatnonzero(where)
    if not len(rows):
        return []
    ends = np.flatnonzero(np.diff(time[rows]) > PAUSE)
    return [
        (int(first), int(last))
        for first, last in zip(
            rows[np.concatenate([[0], ends + 1])], rows[np.concatenate([ends, [-1]])], strict=True
        )
    ]


def _slack(recording: Recording) -> list[dict[str, Any]]:
    spent = recording["slack_times"]
    found = []
    for i in range(recording.n):
        grows = np.diff(spent[:, i], prepend=0.0) > 0.0
        for first, last in _stretches(recording.time, grows):
            before = spent[first - 1, i] if first and np.isfinite(spent[first - 1, i]) else 0.0
            text = f"Cable {i + 1} slack for {spent[last, i] - before:.3g} s"
            found.append(_event(recording.time[first], "slack", text, i))
    return found


def _fallback(recording: Recording) -> list[dict[str, Any]]:
    status = recording["allocator_status"]
    found = []
    for code in Status:
        if not code.ok:
            for first, last in _stretches(recording.cycle_time, status == code):
                count = int(np.count_nonzero(status[first : last + 1] == code))
                name = code.name.replace("_", " ").lower()
                text = f"Allocator: {name}, {count} cycle{'s' * (count != 1)}"
                found.append(_event(recording.cycle_time[first], "fallback", text))
    return found


def _angle(recording: Recording) -> list[dict[str, Any]]:
    n, least = recording.n, limits(recording.mission).angle_deg
    if least is None or not angle_pairs(n):
        return []
    angles = np.degrees(pairwise_angles(recording["directions"]))
    one, other = np.triu_indices(n, k=1)
    found = []
    for first, last in _stretches(recording.time, np.any(angles < least, axis=1)):
        part = np.where(np.isfinite(angles[first : last + 1]), angles[first : last + 1], np.inf)
        pair = int(part.min(axis=0).argmin())
        text = (
            f"Cables {one[pair] + 1} and {other[pair] + 1} down to {part.min():.1f} deg, "
            f"below {least:g} deg for {recording.time[last] - recording.time[first]:.3g} s"
        )
        found.append(_event(recording.time[first], "angle", text))
    return found


def _planned(event: Event) -> dict[str, Any]:
    """A change that the mission asks for."""
    if event.field == "drones.lose":
        return _event(event.at, "fault", f"Cable of drone {event.value + 1} cut", event.value)
    if event.field == "drones.join":
        return _event(event.at, "command", f"Drone {event.value + 1} joins", event.value)
    return _event(event.at, "command", f"{event.field} = {event.value}")
