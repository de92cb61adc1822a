"""The safe allocator for rigid loads: a wrench shared among cables, under hard limits on cables, drones and distances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import (
    INFO_ACTIVE,
    INFO_BALANCE,
    INFO_GAP,
    INFO_MOMENT,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    SIGNATURE,
    Allocator,
    Status,
)
from colift.control.allocation.common.wrenches import imbalance
from colift.control.allocation.limits import elastic, metres, rigid
from colift.control.allocation.limits.cycle import MAX_TURN
from colift.control.allocation.limits.rigid import (
    COLUMNS,
    MEMORY,
    PAIR,
    PARAMS,
    PLACES,
    WIDTH,
    M,
    P,
    R,
    V,
)
from colift.control.allocation.limits.usual import (
    LOW,
    RATE,
    Degrees,
    Distance,
    Force,
    Limited,
    share_of,
)
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.spans import POINT
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import LEVEL
from colift.team.plan import least_lean, plan, shares, spanned

_CONVERGED = int(Status.CONVERGED)
_ITERATION_LIMIT = int(Status.ITERATION_LIMIT)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)
_RECOVERING = int(Status.RECOVERING)

TURNING = 3.0
"""Fastest turn of a cable of 1 m that holds a rigid load, rad/s."""
LOWER, PLANNED = 0.15, 0.3
"""Least tension of a cable that holds a rigid load, over its share of the weight, and least upright part of what is planned for it."""
PRICES = {"horizontal": 60.0, "vertical": 1000.0, "tip": 200.0, "yaw": 20.0}
"""Of what is missing of a wrench, in shares of the load: yaw gives way first, then horizontal force, roll and pitch, the weight last."""
WITH_LOAD = 0.4
"""Part of the largest turn by which the last cables turn with the wanted attitude before anything else."""
ANY = 1e6
"""Force that nothing limits, N."""
STEEP = 5.0
"""Angle of a plan's cables that needs little thrust, degrees."""
RECOVERY = 5.0
"""Time in which a start that breaks a limit must be led back, s."""
BROKEN = {
    rigid.CONE: "max_cone_deg", rigid.POWER: "max_thrust", rigid.TILT: "max_tilt_deg", rigid.DRONES: "min_distance",
    rigid.CABLE: "cable_distance", rigid.BOX: "box_deg", rigid.GAP: "cable_gap",
}  # fmt: skip
"""Settings by their bit of ``active_limits``."""
COUPLED = 4
"""Most pairs in a step's matrix, for each cable; others only shorten the step."""


