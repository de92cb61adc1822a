"""The safe allocator: the paper's cost under hard limits on cables, pairs and drones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from colift.control.allocation.base import (
    INFO_ACTIVE,
    INFO_BALANCE,
    INFO_GAP,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    SIGNATURE,
    Allocator,
    Motors,
    Status,
)
from colift.control.allocation.common.oracle import paper_objective
from colift.control.allocation.limits import cycle, distance, newton, recovery
from colift.control.allocation.limits import feasibility as feasible
from colift.control.allocation.limits.usual import Degrees, Distance, Force, Limited, share_of
from colift.control.allocation.paper import newton as paper
from colift.errors import Problem, SettingError
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.rounding import KEPT, REDUCED, ROOM, SURE
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array, pairwise_angles, ring, widest_gap

_CONVERGED = int(Status.CONVERGED)
_ITERATION_LIMIT = int(Status.ITERATION_LIMIT)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)
_RECOVERING = int(Status.RECOVERING)
"""Where ``info`` has a sixth place: which kinds of limits push, one bit each in the order of
:mod:`colift.control.allocation.limits.newton`; of pairs 64 stands for the angle, 128 for the distance of drones, 256 for that from a cable."""

MEMORY = Layout(
    team={"S": newton.SYSTEM, "lam": 3, "M": 6, "facing": 3, "yielded": 1, "asked": 3},
    drone={
        "data": newton.DATA, "T": 1, "alpha": 3, "start": 3, "w": 3, "dw": 3, "w_new": 3,
        "row": newton.ROW, "Y": 2 * newton.PITCH, "order": 1, "first": 1, "strong": 1, "last": 1, "begin": 1,
        "eta": 2, "length": 1, "size": 1,
    },
)  # fmt: skip
"""In columns; those of every limit, of every pair, and the matrix ``K`` follow. A team that changes starts anew."""
LIMIT = Layout(drone={"g": 1, "g_new": 1, "z": 1})
PAIR = Layout(drone={"kappa": 1, "cos_max": 1, "both": 2, "cause": 1, "root": 1})
C, L, N, P = MEMORY.at, LIMIT.at, PAIR.at, cycle.PARAMS.at
CABLES, LIMITS, PAIRS = MEMORY.spans, LIMIT.spans, PAIR.spans


@kernel(SIGNATURE, counted=False)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    force, acceleration = sees.force, sees.reference[2]
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    most = n * (n - 1)  # angle and ellipsoid of every pair
    count = newton.LIMITS * n + most
    limits = C.rows + C.width * n
    near = limits + L.width * count
    square = near + N.width * most
    work = newton.Work(
        data=column(memory, C.rows, n, CABLES.data),
        T=column(memory, C.rows, n, CABLES.T),
        alpha=column(memory, C.rows, n, CABLES.alpha),
        w=column(memory, C.rows, n, CABLES.w),
        dw=column(memory, C.rows, n, CABLES.dw),
        w_new=column(memory, C.rows, n, CABLES.w_new),
        g=column(memory, limits, count, LIMITS.g),
        g_new=column(memory, limits, count, LIMITS.g_new),
        z=column(memory, limits, count, LIMITS.z),
        pairs=column(memory, near, most, PAIRS.both),
        kappa_pair=column(memory, near, most, PAIRS.kappa),
        cos_max=column(memory, near, most, PAIRS.cos_max),
        cause=column(memory, near, most, PAIRS.cause),
        root=column(memory, near, most, PAIRS.root),
        flat=params[P.flat],
        first=column(memory, C.rows, n, CABLES.first),
        strong=column(memory, C.rows, n, CABLES.strong),
        last=column(memory, C.rows, n, CABLES.last),
        begin=column(memory, C.rows, n, CABLES.begin),
        rows=column(memory, C.rows, n, CABLES.row),
        K=memory[square : square + 4 * n * n],
        Y=column(memory, C.rows, n, CABLES.Y),
        S=column(memory, 0, 1, CABLES.S),
        eta=column(memory, C.rows, n, CABLES.eta),
        lam=column(memory, 0, 1, CABLES.lam),
        M=column(memory, 0, 1, CABLES.M),
    )
    data, T, alpha, M = work.data, work.T, work.alpha, work.M
    start = column(memory, C.rows, n, CABLES.start)
    order = column(memory, C.rows, n, CABLES.order)
    facing = column(memory, 0, 1, CABLES.facing)
    yielded = column(memory, 0, 1, CABLES.yielded)
    asked = column(memory, 0, 1, CABLES.asked)
    kinds = int(params[P.limits])

    for k in range(info.shape[0]):
        info[k] = 0.0
    fx, fy, fz = force[0], force[1], force[2]
    if not math.isfinite(fx + fy + fz):
        info[INFO_RESIDUAL] = math.nan
        info[INFO_GAP] = math.nan
        info[INFO_OBJECTIVE] = math.nan
        info[INFO_BALANCE] = math.nan
        return _INVALID_FORCE
    sigma = params[P.sigma]
    unit = 1.0 / sigma
    # More than all cables can give changes nothing but the numbers' size.
    most_force = 2.0 * params[P.total]
    fx = min(max(fx, -most_force), most_force) * unit
    fy = min(max(fy, -most_force), most_force) * unit
    fz = min(max(fz, -most_force), most_force) * unit
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    mu = params[P.mu] * unit * unit
    if params[P.mu_scaled] != 0.0:
        mu *= (W * sigma / params[P.mu_force]) ** 2
    period = dt if dt > 1e-6 else 1e-6
    delta = min(params[P.max_rate] * period, cycle.MAX_TURN)
    rho = params[P.settling] / period

    cycle.sort_cables(n, directions, order)
    table = P.rows + P.width * n
    apart = distance.Apart(
        capped=params[P.capped] != 0.0,
        stacked=params[P.stacked] != 0.0,
        flat=params[P.flat],
        table=params[table : table + n * n],
        length=column(memory, C.rows, n, CABLES.length),
        size=column(memory, C.rows, n, CABLES.size),
        order=order,
    )
    if apart.stacked:
        for i in range(n):
            row = P.rows + P.width * int(order[i])
            apart.length[i] = params[row + P.length]
            apart.size[i] = params[row + P.size]
    relaxed = cycle.set_up(
        n, order, W, unit, delta, acceleration, tensions, directions, params, start, apart, work
    )
    if W > 1e-6 and not relaxed:
        follow = period / (params[P.turning] + period)
        cycle.turn_home(n, fx, fy, fz, W, follow, cycle.TURN * delta, facing, work)
    edge = params[P.cos_edge]
    if 2.0 * delta > params[P.reach]:
        edge = math.cos(min(params[P.min_angle] + 2.0 * delta, math.pi))
    m = caps = cycle.near_pairs(
        n, params[P.cos_angle], edge, params[P.kappa_pair], rho, start, apart, work
    )
    if apart.stacked:
        m = distance.near_ellipsoids(
            n, m, params[P.reach], delta, params[P.kappa_pair], SURE, ROOM, recovery.FIRM,
            start, apart, work,
        )  # fmt: skip
    heavy = max(1.0, abs(fz) / n)
    leaning = 0.0
    if yielded[0] > 0.0:
        leaning = cycle.leaning_now(fx, fy, fz, W, delta, yielded, asked)
    task = cycle.Task(
        fx=fx,
        fy=fy,
        fz=fz,
        mu=mu,
        rho=rho,
        kappa=params[P.kappa],
        kappa_rate=0.5 * params[P.kappa_rate] * max(rho, 1.0) * delta * delta,
        spread=params[P.kappa_pair],
        price=params[P.price] * heavy,
        yielding=yielded[0] != 0.0,
        leaning=leaning,
        tolerance=params[P.tolerance],
        max_iterations=int(params[P.iterations]),
    )
    outcome = cycle.iterate(n, kinds, caps, m, task, work, info)
    info[INFO_ACTIVE] = cycle.active_limits(n, kinds, m, work.cause, work.z)
    squares = M[0] * M[0] + M[3] * M[3] + M[5] * M[5]
    squares += 2.0 * (M[1] * M[1] + M[2] * M[2] + M[4] * M[4])
    J = 0.5 * mu * (squares - n)
    rx, ry, rz = force[0], force[1], force[2]
    for i in range(n):
        at = int(order[i])
        J += 0.5 * data[newton.DATA * i + newton.OMEGA] * T[i] * T[i]
        tensions[at] = T[i] * sigma
        for k in range(3):
            directions[at, k] = alpha[3 * i + k]
        rx += tensions[at] * directions[at, 0]
        ry += tensions[at] * directions[at, 1]
        rz += tensions[at] * directions[at, 2]
    balance = math.sqrt(rx * rx + ry * ry + rz * rz)
    info[INFO_BALANCE] = balance
    info[INFO_OBJECTIVE] = J * sigma * sigma
    info[INFO_GAP] = math.nan
    if W > 1e-6 and mu > 0.0 and params[P.equal] != 0.0:
        info[INFO_GAP] = (J - W * W * paper.optimal_objective(n, mu / (W * W))) * sigma * sigma
    reduced = balance > REDUCED * max(1.0, sigma)
    yielded[0] = min(yielded[0] + 1.0, 1e9) if reduced else 0.0
    if relaxed and cycle.breaks_a_limit(n, order, unit, params, apart, work):
        if apart.capped or apart.stacked:
            bits = distance.broken(n, apart, KEPT, alpha)
            info[INFO_ACTIVE] = float(int(info[INFO_ACTIVE]) | bits)
        return _RECOVERING
    if reduced:
        return _FORCE_REDUCED
    if outcome == cycle.CONVERGED:
        return _CONVERGED
    return _ITERATION_LIMIT


RATE_BARRIER = 1.0
"""Barrier of the rate limit, relative to the proximal term at the limit: it holds as strongly as that."""
GIVE_WAY = 20.0
"""Price of horizontal force, in shares of the load per cable of the largest weight, at which the force gives way."""
MU = 8.0
"""Weight of the alignment penalty over W^2 / n^3, for a load of weight W on n cables: a cone in which they stand wide apart."""
ANY = 1e6
"""Force that nothing limits, N."""
RECOVERY = 5.0
"""Time in which a start that breaks a limit must be led back, s."""


class Safe(Limited):
    """The paper's cost under hard limits on cables, pairs of cables and drones.

    The limits hold in every answer. Where they do not allow the whole force, the force gives way, its
    horizontal part first. Which member of the paper's flat family of optima is chosen, and kept, is
    decided by the barrier of the pairs (``spread``) and a proximal term (``settling``), whose centre turns with
    the force (``turning``).
    """

    kernel = _allocate
    spread_setting = ("mu", (0.05, 0.15, 0.4, 0.75, 1.35))
    per_drone = (
        "tension_min", "tension_max", "max_thrust", "weights", "min_distance", "cable_distance",
    )  # fmt: skip
    of_all = ("tension_min", "tension_max", "mu", "mu_force", "max_rate")
    from_team: ClassVar[Mapping[str, float | None]] = {
        "tension_min": 0.05,
        "tension_max": 5.0,
        "max_thrust": None,
        "mu": 0.15,
        "mu_force": 2.20725,
        "max_rate": 6.0,
        "min_distance": 0.0,
        "cable_distance": 0.0,
    }

    mu: Annotated[float, Field(ge=0.0)] | None = None
    """Weight of the alignment penalty, N^2. None: 8 W^2 / n^3 for a load of weight W on n cables where ``drones.max_thrust`` is
    known, growing with the square of the force; else 0.15."""
    mu_scaling: Literal["absolute", "weight"] | None = None
    """``weight``: mu grows with the square of the force, so that a heavier load does not draw the
    cables together; ``mu`` is meant for ``mu_force``. None: ``weight`` where mu is left to the team, else ``absolute``."""
    mu_force: Force | None = None
    """Force for which ``mu`` is meant when it is scaled, N. None: the load's weight where mu is left to the team, else that of
    the paper's load."""
    min_angle_deg: Annotated[float, Field(gt=0.0, lt=150.0)] = 30.0
    """Least angle between any two cables, degrees."""
    min_distance: Distance | list[Distance] | None = None
    """Least distance between the centres of two drones, m; one value, or one per drone: two keep the mean of theirs. 0: not
    limited. None: 2.4 of ``drones.radius`` where that is known, else 0."""
    downwash: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    """How much more of ``min_distance`` drones keep above each other than beside each other."""
    cable_distance: Distance | list[Distance] | None = None
    """Least distance of a drone's centre from the others' cables, m; one value, or one per drone. 0: not limited. None: 1.2 of
    ``drones.radius`` where that is known, else 0."""
    tension_min: Force | list[Force] | None = None
    """Least tension, N; one value, or one per cable. None: half of a cable's share of the load's weight where
    ``drones.max_thrust`` is known, else 0.05."""
    tension_max: Force | list[Force] | None = None
    """Largest tension, N; one value, or one per cable. None: what 0.95 of ``drones.max_thrust`` lifts beside the drone,
    or 5."""
    max_cone_deg: Degrees = 75.0
    """Largest angle between a cable and the vertical, degrees: drones stay above the load."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e3)] | None = None
    """Fastest turn of a cable's direction, rad/s. None: where ``drones.max_thrust`` is known, 0.4 for a cable of 1 m and less as
    the square root of its length, 1 for teams of one or two; else 6."""
    max_thrust: Force | list[Force] | None = None
    """Largest thrust of a drone, N. None: 0.95 of ``drones.max_thrust``, or not limited."""
    max_tilt_deg: Degrees | None = None
    """Largest angle between a drone's thrust and the vertical, degrees; none: not limited."""
    weights: Annotated[float, Field(gt=0.0)] | list[Annotated[float, Field(gt=0.0)]] = 1.0
    """Weight of each cable's squared tension, such as the inverse of a battery's charge; only ratios count."""
    settling: Annotated[float, Field(ge=0.0, le=10.0)] = 0.3
    """Time with which directions settle at the optimum, s; tensions follow at once."""
    turning: Annotated[float, Field(ge=0.0, le=10.0)] = 0.04
    """Time with which the formation as a whole turns with the force, s."""
    spread: Annotated[float, Field(ge=1e-6, le=1.0)] = 1e-2
    """Barrier between near cables, in squared shares of the load; more spreads them wider."""
    barrier: Annotated[float, Field(ge=1e-7, le=0.1)] = 1e-3
    """Barrier of all other limits, in squared shares of the load. Approach very small ones in steps."""
    tolerance: Annotated[float, Field(ge=1e-10, le=1e-3)] = 1e-6
    """KKT residual, in shares of the load, at which the iteration stops."""
    max_iterations: Annotated[int, Field(ge=2, le=200)] = 36
    """Most interior-point steps in one call, one whose matrix has to be built again counted half as well. The next call goes
    on from there; limits hold after every step."""

    @model_validator(mode="after")
    def _ranges(self) -> Safe:
        if self.tension_min is None or self.tension_max is None:
            return self
        low = np.atleast_1d(np.asarray(self.tension_min, dtype=float))
        high = np.atleast_1d(np.asarray(self.tension_max, dtype=float))
        comparable = 1 in (low.size, high.size) or low.size == high.size
        if comparable and np.any(1.2 * low > high):
            raise ValueError(
                f"tension_min = {self.tension_min} conflicts with tension_max = {self.tension_max}: "
                "each cable needs tension_max of at least 1.2 tension_min"
            )
        return self

    def check(self, team: Team) -> list[tuple[str, str]]:
        one = (self.tension_min is None) != (
            self.tension_max is None
        )  # both given are checked alone
        return super().check(team) or (self.crossed(team) if one else [])

    def asked_angles(self, team: Team) -> tuple[Array, Array]:
        """As :meth:`pair_angles`, with ellipsoids as the spheres within them: what no formation can do without."""
        sizes, least = self.drone_distances(team), math.radians(self.min_angle_deg)
        return distance.angles_of(team.cable_lengths, sizes, self.cable_distances(team), least)

    def left_open(self, team: Team) -> dict[str, Vector]:
        weight = team.n * share_of(team)
        own = bool(np.isfinite(team.max_thrusts).all()) and self._left
        return {
            "mu": np.full(team.n, MU * weight**2 / team.n**3 if own else math.nan),
            "mu_force": np.full(team.n, weight if own else math.nan),
            **self.usual_limits(team),
        }

    def filled(self, team: Team) -> Safe:
        copy = super().filled(team)
        if "mu_scaling" not in self.model_fields_set:
            scaled: Literal["weight", "absolute"] = "weight" if self._scaled(team) else "absolute"
            copy = copy.model_copy(update={"mu_scaling": scaled})
            copy.model_fields_set.discard("mu_scaling")
        return copy

    def by_team(self, team: Team) -> list[str]:
        scaling = [] if "mu_scaling" in self.model_fields_set else ["mu_scaling"]
        return super().by_team(team) + scaling

    @property
    def _left(self) -> bool:
        """Whether mu is left to the team."""
        return self.mu is None or "mu" not in self.model_fields_set

    def with_any_thrust(self, team: Team) -> Safe:
        free = {"max_thrust", "tension_max"} & {*self.by_team(team)}
        return self.model_copy(update={**dict.fromkeys(free, ANY), "mu": 0.0})

    def penalty(self, team: Team) -> float:
        """Weight of the alignment penalty, N^2."""
        return float(self.settled("mu", team)[0])

    def _scaled(self, team: Team) -> bool:
        """Whether mu grows with the square of the force."""
        if "mu_scaling" in self.model_fields_set and self.mu_scaling is not None:
            return self.mu_scaling == "weight"
        return self._left and bool(np.isfinite(team.max_thrusts).all())

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        return super().conflicts(team) + feasible.conflicts_of(team, self)

    def cannot_hold(self, team: Team, thrusts: Vector, directions: Vector) -> list[str]:
        return feasible.cannot_hold(team, self, thrusts, directions)

    def binding(self, team: Team, actuation: Motors) -> list[str]:
        return [str(each) for each in feasible.binding_limits(team, self, actuation)]

    def cannot_start(self, team: Team, directions: Array) -> str:
        if self.keeps_pairs(team, directions) and self._keeps_cone(directions):
            return ""
        allocator = SafeAllocator.unchecked(team, self)
        allocator.reset(directions)
        for _ in range(round(RECOVERY / allocator.dt)):
            answer = allocator.allocate([0.0, 0.0, team.load_mass * team.gravity])
            if answer.status is not Status.RECOVERING:
                return ""
        polar = np.arccos(np.clip(-answer.directions[:, 2], -1.0, 1.0))
        drones, cables = self.distances(team, answer.directions)
        metres = "".join(
            f", {name} = {np.max(asked):g} m where {np.min(found):.3g} m would be left"
            for name, asked, found in (
                ("min_distance", self.drone_distances(team), drones),
                ("cable_distance", self.cable_distances(team), cables),
            )
            if np.any(asked > 0.0) and team.n > 1
        )
        apart, widest = (
            f"{math.degrees(angle):.1f} degrees"
            for angle in (
                np.min(pairwise_angles(answer.directions), initial=math.pi),
                feasible.widest_angle(team.n, math.radians(self.max_cone_deg)),
            )
        )
        return (
            f"breaks a limit and cannot be led back: after {RECOVERY:g} s of hover the {team.n} cables would "
            f"be {apart} apart and up to {math.degrees(polar.max()):.1f} degrees from the vertical "
            f"(allocation.min_angle_deg = {self.min_angle_deg:g}, max_cone_deg = {self.max_cone_deg:g}{metres}; "
            f"the widest formation in that cone has {widest}): start within the limits, with "
            "start.directions where one ring is too narrow, or ask for less"
        )

    def _keeps_cone(self, directions: Array) -> bool:
        return bool(np.all(-directions[:, 2] > math.cos(math.radians(self.max_cone_deg))))

    def keeps_pairs(self, team: Team, directions: Array) -> bool:
        """Whether every pair of cables (n, 3) is as far apart as asked, in degrees and in metres."""
        angles, _ = self.pair_angles(team)
        if np.any(pairwise_angles(directions) <= angles[np.triu_indices(team.n, k=1)]):
            return False
        if not self.ellipsoids(team):
            return True
        sizes = self.drone_distances(team)
        drones, _ = self.distances(team, directions)
        return bool(np.all(drones > 0.5 * (sizes[:, None] + sizes[None, :])))

    def distances(self, team: Team, directions: Array) -> tuple[Array, Array]:
        """Of wanted drones from each other, in the ellipsoid's norm, and from each other's cables (..., n, n), m."""
        return distance.distances(team.cable_lengths, directions, self.downwash)

    def pair_angles(self, team: Team) -> tuple[Array, Array]:
        """Least angle of every pair (n, n), rad, with what distances ask for, and the bit of the limit that asks for it.

        Without the ellipsoids, which are no angles (:meth:`ellipsoids`).
        """
        sizes = self.drone_distances(team) if self.downwash == 1.0 else np.zeros(team.n)
        return distance.angles_of(
            team.cable_lengths, sizes, self.cable_distances(team), math.radians(self.min_angle_deg)
        )

    def ellipsoids(self, team: Team) -> bool:
        """Whether ellipsoids about the drones limit more than the angles do already."""
        sizes = self.drone_distances(team)
        if self.downwash == 1.0 or team.n < 2 or not sizes.any():
            return False
        a, b = team.cable_lengths[:, None], team.cable_lengths[None, :]
        angles, _ = self.pair_angles(team)
        near = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(angles)) / self.downwash
        pairs = np.triu_indices(team.n, k=1)
        return bool(np.any(near[pairs] < 0.5 * (sizes[:, None] + sizes[None, :])[pairs]))

    def turning_lag(self, n: int) -> float:
        return self.turning if n > 1 else 0.0

    def params(self, team: Team) -> Vector:
        n = team.n
        angles, causes = self.pair_angles(team)
        angles = np.minimum(angles, distance.WIDEST)
        table = np.triu(np.cos(angles)) + np.tril(causes, -1)
        most = self.thrust_limits(team)
        limited = bool(np.isfinite(most).any()) or self.max_tilt_deg is not None
        weights = self._relative_weights(n)
        least = math.radians(self.min_angle_deg)
        if n > 1:
            least = float(angles[np.triu_indices(n, k=1)].max())
        reach = self._reach(n, least)
        cone, tilt = math.radians(self.max_cone_deg), math.radians(self.max_tilt_deg or 89.0)
        packed = cycle.PARAMS.pack(
            n,
            mu=self.penalty(team),
            mu_scaled=self._scaled(team),
            mu_force=float(self.settled("mu_force", team)[0]),
            sigma=max(share_of(team), 1e-6),
            kappa=self.barrier,
            kappa_rate=RATE_BARRIER,
            kappa_pair=self.spread,
            min_angle=least,
            reach=reach,
            max_rate=self.turn_rate(team),
            settling=self.settling,
            turning=self.turning,
            price=GIVE_WAY * float(weights.max()),
            tolerance=self.tolerance,
            iterations=self.max_iterations,
            limits=newton.LIMITS if limited else newton.TILT - 1,
            g=team.gravity,
            cone=cone,
            tilt=tilt,
            cos_angle=math.cos(least),
            cos_edge=math.cos(min(least + reach, math.pi)),
            cos_cone=math.cos(cone),
            cos_tilt=math.cos(tilt),
            tan_lean=math.tan(cycle.LEVEL * tilt),
            total=float(np.sum(self.tension_caps(team))),
            equal=bool(np.all(weights == 1.0)),
            weight=weights,
            T_min=self.tension_floors(team),
            T_max=self.tension_caps(team),
            m=team.masses,
            f_max=np.minimum(most, 1e6),
            capped=bool(np.any(causes != distance.ANGLE)),
            stacked=self.ellipsoids(team),
            flat=1.0 / self.downwash**2,
            length=team.cable_lengths,
            size=self.drone_distances(team),
        )
        return np.concatenate([packed, table.ravel()])

    def _relative_weights(self, n: int) -> Vector:
        """Weight of each cable (n,) relative to their mean; ones, exactly, where all are the same."""
        weights = np.array(np.broadcast_to(np.asarray(self.weights, dtype=float), n))
        weights /= weights.max()
        return np.asarray(weights / weights.mean())

    def _reach(self, n: int, least: float) -> float:
        """Distance beyond the least angle (rad) at which a pair is seen, rad: about the second neighbours."""
        cone = math.radians(self.max_cone_deg)
        spacing = math.sqrt(1.15 * 2.0 * math.pi * (1.0 - math.cos(cone)) / n)
        return min(max(1.8 * spacing - least, 0.3 * least), math.radians(60.0))

    def memory(self, team: Team) -> Vector:
        n = team.n
        pairs = n * (n - 1)
        limits = newton.LIMITS * n + pairs
        return np.zeros(MEMORY.size(n) + LIMIT.size(limits) + PAIR.size(pairs) + 4 * n * n)

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        mu = _of_paper("mu") if self.mu is None else self.mu
        if self.mu_scaling == "weight":
            force = self.mu_force or _of_paper("mu_force")
            mu *= float(np.sum((tensions @ directions) ** 2)) / force**2
        weights = self._relative_weights(len(tensions))
        return paper_objective(mu, np.sqrt(weights) * tensions, directions)


