"""The figures of campaigns, by name; drawn from rows of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colift.mission.criteria import METRICS
from colift.show.report import style
from colift.show.report.figures import Entry, register
from colift.study.campaign import judge
from colift.study.reproduction import THRESHOLD_DEG
from colift.study.sweep import COLUMNS, RIGID, Over, Point, points

Row = Mapping[str, Any]
Rows = Sequence[Row]

CONTEST: dict[str, Entry[Rows]] = {}
"""Every figure of a comparison of allocators by name."""

MARKS = "osD^vPX*<>"
"""Markers of the contestants, in turn."""


def _looks(rows: Rows) -> dict[str, dict[str, Any]]:
    """Colour and marker of each contestant, the same in every figure."""
    names = dict.fromkeys(map(judge.name_of, rows))
    return {
        name: {"color": style.drone(k)["color"], "marker": MARKS[k % len(MARKS)]}
        for k, name in enumerate(names)
    }


def _contest(rows: Rows) -> list[Row]:
    """The flights of the contest that were held."""
    return [r for r in rows if r.get("study", "contest") == "contest" and judge.held(r)]


def _rigid(rows: Rows) -> list[Row]:
    """The flights of rigid loads."""
    return [row for row in rows if judge.load_of(row) == judge.RIGID]


@register(
    CONTEST,
    "Separation against tension",
    "One mission, the start as given. Each line is one allocator over the values of the setting that buys "
    "separation with tension, named in the legend; its first and last value stand beside it. Large single "
    "marks are allocators without such a setting. Better is up and to the left; below the dashed line at "
    "30 degrees drones come close. Medians over time: how a flight begins does not count; of a rigid load the smallest "
    "distance of two drones takes the angle's place. Along the lines, flights "
    "count that lost neither load nor team, whatever their angle; single marks are of flights that were held.",
)
def separation(rows: Rows) -> Figure:
    figure, (axes,) = style.grid(height=3.6, legend_rows=4)
    swept = [r for r in rows if r.get("study") == "spread" and judge.fate(r) in ("held", "missed")]
    contest = _contest(rows)
    first = (swept or contest)[0]["mission"]
    rigid = judge.load_of((swept or contest)[0]) == judge.RIGID
    metric = "min_drone_distance_m" if rigid else "usual_angle_deg"
    for name, look in _looks(rows).items():
        line = sorted(
            (r for r in swept if judge.name_of(r) == name), key=lambda r: float(r["value"])
        )
        alone = [r for r in contest if (judge.name_of(r), r["mission"]) == (name, first)][:1]
        shown = [(r["mean_total_tension_N"], r[metric]) for r in line or alone]
        label = f"{name}: {line[0]['setting']}" if line else name
        axes.plot(*zip(*shown, strict=True), label=label, markersize=4 if line else 8, **look)
        for row, place, side in zip(
            line[:1] + line[-1:], shown[:1] + shown[-1:], (-1, 1), strict=False
        ):
            axes.annotate(
                f"{row['value']:g}", place, (5 * side, -8 if side < 0 else 4),
                textcoords="offset points", fontsize=7.5, color=look["color"],
                ha="right" if side < 0 else "left",
            )  # fmt: skip
    axes.margins(0.08)
    if not rigid:
        _safe_line(axes)
    axes.set_xlabel(f"{first}: mean of the sum of tensions (N)")
    axes.set_ylabel(
        "smallest distance of two drones (m)" if rigid else "usual smallest angle (deg)"
    )
    style.legend(figure, rows=4)
    return figure


@register(
    CONTEST,
    "Smallest angle, mission by mission",
    "Smallest angle between two actual cables: a mark for the mean over the seeds, a bar over their range.",
    needs=(judge.POINT,),
)
def angles(rows: Rows) -> Figure:
    own = [row for row in rows if judge.load_of(row) == judge.POINT]
    return _by_mission(own, "min_angle_deg", "smallest angle (deg)", safe=True)


@register(
    CONTEST,
    "Distance of the drones, mission by mission",
    "Smallest distance between two drones that carry a rigid load: a mark for the mean over the seeds, a bar over their range.",
    needs=(judge.RIGID,),
)
def distances(rows: Rows) -> Figure:
    return _by_mission(_rigid(rows), "min_drone_distance_m", "smallest distance (m)")


@register(
    CONTEST,
    "Attitude, mission by mission",
    "Root mean square of the angle between a rigid load and its wanted attitude: a mark for the mean over the seeds, a bar over "
    "their range; the axis is logarithmic.",
    needs=(judge.RIGID,),
)
def attitudes(rows: Rows) -> Figure:
    return _by_mission(_rigid(rows), "attitude_rms_deg", "attitude RMS (deg)", log=True)


@register(
    CONTEST,
    "Tracking, mission by mission",
    "Root mean square of the load's distance from its reference: a mark for the mean over the seeds, a "
    "bar over their range; the axis is logarithmic.",
)
def tracking(rows: Rows) -> Figure:
    return _by_mission(rows, "tracking_rms_m", "tracking RMS (cm)", scale=100.0, log=True)


@register(
    CONTEST,
    "Time of one allocation",
    "From the median (mark) over the 99th percentile (tick) to the longest of all flights (end of the thin "
    "line); the axis is logarithmic. The longest are often interruptions by the operating system, or the first call, which loads a solver.",
)
def time(rows: Rows) -> Figure:
    field = judge.contestants(_contest(rows))
    figure, (axes,) = style.grid(height=0.25 * len(field) + 0.3, left=1.25)
    looks = _looks(rows)
    for k, contestant in enumerate(field):
        middle, late, worst = (
            contestant.values.get(f"allocator_{name}_us", math.nan)
            for name in ("median", "p99", "max")
        )
        look = looks[contestant.name]
        axes.plot([middle, worst], [k, k], color=look["color"], linewidth=0.8)
        axes.plot([middle, late], [k, k], color=look["color"], linewidth=2.4)
        axes.plot([late], [k], color=look["color"], marker="|", markersize=9)
        axes.plot([middle], [k], **look)
    axes.set_xscale("log")
    axes.margins(x=0.03)
    style.plain_ticks(axes.xaxis)
    axes.set_yticks(range(len(field)), [c.name for c in field])
    axes.set_ylim(len(field) - 0.5, -0.5)
    axes.set_xlabel("time (µs)")
    return figure


def _by_mission(
    rows: Rows,
    metric: str,
    label: str,
    *,
    scale: float = 1.0,
    log: bool = False,
    safe: bool = False,
) -> Figure:
    contest = _contest(rows)
    figure, (axes,) = style.grid(height=2.8, legend_rows=2)
    missions = list(dict.fromkeys(str(row["mission"]) for row in contest))
    looks = _looks(rows)
    for k, (name, look) in enumerate(looks.items()):
        shift = 0.75 * ((k + 0.5) / len(looks) - 0.5)
        for m, mission in enumerate(missions):
            values = [
                scale * float(row[metric])
                for row in contest
                if judge.name_of(row) == name and row["mission"] == mission
            ]
            if values:
                x = m + shift
                axes.plot([x, x], [min(values), max(values)], color=look["color"], linewidth=1.4)
                axes.plot([x], [np.mean(values)], linestyle="", markersize=4.5, label=name, **look)
    axes.set_xticks(range(len(missions)), missions)
    axes.set_xlim(-0.5, len(missions) - 0.5)
    axes.grid(visible=False, axis="x")
    if log:
        axes.set_yscale("log")
        style.plain_ticks(axes.yaxis)
    elif safe:
        _safe_line(axes)
    axes.set_ylabel(label)
    style.legend(figure, rows=2)
    return figure


def _safe_line(axes: Axes) -> None:
    axes.axhline(THRESHOLD_DEG, color=style.LIMIT, linewidth=0.8, linestyle=(0, (4, 3)))


@dataclass(frozen=True)
class Swept:
    """The rows of a sweep and what it went over."""

    rows: Rows
    overs: Sequence[Over]

    @property
    def metrics(self) -> Mapping[str, str]:
        """Names of the numbers that are shown, and how they are called."""
        return (
            RIGID if any("attitude_max_deg" in point.spread for point in self.points) else COLUMNS
        )

    @property
    def points(self) -> list[Point]:
        """One summary a combination of values."""
        return points(self.rows, self.overs)


SWEEP: dict[str, Entry[Swept]] = {}
"""Every figure of a sweep by name."""


@register(
    SWEEP,
    "Over the sweep",
    "Each number over the first field that was swept; one line for each combination of the others. The "
    "line is the mean over the seeds, the band their range.",
)
def sweep(swept: Swept) -> Figure:
    first, *others = swept.overs
    lines: dict[str, list[Point]] = {}
    for point in swept.points:
        rest = zip(others, point.values[1:], strict=True)
        lines.setdefault(", ".join(f"{over.path} {v}" for over, v in rest), []).append(point)
    rows = -(-len(lines) // 3)
    figure, axes = style.grid(rows=len(swept.metrics), height=1.25, legend_rows=rows)
    units = {metric.name: metric.unit for metric in METRICS}
    numeric = first.numeric
    place = {value: value if numeric else k for k, value in enumerate(first.labels)}
    for panel, name in zip(axes, swept.metrics, strict=True):
        for k, (label, entries) in enumerate(lines.items()):
            x = [place[point.values[0]] for point in entries]
            mean, least, most = np.array([point.spread[name] for point in entries]).T
            look = style.series(k)
            panel.fill_between(x, least, most, color=look["color"], alpha=0.2, linewidth=0)
            marker = "" if numeric and len(x) > 12 else "o"
            panel.plot(x, mean, label=label or None, marker=marker, markersize=3.5, **look)
        panel.set_ylabel(f"{swept.metrics[name]}\n({units[name]})", fontsize=8)
    if not numeric:
        axes[-1].set_xticks(range(len(first.labels)), [str(value) for value in first.labels])
    elif _geometric(first.values):
        axes[-1].set_xscale("log")
        style.plain_ticks(axes[-1].xaxis, (1.0, 2.0, 5.0))
    axes[-1].set_xlabel(first.path)
    style.legend(figure, rows=rows)
    return figure


def _geometric(values: Sequence[Any]) -> bool:
    """Whether equal ratios lie between the values, as after ``:log``."""
    numbers = np.array(values, dtype=float)
    if len(numbers) < 3 or numbers.min() <= 0.0:
        return False
    steps = np.diff(np.log(numbers))
    return bool(np.allclose(steps, steps[0], rtol=1e-6))
