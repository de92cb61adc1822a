"""Kernels let other threads run; allocators in different threads do not disturb each other."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

import numpy as np
import pytest

import colift
from colift.control.allocation.base import Allocator
from colift.flight.flight import Flight
from colift.kernel import jit
from colift.part import find

needs_jit = pytest.mark.skipif(not jit.JIT_ENABLED, reason="compiled kernels only")
KINDS = ("safe", "sqp", "min-norm", "internal-force", "ring", "lopsided")


def answers(kind: str, n: int, seed: int, calls: int) -> list[bytes]:
    allocator = Allocator(find("allocation", kind)(), n)
    rng = np.random.default_rng(seed)
    force, found = np.array([0.0, 0.0, 2.2]), []
    for _ in range(calls):
        force = force + rng.normal(0.0, 0.05, 3)
        answer = allocator.allocate(force, dt=0.01)
        found.append(answer.tensions.tobytes() + answer.directions.tobytes())
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_answers_in_threads_are_those_in_series(kind):
    jobs = [(kind, n, seed, 300) for n, seed in ((4, 0), (6, 1), (4, 2), (5, 3))]
    alone = [answers(*job) for job in jobs]
    together = threading.Barrier(len(jobs))

    def fly(job):
        together.wait()
        return answers(*job)

    with ThreadPoolExecutor(len(jobs)) as pool:
        assert list(pool.map(fly, jobs)) == alone


def test_flights_in_threads_are_those_in_series():
    missions = [
        colift.load_mission("paper-spiral", {"timing.duration": 1.0, "allocation.kind": kind, "seed": seed})
        for seed, kind in enumerate(("safe", "sqp", "safe"))
    ]  # fmt: skip
    alone = [Flight(mission).run()["load"] for mission in missions]
    with ThreadPoolExecutor(len(missions)) as pool:
        flown = list(pool.map(lambda mission: Flight(mission).run()["load"], missions))
    for one, other in zip(alone, flown, strict=True):
        np.testing.assert_array_equal(one, other)


@needs_jit
def test_another_thread_runs_during_one_call_of_a_kernel():
    """Python's lock is free during the call: a thread that counts goes on in its middle."""
    mission = colift.load_mission(
        "paper-spiral", {"timing.duration": 200.0, "timing.recording": 0.1}
    )
    flight = Flight(mission)
    flight.advance(0.1)
    ticks: list[float] = []
    running, done = threading.Event(), threading.Event()

    def count() -> None:
        running.set()
        while not done.is_set():
            ticks.append(perf_counter())
            done.wait(1e-4)

    counter = threading.Thread(target=count)
    counter.start()
    running.wait()
    begin = perf_counter()
    flight.advance(100.0)  # one call of the compiled loop
    end = perf_counter()
    done.set()
    counter.join()
    assert len(flight.snapshot().legs[-1][2]) == 2
    quarter = 0.25 * (end - begin)
    inside = [tick for tick in ticks if begin + quarter < tick < end - quarter]
    assert len(inside) > 10


@needs_jit
def test_threads_may_load_different_kernels_at_once():
    """Where kernels are cached is a setting of the whole process while they load."""
    script = """
import threading
from importlib import import_module
from pathlib import Path
from colift.kernel import jit
before = jit.config.CACHE_DIR
names = ["control.reference.hover", "control.allocation.sqp", "world.link.radio", "world.disturbance.gust", "world.sensing.noisy", "kernel.math.noise"]
start = threading.Barrier(len(names))
def load(name):
    start.wait()
    import_module("colift." + name)
threads = [threading.Thread(target=load, args=(name,)) for name in names]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert jit.config.CACHE_DIR == before
for name in names:
    module = import_module("colift." + name)
    for value in vars(module).values():
        if hasattr(value, "py_func") and value.py_func.__module__ == module.__name__ and value.signatures and value._cache.cache_path:
            folder = jit.cache_folder(Path(module.__file__).parent)
            assert Path(value._cache.cache_path).is_relative_to(folder), (name, value._cache.cache_path)
            print(name)
"""
    flown = subprocess.run(
        [sys.executable, "-c", script], text=True, capture_output=True, timeout=600
    )
    assert flown.returncode == 0, flown.stderr
    assert {"world.link.radio", "control.allocation.sqp"} <= set(flown.stdout.split())
