"""The figures that set several flights side by side, by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from colift.record.recording import Recording
from colift.record.verdict import limits
from colift.show.report import panels, style
from colift.show.report.figures import Entry, register

Recordings = Mapping[str, Recording]
"""Recordings by the label that they carry in the figure."""

COMPARISONS: dict[str, Entry[Recordings]] = {}
"""Every figure of several flights by name."""


@register(
    COMPARISONS,
    "Cable tensions compared",
    "Actual tension of each cable, one panel per flight, all on the same scale.",
)
def tensions(recordings: Recordings) -> Figure:
    return _side_by_side(recordings, panels.tensions)


@register(
    COMPARISONS,
    "Angles between cables compared",
    "Angle between every two cables, one panel per flight; the least angle that the mission asks for dashed. Each line carries "
    "the colours of its two drones.",
)
def angles(recordings: Recordings) -> Figure:
    return _side_by_side(recordings, panels.angles)


@register(
    COMPARISONS,
    "Sensitivity",
    "Left: tension of the cables, the mean as a line and the range over the cables as a band. "
    "Right: the smallest angle between two cables at each time; the angle that the missions ask for dashed.",
)
def sensitivity(recordings: Recordings) -> Figure:
    figure, (left, right) = style.grid(columns=2, share=False)
    seen = []
    for k, (label, recording) in enumerate(recordings.items()):
        look, flight = style.series(k), panels.intact(recording)
        values = flight["tensions"]
        seen.append(values)
        low, high = np.nanmin(values, axis=1), np.nanmax(values, axis=1)
        panels.band(left, flight.time, low, high, color=look["color"], alpha=0.2)
        panels.line(left, flight.time, np.nanmean(values, axis=1), label=label, **look)
        panels.line(right, *panels.smallest_angle(flight), **look)
    panels.focus([left], [np.concatenate(seen, axis=None)])
    asked = [limits(recording.mission).angle_deg for recording in recordings.values()]
    panels.least_angle(right, max((angle for angle in asked if angle), default=None))
    left.set_ylabel("tension (N)")
    right.set_ylabel("smallest angle (deg)")
    end = max(float(recording.time[-1]) for recording in recordings.values())
    for axes in (left, right):
        axes.set_xlim(0.0, max(end, 1e-3))
        axes.set_xlabel("time (s)")
    style.legend(figure)
    return figure


def _side_by_side(recordings: Recordings, draw: panels.Panel) -> Figure:
    figure, axes = style.grid(columns=len(recordings), titles=True)
    values = []
    for panel, (label, recording) in zip(axes, recordings.items(), strict=True):
        values.append(draw(panel, recording))
        panels.time_axis(panel, recording, top=False)
        panel.set_title(label)
        if panel is not axes[0]:
            panel.set_ylabel("")
    panels.focus(axes, values)
    style.legend(figure)
    return figure
