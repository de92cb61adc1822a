"""Drag of drones, load and cables in the air that moves past them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.small import cross
from colift.part import Vector
from colift.team import Team
from colift.team.scaling import PAPER_LOAD
from colift.team.vehicles import PAPER_MASS
from colift.world.disturbance._lever import Metre, arm_of, aside, turn_by
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Area = Annotated[float, Field(ge=0.0, le=10.0)]
Linear = Annotated[float, Field(ge=0.0, le=10.0)]
RotorDrag = Annotated[float, Field(ge=0.0, le=1.0)]

DRONE_AREA, LOAD_AREA, CABLE_DIAMETER = 0.012, 0.006, 0.0015
"""Of the paper's drone and load (m^2) and cables (m), which it does not say: chosen."""

# Gauss and Legendre's three points on (0, 1): exact for polynomials up to degree five.
_POINTS = (0.5 - 0.5 * math.sqrt(0.6), 0.5, 0.5 + 0.5 * math.sqrt(0.6))
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)

PARAMS = Layout(
    team={
        "density": 1, "drone_linear": 1, "load_area": 1, "load_linear": 1, "cable": 1, "arm": 3, "centre": 3,
    },
    drone={"drone_area": 1, "rotor_drag": 1},
)  # fmt: skip
"""``cable``: drag coefficient times diameter; ``arm``: from a rigid load's centre of mass to where the air pushes it, ``centre``: that of mass, in the load's frame."""
P = PARAMS.at


@inline
def _on_body(velocity, wind, quadratic, linear, force):  # type: ignore[no-untyped-def]
    """Add the drag of a body to the force on it: ``(rho C_d A / 2 |w| + c) w`` in the relative wind w."""
    x, y, z = wind[0] - velocity[0], wind[1] - velocity[1], wind[2] - velocity[2]
    scale = quadratic * math.sqrt(x * x + y * y + z * z) + linear
    force[0] += scale * x
    force[1] += scale * y
    force[2] += scale * z


