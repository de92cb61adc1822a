"""Replays in a notebook: the last value of a cell is shown below it."""

from __future__ import annotations

from html import escape
from typing import Any

from colift.flight.runner import Run
from colift.record import metrics
from colift.record.recording import Recording
from colift.show.viewer.data import payload
from colift.show.viewer.page import replay_page


class Replay:
    """One or more flights side by side, as Jupyter shows them: the page of ``colift replay``, which needs no network.

    Parameters
    ----------
    *flights : Run or Recording
        Up to three.
    labels : list of str
        What tells them apart; the allocators' names unless given.
    height : int
        Of the picture, pixels.
    **view
        How the page opens, as for :func:`colift.show.viewer.page.replay_page`.

    """

    def __init__(
        self, *flights: Run | Recording, labels: list[str] | None = None, height: int = 640, **view: Any
    ) -> None:  # fmt: skip
        recordings = [each.recording if isinstance(each, Run) else each for each in flights]
        if not 1 <= len(recordings) <= 3:
            raise ValueError(f"{len(recordings)} flights: one to three fit side by side")
        names = labels or [each.mission.kinds.get("allocation", "flight") for each in recordings]
        self._data = payload(recordings, [metrics.compute(each) for each in recordings], names)
        self._height, self._view = height, view

    def _repr_html_(self) -> str:
        page = escape(replay_page(self._data, **self._view))
        # Scripts run, in a page that is no part of the notebook's.
        return (
            f'<iframe srcdoc="{page}" sandbox="allow-scripts" width="100%" height="{self._height}" '
            'style="border: 0" title="replay"></iframe>'
        )
