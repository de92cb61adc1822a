"""The paper's allocator against the safe one: ``python docs/figures/safe_against_paper.py``.

Draws ``safe_against_paper.svg`` beside this file and prints the smallest angles that it shows.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import colift
from colift.control.allocation.base import Allocator
from colift.control.allocation.sqp import Sqp
from colift.study import safety
from colift.team.geometry import pairwise_angles

TEAMS = (3, 4, 6, 8, 12, 16)
SECONDS = 60.0
COLOURS = {"safe": "#0072B2", "sqp": "#D55E00"}
LABELS = {"safe": "safe allocator", "sqp": "paper's allocator"}


def under_noise(n, kind):
    """Running smallest wanted angle, degrees, in hover with 0.3 m/s^2 of white noise at 100 Hz."""
    team, limits = safety.problem(n)
    part = limits if kind == "safe" else Sqp(mu=limits.mu)
    allocator = Allocator(part, team, dt=safety.PERIOD)
    cone = np.radians(safety.CONES[n])
    least = np.radians(limits.min_angle_deg + 1.0)
    allocator.reset(directions=safety.spread_formation(n, cone, least))
    rng = np.random.default_rng(1)
    smallest = []
    for _ in range(int(SECONDS / safety.PERIOD)):
        force = team.load_mass * (0.3 * rng.standard_normal(3) + [0.0, 0.0, safety.GRAVITY])
        smallest.append(pairwise_angles(allocator.allocate(force).directions).min())
    return np.degrees(np.minimum.accumulate(smallest))


def in_flight(mission, kind, **overrides):
    """Time, s, and smallest actual angle, degrees, of a flight."""
    flown = colift.run(mission, overrides={"allocation.kind": kind, **overrides}).recording
    return flown.time, np.degrees(pairwise_angles(flown["directions"]).min(axis=1))


figure = Figure(figsize=(9.0, 6.0), layout="constrained")
grid = figure.subplots(3, 3, sharey=True)
for axes, n in zip(grid.flat, TEAMS, strict=False):
    limit = safety.problem(n)[1].min_angle_deg
    for kind in ("sqp", "safe"):
        angle = under_noise(n, kind)
        axes.plot(np.linspace(0, SECONDS, len(angle)), angle, color=COLOURS[kind])
        print(f"noise, n = {n}, {LABELS[kind]}: {angle[-1]:.1f} deg (limit {limit:g})")
    axes.axhline(limit, color="#555555", linestyle="--", linewidth=0.8)
    axes.set_title(f"n = {n}, noise: smallest so far", fontsize=9)
hour = {"timing.duration": 3600.0, "timing.recording": 1.0}
flights = (
    ("from rest", "from-rest", {"position_control.kind": "pid"}),
    ("from rest, cable motion fed forward", "from-rest", {}),
    ("one hour of spiral", "paper-spiral", hour),
)
for axes, (title, mission, overrides) in zip(grid[2], flights, strict=True):
    for kind in ("sqp", "safe"):
        time, angle = in_flight(mission, kind, **overrides)
        axes.plot(time, angle, color=COLOURS[kind], label=LABELS[kind])
        print(f"{title}, {LABELS[kind]}: {angle.min():.1f} deg, at the end {angle[-1]:.1f} deg")
    axes.axhline(30.0, color="#555555", linestyle="--", linewidth=0.8)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("time (s)")
for row in grid:
    row[0].set_ylabel("angle (deg)")
figure.legend(
    *grid[2, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False
)
figure.savefig(Path(__file__).with_suffix(".svg"), metadata={"Date": None})
