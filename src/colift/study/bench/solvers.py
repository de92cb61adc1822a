"""Who takes part: colift's allocators, published ones and general solvers, each called in its own way.

Only the solver's own call is timed. General solvers get the same forces, analytic derivatives, their own
last answer (and multipliers, where they take them) as a start, and one BLAS thread where the program sees to
it in time (:func:`colift.threads.one_blas_thread`).
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from typing import Literal, NamedTuple, cast

import numpy as np

from colift.control.allocation.base import Allocator, AllocatorPart
from colift.control.allocation.common.oracle import TensionProblem
from colift.part import find
from colift.study.bench.problems import Name, Problem
from colift.team.geometry import Array

TOLERANCE = 1e-5
"""Asked of general solvers; SLSQP's ``ftol`` is its square."""
MOST_ITERATIONS = 300


class Answer(NamedTuple):
    """Tensions (n,) N, directions (n, 3), iterations, and whether the solver calls it solved."""

    tensions: Array
    directions: Array
    iterations: int
    solved: bool


class Called:
    """An allocator of colift by ``allocate()``, as a Python program calls it."""

    def __init__(self, part: AllocatorPart, problem: Problem) -> None:
        tensions, directions = problem.start
        self._allocator = Allocator(part, problem.team, dt=problem.period)
        self._allocator.reset(directions=directions, tensions=tensions)

    def prepare(self, force: Array) -> None:
        self._force = force

    def solve(self) -> None:
        self._found = self._allocator.allocate(self._force)

    def answer(self) -> Answer:
        found = self._found
        return Answer(found.tensions, found.directions, found.iterations, found.status.ok)


class General:
    """Base of the general solvers: the problem in shares of the force, a point ``z`` to start from."""

    def __init__(self, problem: Problem) -> None:
        tensions, directions = problem.start
        self._problem = problem
        self._size = float(np.linalg.norm(tensions @ directions))
        self._z = np.concatenate([tensions / self._size, directions.ravel()])
        self._iterations, self._solved = 0, False

    def prepare(self, force: Array) -> None:
        self._size = float(np.linalg.norm(force))
        limits = self._problem.limits
        shares = limits._replace(
            tension_min=limits.tension_min / self._size, tension_max=limits.tension_max / self._size
        )
        mu = self._problem.mu / self._size**2
        self._asked = TensionProblem(self._problem.n, mu, force / self._size, shares)

    def solve(self) -> None:
        """Move ``z`` to the solver's answer."""
        raise NotImplementedError

    def answer(self) -> Answer:
        T, alpha = self._asked.split(self._z)
        return Answer(self._size * T, alpha.copy(), self._iterations, self._solved)


class Slsqp(General):
    """SciPy's SLSQP."""

    def solve(self) -> None:
        from colift.control.allocation.slsqp import minimise

        found = minimise(self._asked, self._z, TOLERANCE, MOST_ITERATIONS)
        self._z, self._iterations = np.asarray(found.x), int(found.nit)
        self._solved = bool(found.success)


class Ipopt(General):
    """IPOPT through CasADi."""

    _multipliers: tuple[Array, Array] | None = None

    def solve(self) -> None:
        from colift.control.allocation.ipopt import SHARPER, minimise

        found, account = minimise(
            self._asked, self._z, SHARPER * TOLERANCE, MOST_ITERATIONS, self._multipliers
        )
        self._solved = bool(account["success"])
        self._iterations = int(account["iter_count"])
        self._z = found["x"].full().ravel()
        lam_x, lam_g = found["lam_x"].full().ravel(), found["lam_g"].full().ravel()
        self._multipliers = (lam_x, lam_g) if self._solved else None


Solver = Called | General
"""One solver at work on one problem: ``prepare(force)``, ``solve()`` (timed), ``answer()``."""


def wahba_hoenig(problem: Problem) -> AllocatorPart:
    """The cascade of QPs, asked for the distance that drones at the least angle have."""
    angle = math.acos(problem.limits.cosine_max)
    length = float(problem.team.cable_lengths.min())
    kind = find("allocation", "wahba-hoenig")
    return cast(AllocatorPart, kind(distance=2.0 * length * math.sin(0.5 * angle)))  # type: ignore[call-arg]


def _plain(kind: str) -> Callable[[Problem], AllocatorPart]:
    """An allocator with the settings that it comes with."""
    return lambda _: cast(AllocatorPart, find("allocation", kind)())


class Entrant(NamedTuple):
    """Who takes part: name, from where it is called, how it begins, and the module that it needs."""

    name: str
    caller: Literal["loop", "python"]
    begin: Callable[[Problem], AllocatorPart | General]
    module: str = ""

    @property
    def package(self) -> str:
        return self.module.partition(".")[0]

    @property
    def installed(self) -> bool:
        return not self.module or importlib.util.find_spec(self.package) is not None


def _own(problem: Problem) -> AllocatorPart:
    return problem.own


GENERAL = (
    Entrant("slsqp", "python", Slsqp, "scipy.optimize"),
    Entrant("ipopt", "python", Ipopt, "casadi"),
)
ENTRANTS: dict[Name, tuple[Entrant, ...]] = {
    "paper": (Entrant("sqp", "loop", _own), Entrant("sqp", "python", _own), *GENERAL),
    "safe": (
        Entrant("safe", "loop", _own),
        Entrant("safe", "python", _own),
        *GENERAL,
        Entrant("wahba-hoenig", "python", wahba_hoenig, "daqp"),
        *(Entrant(name, "loop", _plain(name)) for name in ("internal-force", "min-norm", "ring")),
    ),
}
"""Our allocator comes first. Those from ``wahba-hoenig`` on solve problems of their own."""