@kernel(SIGNATURE, counted=False)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    force, moment = sees.force, sees.moment
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    count = n * (n - 1) // 2
    watched = metres.KINDS * count
    rest_at = M.rows + M.width * n
    pairs_at = rest_at + count
    square_at = pairs_at + PAIR * watched
    most_rows = min(COUPLED * n, watched)
    order = 6 + most_rows
    right_at = square_at + order * order
    moved_at = right_at + order
    data = column(memory, M.rows, n, COLUMNS.row)
    last = column(memory, M.rows, n, COLUMNS.last)
    spare = column(memory, M.rows, n, COLUMNS.w)
    ends = column(memory, M.rows, n, COLUMNS.end)
    places = column(memory, M.rows, n, COLUMNS.place)
    rest = memory[rest_at:pairs_at]
    pairs = memory[pairs_at:square_at]
    moved = memory[moved_at : moved_at + n + 1]
    f = memory[M.f : M.f + 6]
    length = column(params, P.rows, n, PLACES.length)
    arms = column(params, P.rows, n, PLACES.arm)

    for k in range(info.shape[0]):
        info[k] = 0.0
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    wanted, pw, px, py, pz = wrench.unit_attitude(sees.reference_attitude)
    fx, fy, fz = force[0], force[1], force[2]
    mx, my, mz = moment[0], moment[1], moment[2]
    if not (known and wanted and math.isfinite(fx + fy + fz) and math.isfinite(mx + my + mz)):
        info[INFO_RESIDUAL] = math.nan
        info[INFO_GAP] = math.nan
        info[INFO_OBJECTIVE] = math.nan
        info[INFO_BALANCE] = math.nan
        info[INFO_MOMENT] = math.nan
        return _INVALID_FORCE
    sigma = params[P.sigma]
    unit = 1.0 / sigma
    period = dt if dt > 1e-6 else 1e-6
    delta = min(params[P.max_rate] * period, MAX_TURN)
    limit = params[P.most]
    if params[P.slew] > 0.0:
        fx, fy = rigid.slewed(fx, fy, params[P.slew] * n * sigma * delta, memory)
    fx = min(max(fx, -limit), limit) * unit
    fy = min(max(fy, -limit), limit) * unit
    fz = min(max(fz, -limit), limit) * unit
    scale = unit / params[P.arm_unit]
    limit *= 2.0 * params[P.arm_unit]
    mx = min(max(mx, -limit), limit) * scale
    my = min(max(my, -limit), limit) * scale
    mz = min(max(mz, -limit), limit) * scale

    # Ends: as they are for the wrench, in the load's length; as they should be for distances, in metres.
    wrench.turned(qw, qx, qy, qz, n, arms, ends)
    wrench.turned(pw, px, py, pz, n, arms, places)
    back = 1.0 / params[P.arm_unit]
    for k in range(3 * n):
        ends[k] *= back
    span = params[P.span]
    ax, ay, az = quaternion.into_world(
        qw, qx, qy, qz, params[P.axis], params[P.axis + 1], params[P.axis + 2]
    )
    mx, my, mz = wrench.possible(n, span, ax, ay, az, fx, fy, fz, mx, my, mz, ends)
    f[0], f[1], f[2], f[3], f[4], f[5] = fx, fy, fz, mx, my, mz

    # The plan, turned and scaled, and the forces nearest to it: the least cost of all.
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    cos_yaw, sin_yaw = wrench.heading(pw, px, py, pz)
    formation = column(params, P.rows, n, PLACES.plan)
    if sees.formation[0, 2] != 0.0:
        formation = sees.formation.reshape(3 * n)
    if 0.1 * n < W:
        wrench.planned(n, fx, fy, fz, W, cos_yaw, sin_yaw, formation, spare)
    else:
        wrench.planned(n, 0.0, 0.0, 0.1 * n, 0.1 * n, cos_yaw, sin_yaw, formation, spare)
    outs = column(params, P.rows, n, PLACES.out)
    for i in range(n):
        d = WIDTH * i
        for k in range(3):
            data[d + R.home + k] = spare[3 * i + k]
            data[d + R.end + k] = ends[3 * i + k]
            data[d + R.place + k] = places[3 * i + k]
        x, y, z = quaternion.into_world(
            pw, px, py, pz, outs[3 * i], outs[3 * i + 1], outs[3 * i + 2]
        )
        data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3] = -x, -y, -z
    ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, spare)
    wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, spare)
    ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, spare)
    wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, spare)
    bound = 0.0
    for i in range(n):
        for k in range(3):
            bound += 0.5 * (spare[3 * i + k] - data[WIDTH * i + R.home + k]) ** 2

    # Limits, and a start inside of them.
    rates = sees.reference_rates
    spin = math.sqrt(rates[0, 0] ** 2 + rates[0, 1] ** 2 + rates[0, 2] ** 2)
    ahead = min(spin * period, 0.1) if math.isfinite(spin) else 0.0
    flying = params[P.flying] != 0.0
    if flying:
        rigid.accelerate(n, sees.reference, (pw, px, py, pz), rates, arms, data)
        rigid.fly(n, unit, params, data)
    q = memory[M.attitude : M.attitude + 4]
    turning = rigid.turned_by(q, memory[M.known] != 0.0, pw, px, py, pz, WITH_LOAD * delta)
    relaxed = rigid.starts(
        n, unit, delta, ahead, turning, flying, tensions, directions, params, data
    )
    m = rows = 0
    if params[P.metres] != 0.0:
        rigid.went(n, count, (pw, px, py, pz), length, q, last, rest, moved, memory, data)
        m = rigid.watch(n, delta, ahead, moved, params, length, rest, pairs, data)
        rows = min(m, most_rows)

    # The least cost of all, where it is within all limits; else the iteration.
    for i in range(n):
        d = WIDTH * i
        for k in range(3):
            data[d + R.dw + k] = spare[3 * i + k] - data[d + R.w + k]
    simple = elastic.to_the_rim(n, flying, data) > 1.0
    for p in range(m):
        simple = simple and elastic.margin(PAIR * p, params[P.flat], 1.0, pairs, length, data) > 0.0
    if simple:
        outcome = elastic.CONVERGED
        for i in range(n):
            d = WIDTH * i
            for k in range(3):
                data[d + R.w + k] = spare[3 * i + k]
            for k in range(elastic.LIMITS):
                data[d + R.z + k] = 0.0
        for p in range(m):
            pairs[PAIR * p + V.z] = 0.0
    else:
        for i in range(n):
            for k in range(elastic.LIMITS):
                data[WIDTH * i + R.z + k] = 0.0
        lost = memory[M.lost : M.lost + 18]
        none = rigid.nothing(n, span, ax, ay, az, ends, lost)
        work = (
            data, pairs, length, memory[square_at:right_at], memory[right_at:moved_at], memory[M.lam : M.lam + 6],
            memory[M.plus : M.plus + 6], memory[M.minus : M.minus + 6], memory[M.miss : M.miss + 6],
        )  # fmt: skip
        task = (
            params[P.barrier], params[P.tolerance], int(params[P.iterations]), params[P.flat], none
        )  # fmt: skip
        outcome = elastic.iterate(
            n, flying, m, rows, task, lost, params[P.price : P.price + 6], f, work, info
        )

    J = 0.0
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        for k in range(3):
            J += 0.5 * (data[d + R.w + k] - data[d + R.home + k]) ** 2
            spare[3 * i + k] = data[d + R.w + k] * sigma
            ends[3 * i + k] *= params[P.arm_unit]
        t = math.sqrt(x * x + y * y + z * z)
        tensions[i] = t * sigma
        t = 1.0 / t
        directions[i, 0], directions[i, 1], directions[i, 2] = x * t, y * t, z * t
    balance, _ = imbalance(force, moment, ends, spare, info)
    info[INFO_OBJECTIVE] = J * sigma * sigma
    info[INFO_GAP] = (J - bound) * sigma * sigma
    bits = rigid.at_work(n, rows, pairs, data)
    ux, uy, uz, vx, vy, vz = rigid.left_over(n, f, data)
    twist = math.sqrt(vx * vx + vy * vy + vz * vz)
    reduced = balance > 1e-8 * max(1.0, sigma) or twist > 1e-8 * max(1.0, unit)
    cos_cone = math.cos(math.atan(params[P.cone]))
    if relaxed or m > 0:
        cos_box = math.cos(math.atan(params[P.box_angle]))
        wrong = rigid.pairs_broken(n, m, params[P.flat], length, pairs, params, data)
        if relaxed:
            wrong |= rigid.broken(n, flying, unit, cos_cone, cos_box, length, params, data)
        info[INFO_ACTIVE] = float(bits | wrong)
        if wrong != 0:
            return _RECOVERING
    info[INFO_ACTIVE] = float(bits)
    if reduced:
        return _FORCE_REDUCED
    return _CONVERGED if outcome == elastic.CONVERGED else _ITERATION_LIMIT


