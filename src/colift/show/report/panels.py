"""What the figures are made of: each function draws one quantity of a recording into given axes.

Lines are thinned so that every extreme stays visible and files stay small. A flight that ended
badly is drawn up to where its numbers stopped making sense; the rest is shaded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from colift.record.ends import cable_ends, turned_ends
from colift.record.metrics import attitude_error as rotation_error
from colift.record.metrics import thrust_limits, tilts, tracking_error
from colift.record.moments import FOLLOWING, KINDS, Moment
from colift.record.recording import Recording
from colift.record.verdict import criteria_of, limits
from colift.show.report import style
from colift.team.geometry import pairwise_angles
from colift.team.obstacles import CYLINDER

Array = NDArray[np.float64]

VIEW = (-60.0, 25.0)
"""Azimuth and elevation from which paths are seen, deg."""

Panel = Callable[[Axes, Recording], Array]
"""Draws one quantity of a recording into axes; returns the values to :func:`focus` on, or none."""

FREE = np.empty(0)
"""Returned by a panel whose vertical axis is not to be limited."""

POINTS = 1200
"""Most points of a line."""

NEXT = 0.013
"""Least distance of two marks, as a share of the axis."""


def decimate(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """At most ``points`` samples of ``y(x)``: the smallest and largest of each stretch, in order.

    Both ends stay; a stretch without numbers stays a gap.
    """
    if len(y) <= points:
        return x, y
    bins = points // 2 - 1
    size = -(-len(y) // bins)
    filled = np.concatenate([y, np.full(-len(y) % size, y[-1])]).reshape(-1, size)
    missing = np.isnan(filled)
    low = np.where(missing, np.inf, filled).argmin(axis=1)
    high = np.where(missing, -np.inf, filled).argmax(axis=1)
    start = np.arange(len(filled)) * size
    keep = np.unique(np.concatenate([start + low, start + high, [0, len(y) - 1]]))
    keep = keep[keep < len(y)]
    return x[keep], y[keep]


def intact(recording: Recording) -> Recording:
    """The part of a flight with meaningful numbers: all of it, unless it diverged.

    A diverged flight is cut where a number is not finite, the load is further than five cable
    lengths from its reference, or the cables pull with more than a hundred times the load's weight.
    """
    if recording.outcome == "completed":
        return recording
    team = recording.mission.team
    most = 100.0 * team.load_mass * max(team.gravity, 1.0)
    with np.errstate(all="ignore"):
        good = np.isfinite(recording["load"]).all(axis=(1, 2))
        good &= np.linalg.norm(tracking_error(recording), axis=1) < 5.0 * team.cable_lengths.max()
        for name in ("tensions", "desired_tensions"):
            total = np.nansum(np.abs(recording[name]), axis=1)
            good &= (total < most) & np.isfinite(recording[name]).any(axis=1)
    rows = len(good) if good.all() else max(1, int(np.argmin(good)))
    arrays = {
        name: values if name.startswith("allocator_") else values[:rows]
        for name, values in recording.arrays.items()
    }
    if not good[0]:  # nothing to show; zeros can be drawn
        arrays = {name: np.zeros_like(values) for name, values in arrays.items()}
    return replace(recording, time=recording.time[:rows], arrays=arrays)


def line(axes: Axes, x: Array, y: Array, **look: Any) -> None:
    """Draw one thinned line."""
    axes.plot(*decimate(x, y), **look)


def band(axes: Axes, x: Array, low: Array, high: Array, **look: Any) -> None:
    """Fill between two curves, thinned so that the band only ever gains."""
    size = max(1, -(-len(x) // (POINTS // 2)))
    starts = np.arange(0, len(x), size)
    axes.fill_between(
        np.append(x[starts], x[-1]),
        np.append(np.minimum.reduceat(low, starts), low[-1]),
        np.append(np.maximum.reduceat(high, starts), high[-1]),
        linewidth=0.0,
        **look,
    )


def per_drone(axes: Axes, time: Array, values: Array) -> None:
    """Values (rows, n): a line per drone, or range and mean of many drones."""
    n = values.shape[1]
    if n <= style.MANY:
        for i in range(n):
            line(axes, time, values[:, i], label=style.drone_label(i), **style.drone(i))
        return
    band(
        axes,
        time,
        np.nanmin(values, axis=1),
        np.nanmax(values, axis=1),
        color=style.FILL,
        label=f"all {n} drones",
    )
    line(axes, time, np.nanmean(values, axis=1), color=style.PALETTE[0], label="mean")


def focus(panels: Sequence[Axes], values: Sequence[Array]) -> None:
    """Limit a common vertical axis to where the values mostly are, if short peaks would dwarf them.

    The axis then holds the middle 98 % of all values with some room; a note in each panel that is
    cut tells its whole range.
    """
    flat = np.concatenate([part[np.isfinite(part)] for part in values])
    if not len(flat):
        return
    low, high = flat.min(), flat.max()
    inner, outer = np.quantile(flat, (0.01, 0.99))
    middle, size = (inner + outer) / 2.0, max(1.5 * (outer - inner), (high - low) / 6.0)
    if high - low <= 2.5 * size:
        return
    bottom, top = max(low, middle - size / 2.0), min(high, middle + size / 2.0)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    for axes, part in zip(panels, values, strict=True):
        axes.set_ylim(bottom, top)
        least, most = np.nanmin(part), np.nanmax(part)
        if least < bottom or most > top:
            note = f"off scale: {least:.3g} to {most:.3g}".replace("-", "\u2212")
            axes.text(0.985, 0.965, note, transform=axes.transAxes, ha="right", va="top", bbox=box)


def time_axis(axes: Axes, recording: Recording, *, label: bool = True, top: bool = True) -> None:
    """Horizontal axis in seconds over the flight with its moments; a diverged part shaded.

    What causes something is a line across, what follows a mark at the top, where there is room.
    """
    end = max(float(recording.time[-1]), 1e-3)
    axes.set_xlim(0.0, end)
    if label:
        axes.set_xlabel("time (s)")
    last = float(intact(recording).time[-1])
    if last < end:
        axes.set_xlim(0.0, min(end, max(1.25 * last, 1e-3)))
        axes.axvspan(last, end, color=style.SPOILT, zorder=0.5, linewidth=0.0, label="diverged")
    begin, shown = axes.get_xlim()
    taken: list[float] = []
    for causing in (True, False):
        for moment in recording.moments:
            crowded = any(abs(moment.time - t) < NEXT * (shown - begin) for t in taken)
            if (moment.kind not in FOLLOWING) is causing and (causing or not crowded):
                taken.append(moment.time)
                _mark(axes, moment, top=top)


def _mark(axes: Axes, moment: Moment, *, top: bool) -> None:
    look = style.mark(moment.kind)
    if moment.kind not in FOLLOWING:
        axes.axvline(moment.time, color=look["color"], linewidth=0.8, linestyle=":", zorder=1.5)
    if top:
        (drawn,) = axes.plot(
            moment.time, 1.045, transform=axes.get_xaxis_transform(), clip_on=False, linestyle="",
            markersize=7.0, markerfacecolor="none", label=KINDS[moment.kind], **look,
        )  # fmt: skip
        drawn.set_gid(style.MARKED)


def position_error(axes: Axes, recording: Recording) -> Array:
    """Components of the load's position error, cm, within plus and minus its length."""
    flight = intact(recording)
    error = 100.0 * tracking_error(flight)
    distance = np.linalg.norm(error, axis=1)
    band(axes, flight.time, -distance, distance, color=style.PALE, label="± distance")
    for name, colour, values in zip("xyz", style.COMPONENTS, error.T, strict=True):
        line(axes, flight.time, values, color=colour, label=name)
    axes.set_ylabel("position error (cm)")
    return FREE


