"""Flights of a space: whole ones, each of which fails or does not, and such that are split from each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping, MutableMapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from colift.errors import ColiftError
from colift.flight.flight import Flight, Snapshot
from colift.mission.schema import Bound, Described
from colift.record import metrics
from colift.record.assumptions import Monitor, largest
from colift.record.recording import Recording
from colift.record.verdict import criteria_of, judge
from colift.study.campaign.plan import Job, Source, code_digest
from colift.study.campaign.workers import LocalPool, Result, attempt
from colift.study.certify import splitting
from colift.study.certify.space import Space

Told = Callable[[int, int], None]
"""Called with the number of trials that are done, and how many of them failed."""

BATCH = 32
"""Flights that workers are given at a time."""


class Trial(NamedTuple):
    """One flight: its seed, why it failed (empty where it did not), and the largest of each quantity that is watched."""

    seed: int
    reason: str
    worst: dict[str, float]


class Replica(NamedTuple):
    """One estimate by splitting: its seed, the probability, blocks flown, turns, and the largest of each quantity."""

    seed: int
    probability: float
    blocks: int
    turns: int
    worst: dict[str, float]


def fly(
    space: Space,
    seeds: Sequence[int],
    limits: Mapping[str, float],
    *,
    sources: Sequence[Source] = (),
    workers: int | None = None,
    kept: MutableMapping[int, Trial] | None = None,
) -> Generator[Trial]:
    """Fly seeds one after the other, several at a time, but for those that are ``kept``; who goes beyond a limit fails as well.

    Raises
    ------
    ColiftError
        If a flight ends in an error: nobody knows whether it would have failed.

    """
    Monitor(limits)  # names are checked before anything is flown
    kept = {} if kept is None else kept
    with LocalPool(workers, watched) as pool:
        for first in range(0, len(seeds), BATCH):
            batch = seeds[first : first + BATCH]
            jobs = [
                _job(space.mission_of(seed).resolved(), f"{seed}", sources)
                for seed in batch
                if seed not in kept
            ]
            for result in map(_sound, pool.fly(jobs)):
                kept[int(result.key)] = _trial(int(result.key), result, limits)
            for seed in batch:
                yield kept[seed]


def _job(mission: dict[str, Any], key: str, sources: Sequence[Source]) -> Job:
    return Job(key, mission, code_digest(), tuple(sources))


def _sound(result: Result) -> Result:
    if result.error:
        raise ColiftError(f"seed {result.key}: {result.error}")
    return result


def _trial(seed: int, result: Result, limits: Mapping[str, float]) -> Trial:
    reason = "" if result.level in {"pass", "warn"} else "; ".join(result.reasons)
    return Trial(seed, reason or beyond(result.found, limits), result.found)


def beyond(worst: Mapping[str, float], limits: Mapping[str, float]) -> str:
    """Which assumptions do not hold, in words; one of which nothing is known does not."""
    found = []
    for name, limit in limits.items():
        value = worst.get(name, math.nan)
        if not value <= limit:
            found.append(f"assumed {name} <= {limit:g}, found {value:.4g}")
    return "; ".join(found)


def watched(job: Job) -> Result:
    """A worker's task: a flight with a monitor."""
    return attempt(job, _watched)


def _watched(job: Job) -> Result:
    from colift.flight.runner import run

    flown = run(job.mission)
    monitor = Monitor()
    monitor.look(flown.recording)
    verdict = flown.verdict
    return Result(
        job.key, outcome=flown.recording.outcome, level=verdict.level, reasons=verdict.reasons, found=monitor.worst
    )  # fmt: skip


def split(
    space: Space,
    seeds: Sequence[int],
    limits: Mapping[str, float],
    *,
    particles: int,
    block: float,
    sources: Sequence[Source] = (),
    workers: int | None = None,
    kept: MutableMapping[int, Replica] | None = None,
) -> Iterator[Replica]:
    """Estimates by splitting: those that are ``kept``, then the others as they come.

    Raises
    ------
    ColiftError
        If a flight ends in an error, or the mission has no criterion that tells how near a flight is to failing.

    """
    Monitor(limits)
    if not bounds_of(space.mission_of(1)) and not limits:
        raise ColiftError("splitting: the mission has no criterion of a least or largest value")
    task = partial(_attempt_split, space, dict(limits), particles, block)
    kept = {} if kept is None else kept
    yield from [kept[seed] for seed in seeds if seed in kept]
    jobs = [_job(space.mission, f"{seed}", sources) for seed in seeds if seed not in kept]
    with LocalPool(workers, task) as pool:
        for result in map(_sound, pool.fly(jobs)):
            replica = Replica(int(result.key), **result.found)
            kept[replica.seed] = replica
            yield replica


def _attempt_split(
    space: Space, limits: Mapping[str, float], particles: int, block: float, job: Job
) -> Result:
    return attempt(job, partial(_split, space, limits, particles, block))