@kernel(SIGNATURE)
def _drag(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, ends, positions, velocities = sees.load, sees.ends, sees.positions, sees.velocities
    attitudes, directions, thrusts = sees.attitudes, sees.directions, sees.applied_thrusts
    attached = sees.attached
    wind, external = writes.wind, writes.external_forces
    n = positions.shape[0]
    half_rho = 0.5 * params[P.density]
    before = (external[n, 0], external[n, 1], external[n, 2])
    _on_body(
        load[1], wind, half_rho * params[P.load_area], params[P.load_linear], external[n]
    )  # fmt: skip
    turn_by(
        P.arm, params, external[n, 0] - before[0], external[n, 1] - before[1], external[n, 2] - before[2], sees, writes,
    )  # fmt: skip
    q = sees.load_attitude
    cx, cy, cz = quaternion.into_world(
        q[0], q[1], q[2], q[3], params[P.centre], params[P.centre + 1], params[P.centre + 2]
    )
    for i in range(n):
        _on_body(
            velocities[i], wind, half_rho * params[P.rows + P.width * i + P.drone_area], params[P.drone_linear],
            external[i],
        )  # fmt: skip
        rotor_drag = params[P.rows + P.width * i + P.rotor_drag]
        if rotor_drag > 0.0:
            # In the rotors' plane, in proportion to thrust: blades flap and drag unevenly.
            axis = quaternion.third_axis(
                attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
            )
            along = 0.0
            for k in range(3):
                along += axis[k] * (wind[k] - velocities[i, k])
            for k in range(3):
                across = wind[k] - velocities[i, k] - along * axis[k]
                external[i, k] += rotor_drag * thrusts[i] * across
        if attached[i] == 0.0 or params[P.cable] == 0.0:
            continue
        length = 0.0
        for k in range(3):
            length += (ends[i, 0, k] - positions[i, k]) * directions[i, k]
        for m in range(3):
            s = _POINTS[m]
            along = squared = 0.0
            for k in range(3):
                past = wind[k] - (1.0 - s) * velocities[i, k] - s * ends[i, 1, k]
                along += past * directions[i, k]
                squared += past * past
            normal = math.sqrt(max(squared - along * along, 0.0))
            scale = _WEIGHTS[m] * half_rho * params[P.cable] * length * normal
            pushed = (0.0, 0.0, 0.0)
            for k in range(3):
                past = wind[k] - (1.0 - s) * velocities[i, k] - s * ends[i, 1, k]
                force = scale * (past - along * directions[i, k])
                external[i, k] += (1.0 - s) * force
                external[n, k] += s * force
                pushed = (pushed[1], pushed[2], s * force)
            arm = (
                ends[i, 0, 0] - load[0, 0] - cx,
                ends[i, 0, 1] - load[0, 1] - cy,
                ends[i, 0, 2] - load[0, 2] - cz,
            )
            moment = cross(arm, pushed)
            for k in range(3):
                writes.external_moment[k] += moment[k]


class Drag(DisturbancePart):
    """Quadratic and linear drag in the relative wind; that of a cable goes to its two ends.

    Across a cable acts ``rho C_d d / 2 |w_n| w_n`` per length, with the wind ``w_n`` across it (the
    cross-flow principle; Hoerner, "Fluid-Dynamic Drag", 1965, ch. 3). It is integrated along the straight
    cable and shared between drone and load by the lever rule, which for a massless cable is exact.
    The rotors' own drag is linear in speed and thrust (Faessler, Franchi, Scaramuzza, RA-L 2018).
    """

    kernel = _drag
    feels_wind: ClassVar[bool] = True
    per_drone = ("drone_area", "rotor_drag")
    from_team: ClassVar[Mapping[str, float | None]] = {
        "drone_area": None, "load_area": None, "rotor_drag": 0.0, "cable_diameter": None,
    }  # fmt: skip

    air_density: Annotated[float, Field(ge=0.0, le=10.0)] = 1.225
    """kg/m^3."""
    drone_area: Area | list[Area] | None = None
    """Drag coefficient times frontal area of a drone's body, m^2. None: 0.012 for a drone of 0.5 kg, and as the surface of
    bodies of the same make grows with their mass."""
    drone_linear: Linear = 0.0
    """Linear drag of a drone, N s/m."""
    load_area: Area | None = None
    """Drag coefficient times frontal area of the load, m^2. None: 0.006 for 0.225 kg (about that of a cube of 7.5 cm), and for
    others as the surface of bodies of the same density."""
    load_centre: tuple[Metre, Metre, Metre] = (0.0, 0.0, 0.0)
    """Where the air pushes a rigid load, its frame, m: beside its centre of mass it turns it."""
    load_linear: Linear = 0.0
    """Linear drag of the load, N s/m."""
    rotor_drag: RotorDrag | list[RotorDrag] | None = None
    """Force in the rotors' plane per thrust and speed across it, s/m; one value, or one for each drone. Small racing
    quadrotors have some 0.05, that is half their weight at 10 m/s. None: ``drones.rotor_drag``, or 0."""
    cable_diameter: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    """m. None: 0.0015 for a load of 0.225 kg, and for others so that cables are stressed as much."""
    cable_coefficient: Annotated[float, Field(ge=0.0, le=3.0)] = 1.2
    """Drag coefficient of the cables across the wind (a cylinder's below Re = 10^5)."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        heavier = team.load_mass / PAPER_LOAD
        return {
            "drone_area": DRONE_AREA * (team.masses / PAPER_MASS) ** (2.0 / 3.0),
            "load_area": np.full(team.n, LOAD_AREA * heavier ** (2.0 / 3.0)),
            "rotor_drag": team.rotor_drags,
            "cable_diameter": np.full(team.n, CABLE_DIAMETER * math.sqrt(heavier)),
        }

    def check(self, team: Team) -> list[tuple[str, str]]:
        return super().check(team) or aside("load_centre", self.load_centre, team)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, density=self.air_density, drone_area=self.settled("drone_area", team),
            drone_linear=self.drone_linear, load_area=float(self.settled("load_area", team)[0]),
            load_linear=self.load_linear, rotor_drag=self.settled("rotor_drag", team),
            cable=float(self.settled("cable_diameter", team)[0]) * self.cable_coefficient,
            arm=arm_of(self.load_centre, team), centre=np.zeros(3) if team.body is None else team.body.centre,
        )  # fmt: skip
