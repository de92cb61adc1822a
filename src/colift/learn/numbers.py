"""What a world is to the compiled environment: one row of numbers, by name."""

from __future__ import annotations

from colift.kernel.layout import Layout

MOST_BOXES = 8
NUMBERS = Layout(
    team={
        "weight": 1, "length": 1, "g": 1, "rigid": 1, "reach": 1, "least_height": 1, "scale": 1, "near": 1, "level": 1,
        "slow": 1, "effort": 1, "over": 1, "gap": 3, "boxes": 1, "box": 6 * MOST_BOXES,
    },
    drone={"pull": 3, "thrust": 3, "lever": 1, "ratio": 1, "radius": 1},
)  # fmt: skip
"""Of the team as it is told: ``weight`` of the load, N, mean ``length`` of the cables, m. ``reach``, ``least_height`` and the weights of
the terms are the task's (:mod:`colift.learn.tasks`); ``scale`` is that of nearness, m. A ``box`` is an obstacle: centre and half
edges. Of each drone the ``pull`` of its cable on the load and the ``thrust`` that hold the load at rest in the formation of the start,
N, and arm and torque ratio of its motors, m."""

FAR, TOUCHED, BELOW, NO_NUMBERS = 1, 2, 3, 4
"""Why an episode is over, by the numbers that the compiled environment returns."""
CABLES, FORCES, RATES, MOTORS = 0, 1, 2, 3
"""Levels of the action (:mod:`colift.learn.levels`)."""
CENTRAL, DRONE, PART = 0, 1, 2
"""What is observed."""
OWN = 15
"""Numbers that are observed of each drone: place and speed from its cable's end, first and third axis, rates."""


def observed(kind: int, n: int, *, rigid: bool, boxes: bool) -> tuple[int, ...]:
    """Shape of an observation."""
    if kind == PART:
        return (n, 12 if rigid else 9)
    shared = 12 + 6 * rigid + 3 * boxes
    return (shared + n * OWN,) if kind == CENTRAL else (n, shared + OWN + 3 * (n - 1))
