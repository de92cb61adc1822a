"""Discrete gusts of the shape "one minus cosine"."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Speed = Annotated[float, Field(ge=-60.0, le=60.0)]

PARAMS = Layout(team={"peak": 3, "begin": 1, "duration": 1, "interval": 1})
P = PARAMS.at


@kernel(SIGNATURE)
def _gust(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    wind = writes.wind
    since = step * dt - params[P.begin]
    duration, interval = params[P.duration], params[P.interval]
    size = 1.0
    if interval > 0.0 and since >= 0.0:
        # One gust in each interval, somewhere within it.
        number = int(since / interval)
        size, place = noise.uniforms(key, number, 0)
        since -= number * interval + (interval - duration) * place
    if 0.0 <= since < duration:
        size *= 0.5 * (1.0 - math.cos(2.0 * math.pi * since / duration))
        for k in range(3):
            wind[k] += size * params[P.peak + k]


LASTING = 0.36
"""Share of the peak that lasts long enough to be answered to."""


class Gust(DisturbancePart):
    """``peak / 2 (1 - cos(2 pi t / duration))``, once or again and again (the shape of CS-25.341 / FAR 25.341)."""

    kernel = _gust
    makes_wind: ClassVar[bool] = True

    peak: tuple[Speed, Speed, Speed] = (5.0, 0.0, 0.0)
    """Change of the wind at the peak, world frame, m/s."""
    at: Annotated[float, Field(ge=0.0)] = 2.0
    """Begin of the gust, or of the time with gusts, s."""
    duration: Annotated[float, Field(gt=0.0, le=1e3)] = 1.5
    """Length of a gust, s."""
    every: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Interval in which one gust comes, at a random time and with a random share of the peak, s; 0: a
    single gust, at its time and whole."""

    def strongest_wind(self) -> Vector:
        return LASTING * np.array(self.peak)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, peak=self.peak, begin=self.at, duration=self.duration, interval=self.every
        )

    def check(self, team: Team) -> list[tuple[str, str]]:
        if 0.0 < self.every < self.duration:
            return [("every", f"must be 0 or at least duration = {self.duration:g} s")]
        return []
