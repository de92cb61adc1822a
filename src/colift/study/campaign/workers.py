"""Who flies the jobs: processes on this machine, or a Dask cluster. Both take and give the same."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import signal
import socket
import tempfile
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Protocol

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.study.campaign.plan import Job, code_digest

ATTEMPTS = 2
"""How often a job is given to a worker before the death of its worker counts as its failure."""

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


@dataclass(frozen=True)
class Result:
    """What became of a job; ``error`` is empty where it was flown, which then has a verdict."""

    key: str
    error: str = ""
    outcome: str = ""
    level: str = ""
    reasons: list[str] = field(default_factory=list)
    metrics: dict[str, float] = field(default_factory=dict)
    wall_time: float = 0.0
    worker: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    recording: bytes | None = None
    found: dict[str, Any] = field(default_factory=dict)
    """What a task of a study's own has found (:class:`LocalPool`)."""


Task = Callable[[Job], Result]
"""What a worker does with a job; a function that it can import."""


def fly(job: Job) -> Result:
    """Fly one job in this process; whatever goes wrong becomes the result's error."""
    return attempt(job, _fly)


def _fly(job: Job) -> Result:
    from colift.flight.runner import run

    flown = run(job.mission)
    return Result(
        job.key,
        outcome=flown.recording.outcome,
        level=flown.verdict.level,
        reasons=flown.verdict.reasons,
        metrics=flown.metrics,
        versions=flown.recording.versions,
        recording=_file_of(flown.recording) if job.keep else None,
    )


def attempt(job: Job, task: Task) -> Result:
    """Do a task with the parts of a job; whatever goes wrong becomes the result's error."""
    begin = time.perf_counter()
    worker = f"{socket.gethostname()}:{os.getpid()}"
    try:
        if job.code != code_digest():
            raise ColiftError(
                f"the worker's colift is another one (sources {code_digest()}, asked for {job.code})"
            )
        for source in job.sources:
            source.load()
        result = task(job)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f" ({Path(last.filename).name}, line {last.lineno})"
        result = Result(job.key, error=f"{type(error).__name__}: {error}{where}")
    return replace(result, wall_time=time.perf_counter() - begin, worker=worker)


def _file_of(recording: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="colift-") as folder:
        return bytes(recording.save(Path(folder) / "recording.h5").read_bytes())


class Pool(Protocol):
    """Flies jobs somewhere; a context manager, at whose end no worker of its own is left."""

    @property
    def size(self) -> int:
        """How many jobs are flown at a time."""

    def fly(self, jobs: Sequence[Job]) -> Iterator[Result]:
        """Results as they come, one for every job, in any order."""


class LocalPool:
    """Worker processes on this machine; each has one job at a time, so a death names its job."""

    def __init__(self, workers: int | None = None, task: Task = fly) -> None:
        self.size = workers or cores()
        self._task = task
        self._workers: list[_Worker] = []

    def __enter__(self) -> LocalPool:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def fly(self, jobs: Sequence[Job]) -> Iterator[Result]:
        """Results as they come; the next job leaves before a result is handed on."""
        waiting = deque((job, 1) for job in jobs)
        busy: dict[Any, tuple[_Worker, Job, int]] = {}

        def give(worker: _Worker) -> None:
            job, attempt = waiting.popleft()
            busy[worker.pipe] = (worker, job, attempt)
            with contextlib.suppress(BrokenPipeError):  # one that has died shows it when asked
                worker.pipe.send(job)

        while waiting or busy:
            while waiting and len(busy) < self.size:
                give(self._idle_worker(busy))
            for pipe in wait(list(busy)):
                worker, job, attempt = busy.pop(pipe)
                try:
                    result = worker.pipe.recv()
                except (EOFError, OSError):
                    self._workers.remove(worker)
                    code = worker.end()
                    if attempt < ATTEMPTS:
                        waiting.appendleft((job, attempt + 1))
                        continue
                    result = Result(
                        job.key, error=f"the worker died {attempt} times (exit code {code})"
                    )
                else:
                    if waiting:
                        give(worker)
                yield result

    def _idle_worker(self, busy: dict[Any, Any]) -> _Worker:
        for worker in self._workers:
            if worker.pipe not in busy:
                return worker
        self._workers.append(_Worker(self._task))
        return self._workers[-1]


class _Worker:
    """One process and the pipe to it."""

    def __init__(self, task: Task) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, end = context.Pipe()
        self._process = context.Process(target=_serve, args=(end, task), daemon=True)
        resource_tracker.ensure_running()  # here, for it lets SIGINT through again
        with _environment(_ONE_THREAD), _uninterrupted():
            self._process.start()
        end.close()

    def end(self) -> int | None:
        """End the process at once; its exit code."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode


def _serve(pipe: Connection, task: Task) -> None:
    """Do the task with what comes through the pipe until its other end is gone."""
    os.dup2(2, 1)  # what a part prints must not come between the lines of --json
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            pipe.send(task(pipe.recv()))


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that are started here never see Ctrl-C, which is for the process that asks."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class DaskPool:
    """The workers of a Dask scheduler; a job whose worker dies is given to another by Dask.

    Raises
    ------
    MissingExtraError
        If Dask is not installed here.
    ColiftError
        If no scheduler answers, it has no workers, or a worker has another colift than this one.

    """

    def __init__(self, address: str, timeout: float = 30.0) -> None:
        try:
            distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise MissingExtraError(
                f"--scheduler needs the package distributed: {install('cluster')}"
            ) from None
        self._as_completed = distributed.as_completed
        try:
            self._client: Any = distributed.Client(address, timeout=timeout, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ColiftError(f"no Dask scheduler answers at {address}: {error}") from error
        try:
            self._client.wait_for_workers(1, timeout=timeout)
            found = self._client.run(code_digest, on_error="return")
        except TimeoutError as error:
            self._client.close()
            raise ColiftError(f"{address}: the scheduler has no workers") from error
        wrong = [f"{at} ({code})" for at, code in found.items() if code != code_digest()]
        if wrong:
            self._client.close()
            raise ColiftError(
                f"workers without this colift (sources {code_digest()}): {', '.join(wrong)}"
            )

    def __enter__(self) -> DaskPool:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    @property
    def size(self) -> int:
        return max(1, sum(map(int, self._client.nthreads().values())))

    def fly(self, jobs: Sequence[Job]) -> Iterator[Result]:
        asked = {
            self._client.submit(fly, job, key=f"colift-{job.key}", pure=False): job for job in jobs
        }
        for future in self._as_completed(asked, loop=self._client.loop):
            error = future.exception()
            if error is None:
                yield future.result()
            else:
                yield Result(asked[future].key, error=f"{type(error).__name__}: {error}")
            future.release()
