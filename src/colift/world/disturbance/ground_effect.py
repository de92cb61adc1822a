"""Rotors near the ground carry more: their wake cannot leave as fast."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.part import Vector
from colift.team import Ground, Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Size = Annotated[float, Field(gt=0.0, le=5.0)]

PARAMS = Layout(team={"height": 1, "above": 1}, drone={"radius": 1})
P = PARAMS.at
NEAREST = 0.5
"""Height of a rotor in its radii below which the formula, which has a pole at a quarter, is held."""


@kernel(SIGNATURE)
def _ground_effect(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    positions, attitudes, thrusts = sees.positions, sees.attitudes, sees.applied_thrusts
    external = writes.external_forces
    for i in range(positions.shape[0]):
        ux, uy, uz = quaternion.third_axis(
            attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
        )
        if uz <= 0.0 or thrusts[i] <= 0.0:
            continue
        R = params[P.rows + P.width * i + P.radius]
        z = max(positions[i, 2] + params[P.above] * uz - params[P.height], NEAREST * R)
        s = R / (4.0 * z)
        more = thrusts[i] * s * s / (1.0 - s * s)
        external[i, 0] += more * ux
        external[i, 1] += more * uy
        external[i, 2] += more * uz


class GroundEffect(DisturbancePart):
    """More thrust near the ground: ``1 / (1 - (R / 4 z)^2)`` of that far from it, at the height ``z`` of the rotors.

    Cheeseman and Bennett, "The effect of the ground on a helicopter rotor in forward flight", ARC R&M 3021, 1955, for one
    rotor that hovers; each rotor of a drone is taken as alone. Below half a radius it is held, at a third more thrust. Several
    rotors close together carry more than that, and a drone that tilts is turned level: neither is here.
    """

    kernel = _ground_effect
    per_drone = ("rotor_radius",)
    from_team: ClassVar[Mapping[str, float | None]] = {"rotor_radius": 0.1}

    rotor_radius: Size | list[Size] | None = None
    """Of one rotor, m; one value, or one for each drone. None: ``drones.rotor_radius``, or 0.1."""
    rotor_height: Annotated[float, Field(ge=0.0, le=5.0)] = 0.1
    """Of the rotors above what a drone stands on, m."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        return {"rotor_radius": team.rotor_radii}

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, height=(team.ground or Ground()).height, above=self.rotor_height,
            radius=self.settled("rotor_radius", team),
        )  # fmt: skip

    def check(self, team: Team) -> list[tuple[str, str]]:
        if team.ground is None:
            return [("kind", 'needs a ground, but world.ground = "none"')]
        return []
