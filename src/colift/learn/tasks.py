"""The tasks of the environments: a mission, what differs between worlds, what a step is worth and when an episode is over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.learn.numbers import BELOW, FAR, NO_NUMBERS, TOUCHED

Array = NDArray[np.float64]

TERMS = {
    "near": "exp(-e / 0.25 m), e the distance of the load from where it is wanted",
    "level": "exp(-2 a), a the angle of a rigid load from its wanted attitude, rad",
    "slow": "minus the difference from the wanted velocity, m/s, 10 at most",
    "effort": "minus the mean square of the action",
    "over": "once, where the episode ends before its time",
}
"""What a step is rewarded for, each times its weight in the task."""

ENDS = {
    FAR: ("far", "the load is further from where it is wanted than the task's reach"),
    TOUCHED: ("touched", "two drones, a drone and its cable's end, or anything and an obstacle touch"),
    BELOW: ("below", "a drone that carries is less above its cable's end than the task's least height, in cable lengths"),
    NO_NUMBERS: ("no numbers", "a signal is not finite"),
}  # fmt: skip
"""Why an episode is over before its time."""

RIGID = {"load.kind": "rigid", "load.mass": 0.4, "load.size": [0.5, 0.4, 0.15]}
"""The rigid load of the tasks."""
NEAR_SCALE = 0.25
"""m."""
UNKNOWN_RADIUS = 0.1
"""Of a drone over its cable's length, where the mission does not say it."""


@dataclass(frozen=True)
class Task:
    """One of the tasks.

    Attributes
    ----------
    meaning : str
    mission : mapping
        A mission, as in a file.
    ranges : mapping of path to (low, high)
        What is drawn evenly for each world; lists component by component.
    weights : mapping of :data:`TERMS` to float
    reach, least_height : float
        See :data:`ENDS`.
    rigid : mapping
        What else a rigid load changes of the mission, by path.
    boxes : (m, 6) array
        Obstacles: centres and half edges, m.
    gap : (3,) array
        Where the way leads between them, m.

    """

    meaning: str
    mission: Mapping[str, Any]
    ranges: Mapping[str, tuple[Any, Any]]
    weights: Mapping[str, float] = field(
        default_factory=lambda: {"near": 1.0, "level": 0.5, "slow": 0.1, "effort": 0.05, "over": -10.0}
    )  # fmt: skip
    reach: float = 1.0
    least_height: float = 0.2
    rigid: Mapping[str, Any] = field(default_factory=dict)
    boxes: Array = field(default_factory=lambda: np.zeros((0, 6)))
    gap: tuple[float, float, float] = (0.0, 0.0, 0.0)


TOLD_WRONG = {
    "truth.load_mass_factor": (0.9, 1.1),
    "truth.drone_mass_factor": (0.97, 1.03),
    "truth.cable_length_factor": (0.98, 1.02),
}
"""By which the bodies differ from what the controllers are told."""
START = {
    "start.heading_deg": (0.0, 360.0),
    "start.load_offset": ([-0.2, -0.2, -0.1], [0.2, 0.2, 0.1]),
}


def _mission(
    name: str, duration: float, reference: Mapping[str, Any], **more: Any
) -> dict[str, Any]:
    return {
        "name": name, "reference": reference, "timing": {"duration": duration},
        "plant": {"kind": "slack-cables"}, **more,
    }  # fmt: skip


def _wall(x: float, opening: tuple[float, float, float, float]) -> Array:
    """A wall across the way at ``x``, 0.1 m thick, 8 m wide and 5 m high, with an opening: y and z from and to, m."""
    left, right, low, high = opening
    edges = [
        (-4.0, left, 0.0, 5.0),
        (right, 4.0, 0.0, 5.0),
        (left, right, 0.0, low),
        (left, right, high, 5.0),
    ]
    return np.array(
        [
            [x, 0.5 * (a + b), 0.5 * (c + d), 0.05, 0.5 * (b - a), 0.5 * (d - c)]
            for a, b, c, d in edges
        ]
    )


def _lift(low: float) -> tuple[tuple[float, float, float], ...]:
    """Up from the ground, across and down again."""
    return ((0.0, 0.0, low), (0.0, 0.0, 1.0), (1.5, 0.0, 1.0), (1.5, 0.0, low))


TASKS = {
    "Hover": Task(
        "Hold the load still; it begins up to 0.3 m away.",
        _mission("hover", 5.0, {"kind": "hover", "position": [0.0, 0.0, 1.5]}),
        {**TOLD_WRONG, **START},
    ),
    "Track": Task(
        "Lead the load along a figure eight, 1.5 m long, in 6 to 10 s each.",
        _mission(
            "track", 12.0,
            {"kind": "figure-eight", "centre": [0.0, 0.0, 1.5], "length": 1.5, "width": 0.75, "ramp": 2.0},
        ),
        {**TOLD_WRONG, **START, "reference.period": (6.0, 10.0)},
    ),
    "PickAndPlace": Task(
        "Load and drones stand on the ground: lift the load by 1 m, carry it 1.5 m, put it down.",
        _mission(
            "pick-and-place", 9.0,
            {"kind": "waypoints", "points": _lift(0.0), "travel": 2.0, "hold": 0.75},
            start={"on_ground": True}, supervision={"kind": "none"},
        ),
        {**TOLD_WRONG, "start.heading_deg": (0.0, 360.0)},
        least_height=-1.0,
        rigid={"reference.points": _lift(0.075)},
    ),
    "LoseOne": Task(
        "Hold the load still, also when one cable breaks, at 1 to 3 s; nobody is told which. With four drones or more.",
        _mission(
            "lose-one", 6.0, {"kind": "hover", "position": [0.0, 0.0, 2.0]}, fault=[{"kind": "cable-cut"}]
        ),
        {**TOLD_WRONG, **START, "fault.0.at": (1.0, 3.0)},
        reach=1.5,
    ),
    "Window": Task(
        "Through an opening of 1.2 by 1.5 m in a wall: narrower than the formation of the start.",
        _mission(
            "window", 7.0,
            {"kind": "waypoints", "points": [[0.0, 0.0, 1.0], [3.0, 0.0, 1.0]], "travel": 5.0, "hold": 1.0},
        ),
        {**TOLD_WRONG, "start.heading_deg": (0.0, 360.0)},
        boxes=_wall(1.5, (-0.6, 0.6, 0.7, 2.2)),
        gap=(1.5, 0.0, 1.45),
    ),
}  # fmt: skip
"""By name; an environment is ``colift/<name>-v0``."""
