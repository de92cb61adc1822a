"""The same bodies in MuJoCo: physics that is not ours, to check ours against.

Drones are free bodies, the load is a point on three slides, a cable is a spatial tendon with an upper limit of its
length between the two. MuJoCo keeps the limit as a soft constraint whose error decays with ``time_constant``; force and
stretch of a limit at rest follow from ``impedance`` (MuJoCo documentation, "Solver parameters"). A cut cable is a tendon
whose limit is off. The ground is a plane that touches a grain at the load and four at each drone, its feet, with the rate and
damping of ours (:mod:`colift.world.plant._contact`) and MuJoCo's own friction. Integrated by MuJoCo's Runge-Kutta method of order four.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.kernel.math.winch import paid_out, turning
from colift.part import Vector
from colift.team import Team
from colift.world.plant._bodies import BODY, DRONE, LOAD, MASS, BodiesPart, state_size
from colift.world.plant._chain import rope
from colift.world.plant._contact import RATE
from colift.world.plant._params import P

SETTINGS = 4
"""Parameters after those of the bodies: time constant, damping ratio, impedance, substeps."""


SHORTEST = 0.002
"""Time constant that no team's numbers go below, s: two steps of MuJoCo, which would need more of them."""
FINER = 20
"""Steps in place of one while a winch turns: a tendon's limit stands still within each, and would pull in jerks."""
GRAIN = 1e-3
"""Radius of what touches the ground, m; the plane lies as much lower."""
PLACES, SPEEDS = np.array([0, 1, 2, 6, 7, 8, 9]), np.array([3, 4, 5, 10, 11, 12])
"""Where what MuJoCo calls a body's position and velocity stand in its state."""
FEET = ((1, 0), (-1, 0), (0, 1), (0, -1))


class _Scene(NamedTuple):
    model: Any
    data: Any  # scratch: every step writes the whole state first
    qpos: NDArray[np.int64]  # where MuJoCo's positions stand in our state
    qvel: NDArray[np.int64]
    body: NDArray[np.int64]  # of each geometry, as in the ground's forces; of the plane none


