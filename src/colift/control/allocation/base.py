"""The contract of the allocation layer, and the object that calls any allocator by hand.

An allocator shares the wanted load force among the cables: ``sum_i T_i alpha_i = -F``; of a rigid load also the wanted
moment about its centre of mass, ``sum_i r_i x T_i alpha_i = -M`` with ``r_i`` from there to the cable's end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.errors import Problem, SettingError
from colift.kernel.jit import address_of, f8, i8, inline, kernel, matrix, tensor, vector
from colift.kernel.ports import PORTS, Wire
from colift.kernel.signals import LEVEL
from colift.kernel.status import Status as Status
from colift.part import Part, Setup, Vector
from colift.team import Team
from colift.team.geometry import Array, ring, widest_gap
from colift.team.plan import least_lean, plan
from colift.wording import numbers, shown

SIGNATURE = PORTS["allocation"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Returns a :class:`Status` as an integer. Called at the layer's own period, ``now.dt``. ``reference[2]`` is the wanted acceleration of
the load. What it writes holds the last answer on entry, or the start formation; ``allocator_info`` has the places ``INFO_*``.
"""

_Sees, _Writes = PORTS["allocation"].Sees, PORTS["allocation"].Writes
_invoke = PORTS["allocation"].invoke


class Beside(NamedTuple):
    """What an allocator sees beside force and reference, as the signals of these names; for a point load :func:`unplanned`."""

    moment: Any
    reference_attitude: Any
    reference_rates: Any
    estimated_load_attitude: Any
    nominal_forces: Any
    formation: Any


@inline
def ask(address, force, reference, beside, dt, params, memory, tensions, directions, info):  # type: ignore[no-untyped-def]
    """Call an allocator's kernel, from compiled code of studies and benchmarks, by its address."""
    sees = _Sees(
        force, beside.moment, reference, beside.reference_attitude, beside.reference_rates,
        beside.estimated_load_attitude, beside.nominal_forces, beside.formation,
    )  # fmt: skip
    writes = _Writes(tensions, directions, info)
    return _invoke(Wire(address, 0, params, memory, sees, writes), 0, 0.0, dt)


@inline
def unplanned(n):  # type: ignore[no-untyped-def]
    """Beside force and reference: a load that stands level, no moment, and no plan for n cables."""
    level = np.array((1.0, 0.0, 0.0, 0.0))
    return Beside(
        np.zeros(3), level, np.zeros((3, 3)), level.copy(), np.full((n, 3, 3), np.nan), np.zeros((n, 3))
    )  # fmt: skip


@kernel(
    i8(
        i8, vector, matrix, vector, vector, matrix, vector, tensor, matrix, f8, vector, vector,
        vector, matrix, vector,
    ),
    counted=False,
)  # fmt: skip
def _ask(  # type: ignore[no-untyped-def]
    address, force, reference, moment, attitude, rates, load_attitude, nominal, formation, dt, params, memory,
    tensions, directions, info,
):  # fmt: skip
    """:func:`ask` from Python, to which plain arrays are quicker than named tuples of them."""
    beside = Beside(moment, attitude, rates, load_attitude, nominal, formation)
    return ask(address, force, reference, beside, dt, params, memory, tensions, directions, info)


def _ask_plainly(  # type: ignore[no-untyped-def]
    address, force, reference, moment, attitude, rates, load_attitude, nominal, formation, *rest
):  # fmt: skip
    """The same for a kernel in plain Python."""
    beside = Beside(moment, attitude, rates, load_attitude, nominal, formation)
    return getattr(ask, "py_func", ask)(address, force, reference, beside, *rest)


INFO_ITERATIONS, INFO_RESIDUAL, INFO_OBJECTIVE, INFO_GAP, INFO_BALANCE, INFO_ACTIVE, INFO_MOMENT = (
    range(7)
)
INFO_SIZE = 7


FOR_BODIES = (
    "safe-wrench, wrench-min-norm, sqp-wrench, internal-force-wrench or wahba-hoenig-wrench"
)
"""Allocators for rigid loads, for messages."""
HOVER_CALLS = 1000
"""Most calls until an allocator is taken to have settled in hover; a plain Python one is asked less often."""
HOVER_STILL = 1e-7
"""Change of a cable's force from call to call, over the load's weight, at which it has."""
HOVER_PERIOD = 0.01
"""Least time between these calls, s: ten seconds in all."""


