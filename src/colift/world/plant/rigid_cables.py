"""Quadrotors on rigid massless cables above their load (paper eqs. 1 to 5), RK4 with projection.

The equations are in :mod:`colift.world.plant._rigid`. A tension may come out negative: a rigid rod would push. That
time is counted as slack; a rod is never caught.
"""

from __future__ import annotations

import numpy as np

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.math.winch import turning
from colift.part import Vector
from colift.team import Team
from colift.world.plant._bodies import (
    DRONE,
    LOAD,
    STAGES,
    BodiesPart,
    raise_peaks,
    runge_kutta,
    state_size,
    wind,
)
from colift.world.plant._contact import anchors_of, contact_size, rate, settle, spare_of
from colift.world.plant._params import P
from colift.world.plant._rigid import derivative, project
from colift.world.plant.base import STEP_SIGNATURE

SCRATCH = Layout(drone={"T": 1, "b": 1, "alpha": 3, "length": 1, "rate": 1, "bend": 1})
"""In columns, behind the state and three of its size for the integrator."""
SPANS = SCRATCH.spans


@kernel(STEP_SIGNATURE, counted=False)
def _step(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    thrusts, torques, external = sees.applied_thrusts, sees.applied_torques, sees.external_forces
    moment = sees.external_moment
    attached = sees.attached
    tensions, peak_tensions, slack_times = writes.tensions, writes.peak_tensions, writes.slack_times
    n = thrusts.shape[0]
    size = LOAD + DRONE * n
    y = memory[:size]
    begin = memory[size : 2 * size]
    total = memory[2 * size : 3 * size]
    slope = memory[3 * size : 4 * size]
    T = column(memory, 4 * size, n, SPANS.T)
    b = column(memory, 4 * size, n, SPANS.b)
    alpha = column(memory, 4 * size, n, SPANS.alpha)
    L, rates = column(memory, 4 * size, n, SPANS.length), column(memory, 4 * size, n, SPANS.rate)
    bends = column(memory, 4 * size, n, SPANS.bend)
    anchors, w, forces = anchors_of(memory, n), rate(dt), writes.ground_forces
    for k in range(size):
        begin[k] = y[k]
    winches, moving = sees.winches, turning(n, sees.winches, now.time, dt)
    wind(n, winches, now.time, params, L, rates, bends)
    for stage in range(4):
        if moving:
            wind(n, winches, now.time + STAGES[stage] * dt, params, L, rates, bends)
        derivative(
            n,
            y,
            thrusts,
            torques,
            external,
            moment,
            attached,
            anchors,
            w,
            params,
            bends,
            T,
            alpha,
            b,
            forces,
            slope,
        )
        runge_kutta(stage, size, dt, begin, slope, total, y)
        if stage == 0:
            for i in range(n):
                tensions[i] = T[i]
            raise_peaks(n, T, peak_tensions)
            forces = spare_of(memory, n)
    project(n, y, attached, params, L, rates, T, alpha, b)
    if params[P.ground] > 0.0:
        settle(n, begin, y, w, params, anchors, writes.touch_speeds)
    for i in range(n):
        if tensions[i] < 0.0:
            slack_times[i] += dt


class RigidCables(BodiesPart):
    """Rigid massless cables that would push rather than go slack: rods on ball joints; no settings."""

    kernel = _step
    slackens = False

    def memory(self, team: Team) -> Vector:
        return np.zeros(4 * state_size(team.n) + SCRATCH.size(team.n) + contact_size(team.n))
