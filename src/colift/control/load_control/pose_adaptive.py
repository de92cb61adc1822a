"""Place and attitude of a rigid load whose mass, centre of mass and inertia are learned in flight.

Newton's and Euler's laws about the origin of the load's frame are linear in the mass ``m``, its first moment ``h = m c`` and the inertia
``I`` about the origin, ten numbers theta in all::

    F = m y + R (a x h + W x (W x h)),      M = I a + W x I W + h x u,      y = g e3 + a_d,  u = R^T y

where ``W`` and ``a`` are the wanted rates and their derivative in the frame of the load. After Slotine and Li (1987), as on SE(3), with the feedback
of ``pose``, the moment's error teaches ``h`` and ``I``, and the force that observers see beyond what is explained teaches ``m`` (prediction error, Slotine and Li 1989)::

    theta' = -Gamma Y^T (e_W + lambda e_R),      m' = -kappa (y . eps) / |y|^2,      eps = f + (m - m_told) y
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.load_control.base import SIGNATURE
from colift.control.load_control.pose import MEMORY as HELD
from colift.control.load_control.pose import PARAMS as POSE
from colift.control.load_control.pose import Pose, hold_pose, turn_error
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import inertial, quaternion
from colift.kernel.math.inertial import COUNT
from colift.kernel.math.small import cross
from colift.kernel.spans import LINE, POINT
from colift.part import Vector
from colift.team import Team
from colift.team.load import parallel_axis
from colift.team.plan import spanned

SLOWEST = 1.0
"""Gravity from which on it counts for how fast the centre of mass is learned, m/s^2."""
CROSSED = 0.3
"""How far products of inertia may be believed from those told, over the least moment."""
LEARNING = Layout(
    team={"slope": 1, "pass_on": 1, "axis": 3, "learn": COUNT, "lower": COUNT, "upper": COUNT}
)
"""Parameters behind those of ``pose``; ``axis``: the line through the ends of two cables, about which nobody turns the load."""
PARAMS = Layout(team={**POSE.team, **LEARNING.team})
MEMORY = Layout(team={**HELD.team, "learned": COUNT, "rate": COUNT})
"""What is learned beyond what is told; of what is passed on, the rate."""
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _pose_adaptive(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    q, w, reference = sees.estimated_load_attitude, sees.estimated_load_rates, sees.reference
    dt, passed = now.dt, writes.learned_load
    errors = turn_error(
        q, (w[0], w[1], w[2]), sees.reference_attitude, sees.reference_rates
    )  # fmt: skip
    e_R, e_W, W, a = errors
    y = (reference[2, 0], reference[2, 1], reference[2, 2] + params[P.g])
    u = quaternion.into_body(q[0], q[1], q[2], q[3], y[0], y[1], y[2])
    learned, o, slope = memory[M.learned : M.learned + COUNT], P.axis, params[P.slope]
    if sees.standing[sees.standing.shape[0] - 1] == 0.0:
        s = (e_W[0] + slope * e_R[0], e_W[1] + slope * e_R[1], e_W[2] + slope * e_R[2])
        free = s[0] * params[o] + s[1] * params[o + 1] + s[2] * params[o + 2]
        s = (s[0] - free * params[o], s[1] - free * params[o + 1], s[2] - free * params[o + 2])
        # theta' = -Gamma Y^T s, and for the mass what remains of the observed force along y.
        push = y[0] * memory[M.push] + y[1] * memory[M.push + 1] + y[2] * memory[M.push + 2]
        size = max(y[0] * y[0] + y[1] * y[1] + y[2] * y[2], 1.0)
        along = (push / size, *inertial.slopes(s, W, a, u))
        for j in range(COUNT):
            step = dt * params[P.learn + j] * along[j]
            if abs(step) < math.inf:
                learned[j] = min(max(learned[j] - step, params[P.lower + j]), params[P.upper + j])
    force, moment = inertial.needed(learned, W, a, u)
    # The allocator counts moments about the centre of mass that it is told.
    lever = cross((params[P.centre], params[P.centre + 1], params[P.centre + 2]), force)
    moment = (moment[0] - lever[0], moment[1] - lever[1], moment[2] - lever[2])
    force = quaternion.into_world(q[0], q[1], q[2], q[3], force[0], force[1], force[2])
    hold_pose(dt, errors, force, moment, sees, params, memory, writes)
    # Who leads the cables takes derivatives of it, twice: by a critically damped filter.
    omega = params[P.pass_on]
    for j in range(COUNT):
        rate = memory[M.rate + j] + dt * omega * omega * (learned[j] - passed[j])
        memory[M.rate + j] = rate / (1.0 + 2.0 * omega * dt)
        passed[j] += dt * memory[M.rate + j]


class PoseAdaptive(Pose):
    """``pose`` with mass, centre of mass and inertia learned in flight, kept in bounds (projection).

    What is learned takes the place of most of the integral. The centre of mass across the force is learned in hover; its height, and the inertia, only from
    motions that lean and turn the load. On two cables nothing is learned from turns about the line through their ends, which nobody holds.
    A lasting vertical force, such as a wind's, is taken for mass.
    """

    kernel = _pose_adaptive
    remembers = MEMORY

    integral: Annotated[float, Field(ge=0.0, le=5.0)] = 0.03
    """As of ``pose``, for what a centre of mass does not explain: little, for it would take away what there is to learn from."""
    learning: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3
    """Rate at which the centre of mass is learned, 1/s: moment per angle and second, over weight and half the largest edge of the load. 0:
    not at all."""
    inertia_learning: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """That of the inertia over that of the centre of mass."""
    weighing: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3
    """Rate at which the mass is learned, 1/s."""
    lower: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Least mass and moments of inertia that are believed, over those told."""
    upper: Annotated[float, Field(ge=1.0, le=10.0)] = 2.5
    """Largest, likewise."""
    pass_on: Annotated[float, Field(gt=0.0, le=20.0)] = 2.0
    """How fast what is learned is passed on to those who lead the cables, rad/s."""
    aside: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """How far from where it is told the centre of mass may be believed along each axis, over half the largest edge of the load."""

    def params(self, team: Team) -> Vector:
        body, m, g = team.body, team.load_mass, team.gravity
        inertia, centre, size = np.zeros((3, 3)), np.zeros(3), 0.0
        if body is not None:
            inertia, centre, size = body.inertia, body.centre, 0.5 * float(np.max(body.size))
        kind, axis = spanned(team)
        w = self.turn
        # A lasting error of the attitude turns into moment at the rate gamma g^2 lambda, as an integral does.
        slope, gamma = w / (2.0 * self.damping) if self.damping > 0.0 else w, 0.0
        if kind != POINT and slope > 0.0:
            gamma = self.learning * m * size / (max(g, SLOWEST) * slope)
        about = inertia + m * parallel_axis(centre)
        diagonal = np.diag(about)
        far, crossed = np.full(3, self.aside * m * size), np.full(3, CROSSED * diagonal.min())
        learn = [self.weighing] + [gamma] * 3 + [self.inertia_learning * gamma * size * size] * 6
        own = LEARNING.pack(
            team.n, slope=slope, pass_on=self.pass_on, axis=axis if kind == LINE else np.zeros(3), learn=learn,
            lower=np.concatenate([[(self.lower - 1.0) * m], -far, (self.lower - 1.0) * diagonal, -crossed]),
            upper=np.concatenate([[(self.upper - 1.0) * m], far, (self.upper - 1.0) * diagonal, crossed]),
        )  # fmt: skip
        return np.concatenate([super().params(team), own])
