"""The contract of the allocation layer, and the object that calls any allocator by hand.

An allocator shares the wanted load force among the cables: ``sum_i T_i alpha_i = -F``.
"""

from __future__ import annotations

import operator
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.allocation._status import Status as Status
from colift.geometry import ring
from colift.jit import f8, i8, matrix, vector
from colift.part import Part
from colift.team import Team

SIGNATURE = i8(vector, vector, f8, vector, vector, vector, matrix, vector)
"""``kernel(force, acceleration, dt, params, memory, tensions, directions, info) -> status``.

============  ========  ==================================================================
force         (3,)      wanted total force of the cables on the load, world, N
acceleration  (3,)      wanted acceleration of the load, world, m/s^2
dt            float     time since the last call, s
params        (p,)      from :meth:`AllocatorPart.params`
memory        (m,)      from :meth:`AllocatorPart.memory`; owned by the kernel
tensions      (n,)      out: wanted tensions, N
directions    (n, 3)    out: wanted unit directions from drone to load, world
info          (6,)      out: see ``INFO_*``
============  ========  ==================================================================

On entry ``tensions`` and ``directions`` hold the last answer, or the start formation.
"""

INFO_ITERATIONS, INFO_RESIDUAL, INFO_OBJECTIVE, INFO_GAP, INFO_BALANCE, INFO_ACTIVE = range(6)
INFO_SIZE = 6


class AllocatorPart(Part):
    """Base of all allocators: settings, kernel with :data:`SIGNATURE`, parameters and memory."""

    layer: ClassVar[str] = "allocation"
    spread_setting: ClassVar[tuple[str, tuple[float, ...]] | None] = None
    """Setting that buys separation of the cables with tension, and the values that comparisons sweep."""

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        """What the allocator minimises, N^2; NaN for one that minimises nothing."""
        return float("nan")

    def cannot_hold(self, team: Team) -> list[str]:
        """Why its limits do not let the team hold the load in hover; empty when they do, or without limits."""
        return []


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
    def active_limits(self) -> int:
        return int(self._info[INFO_ACTIVE])

    def __repr__(self) -> str:
        return (
            f"Allocation(status={self.status.name}, tensions={np.round(self.tensions, 4)}, "
            f"iterations={self.iterations}, kkt_residual={self.kkt_residual:.1e})"
        )


_STATUS = tuple(Status)
_REST = np.zeros(3)


class Allocator:
    """Calls one allocator outside the simulation loop, warm-started by its own last answer.

    Parameters
    ----------
    part : AllocatorPart
        The allocator and its settings.
    team : Team or int
        The drones and load, or just the number of drones (then the paper's drones and load).
    cone_deg : float
        Half-angle of the ring that :meth:`reset` starts from.
    dt : float
        Time between two calls, s; only allocators that limit rates use it.

    """

    def __init__(
        self, part: AllocatorPart, team: Team | int, *, cone_deg: float = 35.0, dt: float = 0.01
    ) -> None:
        if not isinstance(team, Team):
            n = operator.index(team)  # any kind of integer, NumPy's too
            if n < 1:
                raise ValueError(f"n must be at least 1, got {n}")
            team = Team.uniform(n)
        self.part = part
        self.team = team
        self.dt = float(dt)
        self._cone = float(np.radians(cone_deg))
        self._kernel = type(part).kernel  # through the class: no binding as a method
        self._force = np.zeros(3)
        self._acceleration = np.zeros(3)
        self._tensions = np.zeros(team.n)
        self._directions = np.zeros((team.n, 3))
        self._info = np.zeros(INFO_SIZE)
        self.reset()

    @property
    def n(self) -> int:
        """Number of cables."""
        return self.team.n

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
        ValueError
            For a wrong shape, a value that is not finite, a zero direction or a negative tension.

        """
        n = self.n
        start = ring(n, self._cone) if directions is None else np.array(directions, dtype=float)
        if start.shape != (n, 3):
            raise ValueError(f"directions must have shape ({n}, 3), got {start.shape}")
        norms = np.linalg.norm(start, axis=1)
        if not (np.isfinite(norms).all() and (norms > 0).all()):
            raise ValueError("directions must be finite and not zero")
        share = np.zeros(n) if tensions is None else np.array(tensions, dtype=float)
        if share.shape != (n,):
            raise ValueError(f"tensions must have shape ({n},), got {share.shape}")
        if not (np.isfinite(share).all() and (share >= 0).all()):
            raise ValueError("tensions must be finite and not negative")
        self._directions[:] = start / norms[:, None]
        self._tensions[:] = share
        self._params = self.part.params(self.team)
        self._memory = self.part.memory(self.team)

    def update(self, **settings: Any) -> None:
        """Change settings between two calls; the warm start is kept.

        Raises
        ------
        pydantic.ValidationError
            For an unknown setting or a value out of range; nothing is changed then.

        """
        fields = {**self.part.model_dump(), **settings}
        self.part = type(self.part).model_validate(fields)
        self._params[:] = self.part.params(self.team)

    def allocate(self, force: ArrayLike, acceleration: ArrayLike | None = None) -> Allocation:
        """Share ``force`` among the cables.

        Parameters
        ----------
        force : (3,) array
            Total force that the cables must exert on the load, world frame, N.
        acceleration : (3,) array, optional
            Wanted acceleration of the load, m/s^2, for allocators that respect thrust limits;
            zero when left out.

        Returns
        -------
        Allocation
            Always usable, whatever the force: see its ``status``.

        Raises
        ------
        ValueError
            Only when ``force`` or ``acceleration`` does not have three components.

        """
        wanted = np.asarray(force, dtype=float)
        if wanted.shape != (3,):
            raise ValueError(f"force must have shape (3,), got {wanted.shape}")
        motion = _REST if acceleration is None else np.asarray(acceleration, dtype=float)
        if motion.shape != (3,):
            raise ValueError(f"acceleration must have shape (3,), got {motion.shape}")
        self._force[:] = wanted
        self._acceleration[:] = motion
        start = perf_counter()
        status = self._kernel(
            self._force,
            self._acceleration,
            self.dt,
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
