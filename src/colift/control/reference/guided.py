"""Flown by hand: from any state of motion smoothly to rest at a point, or to a steady velocity; a rigid load also to an attitude."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.turning import turn_to
from colift.part import Vector
from colift.team import Team

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Coordinate, Coordinate, Coordinate]

_ZERO = (0.0, 0.0, 0.0)
_LONGEST, _TRIED = 600.0, 96
"""Longest transition, s, and how many lengths up to it are tried."""
_SAMPLES = np.linspace(0.0, 1.0, 33)


DEGREE = 7
AXIS = DEGREE + 1
PARAMS = Layout(
    team={
        "begin": 1, "duration": 1, "coefficients": 3 * AXIS,
        "turn_begin": 1, "turn_duration": 1, "turn_coefficients": 3 * AXIS,
    }
)  # fmt: skip
"""``coefficients`` of each axis, and of roll, pitch and yaw (rad), in time over duration, the constant first."""
P = PARAMS.at


@inline
def _polynomial(params, first, s, duration):  # type: ignore[no-untyped-def]
    """One coordinate and three derivatives in time."""
    value, d1, d2, d3 = 0.0, 0.0, 0.0, 0.0
    for power in range(DEGREE, -1, -1):
        # Horner's scheme for the polynomial and its derivatives over their factorials.
        d3 = d3 * s + d2
        d2 = d2 * s + d1
        d1 = d1 * s + value
        value = value * s + params[first + power]
    return (
        value,
        d1 / duration,
        2.0 * d2 / (duration * duration),
        6.0 * d3 / (duration * duration * duration),
    )


@kernel(SIGNATURE)
def _guided(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    duration = params[P.duration]
    elapsed = max(t - params[P.begin], 0.0)
    for k in range(3):
        first = P.coefficients + AXIS * k
        motion = _polynomial(params, first, min(elapsed / duration, 1.0), duration)
        for row in range(4):
            reference[row, k] = motion[row]
        if elapsed > duration:
            reference[0, k] += reference[1, k] * (elapsed - duration)
    level = True
    for k in range(3 * AXIS):
        level = level and params[P.turn_coefficients + k] == 0.0
    if level:
        return
    duration = params[P.turn_duration]
    s = min(max(t - params[P.turn_begin], 0.0) / duration, 1.0)
    roll = _polynomial(params, P.turn_coefficients, s, duration)
    pitch = _polynomial(params, P.turn_coefficients + AXIS, s, duration)
    yaw = _polynomial(params, P.turn_coefficients + 2 * AXIS, s, duration)
    turn_to(roll, pitch, yaw, writes.reference_attitude, writes.reference_rates)


Lean = Annotated[float, Field(ge=-60.0, le=60.0)]
Heading = Annotated[float, Field(ge=-3600.0, le=3600.0)]


class Guided(ReferencePart):
    """From a state of motion at ``begin`` to rest at ``target``, or without one to ``velocity`` for ever.

    Each coordinate is a polynomial of degree 7 (6 without a target) in time that keeps position, velocity,
    acceleration and jerk at ``begin`` and ends without acceleration and jerk. Put in place of itself in
    flight (:meth:`towards`, :meth:`along`, :meth:`turned`) it is continuous up to the jerk. Roll, pitch and yaw of a rigid load go
    the same way from ``turn_begin`` to rest at ``attitude_deg``, whatever the place does.
    """

    kernel = _guided
    turns = ("attitude_deg", "turn_start_deg")

    begin: Annotated[float, Field(ge=0.0)] = 0.0
    """When the transition begins, s; before, the reference stands still."""
    start: tuple[Triple, Triple, Triple, Triple] = ((0.0, 0.0, 1.0), _ZERO, _ZERO, _ZERO)
    """Position and three derivatives then, world frame, m, m/s, m/s^2, m/s^3."""
    target: Triple | None = None
    """Where to come to rest, world frame, m; none: fly on at ``velocity``."""
    velocity: Triple = _ZERO
    """Velocity to fly on with when there is no target, world frame, m/s."""
    max_speed: Annotated[float, Field(gt=0.0, le=100.0)] = 1.5
    """Highest speed of the transition, m/s, unless it begins or ends with more."""
    max_acceleration: Annotated[float, Field(gt=0.0, le=50.0)] = 2.0
    """Highest acceleration of the transition, m/s^2, unless it begins with more."""
    least_time: Annotated[float, Field(ge=0.1, le=60.0)] = 0.5
    """Shortest transition, s: a rigid load's cables follow the wanted motion as it is and are turned by a short one, however small it is."""
    turn_begin: Annotated[float, Field(ge=0.0)] = 0.0
    """When a rigid load begins to turn, s."""
    turn_start_deg: tuple[Triple, Triple, Triple, Triple] = (_ZERO, _ZERO, _ZERO, _ZERO)
    """Its roll, pitch and yaw then, degrees, and their three derivatives."""
    attitude_deg: tuple[Lean, Lean, Heading] = _ZERO
    """Roll, pitch and yaw to come to rest at, degrees: ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    max_turn_deg: Annotated[float, Field(gt=0.0, le=1000.0)] = 30.0
    """Highest rate at which these angles change, degrees/s, unless they begin with more."""
    max_turn_acceleration_deg: Annotated[float, Field(gt=0.0, le=5000.0)] = 40.0
    """Highest second derivative of these angles, degrees/s^2, unless they begin with more."""

    def towards(self, target: Triple, begin: float, state: NDArray[np.float64]) -> Self:
        """The same, from ``state`` (4, 3) at ``begin`` (s) to rest at ``target``."""
        return self._planned(begin=begin, start=state.tolist(), target=target, velocity=_ZERO)

    def along(self, velocity: Triple, begin: float, state: NDArray[np.float64]) -> Self:
        """The same, from ``state`` (4, 3) at ``begin`` (s) to a steady velocity."""
        return self._planned(begin=begin, start=state.tolist(), target=None, velocity=velocity)

    def turned(self, attitude_deg: Triple, begin: float, angles: NDArray[np.float64]) -> Self:
        """The same, turning from ``angles`` (4, 3) at ``begin`` (s), rad and derivatives, to rest at an attitude, degrees."""
        start = np.degrees(angles).tolist()
        return self._planned(turn_begin=begin, turn_start_deg=start, attitude_deg=attitude_deg)

    def upright(self) -> Self:
        rows = tuple((0.0, 0.0, yaw) for _, _, yaw in self.turn_start_deg)
        level = (0.0, 0.0, self.attitude_deg[2])
        return self.model_copy(update={"turn_start_deg": rows, "attitude_deg": level})

    def _planned(self, **settings: object) -> Self:
        return type(self).model_validate({**self.model_dump(), **settings})

    def params(self, team: Team) -> Vector:
        ends = (self.velocity,) if self.target is None else (self.target, _ZERO)
        duration, place = _shortest(
            self.start,
            (*ends, _ZERO, _ZERO),
            self.max_speed,
            self.max_acceleration,
            self.least_time,
        )
        turning, turn = _shortest(
            np.radians(self.turn_start_deg),
            np.radians((self.attitude_deg, _ZERO, _ZERO, _ZERO)),
            math.radians(self.max_turn_deg),
            math.radians(self.max_turn_acceleration_deg),
            self.least_time,
        )
        return PARAMS.pack(
            team.n,
            begin=self.begin, duration=duration, coefficients=place.ravel(),
            turn_begin=self.turn_begin, turn_duration=turning, turn_coefficients=turn.ravel(),
        )  # fmt: skip


def _shortest(
    start: ArrayLike, ends: ArrayLike, speed: float, acceleration: float, least: float
) -> tuple[float, NDArray[np.float64]]:
    """Duration and coefficients (3, :data:`AXIS`) of the shortest transition within its limits that is not shorter than ``least``, s.

    ``start`` has value and three derivatives (4, 3), ``ends`` the same, or without the value the derivatives (3, 3). Where nothing keeps
    the limits, the nearest to them.
    """
    start, ends = np.asarray(start), np.asarray(ends)
    # In time over duration, for every duration at once: (durations, coefficients, axes).
    durations = np.geomspace(least, _LONGEST, _TRIED)
    order = np.concatenate([np.arange(4), np.arange(4 - len(ends), 4)])
    scaled = np.concatenate([start, ends]) * durations[:, None, None] ** order[:, None]
    polynomials = _solved(order) @ scaled
    degree = len(order) - 1
    excess = np.zeros(len(durations))
    for derivative, most, given in (
        (1, speed, max(_size(start[1]), _size(ends[-3]))),
        (2, acceleration, _size(start[2])),
    ):
        along = _rows(_SAMPLES, derivative, degree) @ polynomials
        peaks = np.linalg.norm(along, axis=2).max(axis=1) / durations**derivative
        excess = np.maximum(excess, peaks / max(most, 1.001 * given) - 1.0)
    best = int(np.argmax(excess <= 0.0)) if (excess <= 0.0).any() else int(np.argmin(excess))
    coefficients = np.zeros((3, AXIS))
    coefficients[:, : degree + 1] = polynomials[best].T
    return float(durations[best]), coefficients


def _rows(s: Vector, derivative: int, degree: int) -> NDArray[np.float64]:
    """What a derivative at ``s`` is made of, per coefficient: (len(s), degree + 1)."""
    powers = np.arange(degree + 1)
    factor = np.ones(degree + 1)
    for k in range(derivative):
        factor *= np.maximum(powers - k, 0)
    return np.asarray(factor * s[:, None] ** np.maximum(powers - derivative, 0))


def _solved(order: NDArray[np.int64]) -> NDArray[np.float64]:
    """Coefficients from the four values at 0 and the others at 1, derivatives of this order."""
    at = np.repeat([0.0, 1.0], [4, len(order) - 4])
    rows = [_rows(np.array([s]), int(k), len(order) - 1)[0] for s, k in zip(at, order, strict=True)]
    return np.asarray(np.linalg.inv(np.array(rows)))


def _size(vector: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(vector))