def _split(
    space: Space, limits: Mapping[str, float], particles: int, block: float, job: Job
) -> Result:
    system = Flights(space, block, limits)
    before = system.learn(int(job.key))
    found = splitting.estimate(system, particles, int(job.key))
    own = {**found._asdict(), "blocks": before + found.blocks, "worst": system.worst}
    return Result(job.key, found=own)


class State(NamedTuple):
    """A flight at a moment, the largest of each quantity until then, and what the last block showed of criteria and assumptions."""

    flight: Flight
    at: Snapshot
    worst: dict[str, float]
    shown: list[tuple[str, float, float]]


PILOTS, PILOT = 4, 1
"""Flights that show what is usual, before any is split; and beside the seed, of their random numbers."""


class Flights:
    """Flights of a space that go on in blocks (:class:`~colift.study.certify.splitting.System`); random numbers are drawn anew for each block.

    The level is that of the criterion, or assumption, which is nearest to being missed: 1 where it just is, 0 where it is as
    usual. Otherwise one that is always near, and never missed, would be all that is looked at.
    """

    def __init__(self, space: Space, block: float, limits: Mapping[str, float]) -> None:
        self.space, self.block, self.limits = space, block, limits
        self.blocks = max(1, math.ceil(space.mission["timing"]["duration"] / block - 1e-9))
        self.worst: dict[str, float] = {}
        self.usual: dict[str, float] = {}

    def learn(self, seed: int) -> int:
        """Find out what is usual, by flights of their own, so that it depends on none that is split; how many blocks it took."""
        random, seen, flown = np.random.default_rng([seed, PILOT]), dict[str, list[float]](), 0
        for _ in range(PILOTS):
            state, level = self.begin(int(random.integers(2**63))), -math.inf
            for _ in range(self.blocks):
                if level == math.inf:
                    break
                state, level = self.advance(state, int(random.integers(2**63)))
                flown += 1
                for key, value, _ in state.shown:
                    seen.setdefault(key, []).append(value)
        self.usual = {key: float(np.mean(values)) for key, values in seen.items()}
        return flown

    def begin(self, seed: int) -> State:
        flight = Flight(self.space.mission_of(seed))
        return State(flight, flight.snapshot(), {}, [])

    def advance(self, state: State, seed: int) -> tuple[State, float]:
        flight = state.flight
        flight.restore(state.at)
        flight.reseed(seed)
        since, timing = flight.time, flight.mission.timing
        end = timing.steps * timing.step
        last = since + 1.5 * self.block > end
        flight.advance(end - since if last else self.block)
        stretch, monitor = flight.recording(since), Monitor()
        monitor.look(stretch)
        self.worst = largest(self.worst, monitor.worst)
        shown = [
            *shown_by(stretch, bounds_of(flight.mission)),
            *((k, monitor.worst.get(k, math.inf), v) for k, v in self.limits.items()),
        ]
        level = max((self._level(*each) for each in shown), default=-math.inf)
        over = flight.outcome != "completed"
        after = State(flight, flight.snapshot(), largest(state.worst, monitor.worst), shown)
        return after, math.inf if over else level

    def _level(self, key: str, value: float, limit: float) -> float:
        room = limit - self.usual.get(key, math.inf)
        return 1.0 + (value - limit) / (room if room > 0.0 else abs(limit) or 1.0)

    def failed(self, state: State) -> bool:
        state.flight.restore(state.at)
        recording = state.flight.recording()
        verdict = judge(recording, metrics.compute(recording))
        return not verdict.ok or bool(beyond(state.worst, self.limits))


def mean_of_blocks(system: splitting.System, flights: int, seed: int) -> float:
    """Share of failures of so many flights in blocks that nobody splits: what splitting estimates with less effort."""
    random, failures = np.random.default_rng(seed), 0
    for _ in range(flights):
        state, level = system.begin(int(random.integers(2**63))), -math.inf
        for _ in range(system.blocks):
            if not math.isinf(level) or level < 0.0:
                state, level = system.advance(state, int(random.integers(2**63)))
        failures += system.failed(state)
    return failures / flights


EXTREMES = ("min_", "max_", "peak_")


def bounds_of(mission: Described) -> dict[str, Bound]:
    """Criteria of the least or largest value in a flight: a stretch of it shows how near it came."""
    return {
        name: bound
        for name, bound in criteria_of(mission).items()
        if name.startswith(EXTREMES) or "_max_" in name
    }


def shown_by(stretch: Recording, bounds: Mapping[str, Bound]) -> Iterator[tuple[str, float, float]]:
    """What a stretch of a flight shows of each criterion, and from where on that is missed; what must not be too little with its sign turned."""
    for name, bound in bounds.items():
        value = metrics.value_of(name, stretch)
        for limit, sign, key in ((bound.max, 1.0, name), (bound.min, -1.0, f"-{name}")):
            if limit is not None and math.isfinite(value):
                yield key, sign * value, sign * limit
