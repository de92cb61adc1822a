"""Gains that a loop with a given delay can bear: one rule for the attitude, position and load controllers."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import BaseModel, Field

RATE_MARGIN = math.radians(60.0)
"""Phase margin of the body-rate loop."""

VELOCITY_MARGIN = math.radians(52.0)
"""Phase margin of the velocity loop."""

DOUBT = 0.25
"""Share of a predicted delay or lag that still counts: the prediction's model is not the truth."""

LEAN = 0.5
"""Most that the wanted cable directions answer to a load error: metres that the drones move for a metre."""


class Bandwidths(NamedTuple):
    """Of the cascade, from the inside out, rad/s; each outer loop is critically damped by its inner one."""

    rate: float
    attitude: float
    velocity: float
    position: float


class Delays(BaseModel):
    """What stands between a motion and the answer to it; the settings that delay-aware parts share."""

    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measurements, s."""
    period: Annotated[float, Field(gt=0.0, le=0.5)] = 0.01
    """Control period, s."""
    lag: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Time constant of the motors, s."""
    predicted: bool = True
    """Whether the delay is made up for by predictors (in the attitude controller and the estimator)."""

    def bandwidths(self) -> Bandwidths:
        """The rule.

        ``J dOmega/dt = -K_d Omega(t - tau)`` crosses over at ``w = K_d / J`` with the phase margin
        ``pi/2 - w tau``; ``tau`` is the delay, half a period of the hold, and the motors' lag. What
        is predicted counts by a quarter. The angle's loop around it is critically damped at a quarter
        of ``w`` (so ``rho = w / 2``, for the manifold's ``q_e`` is half an angle). The velocity loop
        sees ``tau`` and the lag ``1 / w`` of an attitude whose wanted rate is fed forward; position again
        a quarter.
        """
        share = DOUBT if self.predicted else 1.0
        tau = share * (self.delay + self.lag) + 0.5 * self.period
        rate = (0.5 * math.pi - RATE_MARGIN) / tau
        velocity = (0.5 * math.pi - VELOCITY_MARGIN) / (tau + 2.0 / rate)
        return Bandwidths(rate, 0.25 * rate, velocity, 0.25 * velocity)
