"""Run a campaign: fly what its file does not hold yet, keep every result as it comes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from colift.record.recording import atomic_path
from colift.study.campaign.plan import Job, Plan, unique
from colift.study.campaign.store import Row, Store
from colift.study.campaign.workers import DaskPool, LocalPool, Pool


@dataclass(frozen=True)
class Progress:
    """How far a campaign is."""

    done: int
    total: int
    failed: int
    remaining: float
    """Estimated wall time to the end, s; NaN before anything is known."""


@dataclass(frozen=True)
class Options:
    """Where and how a campaign runs.

    Attributes
    ----------
    file : Path
        Its SQLite file; made if missing, continued otherwise.
    workers : int or None
        Processes on this machine; None stands for one a core.
    scheduler : str or None
        Address of a Dask scheduler whose workers fly instead.
    retry_failed : bool
        Whether runs that failed before are flown again.
    recordings : Path or None
        Folder that gets every recording, ``<key>.h5``.
    progress : callable or None
        Called with a :class:`Progress` after every run.

    """

    file: Path
    workers: int | None = None
    scheduler: str | None = None
    retry_failed: bool = False
    recordings: Path | None = None
    progress: Callable[[Progress], None] | None = None

    def pool(self) -> LocalPool | DaskPool:
        """Who flies."""
        return DaskPool(self.scheduler) if self.scheduler else LocalPool(self.workers)


@dataclass(frozen=True)
class Outcome:
    """Every case with its result, how many runs were flown now, and how long that took (s)."""

    rows: list[Row]
    flown: int
    wall_time: float
    workers: int


def run(planned: Plan, options: Options) -> Outcome:
    """Fly what is planned and not in the file yet; return every case with its result.

    Killed at any moment, the file holds each finished run once, and the same call goes on from there.

    Raises
    ------
    ColiftError
        If another process runs a campaign into the file, or there is nobody to fly.

    """
    jobs = unique(job for _, job in planned)
    begin = time.perf_counter()
    with Store(options.file, create=True) as store, store.writing():
        store.ask(planned)
        if options.retry_failed:
            store.forget_failures(job.key for job in jobs)
        there = store.finished()
        keep = options.recordings is not None
        todo = [replace(job, keep=keep) for job in jobs if job.key not in there]
        size = 0
        if todo:
            from colift.flight import flight  # noqa: F401  compiled once here, loaded by workers

            with options.pool() as pool:
                size = pool.size
                _fly(todo, len(jobs), store, pool, options)
        rows = store.rows(planned)
    return Outcome(rows, len(todo), time.perf_counter() - begin, size)


def kept(planned: Plan, file: Path) -> tuple[int, int]:
    """How many of the flights that are planned a file holds, and how many they are."""
    keys = {job.key for _, job in planned}
    if not file.is_file():
        return 0, len(keys)
    with Store(file) as store:
        return len(keys & store.finished()), len(keys)


def _fly(todo: list[Job], total: int, store: Store, pool: Pool, options: Options) -> None:
    open_jobs = {job.key: job for job in todo}
    estimate = Estimate(store.wall_times())
    failed = 0
    for result in pool.fly(todo):
        job = open_jobs.pop(result.key)
        kept = None
        if options.recordings is not None and result.recording is not None:
            kept = options.recordings.resolve() / f"{job.key}.h5"
            with atomic_path(kept) as temporary:
                temporary.write_bytes(result.recording)
        store.add(job, result, kept)
        if result.error:
            failed += 1
        else:
            estimate.learn(job.kind, job.duration, result.wall_time)
        if options.progress is not None:
            left = estimate.remaining(open_jobs.values(), pool.size)
            options.progress(Progress(total - len(open_jobs), total, failed, left))


class Estimate:
    """Remaining time from the runs so far: wall time for each simulated second, allocator by allocator.

    A kind that has not been flown yet counts as the mean of the others.
    """

    def __init__(self, times: Iterable[tuple[str, float, float]] = ()) -> None:
        self._seen: dict[str, tuple[float, float]] = {}
        for kind, duration, wall_time in times:
            self.learn(kind, duration, wall_time)

    def learn(self, kind: str, duration: float, wall_time: float) -> None:
        """Take in one run."""
        simulated, spent = self._seen.get(kind, (0.0, 0.0))
        self._seen[kind] = (simulated + duration, spent + wall_time)

    def remaining(self, jobs: Iterable[Job], workers: int) -> float:
        """Wall time that these jobs will take on so many workers, s."""
        rates = {kind: spent / simulated for kind, (simulated, spent) in self._seen.items()}
        if not rates:
            return float("nan")
        usual = sum(rates.values()) / len(rates)
        return sum(rates.get(job.kind, usual) * job.duration for job in jobs) / workers
