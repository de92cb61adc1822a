"""Flown by hand: from any state of motion smoothly to rest at a point, or to a steady velocity."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Coordinate, Coordinate, Coordinate]

_ZERO = (0.0, 0.0, 0.0)
_DURATIONS = np.geomspace(0.5, 600.0, 96)
"""Lengths of the transition that are tried, s."""
_SAMPLES = np.linspace(0.0, 1.0, 33)


DEGREE = 7
PARAMS = Layout(team={"begin": 1, "duration": 1, "coefficients": 3 * (DEGREE + 1)})
"""``coefficients`` of each axis, in time over duration, the constant first."""
P = PARAMS.at


@kernel(SIGNATURE)
def _guided(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    duration = params[P.duration]
    elapsed = max(t - params[P.begin], 0.0)
    s = min(elapsed / duration, 1.0)
    for k in range(3):
        value, first, second, third = 0.0, 0.0, 0.0, 0.0
        for power in range(DEGREE, -1, -1):
            # Horner's scheme for the polynomial and its derivatives over their factorials.
            third = third * s + second
            second = second * s + first
            first = first * s + value
            value = value * s + params[P.coefficients + (DEGREE + 1) * k + power]
        reference[0, k] = value
        reference[1, k] = first / duration
        reference[2, k] = 2.0 * second / (duration * duration)
        reference[3, k] = 6.0 * third / (duration * duration * duration)
        if elapsed > duration:
            reference[0, k] += reference[1, k] * (elapsed - duration)


class Guided(ReferencePart):
    """From a state of motion at ``begin`` to rest at ``target``, or without one to ``velocity`` for ever.

    Each coordinate is a polynomial of degree 7 (6 without a target) in time that keeps position, velocity,
    acceleration and jerk at ``begin`` and ends without acceleration and jerk. Put in place of itself in
    flight (:meth:`towards`, :meth:`along`) it is continuous up to the jerk.
    """

    kernel = _guided

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

    def towards(self, target: Triple, begin: float, state: NDArray[np.float64]) -> Self:
        """The same, from ``state`` (4, 3) at ``begin`` (s) to rest at ``target``."""
        return self._planned(begin=begin, start=state.tolist(), target=target, velocity=_ZERO)

    def along(self, velocity: Triple, begin: float, state: NDArray[np.float64]) -> Self:
        """The same, from ``state`` (4, 3) at ``begin`` (s) to a steady velocity."""
        return self._planned(begin=begin, start=state.tolist(), target=None, velocity=velocity)

    def _planned(self, **settings: object) -> Self:
        return type(self).model_validate({**self.model_dump(), **settings})

    def params(self, team: Team) -> Vector:
        ends = [self.start[k] for k in range(4)]
        ends += [self.velocity] if self.target is None else [self.target, _ZERO]
        ends += [_ZERO] * 2
        # In time over duration, for every duration at once: (durations, coefficients, axes).
        order = np.array([0, 1, 2, 3, 1, 2, 3] if self.target is None else [0, 1, 2, 3, 0, 1, 2, 3])
        scaled = np.array(ends) * _DURATIONS[:, None, None] ** order[:, None]
        polynomials = _solved(order) @ scaled
        degree = len(order) - 1
        excess = np.zeros(len(_DURATIONS))
        for derivative, most, given in (
            (1, self.max_speed, max(_size(self.start[1]), _size(self.velocity))),
            (2, self.max_acceleration, _size(self.start[2])),
        ):
            along = _rows(_SAMPLES, derivative, degree) @ polynomials
            peaks = np.linalg.norm(along, axis=2).max(axis=1) / _DURATIONS**derivative
            excess = np.maximum(excess, peaks / max(most, 1.001 * given) - 1.0)
        # The shortest within the limits; where there is none, the nearest to them.
        best = int(np.argmax(excess <= 0.0)) if (excess <= 0.0).any() else int(np.argmin(excess))
        coefficients = np.zeros((3, DEGREE + 1))
        coefficients[:, : degree + 1] = polynomials[best].T
        return PARAMS.pack(
            team.n, begin=self.begin, duration=_DURATIONS[best], coefficients=coefficients.ravel()
        )


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


def _size(vector: Triple) -> float:
    return float(np.linalg.norm(vector))