def attitude_error(axes: Axes, recording: Recording) -> Array:
    """Rotation from a rigid load's wanted attitude to its own, degrees, about the world's axes, within plus and minus its angle."""
    flight = intact(recording)
    error = np.degrees(rotation_error(flight))
    angle = np.linalg.norm(error, axis=1)
    band(axes, flight.time, -angle, angle, color=style.PALE, label="± angle")
    for name, colour, values in zip("xyz", style.COMPONENTS, error.T, strict=True):
        line(axes, flight.time, values, color=colour, label=f"about {name}")
    axes.set_ylabel("attitude error (deg)")
    return FREE


def distances(axes: Axes, recording: Recording) -> Array:
    """Distances between drones, m: each pair, or of many the nearest one of each drone; the least that is asked for dashed."""
    flight, n = intact(recording), recording.n
    places = flight["positions"]
    if n * (n - 1) // 2 <= style.MANY:
        for i, j in zip(*np.triu_indices(n, k=1), strict=True):
            apart = np.linalg.norm(places[:, i] - places[:, j], axis=1)
            line(axes, flight.time, apart, label=f"{i}-{j}", **pair(int(i), int(j)))
    else:
        nearest = np.full(places.shape[:2], np.nan)
        for k in range(n):  # one drone at a time: memory grows with n only
            apart = np.linalg.norm(np.delete(places, k, axis=1) - places[:, k : k + 1], axis=2)
            nearest[:, k] = np.min(apart, axis=1, initial=np.inf, where=~np.isnan(apart))
        per_drone(axes, flight.time, np.where(np.isinf(nearest), np.nan, nearest))
    least = limits(recording.mission).distance_m
    if least is not None:
        least_or_most(axes, least, f"{least:g} m limit")
    axes.set_ylabel("distance of drones (m)")
    return FREE


