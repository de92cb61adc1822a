"""Fly one mission from Python: ``colift.run("paper-spiral", allocator="sqp", mu=0.15)``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.record import metrics
from colift.record.recorded import RecordedMission
from colift.record.recording import Recording
from colift.record.verdict import Verdict, judge

if TYPE_CHECKING:
    from colift.flight.flight import Progress


@dataclass(frozen=True)
class Run:
    """A flown mission.

    Attributes
    ----------
    recording : Recording
        Every signal by name.
    loop_time : float
        Wall time of the closed loop, s.
    compiled : bool
        Whether the loop ran compiled; false when a part is plain Python.

    """

    recording: Recording
    loop_time: float
    compiled: bool

    @property
    def mission(self) -> Mission:
        """The mission as flown."""
        mission = self.recording.mission
        assert isinstance(mission, Mission)  # what a run records was simulated
        return mission

    @cached_property
    def metrics(self) -> dict[str, float]:
        """Numbers that judge the flight, by name; the name ends in the unit."""
        return metrics.compute(self.recording)

    @cached_property
    def verdict(self) -> Verdict:
        """How the flight went: level, reasons and every criterion."""
        return judge(self.recording, self.metrics)


def run(
    mission: str | Path | Mapping[str, Any] | Mission | RecordedMission = "paper-spiral",
    *,
    allocator: str | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Run:
    """Fly a mission.

    Parameters
    ----------
    mission
        Name of a shipped mission, path of a TOML file, a mapping with the same content, or a loaded
        mission, also that of a recording.
    allocator
        Name of the allocator to use instead of the mission's.
    seed
        Seed instead of the mission's.
    overrides
        Values by dotted path, e.g. ``{"load.mass": 0.3}``.
    progress
        Called with the fraction flown.
    **settings
        Settings of the allocator, e.g. ``mu=0.75``; with a double underscore those of any section,
        e.g. ``timing__duration=5.0``.

    Returns
    -------
    Run

    Raises
    ------
    colift.errors.MissionError
        With every mistake found in the mission or the overrides; nothing has been flown then.

    """
    if isinstance(mission, Mission | RecordedMission):
        mission = mission.resolved()
    changes: dict[str, Any] = {}
    if allocator is not None:
        changes["allocation.kind"] = allocator
    if seed is not None:
        changes["seed"] = seed
    for name, value in settings.items():
        path = name.replace("__", ".") if "__" in name else f"allocation.{name}"
        changes[path] = value
    loaded = load_mission(mission, layered(changes, overrides or {}))
    # After it, so that at the first use all cores compile what the mission needs beside the loop.
    from colift.flight.flight import Flight

    flight = Flight(loaded)
    recording = flight.run(progress)
    return Run(recording=recording, loop_time=flight.loop_time, compiled=flight.compiled)
