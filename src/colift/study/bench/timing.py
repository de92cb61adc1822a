"""The race: all solvers in one process take turns along the same forces, so that noise hits all alike."""

from __future__ import annotations

import gc
import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import INFO_SIZE, AllocatorPart, ask, unplanned
from colift.kernel.jit import (
    address_of,
    f8,
    i8,
    kernel,
    matrix,
    monotonic_ns,
    thread_time_ns,
    vector,
)
from colift.study.bench.problems import Family, Problem
from colift.study.bench.referee import Verdict, judge
from colift.study.bench.solvers import Called, Entrant, General
from colift.team.geometry import Array

LONGEST_TURN = 200
"""Most calls in one turn."""
SLOT = 1e-3
"""A fast solver's turn is made this long, s, or long enough to spend its budget if that is less."""
COLD = 0.1
"""Share of a turn's calls that are not timed: another solver has just used the caches."""
JUDGED_A_TURN, JUDGED_CABLES = 10, 160
"""Most answers of one turn that the referee looks at, and most cables in them together."""
COLD_STARTS = 2
"""First calls, in which a solver builds itself: IPOPT once for a cold and once for a warm start."""
FEWEST = 3
"""Calls for which a solver's budget must suffice."""


@kernel(
    i8(
        i8,
        matrix,
        f8,
        vector,
        vector,
        vector,
        matrix,
        vector,
        matrix,
        matrix,
    )
)
def _time_calls(  # type: ignore[no-untyped-def]
    allocate, forces, dt, params, memory, tensions, directions, info, rest, out
):
    """Call an allocator once per force; processor time of all, ns.

    A row of ``out``: wall time (ns), iterations, status, tensions (n), directions (3n).
    """
    n = tensions.shape[0]
    beside = unplanned(n)
    cpu = thread_time_ns()
    for k in range(forces.shape[0]):
        begin = monotonic_ns()
        status = ask(
            allocate, forces[k], rest, beside, dt, params, memory, tensions, directions, info
        )
        out[k, 0] = monotonic_ns() - begin
        out[k, 1] = info[0]
        out[k, 2] = status
        for i in range(n):
            out[k, 3 + i] = tensions[i]
            for m in range(3):
                out[k, 3 + n + 3 * i + m] = directions[i, m]
    return thread_time_ns() - cpu


class Turn(NamedTuple):
    """What one turn of b calls gave: wall and processor time (b,) s, and the answers.

    The processor time of compiled calls is the turn's, shared evenly: to ask for it takes as long as a call.
    """

    wall: Array
    cpu: Array
    iterations: Array
    solved: NDArray[np.bool_]
    tensions: Array
    directions: Array


class Compiled:
    """An allocator in a compiled loop, as in a flight."""

    def __init__(self, part: AllocatorPart, problem: Problem) -> None:
        tensions, directions = problem.start
        self._kernel, self._dt = address_of(type(part).kernel), problem.period
        self._state = (
            part.params(problem.team), part.memory(problem.team), tensions.copy(),
            directions.copy(), np.zeros(INFO_SIZE), np.zeros((4, 3)),
        )  # fmt: skip

    def turn(self, forces: Array) -> Turn:
        n = len(self._state[2])
        out = np.zeros((len(forces), 3 + 4 * n))
        cpu = _time_calls(self._kernel, forces, self._dt, *self._state, out)
        T, alpha = out[:, 3 : 3 + n], out[:, 3 + n :].reshape(-1, n, 3)
        each = np.full(len(forces), 1e-9 * cpu / len(forces))
        return Turn(out[:, 0] * 1e-9, each, out[:, 1], out[:, 2] == 0.0, T, alpha)


class Interpreted:
    """A solver called from Python."""

    def __init__(self, solver: Called | General) -> None:
        self._solver = solver

    def turn(self, forces: Array) -> Turn:
        solver = self._solver
        wall, cpu, answers = np.zeros(len(forces)), np.zeros(len(forces)), []
        for k, force in enumerate(forces):
            solver.prepare(force)
            cpu_begin, begin = time.thread_time(), time.perf_counter()
            solver.solve()
            wall[k] = time.perf_counter() - begin
            cpu[k] = time.thread_time() - cpu_begin
            answers.append(solver.answer())
        tensions, directions, iterations, solved = map(np.array, zip(*answers, strict=True))
        return Turn(wall, cpu, iterations, solved, tensions, directions)