def tensions(axes: Axes, recording: Recording) -> Array:
    """Actual tensions, N."""
    flight = intact(recording)
    per_drone(axes, flight.time, flight["tensions"])
    axes.set_ylabel("tension (N)")
    return flight["tensions"]


def wanted_tensions(axes: Axes, recording: Recording) -> Array:
    """Wanted tensions, N."""
    flight = intact(recording)
    per_drone(axes, flight.time, flight["desired_tensions"])
    axes.set_ylabel("wanted tension (N)")
    return flight["desired_tensions"]


def desired_tensions(axes: Axes, recording: Recording) -> Array:
    """Actual tensions, N, with the wanted ones dashed on top (their mean if they are many)."""
    tensions(axes, recording)
    flight = intact(recording)
    wanted = flight["desired_tensions"]
    if recording.n > style.MANY:
        wanted = np.nanmean(wanted, axis=1, keepdims=True)
    for i, values in enumerate(wanted.T):
        name = ("wanted" if recording.n <= style.MANY else "wanted, mean") if i == 0 else None
        line(
            axes,
            flight.time,
            values,
            color="#000000",
            linestyle=(0, (3, 3)),
            linewidth=0.8,
            label=name,
        )
    return flight["tensions"]


def tension_error(axes: Axes, recording: Recording) -> Array:
    """Actual less wanted tension, N."""
    flight = intact(recording)
    error = flight["tensions"] - flight["desired_tensions"]
    per_drone(axes, flight.time, error)
    axes.set_ylabel("tension error (N)")
    return error


def thrusts(axes: Axes, recording: Recording) -> Array:
    """Thrust of each drone, N, with the most that it can give dashed where that comes near."""
    flight = intact(recording)
    values = flight["applied_thrusts" if flight.measured("applied_thrusts") else "thrusts"]
    per_drone(axes, flight.time, values)
    most = thrust_limits(recording)
    if most is not None and np.nanmax(values) > 0.7 * most.min():
        for k, limit in enumerate(np.unique(most)):
            least_or_most(axes, limit, "most thrust" if k == 0 else None)
    axes.set_ylabel("thrust (N)")
    return values