def _of_paper(name: str) -> float:
    """Value of a setting for a team of which nothing more is known."""
    value = Safe.from_team[name]
    assert value is not None
    return value


class _Further(TypedDict, total=False):
    mu_scaling: Literal["absolute", "weight"] | None
    mu_force: float | None
    max_rate: float | None
    max_thrust: float | list[float] | None
    max_tilt_deg: float | None
    weights: float | list[float]
    settling: float
    turning: float
    spread: float
    barrier: float
    tolerance: float
    max_iterations: int
    min_distance: float | list[float] | None
    downwash: float
    cable_distance: float | list[float] | None


class SafeSettings(_Further, total=False):
    """The settings of :class:`Safe` as keywords, so that a type checker knows their names."""

    mu: float | None
    min_angle_deg: float
    tension_min: float | list[float] | None
    tension_max: float | list[float] | None
    max_cone_deg: float


class SafeAllocator(Allocator):
    """The safe allocator, called by hand; see :class:`Safe` for the settings.

    Raises
    ------
    SettingError
        For an unknown setting, a value out of range, or limits that cannot hold together, by name.

    Examples
    --------
    >>> allocator = SafeAllocator(n=4, mu=0.15, min_angle_deg=30, tension_min=0.05)
    >>> allocator.allocate([0.0, 0.0, 2.2]).status.ok
    True

    """

    part: Safe

    def __init__(
        self,
        n: int | Team = 4,
        mu: float | None = None,
        min_angle_deg: float = 30.0,
        tension_min: float | list[float] | None = None,
        tension_max: float | list[float] | None = None,
        max_cone_deg: float = 75.0,
        *,
        cone_deg: float = 35.0,
        dt: float = 0.01,
        **settings: Unpack[_Further],
    ) -> None:
        part = Safe(
            mu=mu,
            min_angle_deg=min_angle_deg,
            tension_min=tension_min,
            tension_max=tension_max,
            max_cone_deg=max_cone_deg,
            **settings,
        )
        team = n if isinstance(n, Team) else Team.uniform(n)
        if problems := part.check(team) or part.conflicts(team):
            raise SettingError([Problem(name, "", message) for name, message in problems])
        super().__init__(part, team, cone_deg=cone_deg, dt=dt)

    def update(self, **settings: Unpack[SafeSettings]) -> None:  # type: ignore[override]
        super().update(**settings)

    @classmethod
    def unchecked(cls, team: Team, part: Safe) -> SafeAllocator:
        """An allocator for limits that may conflict: the least violation is what is wanted."""
        allocator = cls.__new__(cls)
        Allocator.__init__(allocator, part, team)
        return allocator

    @property
    def mu(self) -> float:
        """Weight of the alignment penalty, N^2; may be changed between two calls."""
        return self.part.penalty(self._team)

    @mu.setter
    def mu(self, value: float) -> None:
        self.update(mu=value)

    def reset(self, directions: ArrayLike | None = None, tensions: ArrayLike | None = None) -> None:
        """Forget the last answer and start from the given one, or from a formation within the limits.

        The default is the ring of ``cone_deg``, or a wider formation where the ring is too narrow.
        """
        if directions is None:
            directions = self._default()
        super().reset(directions, tensions)

    def _default(self) -> Vector:
        cone, most = self._cone, math.radians(self.part.max_cone_deg)
        enough = math.radians(self.part.min_angle_deg + 1.0)
        default = ring(self.n, min(cone, 0.95 * most))
        if self.n == 1:
            return default
        angles, _ = self.part.pair_angles(self.team)
        enough = max(enough, float(angles[np.triu_indices(self.n, k=1)].max()) + math.radians(1.0))
        metres = self.part.ellipsoids(self.team)

        def wide(formation: Vector, angle: float) -> bool:
            return angle >= enough and not (
                metres and not self.part.keeps_pairs(self.team, formation)
            )

        if wide(default, float(pairwise_angles(default).min())):
            return default
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            candidate, angle = feasible.widest_formation(
                self.n, cone + share * (0.98 * most - cone), enough=math.inf if metres else enough
            )
            if wide(candidate, angle):
                break
        return candidate

    def _gap(self) -> Vector:
        """In the start's cone if that has room, else in a wider one."""
        most = 0.98 * math.radians(self.part.max_cone_deg)
        angles, _ = self.part.pair_angles(self.team)
        enough = math.cos(float(angles.max()) + math.radians(1.0))
        narrow = min(self._cone, most)
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            cable = widest_gap(self._directions, narrow + share * (most - narrow))
            if float(np.max(self._directions @ cable)) <= enough:
                break
        return cable