def _text(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def model_xml(params: Vector) -> str:
    """MJCF of load, drones and cables."""
    load_mass, gravity, grounded, height, friction, damping, rigid = params[: P.inertia]
    bodies = params[MASS:-SETTINGS].reshape(-1, BODY)
    time_constant, damping_ratio, impedance = params[-SETTINGS:-1]
    limit = (
        f'limited="true" solreflimit="{_text(time_constant, damping_ratio)}" '
        f'solimplimit="{_text(impedance, impedance, 1.0)}"'
    )
    grain, plane = "", ""
    if grounded:
        contact = (
            f'solref="{_text(-(RATE**2), -2.0 * damping * RATE)}" solimp="0.9999 0.9999 1 0.5 1" '
            f'friction="{_text(friction, 0.0, 0.0)}" condim="3"'
        )
        grain = f'<geom size="{_text(GRAIN)}" mass="0" conaffinity="0" {contact} pos="'
        plane = f'<geom type="plane" size="1 1 1" pos="0 0 {_text(height - GRAIN)}" contype="0" {contact}/>'
    drones, cables, motors, ends = [], [], [], []
    for i, (mass, length, jx, jy, jz, foot, *end) in enumerate(bodies):
        feet = [f'{grain}{_text(x * foot, y * foot, 0.0)}"/>' for x, y in FEET if grain]
        drones.append(
            f'<body pos="0 0 {_text(length)}"><freejoint/><inertial pos="0 0 0" mass="{_text(mass)}" '
            f'diaginertia="{_text(jx, jy, jz)}"/>{"".join(feet)}<site name="{i}"/></body>'
        )
        cables.append(
            f'<spatial {limit} range="0 {_text(length)}"><site site="{i}"/>'
            f'<site site="end{i}"/></spatial>'
        )
        ends.append(f'<site name="end{i}" pos="{_text(*end)}"/>')
        motors += [f'<motor site="{i}" gear="{_text(*row)}"/>' for row in np.eye(6)[[2, 3, 4, 5]]]
    load = "".join(f'<joint type="slide" axis="{_text(*axis)}"/>' for axis in np.eye(3))
    touching, inertia = np.zeros((1, 3)), "1 1 1 0 0 0"
    if rigid:
        load, (xx, xy, xz, _, yy, yz, _, _, zz) = "<freejoint/>", params[P.inertia : P.inverse]
        touching = params[P.corner : MASS].reshape(-1, 3)[: int(params[P.corners])]
        inertia = _text(xx, yy, zz, xy, xz, yz)
    if grain:
        ends += [f'{grain}{_text(*point)}"/>' for point in touching]
    return f"""<mujoco><option integrator="RK4" gravity="0 0 {_text(-gravity)}">
<flag autoreset="disable"/></option>
<worldbody>{plane}<body>{load}<inertial pos="0 0 0" mass="{_text(load_mass)}" fullinertia="{inertia}"/>
{"".join(ends)}</body>{"".join(drones)}</worldbody>
<tendon>{"".join(cables)}</tendon><actuator>{"".join(motors)}</actuator></mujoco>"""


@lru_cache(maxsize=8)
def _scene(params: bytes) -> _Scene:
    """The model for a parameter vector, made once."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(model_xml(np.frombuffer(params)))
    drones = LOAD + DRONE * np.arange(model.ntendon)[:, None]
    rigid = model.nq > 3 + 7 * model.ntendon
    return _Scene(
        model=model,
        data=mujoco.MjData(model),
        qpos=np.append(PLACES if rigid else PLACES[:3], drones + PLACES),
        qvel=np.append(SPEEDS if rigid else SPEEDS[:3], drones + SPEEDS),
        body=model.geom_bodyid - 2,
    )


def _step(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt, attached, n = now.dt, sees.attached, sees.attached.shape[0]
    tensions, peak_tensions = writes.tensions, writes.peak_tensions
    catch_impulses, slack_times = writes.catch_impulses, writes.slack_times
    import mujoco

    scene = _scene(params.tobytes())
    model, data = scene.model, scene.data
    state, rest, parting = np.split(memory, [state_size(n), memory.size - n])
    warm_start = rest[: model.nv]
    pushes = sees.applied_thrusts, sees.applied_torques, sees.external_forces, sees.external_moment
    if not all(np.abs(a).max() < mujoco.mjMAXVAL for a in (*pushes, state)):
        state[:] = np.nan  # MuJoCo would go on with other numbers; a flight that diverges shall end
        return
    # MuJoCo would soften, without a word, a limit that its step cannot follow.
    substeps = max(int(params[-1]), math.ceil(2.0 * dt / params[-SETTINGS] - 1e-9))
    if turning(n, sees.winches, now.time, dt):
        substeps *= FINER
    model.opt.timestep = dt / substeps
    model.tendon_limited[:] = attached > 0.0
    lengths = params[MASS + 1 : -SETTINGS : BODY]
    data.qpos[:], data.qvel[:] = state[scene.qpos], state[scene.qvel]
    data.qacc_warmstart[:] = warm_start
    _apply(data, sees)
    reduced = 1.0 / (1.0 / params[MASS:-SETTINGS:BODY] + 1.0 / params[0])
    for substep in range(substeps):
        at = now.time + substep * dt / substeps
        wound = np.array([paid_out(sees.winches, i, at) for i in range(n)])
        model.tendon_range[:, 1] = lengths + wound @ _ahead(params)
        middle = [paid_out(sees.winches, i, at + 0.5 * dt / substeps) for i in range(n)]
        mujoco.mj_forward(model, data)
        pressed = _touching(scene, n)
        if substep == 0:
            _press(scene, writes.ground_forces)
        limits = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON)
        pulls = np.zeros(n)
        pulls[data.efc_id[limits]] = data.efc_force[limits]
        if substep == 0:
            tensions[:] = pulls
        np.maximum(peak_tensions, np.append(pulls, pulls.sum()), out=peak_tensions)
        slack_times[(pulls == 0.0) & (attached > 0.0)] += dt / substeps
        holds, taut = attached > 0.0, data.ten_length > lengths + wound[:, 0]
        np.maximum(catch_impulses, reduced * parting, out=catch_impulses, where=holds & taut)
        parting[:] = np.where(holds & ~taut, np.maximum(data.ten_velocity - wound[:, 1], 0.0), 0.0)
        sinking = -np.append(data.qvel[-6 * n :][2::6], data.qvel[2])
        model.tendon_range[:, 1] = lengths + np.array(middle) @ _ahead(params)
        mujoco.mj_step(model, data)
        if model.ngeom:
            np.maximum(
                writes.touch_speeds, sinking, out=writes.touch_speeds,
                where=~pressed & _touching(scene, n),
            )  # fmt: skip
    state[scene.qpos], state[scene.qvel] = data.qpos, data.qvel
    warm_start[:] = data.qacc_warmstart
    if data.warning.number.any():
        mujoco.mj_resetData(model, data)
        state[:] = np.nan


def _apply(data: Any, sees: Any) -> None:
    """What pushes drones and load in this step."""
    external, n = sees.external_forces, sees.applied_thrusts.shape[0]
    controls = data.ctrl.reshape(n, 4)
    controls[:, 0], controls[:, 1:] = sees.applied_thrusts, sees.applied_torques
    data.xfrc_applied[1, :3] = external[n]
    data.xfrc_applied[1, 3:] = sees.external_moment
    data.xfrc_applied[2:, :3] = external[:n]


def _ahead(params: Vector) -> Vector:
    """Shift of a tendon's limit by its length, rate and acceleration with which MuJoCo has the tendon follow a length that changes.

    MuJoCo draws a tendon beyond its limit back by ``-b v - k r`` as if the limit stood still, with ``b = 2 / (d t)`` and
    ``k = 1 / (d t^2 z^2)`` of impedance ``d``, time constant ``t`` and damping ratio ``z``.
    """
    time_constant, damping_ratio, impedance = params[-SETTINGS:-1]
    scale = time_constant * damping_ratio**2
    return np.array([1.0, 2.0 * scale, impedance * time_constant * scale])


def _touching(scene: _Scene, n: int) -> NDArray[np.bool_]:
    """Which of drones and, last, load (n + 1,) touch the ground now."""
    touching = np.zeros(n + 1, dtype=bool)
    if scene.data.ncon:
        contacts = scene.data.contact
        touching[scene.body[contacts.geom2[contacts.dist < 0.0]]] = True
    return touching


def _press(scene: _Scene, forces: NDArray[np.float64]) -> None:
    """Fill the forces (n + 1, 3) of the ground on drones and, last, load, N."""
    import mujoco

    forces[:] = 0.0
    if scene.data.ncon:
        contacts, force = (
            scene.data.contact,
            np.zeros(6),
        )  # of all a field at once: one contact costs as much
        frames, bodies = contacts.frame.reshape(-1, 3, 3), scene.body[contacts.geom2]
        for k, body in enumerate(bodies):
            mujoco.mj_contactForce(scene.model, scene.data, k, force)
            forces[body] += force[:3] @ frames[k]


class Mujoco(BodiesPart):
    """MuJoCo: rigid bodies, and tendons with a soft limit of their length for cables."""

    kernel = _step
    anchored = False
    needs = ("mujoco", "mujoco")

    from_team: ClassVar[Mapping[str, float | None]] = {"time_constant": None}

    time_constant: Annotated[float, Field(ge=1e-4, le=1.0)] | None = None
    """In which an error of a cable's length decays, s. None: that of drone and load on the rope that `elastic-cables` has for the team,
    the shortest of its cables', and no less than 0.002."""
    damping_ratio: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    """Of that decay."""
    impedance: Annotated[float, Field(ge=0.5, le=0.9999)] = 0.999
    """Share of the acceleration that a constraint would need to be exact; nearer to 1 is stiffer."""
    substeps: Annotated[int, Field(ge=1, le=100)] = 1
    """MuJoCo's steps per physics step; more where the time constant would be less than two of them."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        swinging = 1.0 / (1.0 / team.masses + 1.0 / team.load_mass)
        decays = np.sqrt(swinging * team.cable_lengths / rope(team))
        return {"time_constant": np.full(team.n, max(float(decays.min()), SHORTEST))}

    def decay(self, team: Team) -> float:
        """The time constant, s."""
        return float(self.settled("time_constant", team)[0])

    def stretched(self, team: Team, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        softness = (1.0 - self.impedance) * (self.decay(team) * self.damping_ratio) ** 2
        give = softness * tensions * (1.0 / team.masses + 1.0 / team.load_mass)
        return np.asarray(team.cable_lengths + give)

    def params(self, team: Team) -> Vector:
        settings = [self.decay(team), self.damping_ratio, self.impedance, self.substeps]
        return np.append(super().params(team), settings)

    def memory(self, team: Team) -> Vector:
        return np.zeros(state_size(team.n) + 6 + 7 * team.n)