def runner(entrant: Entrant, problem: Problem) -> Compiled | Interpreted:
    """The entrant, ready for its first turn; imports, which take longer than a call, are done."""
    if entrant.module:
        importlib.import_module(entrant.module)
    begun = entrant.begin(problem)
    if isinstance(begun, General):
        return Interpreted(begun)
    if entrant.caller == "loop":
        return Compiled(begun, problem)
    return Interpreted(Called(begun, problem))


@dataclass
class Racer:
    """One entrant on the way: where it is along the forces, what it took, what the referee saw.

    Verdicts, faults and whether the solver called it solved are by place along the forces.
    """

    entrant: Entrant
    runner: Compiled | Interpreted
    problem: Problem
    first: float
    block: int
    place: int
    wall: list[Array] = field(default_factory=list)
    cpu: list[Array] = field(default_factory=list)
    calls: int = 0
    iterations: float = 0.0
    unsolved: int = 0
    verdicts: dict[int, Verdict] = field(default_factory=dict)
    faults: dict[int, tuple[str, ...]] = field(default_factory=dict)
    claimed: dict[int, bool] = field(default_factory=dict)

    @property
    def n(self) -> int:
        return self.problem.n

    @property
    def spent(self) -> float:
        """Time in calls so far, s."""
        return float(sum(turn.sum() for turn in self.wall))

    def take_turn(self, path: Array) -> None:
        forces = path[self.place : self.place + self.block]
        done = self.runner.turn(forces)
        cold = int(COLD * len(forces))
        self.wall.append(done.wall[cold:])
        self.cpu.append(done.cpu[cold:])
        self.calls += len(forces)
        self.iterations += float(done.iterations.sum())
        self.unsolved += int(np.count_nonzero(~done.solved))
        seen = min(JUDGED_A_TURN, max(1, JUDGED_CABLES // self.n))
        for k in range(min(len(forces), seen)):
            place = self.place + k
            verdict = judge(self.problem, forces[k], done.tensions[k], done.directions[k])
            self.verdicts[place] = verdict
            self.faults[place] = verdict.faults(self.problem)
            self.claimed[place] = bool(done.solved[k])
        self.place += len(forces)


class Skipped(NamedTuple):
    """An entrant that was not raced, and why."""

    entrant: Entrant
    reason: str


@contextmanager
def _no_collector() -> Iterator[None]:
    """Garbage of one solver must not be collected on another's time."""
    was = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def enter(
    entrant: Entrant, problem: Problem, path: Array, budget: float, rounds: int
) -> Racer | Skipped:
    """Warm an entrant up on the first forces, and measure how many calls make up its turn."""
    ready = runner(entrant, problem)
    begin = time.thread_time()
    ready.turn(path[:COLD_STARTS])
    first = time.thread_time() - begin
    warm = COLD_STARTS + (1 if first > 0.1 * budget else 20)
    typical = float(np.median(ready.turn(path[COLD_STARTS:warm]).cpu))
    if FEWEST * typical > budget:
        return Skipped(entrant, f"one call takes {typical:.2g} s")
    block = int(min(SLOT, budget / rounds) / typical)
    return Racer(entrant, ready, problem, first, min(max(block, 1), LONGEST_TURN), warm)


def race(
    problem: Problem, family: Family, entrants: list[Entrant], *, rounds: int, budget: float,
    after_round: Callable[[float], None] = lambda _: None,
) -> tuple[list[Racer], list[Skipped]]:  # fmt: skip
    """Let the entrants take turns; who leads changes every round.

    One whose budget (s) is spent leaves the race; one for which it does not suffice is named.
    """
    path = problem.forces(COLD_STARTS + 20 + rounds * LONGEST_TURN, family)
    found = [enter(entrant, problem, path, budget, rounds) for entrant in entrants]
    racers = [one for one in found if isinstance(one, Racer)]
    with _no_collector():
        for k in range(rounds):
            lead = k % max(1, len(racers))
            for racer in racers[lead:] + racers[:lead]:
                if racer.spent < budget:
                    racer.take_turn(path)
            after_round((k + 1) / rounds)
    return racers, [one for one in found if isinstance(one, Skipped)]
