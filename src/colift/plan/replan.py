"""Re-planning in flight: what is left of a plan, bent round obstacles that have moved, and certified before it replaces anything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colift.plan.planner import MARGINS, Attempt, Grid, Limits, Numbers, Plan, by_kind, excess

LEAST = 7
"""Intervals that must be left: with fewer no control point is free between what is flown and the rest at the end."""
ROUNDS = (24, 12)
"""Iterations before each certificate. They bound the work."""


def replan(
    plan: Plan, begin: int, obstacles: Numbers, limits: Limits | None = None, margins: Numbers = MARGINS
) -> Plan | None:  # fmt: skip
    """The plan among obstacles as they are now, the same up to the knot ``begin`` and of the same duration.

    It starts from the plan that is flown and takes no more than the iterations of ``ROUNDS``. Only control points are moved that
    act after the knot, so that six derivatives of the load's path and four of the pulls go on there without a step, and the
    reference that flies the plan takes the new one without another word.

    Parameters
    ----------
    plan : Plan
        Being flown.
    begin : int
        Knot from which on it may change; they are ``plan.duration / plan.intervals`` apart.
    obstacles : (m, 8) array
        Rows of :mod:`colift.team.obstacles`.
    limits : Limits, optional
        Wider ones than those of the plan, for what it kept in reserve.
    margins : (5,) array
        Kept from each limit between samples.

    Returns
    -------
    Plan or None
        Certified from the knot on by dense samples, as every plan; None where the bounded work found none, or fewer than
        ``LEAST`` intervals are left. Then the old plan is still the best that is known.

    """
    limits = limits or plan.limits
    if not 0 <= begin <= plan.intervals - LEAST:
        return None
    scene = replace(plan.scene, obstacles=obstacles)
    n = len(scene.lengths)
    attempt = Attempt(scene, limits, np.zeros((n, 3)))
    attempt.x, attempt.z, attempt.T[0] = (
        plan.load_points.copy(),
        plan.pull_points.copy(),
        plan.duration,
    )
    worst = excess(scene, limits, attempt.x, attempt.z, plan.duration, begin=begin)
    if worst.max() > 0.0:
        attempt.grid = Grid(n, plan.intervals, begin=begin)
    for iterations in ROUNDS:
        if worst.max() <= 0.0:
            break
        attempt.improve(0.0, iterations, margins)
        worst = excess(scene, limits, attempt.x, attempt.z, plan.duration, begin=begin)
        margins = margins + np.clip(worst[: len(margins)], 0.0, margins)
    if worst.max() > 0.0:
        return None
    return replace(
        plan, scene=scene, limits=limits, load_points=attempt.x, pull_points=attempt.z, excess=by_kind(worst)
    )  # fmt: skip