class Motors(Protocol):
    """What an allocator may ask of the rotors that the team flies with."""

    thrust_setting: ClassVar[str]
    """Setting that limits the thrust, for messages."""

    def thrust_limits(self, team: Team) -> Vector:
        """Largest steady thrust of each drone (n,), N; inf where there is no limit."""
        ...

    def thrust_path(self, team: Team) -> str:
        """Path in the mission of what limits the thrust, for messages."""
        ...

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        """Why they cannot fly this team."""
        ...


class AllocatorPart(Part):
    """Base of all allocators: settings, kernel with :data:`SIGNATURE`, parameters and memory."""

    layer: ClassVar[str] = "allocation"
    spread_setting: ClassVar[tuple[str, tuple[float, ...]] | None] = None
    """Setting that buys separation of the cables with tension, and the values that comparisons sweep."""

    wrenches: ClassVar[bool] = False
    """Whether it gives a rigid load the wanted moment as well."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        if team.body is not None and not self.wrenches:
            return [("kind", f"shares forces only: a rigid load needs {FOR_BODIES}")]
        return super().check(team)

    def with_any_thrust(self, team: Team) -> Self:
        """The same limits but those that follow from the drones' thrust, and cables as steep as they allow: what needs the least."""
        return self

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        """What the allocator minimises, N^2; NaN for one that minimises nothing."""
        return float("nan")

    def formation(self, team: Team) -> tuple[Array, Array]:
        """Directions (n, 3) and tensions (n,), N, of the formation that holds a rigid load in hover; see :mod:`colift.team.plan`."""
        return plan(team)

    def leaning(self, team: Team) -> tuple[float, Array] | None:
        """Least angle, rad, by which a rigid load leans to hang on these cables, and that attitude (4,); None where it cannot.

        Asked as :meth:`cannot_hold` is.
        """
        return least_lean(team)

    def cannot_hold(self, team: Team, thrusts: Vector, directions: Array) -> list[str]:
        """Why the team cannot hold the load in hover; empty when it can, or for all that is known.

        Asked in flight when drones have left, so it takes a few milliseconds at most and calls no kernel.
        ``thrusts`` (n,) are the drones' largest, N; ``directions`` (n, 3) are those that the drones fly now.
        """
        return []

    def cannot_start(self, team: Team, directions: Array) -> str:
        """Why the cables (n, 3) cannot be led from there to within its limits; empty when they can."""
        return ""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        from colift.control.allocation.limits.hover import hovering  # which reads answers

        drones = mission.first_drones()
        told, real = mission.team.of(drones), mission.true_team.of(drones)
        changes = [float(each.value) for each in mission.events if each.field == "load.mass"]
        real = replace(real, load_mass=max([real.load_mass, *changes]))
        if real.gravity == 0.0 or (
            real.load_mass <= told.load_mass and np.all(real.masses <= told.masses)
        ):
            return
        given = mission.actuation.of(drones).thrust_limits(real)
        _, conflicts = hovering(
            real, self.of(drones), given, mission.start_directions(), mission.timing.allocation
        )
        for message in conflicts.values():
            yield "kind", f"with what the drones really weigh and carry (truth, events) {message}"

    def binding(self, team: Team, actuation: Motors) -> list[str]:
        """Which limits keep the load from being heavier, by name and value, the costliest first."""
        return []

    def turning_lag(self, n: int) -> float | None:
        """Time constant with which the directions of n cables turn with the force, as a whole, s; None where nobody knows."""
        return 0.0 if n == 1 else None

    def hover(self, team: Team, directions: Array, dt: float) -> Allocation:
        """Its answer to the load's weight once it has settled, from these directions (n, 3); dt in s."""
        allocator = Allocator(self, team, dt=max(dt, HOVER_PERIOD))
        allocator.reset(directions=directions)
        weight = [0.0, 0.0, team.load_mass * team.gravity]
        compiled = hasattr(type(self).kernel, "py_func")
        answer = allocator.allocate(weight)
        for _ in range(HOVER_CALLS if compiled else HOVER_CALLS // 50):
            before = answer.tensions[:, None] * answer.directions
            answer = allocator.allocate(weight)
            change = np.abs(answer.tensions[:, None] * answer.directions - before).max()
            if change <= HOVER_STILL * weight[2]:
                break
        return answer


class Allocation:
    """One answer of an allocator.

    Attributes
    ----------
    tensions : (n,) array, N
    directions : (n, 3) array, unit vectors from drone to load, world frame
    status : Status
    iterations : int
    kkt_residual : float
        Largest violation of stationarity, relative to the scale of the problem; NaN where the
        allocator optimises nothing.
    objective : float
        N^2.
    optimality_gap : float
        Objective minus the closed-form global optimum, N^2; NaN where no certificate applies.
    force_residual : float
        ``|sum T_i alpha_i + F|``, N.
    moment_residual : float
        ``|sum r_i x T_i alpha_i + M|``, N m, with the moment that no cable of this load can make; 0 for one that shares forces only.
    active_limits : int
        Bits of the limits at work, as the allocator names them; 0 for one without limits.
    solve_time : float
        s, of the kernel call.

    """

    __slots__ = ("_info", "directions", "solve_time", "status", "tensions")

    def __init__(
        self,
        tensions: NDArray[np.float64],
        directions: NDArray[np.float64],
        status: Status,
        info: NDArray[np.float64],
        solve_time: float,
    ) -> None:
        self.tensions = tensions
        self.directions = directions
        self.status = status
        self.solve_time = solve_time
        self._info = info

    @property
    def iterations(self) -> int:
        return int(self._info[INFO_ITERATIONS])

    @property
    def kkt_residual(self) -> float:
        return float(self._info[INFO_RESIDUAL])

    @property
    def objective(self) -> float:
        return float(self._info[INFO_OBJECTIVE])

    @property
    def optimality_gap(self) -> float:
        return float(self._info[INFO_GAP])

    @property
    def force_residual(self) -> float:
        return float(self._info[INFO_BALANCE])

    @property
    def moment_residual(self) -> float:
        return float(self._info[INFO_MOMENT])

    @property
    def active_limits(self) -> int:
        return int(self._info[INFO_ACTIVE])

    def __repr__(self) -> str:
        return (
            f"Allocation(status={self.status.name}, tensions={np.round(self.tensions, 4)}, "
            f"iterations={self.iterations}, kkt_residual={self.kkt_residual:.1e})"
        )


_STATUS = tuple(Status)
_REST = np.zeros(3)
_SHORTEST, _LONGEST = 1e-6, 1e3  # s; what lies outside, or is no number, counts as these


class Allocator:
    """Calls one allocator outside the simulation loop, warm-started by its own last answer.

    An object belongs to one thread at a time; different objects may be called in different threads, and
    run at the same time: a kernel does not hold Python's global lock.

    Parameters
    ----------
    part : AllocatorPart
        The allocator and its settings.
    team : Team or int
        The drones and load, or just the number of drones (then the paper's drones and load).
    cone_deg : float
        Half-angle of the ring that :meth:`reset` starts from, and within which :meth:`join` looks for a gap.
    dt : float
        Time between two calls, s, unless a call says otherwise; only allocators that limit rates use it.

    Raises
    ------
    SettingError
        For arguments that cannot be used; the message names them.

    """

    def __init__(
        self, part: AllocatorPart, team: Team | int, *, cone_deg: float = 35.0, dt: float = 0.01
    ) -> None:
        if not isinstance(part, AllocatorPart):
            raise SettingError.of("part", shown(part), "must be an allocator's settings")
        self.part = part
        self._whole = team if isinstance(team, Team) else Team.uniform(team)
        self.dt = float(numbers("dt", dt, (), above=0.0))
        self._cone = math.radians(float(numbers("cone_deg", cone_deg, (), above=0.0, below=180.0)))
        if problems := part.wrong_lengths(self._whole.n):
            raise SettingError([Problem(name, "", message) for name, message in problems])
        kernel = type(part).kernel  # through the class: no binding as a method
        self._function = address_of(kernel)
        self._ask = _ask if self._function is not kernel else _ask_plainly
        self._force, self._moment = np.zeros(3), np.zeros(3)
        self._reference, self._rates = np.zeros((4, 3)), np.zeros((3, 3))
        self._wanted, self._attitude = np.array(LEVEL), np.array(LEVEL)
        self._info = np.zeros(INFO_SIZE)
        self._bind(range(self._whole.n))
        self.reset()

    @property
    def n(self) -> int:
        """Number of cables."""
        return len(self.drones)

    @property
    def team(self) -> Team:
        """The drones that carry, and the load."""
        return self._team

    @property
    def drones(self) -> tuple[int, ...]:
        """Numbers of the drones that carry, in the order of the answers; those of the team at the start."""
        return self._drones

    def _bind(self, drones: Sequence[int]) -> None:
        self._drones = tuple(drones)
        self._team = self._whole.of(self._drones)
        self._tensions = np.zeros(self.n)
        self._directions = np.zeros((self.n, 3))
        self._nominal = np.full((self.n, 3, 3), np.nan)
        self._formation = np.zeros((self.n, 3))  # its own
        self._params = self.part.of(self._drones).params(self._team)
        self._memory = self.part.of(self._drones).memory(self._team)

    def reset(self, directions: ArrayLike | None = None, tensions: ArrayLike | None = None) -> None:
        """Forget the last answer and start from the given one, or from the default ring.

        Parameters
        ----------
        directions : (n, 3) array, optional
            From drone to load, world frame; any length but zero.
        tensions : (n,) array, optional
            N, not negative.

        Raises
        ------
        SettingError
            For a wrong shape, a value that is not finite, a zero direction or a negative tension.

        """
        n = self.n
        start = ring(n, self._cone) if directions is None else _units(directions, (n, 3))
        share = np.zeros(n) if tensions is None else numbers("tensions", tensions, (n,), least=0.0)
        self._bind(self._drones)
        self._directions[:] = start
        self._tensions[:] = share

    def update(self, **settings: Any) -> None:
        """Change settings between two calls; the warm start is kept.

        Raises
        ------
        SettingError
            For an unknown setting or a value out of range; nothing is changed then.

        """
        part = type(self.part)(**{**self.part.model_dump(), **settings})
        if problems := part.wrong_lengths(self._whole.n):
            raise SettingError([Problem(name, "", message) for name, message in problems])
        self.part = part
        self._params[:] = part.of(self._drones).params(self._team)

    def lose(self, drone: int) -> None:
        """Go on without one drone, now; the others keep their numbers and their warm start.

        Raises
        ------
        SettingError
            For a drone that does not carry, or the last one.

        """
        rest = [other for other in self._drones if other != drone]
        if len(rest) == self.n:
            carrying = ", ".join(map(str, self._drones))
            raise SettingError.of(
                "drone", shown(drone), f"must be one of those that carry: {carrying}"
            )
        if not rest:
            raise SettingError.of("drone", shown(drone), "is the last one that carries")
        self._go_on(rest)

    def join(self, drone: int | None = None, direction: ArrayLike | None = None) -> int:
        """Take a drone of the team back in, now; the others keep their warm start.

        Parameters
        ----------
        drone : int, optional
            Its number in the team at the start; the lowest that does not carry when left out.
        direction : (3,) array, optional
            Of its cable, from drone to load, world frame; the widest gap between the others' when left out.

        Returns
        -------
        int
            The drone's number.

        Raises
        ------
        SettingError
            For a drone that carries already or is not of the team, or a direction that is none.

        """
        away = [other for other in range(self._whole.n) if other not in self._drones]
        if drone is None and away:
            drone = away[0]
        if drone not in away:
            others = ", ".join(map(str, away)) or "none"
            raise SettingError.of(
                "drone", shown(drone), f"must be one of those that do not carry: {others}"
            )
        cable = self._gap() if direction is None else _units(direction, (3,), "direction")
        self._go_on(sorted([*self._drones, drone]))
        self._directions[self._drones.index(drone)] = cable
        return int(drone)

    def _gap(self) -> NDArray[np.float64]:
        """Where a cable that joins is hung: as far from the others as the start's cone has room."""
        return widest_gap(self._directions, self._cone)

    def _go_on(self, drones: Sequence[int]) -> None:
        """With these drones, as a flight does: who stays keeps its row, and the kernel what it remembers."""
        before, tensions, directions, memory = (
            self._drones, self._tensions, self._directions, self._memory,
        )  # fmt: skip
        self._bind(drones)
        places = np.array([before.index(d) if d in before else -1 for d in drones], dtype=np.int64)
        stay = places >= 0
        self._tensions[stay] = tensions[places[stay]]
        self._directions[stay] = directions[places[stay]]
        self._memory = self.part.carry_over(memory, self._memory, places)

    def allocate(
        self,
        force: ArrayLike,
        acceleration: ArrayLike | None = None,
        dt: float | None = None,
        *,
        moment: ArrayLike | None = None,
        attitude: ArrayLike | None = None,
        wanted_attitude: ArrayLike | None = None,
    ) -> Allocation:
        """Share ``force``, and for a rigid load ``moment``, among the cables.

        Parameters
        ----------
        force : (3,) array
            Total force that the cables must exert on the load, world frame, N.
        acceleration : (3,) array, optional
            Wanted acceleration of the load, m/s^2, for allocators that respect thrust limits;
            zero when left out.
        dt : float, optional
            Time since the last call, s, for allocators that limit rates; the allocator's own ``dt`` when
            left out. What is not positive, or no number, counts as no time at all: nothing turns.
        moment : (3,) array, optional
            That the cables must exert about a rigid load's centre of mass, world frame, N m; none when left out.
        attitude, wanted_attitude : (4,) array, optional
            Of a rigid load as it is and as it should be, unit quaternions wxyz, load to world; the last given, level at first.

        Returns
        -------
        Allocation
            Always usable, whatever the force: see its ``status``.

        Raises
        ------
        SettingError
            Only when ``force``, ``acceleration`` or ``moment`` is not three numbers, an attitude not four, or ``dt`` not one.

        """
        try:
            wanted = np.asarray(force, dtype=float)
            motion = _REST if acceleration is None else np.asarray(acceleration, dtype=float)
            period = min(_LONGEST, max(_SHORTEST, self.dt if dt is None else float(dt)))
            turning = _REST if moment is None else np.asarray(moment, dtype=float)
        except (TypeError, ValueError):
            wanted = motion = turning = np.empty(0)
        if wanted.shape != (3,) or motion.shape != (3,) or turning.shape != (3,):
            given = {"acceleration": acceleration, "moment": moment}
            _refuse(dt, force=force, **{k: v for k, v in given.items() if v is not None})
        if attitude is not None:
            self._attitude[:] = numbers("attitude", attitude, (4,), finite=False)
        if wanted_attitude is not None:
            self._wanted[:] = numbers("wanted_attitude", wanted_attitude, (4,), finite=False)
        self._force[:] = wanted
        self._moment[:] = turning
        self._reference[2] = motion
        start = perf_counter()
        status = self._ask(
            self._function,
            self._force,
            self._reference,
            self._moment,
            self._wanted,
            self._rates,
            self._attitude,
            self._nominal,
            self._formation,
            period,
            self._params,
            self._memory,
            self._tensions,
            self._directions,
            self._info,
        )
        elapsed = perf_counter() - start
        return Allocation(
            self._tensions.copy(),
            self._directions.copy(),
            _STATUS[status],
            self._info.copy(),
            elapsed,
        )


def _refuse(dt: float | None, **vectors: ArrayLike | None) -> None:
    """Say what of it is not the numbers that :meth:`Allocator.allocate` takes."""
    for name, value in vectors.items():
        numbers(name, value, (3,), finite=False)
    if dt is not None:
        numbers("dt", dt, (), finite=False)


def _units(
    directions: ArrayLike, shape: tuple[int, ...], name: str = "directions"
) -> NDArray[np.float64]:
    """Directions of any length but zero, as unit vectors."""
    found = numbers(name, directions, shape)
    norms = np.linalg.norm(found, axis=-1, keepdims=True)
    if not (np.isfinite(norms) & (norms > 0.0)).all():
        raise SettingError.of(
            name, shown(found.tolist()), "must have lengths that are finite and not zero"
        )
    return np.asarray(found / norms)
