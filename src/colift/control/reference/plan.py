"""A plan of the whole team: the load's path and the pull of every cable, as splines in time."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import splines
from colift.part import Setup, Vector
from colift.team import Team

DEGREES = (7, 5)
"""Of the splines of the load's path and of the pulls."""
PARAMS = Layout(team={"hold": 1, "duration": 1, "intervals": 1, "pulls": 1, "g": 1, "m_L": 1})
"""Behind them the polynomials of each interval, lowest power first: 8 of the load (3,), then 6 of all pulls (3 n); none of the
latter where ``pulls`` is 0."""
P, FIRST = PARAMS.at, PARAMS.size(0)
LOAD, PULLS = 3 * (DEGREES[0] + 1), 3 * (DEGREES[1] + 1)


@inline
def _derivative(params, o, stride, degree, order, s):  # type: ignore[no-untyped-def]
    """Of a polynomial whose coefficients stand ``stride`` apart from ``o`` on, with respect to s."""
    value = 0.0
    for p in range(degree, order - 1, -1):
        factor = 1.0
        for q in range(p - order + 1, p + 1):
            factor *= q
        value = value * s + factor * params[o + stride * p]
    return value


@kernel(SIGNATURE)
def _follow(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    motion, nominal = writes.reference, writes.nominal_forces
    n, K = nominal.shape[0], int(params[P.intervals])
    m, g, planned = params[P.m_L], params[P.g], params[P.pulls] != 0.0
    pace = K / params[P.duration]
    at = min(max((now.time - params[P.hold]) * pace, 0.0), float(K))
    j = min(int(at), K - 1)
    s = at - j
    o = FIRST + j * (LOAD + (n * PULLS if planned else 0))
    for k in range(3):
        scale = 1.0
        for order in range(4):
            motion[order, k] = scale * _derivative(params, o + k, 3, 7, order, s)
            if order < 3:
                # f_i = F / n + m_L g p_i with F = m_L (x'' + g e3); on the drone it pulls the other way.
                F = scale * pace * pace * _derivative(params, o + k, 3, 7, order + 2, s)
                if k == 2 and order == 0:
                    F += g
                for i in range(n):
                    pull = math.nan
                    if planned:
                        p = _derivative(params, o + LOAD + 3 * i + k, 3 * n, 5, order, s)
                        pull = -m * (F / n + g * scale * p)
                    nominal[i, order, k] = pull
            scale *= pace


Length = Annotated[float, Field(ge=-1e6, le=1e6)]
Share = Annotated[float, Field(ge=-1e3, le=1e3)]
Place = Annotated[list[Length], Field(min_length=3, max_length=3)]
Pull = Annotated[list[Share], Field(min_length=3, max_length=3)]
_UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    EOFError,
    zipfile.BadZipFile,
)
_NUMBERS = ("duration", "load_points", "pull_points")