class SafeWrench(Limited):
    """The cable forces nearest to a hover formation that make the wanted force and moment, under hard limits.

    The limits hold in every answer. Where they do not allow the whole wrench, it gives way in this order: yaw, horizontal force,
    roll and pitch, the weight last. A load that is a point has no moment, and one on two cables none about the line through their ends: what
    no formation can make is left out.
    """

    kernel = _allocate
    wrenches = True
    spread_setting = ("cone_deg", (10.0, 20.0, 30.0, 40.0, 50.0))
    per_drone = ("tension_min", "tension_max", "max_thrust", "min_distance", "cable_distance")
    of_all = ("tension_min", "tension_max", "max_rate")
    from_team: ClassVar[Mapping[str, float | None]] = {
        "tension_min": 0.05,
        "tension_max": None,
        "max_thrust": None,
        "max_rate": 6.0,
        "min_distance": 0.0,
        "cable_distance": 0.0,
    }

    cone_deg: Degrees = 30.0
    """Angle of the plan's cables from the vertical in hover, degrees; more where distances ask for it."""
    min_distance: Distance | list[Distance] | None = None
    """Least distance between the centres of two drones, m; one value, or one per drone: two keep the mean of theirs. 0: not
    limited. None: 2.4 of ``drones.radius`` where that is known, else 0."""
    downwash: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    """How much more of ``min_distance`` drones keep above each other than beside each other."""
    cable_distance: Distance | list[Distance] | None = None
    """Least distance of a drone's centre from the others' cables, m; one value, or one per drone. 0: not limited. None: 1.2 of
    ``drones.radius`` where that is known, else 0."""
    cable_gap: Distance | None = None
    """Least distance between two cables, m. 0: not limited. None: 5 cm, or half of that between the nearest two attachments."""
    box_deg: Annotated[float, Field(ge=0.0, lt=60.0)] = 5.0
    """Least angle between a cable and the load's surface where it ends, degrees. 0: not limited."""
    tension_min: Force | list[Force] | None = None
    """Least tension, N; one value, or one per cable. None: where ``drones.max_thrust`` is known 0.15 of a cable's share of a rigid load's
    weight, half of one of a point's, else 0.05."""
    tension_max: Force | list[Force] | None = None
    """Largest tension, N; one value, or one per cable. None: what 0.95 of ``drones.max_thrust`` lifts beside the drone,
    or six shares of the weight."""
    max_cone_deg: Degrees = 75.0
    """Largest angle between a cable and the vertical, degrees: drones stay above the load."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e3)] | None = None
    """Fastest turn of a cable's direction, rad/s. None: where ``drones.max_thrust`` is known, 3 for a cable of 1 m and less as the
    square root of its length, as a rigid load is moved by cables that turn; 0.4 on a point, 1 for teams of one or two; else 6."""
    max_thrust: Force | list[Force] | None = None
    """Largest thrust of a drone, N. None: 0.95 of ``drones.max_thrust``, or not limited."""
    max_tilt_deg: Degrees | None = None
    """Largest angle between a drone's thrust and the vertical, degrees; none: not limited."""
    slew: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Fastest change of the level force that is asked of the cables, over what the formation gives that turns as a whole
    with ``max_rate``. 0: not limited."""
    barrier: Annotated[float, Field(ge=1e-9, le=0.1)] = 1e-5
    """Barrier of all limits where the whole wrench is given, in squared shares of the load."""
    tolerance: Annotated[float, Field(ge=1e-10, le=1e-2)] = 1e-4
    """KKT residual, in shares of the load, at which the iteration stops."""
    max_iterations: Annotated[int, Field(ge=2, le=200)] = 40
    """Most interior-point steps in one call; limits hold after every step."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        rate, low = (RATE, LOW) if team.body is None else (TURNING, LOWER)
        found = self.usual_limits(team, rate, low)
        caps = found["tension_max"]
        return {**found, "tension_max": np.where(np.isnan(caps), 6.0 * share_of(team), caps)}

    def check(self, team: Team) -> list[tuple[str, str]]:
        return super().check(team) or self.crossed(team)

    def with_any_thrust(self, team: Team) -> SafeWrench:
        free = {"max_thrust", "tension_max"} & {*self.by_team(team)}
        return self.model_copy(update={**dict.fromkeys(free, ANY), "cone_deg": STEEP})

    def cannot_start(self, team: Team, directions: Array) -> str:
        allocator = Allocator(self, team)
        allocator.reset(directions)
        for _ in range(round(RECOVERY / allocator.dt)):
            answer = allocator.allocate([0.0, 0.0, team.load_mass * team.gravity])
            if answer.status is not Status.RECOVERING:
                return ""
        names = [name for bit, name in BROKEN.items() if answer.active_limits & bit]
        return (
            f"breaks a limit and cannot be led back: after {RECOVERY:g} s of hover the {team.n} cables would still break "
            f"{', '.join(names)}: start within the limits, or ask for less"
        )

    def leaning(self, team: Team) -> tuple[float, Array] | None:
        return least_lean(team, **self._asked(team))

    def cannot_hold(self, team: Team, thrusts: Vector, directions: Array) -> list[str]:
        """By its plan of the load as it hangs: what that needs of attachments, tensions and thrusts."""
        held = self.leaning(team)
        if held is None:
            return [
                f"its {team.n} cables hold the load neither level nor leaning: its weight is not between their ends"
            ]
        if held[0] > 0.0 and team.body is not None and np.array_equal(team.body.hang, LEVEL):
            return [
                f"its {team.n} cables hold the load only leaning, not level: its weight is not between their ends"
            ]
        along, tensions = self.formation(team)
        problems = []
        caps = self.tension_caps(team)
        if np.any(tensions > caps):
            i = int(np.argmax(tensions - caps))
            problems.append(
                f"cable {i} would need {tensions[i]:.3g} N of tension_max = {caps[i]:.3g}"
            )
        needed = team.hover_thrusts(tensions, along)
        if np.any(needed > thrusts):
            i = int(np.argmax(needed - thrusts))
            problems.append(f"drone {i} would need {needed[i]:.3g} N of its {thrusts[i]:.3g} N")
        return problems

    def gap(self, team: Team) -> float:
        """Least distance between two cables, m; 0: not limited."""
        if self.cable_gap is not None:
            return self.cable_gap
        if team.n < 2:
            return 0.0
        i, j = np.triu_indices(team.n, k=1)
        ends = np.linalg.norm(team.levers[i] - team.levers[j], axis=1)
        return min(0.05, 0.5 * float(ends.min()))

    def formation(self, team: Team) -> tuple[Array, Array]:
        return plan(team, **self._asked(team))

    def _asked(self, team: Team) -> dict[str, Any]:
        """What is asked of a plan."""
        most = math.radians(self.max_cone_deg)
        return {
            "lean": min(math.radians(self.cone_deg), 0.9 * most),
            "widest": 0.9 * most,
            "distance": self.drone_distances(team),
            "downwash": self.downwash,
            "least": np.maximum(1.1 * self.tension_floors(team), PLANNED * share_of(team)),
        }

    def params(self, team: Team) -> Vector:
        n = team.n
        span, axis = spanned(team)
        sigma = max(share_of(team), 1e-6)
        size = max(float(np.abs(team.levers).max()), 1e-3)
        most = self.thrust_limits(team)
        flying = bool(np.isfinite(most).any()) or self.max_tilt_deg is not None
        caps = self.tension_caps(team)
        sizes, rotors, gap = self.drone_distances(team), self.cable_distances(team), self.gap(team)
        if span == POINT:
            rotors, gap = np.zeros(n), 0.0  # cables that meet come as near as they like
        outs = outward(team)
        level, tip = PRICES["horizontal"], PRICES["tip"]
        order = [level, level, PRICES["vertical"], tip, tip, PRICES["yaw"]]
        head = Layout(team=PARAMS.team).pack(
            0,
            sigma=sigma,
            arm_unit=size,
            span=span,
            axis=axis,
            most=2.0 * float(caps.sum()),
            max_rate=self.turn_rate(team),
            cone=math.tan(math.radians(self.max_cone_deg)),
            tilt=math.tan(math.radians(self.max_tilt_deg or 89.0)),
            flat=1.0 / self.downwash**2,
            box_angle=math.tan(math.radians(90.0 - max(self.box_deg, 1.0))),
            slew=self.slew,
            barrier=self.barrier,
            tolerance=self.tolerance,
            iterations=self.max_iterations,
            g=team.gravity,
            flying=flying,
            price=order,
            metres=bool(sizes.any() or rotors.any() or gap > 0.0),
            rods=bool(rotors.any() or gap > 0.0),
            clear=gap,
        )
        columns = (
            shares(team, *self.formation(team)), team.levers, outs,
            np.any(outs != 0.0, axis=1) & (self.box_deg > 0.0), self.tension_floors(team), caps, team.masses,
            np.minimum(most, 1e6), team.cable_lengths, sizes, rotors,
        )  # fmt: skip
        return np.concatenate(
            [head, *(np.ravel(np.asarray(each, dtype=float)) for each in columns)]
        )

    def memory(self, team: Team) -> Vector:
        n = team.n
        count = n * (n - 1) // 2
        watched = metres.KINDS * count
        order = 6 + min(COUPLED * n, watched)
        return np.zeros(MEMORY.size(n) + count + PAIR * watched + order * order + order + n + 1)

    def carry_over(self, old: Vector, fresh: Vector, places: NDArray[np.int64]) -> Vector:
        return fresh  # all that is remembered is how far pairs are apart


def outward(team: Team) -> Array:
    """Normals (n, 3) of the load's box where the cables end on it, in the load's frame; zero within the box, and where it faces down.

    On an edge or corner the mean of its faces, the top one twice.
    """
    normals = np.zeros((team.n, 3))
    if team.body is None:
        return normals
    half = 0.5 * team.body.size
    for i, end in enumerate(team.body.attachments):
        on = (np.abs(end) >= half * (1.0 - 1e-6)) & (half > 0.0)
        normal = np.where(on, np.sign(end), 0.0) * np.array([1.0, 1.0, 2.0])
        if normal[2] < 0.0:
            normal[2] = 0.0
        size = np.linalg.norm(normal)
        normals[i] = normal / size if size > 0.0 else 0.0
    return normals
