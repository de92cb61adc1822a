"""The benchmark: every solver on the same problems in one process, judged by one referee.

Two problems (:mod:`~colift.study.bench.problems`), who takes part (:mod:`~colift.study.bench.solvers`), taking
turns on a clock (:mod:`~colift.study.bench.timing`), what the answers are worth
(:mod:`~colift.study.bench.referee`), instructions per call (:mod:`~colift.study.bench.instructions`), tables.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colift.study.bench.instructions import LARGEST, count
from colift.study.bench.machine import machine
from colift.study.bench.problems import FAMILIES, NAMES, Family, Problem
from colift.study.bench.referee import Verdict
from colift.study.bench.solvers import ENTRANTS, Entrant
from colift.study.bench.timing import FEWEST, Racer, race

if TYPE_CHECKING:
    from colift.flight.flight import Progress

SCHEMA = "colift bench 1"
SIZES = (2, 3, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
QUICK_SIZES = (2, 4, 16)


class Effort(NamedTuple):
    """How long to measure.

    Attributes
    ----------
    rounds : turns of each solver in a race.
    budget : time that each solver may take in a race, s.
    first : longest first call, in which a solver may build itself, s.
    flights : of the closed loop.

    """

    rounds: int
    budget: float
    first: float
    flights: int


FULL, QUICK = Effort(100, 1.5, 10.0, 9), Effort(10, 0.2, 1.0, 3)


@dataclass(frozen=True)
class Measurement:
    """One solver on one problem along one family of forces; times in us.

    ``cpu_us`` is the median processor time of a call. Of ``judged`` answers ``wrong`` have a fault although the
    solver called them solved; ``faults`` counts all. ``worst`` has the largest of each of the referee's
    measures. ``excess`` is the median cost above the best answer without fault to the same force, relative
    to the closed-form optimum; NaN where nobody else was asked the same.
    """

    problem: str
    family: str
    n: int
    solver: str
    caller: str
    calls: int
    median_us: float
    p99_us: float
    worst_us: float
    cpu_us: float
    iterations: float
    unsolved: int
    judged: int
    wrong: int
    faults: dict[str, int]
    worst: dict[str, float]
    excess: float


def measurements(
    problem: Problem, family: Family, racers: Sequence[Racer]
) -> Iterator[Measurement]:
    """What the race gave, one row a solver."""
    best: dict[int, float] = {}
    for racer in racers:
        for place, verdict in racer.verdicts.items():
            if not racer.faults[place]:
                best[place] = min(best.get(place, math.inf), verdict.gap)
    for racer in racers:
        wall, cpu = np.concatenate(racer.wall) * 1e6, np.concatenate(racer.cpu) * 1e6
        verdicts = np.array(list(racer.verdicts.values()))
        names = [name for faults in racer.faults.values() for name in faults]
        excess = [v.gap - best[place] for place, v in racer.verdicts.items() if place in best]
        yield Measurement(
            problem=problem.name,
            family=family,
            n=problem.n,
            solver=racer.entrant.name,
            caller=racer.entrant.caller,
            calls=racer.calls,
            median_us=float(np.median(wall)),
            p99_us=float(np.percentile(wall, 99)),
            worst_us=float(wall.max()),
            cpu_us=float(np.median(cpu)),
            iterations=racer.iterations / racer.calls,
            unsolved=racer.unsolved,
            judged=len(verdicts),
            wrong=sum(
                bool(racer.faults[place]) and racer.claimed[place] for place in racer.claimed
            ),
            faults={name: names.count(name) for name in sorted(set(names))},
            worst=dict(zip(Verdict._fields, map(float, verdicts.max(axis=0)), strict=True)),
            excess=float(np.median(excess)) if excess else math.nan,
        )


class _Forecast:
    """Who can still be asked at the next size: a call grows with the square of n, a first call with its cube."""

    def __init__(self, effort: Effort) -> None:
        self._effort = effort
        self._seen: dict[Entrant, tuple[int, float, float]] = {}
        self._out: dict[Entrant, str] = {}

    def reason(self, entrant: Entrant, n: int) -> str:
        """Why not to ask; empty where nothing speaks against it."""
        if not entrant.installed:
            return f"{entrant.package} is not installed"
        if entrant in self._out:
            return self._out[entrant]
        before, call, first = self._seen.get(entrant, (n, 0.0, 0.0))
        call, first = call * (n / before) ** 2, first * (n / before) ** 3
        if FEWEST * call > self._effort.budget:
            return self.stop(entrant, f"about {call:.2g} s a call at n = {n}")
        if first > self._effort.first:
            return self.stop(entrant, f"about {first:.2g} s to get going at n = {n}")
        return ""

    def stop(self, entrant: Entrant, reason: str) -> str:
        self._out[entrant] = reason
        return reason

    def note(self, racer: Racer) -> None:
        call = float(np.median(np.concatenate(racer.cpu)))
        self._seen[racer.entrant] = (racer.n, call, racer.first)


def closed_loop(repetitions: int) -> dict[str, float]:
    """Time the loop of the 20 s paper mission, recorded."""
    # Not where only calls are counted: it compiles the loop.
    from colift.flight.runner import run as fly

    fly("paper-spiral", timing__duration=0.5)
    times = [fly("paper-spiral").loop_time for _ in range(repetitions)]
    return {
        "simulated_s": 20.0,
        "physics_steps": 20_001,
        "repetitions": repetitions,
        "median_s": statistics.median(times),
        "worst_s": max(times),
    }


def _at(report: Progress, done: int, races: int, share: float) -> None:
    report((done + share) / races)


def run(
    sizes: Sequence[int],
    *,
    effort: Effort = FULL,
    instructions: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """All benchmarks as plain data.

    Parameters
    ----------
    sizes : sequence of int
        Numbers of cables, at least 2.
    effort : Effort
        How long to measure.
    instructions : bool
        Also count the instructions of a call, see :mod:`colift.study.bench.instructions`.
    progress : callable, optional
        Called with the fraction that is done.

    """
    report: Progress = progress or (lambda _: None)
    rows: list[Measurement] = []
    skipped: list[dict[str, Any]] = []
    races = [(name, family, n) for name in NAMES for family in FAMILIES for n in sorted(set(sizes))]
    forecasts = {(name, family): _Forecast(effort) for name in NAMES for family in FAMILIES}
    for k, (name, family, n) in enumerate(races):
        forecast, problem = forecasts[name, family], Problem(name, n)
        reasons = {entrant: forecast.reason(entrant, n) for entrant in ENTRANTS[name]}
        racers, late = race(
            problem, family, [entrant for entrant, reason in reasons.items() if not reason],
            rounds=effort.rounds, budget=effort.budget,
            after_round=partial(_at, report, k, len(races) + 1),
        )  # fmt: skip
        for racer in racers:
            forecast.note(racer)
        for entrant, reason in late:
            reasons[entrant] = forecast.stop(entrant, f"{reason} at n = {n}")
        rows += measurements(problem, family, racers)
        skipped += [
            {"problem": name, "family": family, "n": n, "solver": entrant.name, "reason": reason}
            for entrant, reason in reasons.items()
            if reason
        ]
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "machine": machine(),
        "effort": effort._asdict(),
        "results": [asdict(row) for row in rows],
        "skipped": skipped,
        "closed_loop": closed_loop(effort.flights),
    }
    if instructions:
        result["instructions"] = count([n for n in sorted(set(sizes)) if n <= LARGEST])
    report(1.0)
    return result