class Plan(ReferencePart):
    """Fly what ``colift plan`` has planned: path of the load, and as nominal forces what every cable pulls on the way.

    Load ``x`` and pulls beyond an equal share, ``p_i``, are B-splines of degrees 7 and 5 on the same clamped, equal knots of the
    duration. The force of cable i on the load is ``m_L (x'' + g e3) / n + m_L g p_i``. Its two derivatives are exact, so that
    whoever follows it need not filter. Before and after the load is at rest. Where a drone has left or joined there is no plan of the cables, only of
    the load.
    """

    kernel = _follow

    file: str | None = None
    """File that ``colift plan --npz`` wrote; duration and control points are read from it, and kept with the mission."""
    hold: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    """Time at rest before, s."""
    duration: Annotated[float, Field(gt=0.0, le=1e5)] = 1.0
    """From rest to rest, s."""
    load_points: Annotated[list[Place], Field(min_length=8, max_length=10_000)] = [
        [0.0, 0.0, 1.0]
    ] * 8
    """Control points of the load's path, world frame, m."""
    pull_points: Annotated[list[list[Pull]], Field(default_factory=list, max_length=10_000)]
    """Control points of what each cable's force on the load is beyond an equal share of all, over the load's weight: two fewer than
    the load's, each with one vector a drone that add up to nothing; empty: the cables are not planned."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any) -> Any:
        """Take duration and points from the file."""
        if not isinstance(given, Mapping) or not isinstance(given.get("file"), str):
            return given
        name = given["file"]
        try:
            with np.load(name, allow_pickle=False) as stored:
                found = {key: stored[key] for key in _NUMBERS}
        except _UNREADABLE as error:
            raise ValueError(
                f"file {name!r} cannot be read as a plan of colift plan --npz: {error}"
            ) from error
        values = {key: value.tolist() for key, value in found.items()}
        return {**values, **{key: value for key, value in given.items() if key != "file"}}

    @model_validator(mode="after")
    def _fit(self) -> Self:
        load, pulls = len(self.load_points), self.pull_points
        if not pulls:
            return self
        if len(pulls) != load - 2:
            raise ValueError(
                f"pull_points has {len(pulls)} points; must be two fewer than the {load} of load_points"
            )
        counts = {len(point) for point in pulls}
        if len(counts) > 1 or 0 in counts:
            raise ValueError("pull_points must have one vector a drone in every point")
        if np.abs(np.sum(pulls, axis=1)).max() > 1e-6:
            raise ValueError("pull_points must add up to nothing in every point")
        return self

    @property
    def drones(self) -> int:
        """For how many cables there is a plan."""
        return len(self.pull_points[0]) if self.pull_points else 0

    def check(self, team: Team) -> list[tuple[str, str]]:
        found = super().check(team)
        if self.drones not in (0, team.n):
            found.append(
                ("pull_points", f"plan {self.drones} cables, but there are {team.n} drones")
            )
        if self.drones and team.body is not None:
            found.append(("pull_points", "plan the cables of a load that is a point: load.kind"))
        return found

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        drones = mission.first_drones()
        if self.drones == len(drones):
            team = mission.team.of(drones)
            pulls = self.pulls(team)
            begin = pulls / np.linalg.norm(pulls, axis=1, keepdims=True)
            away = np.degrees(
                np.arccos(np.clip((begin * mission.start_directions()).sum(1), -1, 1))
            )
            if away.max() > 1.0:
                yield (
                    "pull_points",
                    f"begin {away.max():.1f} degrees from the formation of the start: start.directions",
                )

    def pulls(self, team: Team, time: float = 0.0) -> Vector:
        """Nominal pull of each cable on its drone (n, 3), N."""
        writes, _ = self.call(team, np.zeros(0), time=time)
        return np.array(writes.nominal_forces[:, 0])

    def params(self, team: Team) -> Vector:
        K = len(self.load_points) - DEGREES[0]
        planned = self.drones == team.n
        points = [np.array(self.load_points)]
        if planned:
            points.append(np.array(self.pull_points).reshape(K + DEGREES[1], -1))
        pieces = [_pieces(each, degree, K) for each, degree in zip(points, DEGREES, strict=False)]
        own = PARAMS.pack(
            team.n, hold=self.hold, duration=self.duration, intervals=K, pulls=planned, g=team.gravity, m_L=team.load_mass,
        )  # fmt: skip
        return np.concatenate([own, np.concatenate(pieces, axis=1).ravel()])


def _pieces(points: Vector, degree: int, intervals: int) -> Vector:
    """Coefficients (intervals, (degree + 1) d) of the polynomials in each interval of unit length, lowest power first."""
    local = splines.table(intervals, degree, degree + 1, 1)[:-1]
    powers = float(intervals) ** -np.arange(degree + 1.0)
    own = np.arange(intervals)[:, None] + np.arange(degree + 1)
    found = np.einsum("jka,jad->jkd", local, points[own]) * powers[:, None]
    return np.asarray(found.reshape(intervals, -1))
