"""Flights and opened pages for the tests of this folder."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import colift
from colift.mission.load import load_mission
from colift.record import metrics
from colift.record.recording import Recording
from colift.show.viewer.data import payload

Size = tuple[int, int]

PATIENCE = 120.0
"""Longest wait for something that happens at once on an idle machine and not on one that is busy, s."""


def fly(mission: str = "paper-spiral", **settings: object) -> Recording:
    """Two seconds of a mission, its events and faults early."""
    table = load_mission(mission).resolved()
    early = {
        name: [item | {"at": 1.0 + 0.1 * k} for k, item in enumerate(table[name])]
        for name in ("events", "fault")
    }
    return colift.run(mission, overrides={"timing.duration": 2.0, **early, **settings}).recording


def payload_of(*recordings: Recording) -> dict[str, Any]:
    labels = [f"flight {k}" for k in range(len(recordings))]
    return payload(recordings, [metrics.compute(recording) for recording in recordings], labels)


@dataclass
class Opened:
    """A page in the browser, with what it said and asked for."""

    page: Any
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def state(self) -> Any:
        return self.page.evaluate("colift.state()")

    def seek(self, time: float) -> Any:
        return self.page.evaluate("t => { colift.seek(t); return colift.state(); }", time)

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression holds."""
        # Not wait_for_function: the page's policy forbids its eval.
        end = time.monotonic() + PATIENCE
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, f"never: {condition}"
            self.page.wait_for_timeout(20)

    def click(self, title: str) -> None:
        self.page.get_by_title(title, exact=True).click()


Open = Callable[..., Opened]