def tilt(axes: Axes, recording: Recording) -> Array:
    """Tilt of each drone, degrees, with the mission's limit where that comes near."""
    flight = intact(recording)
    values = tilts(flight)
    per_drone(axes, flight.time, values)
    bound = criteria_of(recording.mission).get("max_tilt_deg")
    if bound is not None and bound.max is not None and np.nanmax(values) > 0.7 * bound.max:
        least_or_most(axes, bound.max, f"{bound.max:g}° limit")
    axes.set_ylabel("tilt (deg)")
    axes.set_ylim(0.0, max(axes.get_ylim()[1], 1.0))
    return FREE


def least_or_most(axes: Axes, value: float, label: str | None) -> None:
    """A dashed line at a limit."""
    axes.axhline(value, color=style.LIMIT, linestyle=(0, (5, 3)), linewidth=1.0, label=label)


def nearest_angles(directions: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Angle of each cable to its nearest one (rows, n) and of the widest pair (rows,), rad.

    A drone that has left counts as opposite to all others. Returns also which rows were used: all, unless that would take more than some seconds.
    """
    n = directions.shape[1]
    every = max(1, int(len(directions) * n * n / 2e8))
    chosen = np.arange(0, len(directions), every)
    diagonal = np.arange(n)
    nearest, widest = [], []
    slices = max(1, 4_000_000 // (n * n))
    for k in range(0, len(chosen), slices):
        part = directions[chosen[k : k + slices]]
        cosines = part @ part.swapaxes(1, 2)
        widest.append(np.nanmin(cosines, axis=(1, 2)))
        cosines[:, diagonal, diagonal] = -2.0
        cosines[np.isnan(cosines)] = -2.0  # a drone that has left is near to none
        nearest.append(cosines.max(axis=2))
    # arccos loses digits near zero, but 1e-8 rad is no matter in a figure.
    to_angle = [np.arccos(np.clip(np.concatenate(c), -1.0, 1.0)) for c in (nearest, widest)]
    return chosen, to_angle[0], to_angle[1]


def smallest_angle(recording: Recording) -> tuple[Array, Array]:
    """Time, s, and smallest angle between two cables at that time, deg; NaN for one cable."""
    if recording.n < 2:
        return recording.time, np.full(len(recording.time), np.nan)
    rows, nearest, _ = nearest_angles(recording["directions"])
    return recording.time[rows], np.degrees(nearest.min(axis=1))


def angles(axes: Axes, recording: Recording) -> Array:
    """Angles between cables, deg: each pair, or ranges if they are many; 30 deg dashed."""
    flight, n = intact(recording), recording.n
    time = flight.time
    if n < 2:
        axes.text(0.5, 0.6, "one cable: no pairs", transform=axes.transAxes, ha="center")
        axes.set_ylim(0.0, 60.0)
    elif n * (n - 1) // 2 <= style.MANY:
        pairs = zip(*np.triu_indices(n, k=1), strict=True)
        degrees = np.degrees(pairwise_angles(flight["directions"]))
        for (i, j), values in zip(pairs, degrees.T, strict=True):
            line(axes, time, values, label=f"{i}-{j}", **pair(int(i), int(j)))
    else:
        rows, nearest, widest = nearest_angles(flight["directions"])
        near, wide, time = np.degrees(nearest), np.degrees(widest), time[rows]
        band(axes, time, near.min(axis=1), wide, color=style.PALE, label="all pairs")
        band(
            axes,
            time,
            near.min(axis=1),
            near.max(axis=1),
            color=style.FILL,
            label="nearest neighbours",
        )
        line(axes, time, near.min(axis=1), color=style.PALETTE[0], label="closest pair")
    least_angle(axes, limits(recording.mission).angle_deg)
    axes.set_ylabel("angle between cables (deg)")
    return FREE


def pair(i: int, j: int) -> dict[str, Any]:
    """Look of the pair of drones ``i`` and ``j``: dashes in the two drones' colours."""
    first, second = style.drone(i)["color"], style.drone(j)["color"]
    return {"color": first, "gapcolor": second, "linestyle": (0, (4, 4)), "linewidth": 1.6}


def least_angle(axes: Axes, degrees: float | None) -> None:
    """A dashed line at the angle that was asked for, if any was; the axis starts at zero."""
    top = axes.get_ylim()[1]
    if degrees is not None:
        least_or_most(axes, degrees, f"{degrees:g}° limit")
        top = max(top, degrees * 1.2)
    axes.set_ylim(0.0, top)


def allocator_time(axes: Axes, recording: Recording) -> None:
    """Histogram of the allocator's durations, us, both axes logarithmic, with three marks."""
    durations = 1e6 * recording["allocator_time"]
    durations = durations[np.isfinite(durations) & (durations > 0.0)]
    axes.set_xlabel("duration of one allocation (µs)")
    axes.set_ylabel("allocations")
    if not len(durations):
        axes.text(0.5, 0.5, "no durations measured", transform=axes.transAxes, ha="center")
        return
    low, high = durations.min() * 0.8, durations.max() * 1.25
    counts, edges = np.histogram(durations, np.geomspace(low, high, 61))
    axes.stairs(counts, edges, fill=True, color=style.FILL, baseline=0.5)
    marks = {
        "median": (np.median(durations), "-"),
        "99 %": (np.percentile(durations, 99), (0, (4, 2))),
        "worst": (durations.max(), (0, (1.2, 1.2))),
    }
    for name, (value, dashes) in marks.items():
        label = f"{name} {value:.3g} µs" if value < 1000.0 else f"{name} {value:.0f} µs"
        axes.axvline(float(value), color=style.INK, linestyle=dashes, linewidth=1.1, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(0.5, 2.0 * counts.max())
    fine = (1.0, 2.0, 5.0) if high < 500.0 * low else (1.0,)
    style.plain_ticks(axes.xaxis, fine)
    style.plain_ticks(axes.yaxis)


CORNERS = 2.0 * (np.arange(8)[:, None] >> np.arange(3) & 1) - 1.0
ALONG = [0, 1, 3, 2, 0, 4, 5, 7, 6, 4, -1, 1, 5, -1, 2, 6, -1, 3, 7, -1]
"""Edges of a box with these corners: below, above, then what connects them; -1 is a gap."""


def path(axes: Any, recording: Recording) -> None:
    """Three-dimensional path, m: reference, flown, and the formation at up to four instants."""
    flight, team = intact(recording), recording.mission.team
    wanted, flown = flight["reference"][:, 0], flight["load"][:, 0]
    every = max(1, len(flown) // 400)
    axes.plot(*wanted[::every].T, color=style.MUTED, linewidth=4.0, label="reference")
    axes.plot(*flown[::every].T, color=style.INK, linewidth=1.1, label="load")
    rows = snapshots(flown, 0.8 * team.cable_lengths.max())
    drones = flight["positions"][rows]
    cables = np.full((len(rows), recording.n, 3, 3), np.nan)
    cables[:, :, 0] = drones
    cables[:, :, 1] = cable_ends(flight)[rows][:, :, 0]
    axes.plot(*cables.reshape(-1, 3).T, color="#777777", linewidth=0.8)
    if team.body is None:
        axes.plot(*flown[rows].T, "s", color=style.INK, markersize=4.5)
    else:
        axes.plot(*_boxes(flight, rows).T, color=style.INK, linewidth=1.0)
    few = recording.n <= style.MANY
    for i in range(min(recording.n, len(style.PALETTE))):
        axes.plot(
            *drones[:, i :: len(style.PALETTE)].reshape(-1, 3).T,
            "o",
            color=style.PALETTE[i],
            markeredgecolor="white",
            markeredgewidth=0.5,
            markersize=6.5 if few else 4.0,
            label=style.drone_label(i) if few else None,
        )
    below = 0.0 if team.body is None else 0.6 * float(np.linalg.norm(team.body.size))
    for row in rows:
        x, y, z = flown[row] - [0.0, 0.0, below]
        axes.text(
            x, y, z, f"\u00a0\u00a0 {flight.time[row]:.3g} s", fontsize=8, color="#444444", va="top"
        )
    points = np.concatenate([wanted, flown, drones.reshape(-1, 3)])
    _equal_box(axes, points[np.isfinite(points).all(axis=1)])
    if outlines := _obstacles(axes, recording.mission.world.rows()):
        axes.plot(*np.concatenate(outlines).T, color=style.MUTED, linewidth=0.9, label="obstacles")
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name} (m)", labelpad=0.0)
        axes.tick_params(axis=name, pad=0.0)


def _boxes(flight: Recording, rows: list[int]) -> Array:
    """Edges of a rigid load at these rows, one line (k, 3) with gaps."""
    team = flight.mission.true_team
    assert team.body is not None
    corners = 0.5 * team.body.size * CORNERS
    load, attitude, rates = (flight[name][rows] for name in ("load", "load_attitude", "load_rates"))
    places = turned_ends(load, attitude, rates, corners)[:, :, 0]
    places = np.concatenate([places, np.full((len(rows), 1, 3), np.nan)], axis=1)
    return places[:, ALONG].reshape(-1, 3)


def _obstacles(axes: Any, rows: Array) -> list[Array]:
    """Outlines (k, 3) with gaps of the obstacles that reach into the axes, cut off at their ends."""
    low, high = np.transpose([getattr(axes, f"get_{name}lim")() for name in "xyz"])
    a = np.linspace(0.0, 2.0 * np.pi, 33)
    ring = np.column_stack([np.cos(a), np.sin(a), 0.0 * a])
    gap, rod = np.full((1, 3), np.nan), np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    posts = [part for k in (0, 8, 16, 24) for part in (ring[k] + rod, gap)]
    cylinder = np.concatenate([ring + rod[0], gap, ring + rod[1], gap, *posts])
    sphere = np.concatenate([np.concatenate([np.roll(ring, k, axis=1), gap]) for k in range(3)])
    box = np.concatenate([CORNERS, gap])[ALONG]
    found = []
    for kind, *centre, x, y, z, radius in rows:
        half = np.array([x, y, z]) + radius
        if (centre + half > low).all() and (centre - half < high).all():
            unit = cylinder if kind == CYLINDER else sphere if radius > 0.0 else box
            found.append(np.clip(centre + half * unit, low, high))
    return found


def snapshots(flown: Array, apart: float, most: int = 4) -> list[int]:
    """Rows of the start and of instants at which the load is seen far from all others chosen, m."""
    azimuth, elevation = np.radians(VIEW)
    out = np.array([np.cos(azimuth), np.sin(azimuth)])
    right = [-out[1], out[0], 0.0]
    up = [*(-np.sin(elevation) * out), np.cos(elevation)]
    known = np.flatnonzero(np.isfinite(flown).all(axis=1))
    candidates = known[np.linspace(0, len(known) - 1, min(61, len(known))).astype(int)]
    seen = flown @ np.array([right, up]).T
    rows = [int(candidates[0])]
    while len(rows) < most:
        gaps = np.linalg.norm(seen[candidates, None] - seen[rows], axis=2).min(axis=1)
        if gaps.max() < apart:
            break
        rows.append(int(candidates[gaps.argmax()]))
    return sorted(rows)


def _equal_box(axes: Any, points: Array) -> None:
    """One metre is as long on each axis; a flat path still gets a box of some depth."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, max(0.3 * (high - low).max(), 1e-3)) * 1.06
    middle = (low + high) / 2
    for name, centre, length in zip("xyz", middle, size, strict=True):
        getattr(axes, f"set_{name}lim")(centre - length / 2, centre + length / 2)
        ticks = 6 if length > 0.6 * size.max() else 4
        axes.locator_params(axis=name, nbins=ticks)
    axes.view_init(azim=VIEW[0], elev=VIEW[1])
    axes.set_box_aspect(size, zoom=1.04)
