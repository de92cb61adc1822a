"""The allocator on a clock: called at a fixed rate while other processes use the machine.

Every tick has a deadline, the next tick. Of each tick four parts are told apart: how late the operating
system (or the caller's own work) let it begin, Python's garbage collector, the allocator's own
processor time, and the time for which the thread was not running although it had begun. Processor time is
what the operating system books on the thread, with interrupts, page faults and what a hypervisor takes
unseen; the iterations of the longest call tell whether it was the allocator that worked longer.

A caller that is late by more than a tick goes on with the next tick to come. The ticks that it skipped count:
as missed deadlines, and with the time from their tick to the answer that came too late for them. (Without
that a delay of ten ticks would be one bad value instead of ten.) Three callers are measured: Python code that sleeps between calls of ``allocate()``; the same in a program with many objects
that makes cyclic garbage in every tick; and a compiled loop, into which no collector reaches.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types

from colift.control.allocation.base import (
    INFO_ITERATIONS,
    INFO_SIZE,
    Allocator,
    AllocatorPart,
    ask,
    unplanned,
)
from colift.control.allocation.safe import Safe
from colift.control.allocation.sqp import Sqp
from colift.errors import ColiftError
from colift.kernel.jit import (
    address_of,
    f8,
    i8,
    kernel,
    matrix,
    monotonic_ns,
    thread_time_ns,
    vector,
    void,
)
from colift.study.bench.machine import machine
from colift.study.bench.problems import forces
from colift.team import Team
from colift.team.geometry import Array, ring
from colift.team.scaling import scaled_load, scaled_mu

if TYPE_CHECKING:
    from colift.flight.flight import Progress

LATE, COLLECTOR, OWN, AWAY, ITERATIONS = range(5)
PARTS = ("late start", "collector", "allocator", "preempted")
"""Parts of one tick, in ns, by column; a fifth column holds the allocator's iterations."""

SCHEMA = "colift latency 1"

SPIN = 200_000
"""The compiled loop sleeps until this many ns before a tick, then looks at the clock."""

BUSY = "import os\nblock = bytearray(1 << 22)\nwhile True:\n    sorted(os.urandom(1 << 14)); block[:] = block[::-1]\n"
"""What a disturbing process does: compute, allocate, move memory, without end."""

HEAP, GARBAGE = 200_000, 30
"""Objects that the untidy program keeps, and cycles that it makes in every tick."""

_sleep_us = types.ExternalFunction("usleep", types.int32(types.uint32))


@kernel(
    void(
        i8,
        matrix,
        f8,
        i8,
        vector,
        vector,
        vector,
        matrix,
        vector,
        matrix,
        matrix,
    )
)
def _tick(  # type: ignore[no-untyped-def]
    allocate, forces, dt, period, params, memory, tensions, directions, info, rest, out
):
    """One call per tick, ``period`` ns apart; a row of ``out``: late, 0, own, away (ns), iterations."""
    beside = unplanned(tensions.shape[0])
    tick = monotonic_ns()
    for k in range(forces.shape[0]):
        tick += period
        left = tick - monotonic_ns()
        if left > SPIN:
            _sleep_us((left - SPIN) // 1000)
        while monotonic_ns() < tick:
            pass
        begin, cpu = monotonic_ns(), thread_time_ns()
        ask(allocate, forces[k], rest, beside, dt, params, memory, tensions, directions, info)
        own = thread_time_ns() - cpu
        wall = monotonic_ns() - begin
        out[k, 0] = begin - tick
        out[k, 1] = 0.0
        out[k, 2] = own
        out[k, 3] = max(wall - own, 0)
        out[k, 4] = info[INFO_ITERATIONS]
        behind = begin + wall - tick
        if behind > period:  # a missed deadline: go on with the next tick that is still to come
            tick += behind // period * period


def in_loop(part: AllocatorPart, team: Team, seconds: float, rate: float) -> Iterator[Array]:
    """Ticks from a compiled loop, a second at a time: (k, 5)."""
    params, memory = part.params(team), part.memory(team)
    directions, tensions = ring(team.n, np.radians(35.0)), np.zeros(team.n)
    info, rest = np.zeros(INFO_SIZE), np.zeros((4, 3))
    ticks = round(seconds * rate)
    path = forces(team.n, ticks, period=1.0 / rate)
    chunk = max(1, round(rate))
    for begin in range(0, ticks, chunk):
        some = np.ascontiguousarray(path[begin : begin + chunk])
        out = np.zeros((len(some), 5))
        _tick(
            address_of(type(part).kernel), some, 1.0 / rate, round(1e9 / rate), params, memory, tensions,
            directions, info, rest, out,
        )  # fmt: skip
        yield out


def from_python(
    part: AllocatorPart, team: Team, seconds: float, rate: float, *, garbage: int = 0
) -> Iterator[Array]:
    """Ticks of ``allocate()`` called from Python, a second at a time: (k, 5)."""
    allocator = Allocator(part, team, dt=1.0 / rate)
    period = round(1e9 / rate)
    ticks = round(seconds * rate)
    path = forces(team.n, ticks, period=1.0 / rate)
    collected = [0, 0]  # time in the collector so far, begin of the present collection

    def collector(phase: str, _: dict[str, int]) -> None:
        if phase == "start":
            collected[1] = time.thread_time_ns()
        else:
            collected[0] += time.thread_time_ns() - collected[1]

    gc.callbacks.append(collector)
    try:
        chunk = max(1, round(rate))
        for first in range(0, ticks, chunk):
            out = np.zeros((min(chunk, ticks - first), 5))
            tick = time.perf_counter_ns()
            for k in range(len(out)):
                tick += period
                left = tick - time.perf_counter_ns()
                if left > 0:
                    time.sleep(left * 1e-9)
                before = collected[0]
                for _ in range(garbage):
                    cycle: list[Any] = []
                    cycle.append(cycle)
                earlier = collected[0]
                begin, cpu = time.perf_counter_ns(), time.thread_time_ns()
                answer = allocator.allocate(path[first + k])
                used = time.thread_time_ns() - cpu
                wall = time.perf_counter_ns() - begin
                inside, outside = collected[0] - earlier, earlier - before
                out[k] = (
                    begin - tick - outside, inside + outside, used - inside, max(wall - used, 0),
                    answer.iterations,
                )  # fmt: skip
                behind = begin + wall - tick
                if behind > period:
                    tick += behind // period * period
            yield out
    finally:
        gc.callbacks.remove(collector)


def from_untidy_python(
    part: AllocatorPart, team: Team, seconds: float, rate: float
) -> Iterator[Array]:
    """The same in a program with a large heap that makes garbage."""
    heap = [[k] for k in range(HEAP)]
    yield from from_python(part, team, seconds, rate, garbage=GARBAGE)
    heap.clear()


CALLERS = {from_python: "python", from_untidy_python: "untidy", in_loop: "loop"}


@contextmanager
def disturbed(processes: int) -> Iterator[None]:
    """Keep the machine busy with other processes meanwhile."""
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(processes)]
    try:
        time.sleep(0.3 if others else 0.0)  # until they are at work
        yield
    finally:
        for other in others:
            other.kill()
        for other in others:
            other.wait()


@contextmanager
def scheduled(realtime: bool) -> Iterator[None]:
    """Run in the real-time class meanwhile, if asked to."""
    if not realtime:
        yield
        return
    try:
        before, priority = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except (AttributeError, PermissionError) as error:
        raise ColiftError(f"real-time scheduling is not allowed here: {error}") from error
    try:
        yield
    finally:
        os.sched_setscheduler(0, before, priority)


def waits(answers: Array, period: float) -> Array:
    """Times from tick to answer, us, of the ticks that were served and of those that were skipped.

    ``answers`` (k,) us; a tick that was skipped waited for the answer of the one before.
    """
    skipped = np.maximum(np.ceil(answers / (period * 1e6)).astype(int) - 1, 0)
    late = np.repeat(answers, skipped)
    first = np.repeat(np.cumsum(skipped) - skipped, skipped)
    return np.concatenate([answers, late - period * 1e6 * (np.arange(len(late)) - first + 1)])


def judge(ticks: Array, period: float) -> dict[str, Any]:
    """Percentiles of the time from tick to answer, missed deadlines, and what the worst is made of (us)."""
    us = ticks[:, : len(PARTS)] / 1e3
    answer, own = us.sum(axis=1), us[:, OWN]
    worst = us[np.argmax(answer)]
    waited = waits(answer, period)
    edges = 2.0 ** np.arange(-1, 18)
    counts, _ = np.histogram(np.clip(waited, edges[0], edges[-1]), edges)
    last = int(np.max(np.flatnonzero(counts)))
    return {
        "ticks": len(waited),
        "skipped": len(waited) - len(answer),
        "median_us": float(np.median(waited)),
        "p99_us": float(np.percentile(waited, 99.0)),
        "p999_us": float(np.percentile(waited, 99.9)),
        "worst_us": float(waited.max()),
        "missed": int(np.count_nonzero(answer > period * 1e6)) + len(waited) - len(answer),
        "worst_is_us": dict(zip(PARTS, map(float, worst), strict=True)),
        "own_median_us": float(np.median(own)),
        "own_p999_us": float(np.percentile(own, 99.9)),
        "own_worst_us": float(own.max()),
        "own_worst_iterations": int(ticks[np.argmax(own), ITERATIONS]),
        "most_iterations": int(ticks[:, ITERATIONS].max()),
        "collector_worst_us": float(us[:, COLLECTOR].max()),
        "collections": int(np.count_nonzero(us[:, COLLECTOR])),
        "histogram": {"edges_us": edges[: last + 2].tolist(), "ticks": counts[: last + 1].tolist()},
    }


def run(
    *,
    n: int = 4,
    seconds: float = 60.0,
    rate: float = 1000.0,
    others: int | None = None,
    realtime: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Both allocators from both callers for ``seconds`` each, as plain data.

    Parameters
    ----------
    n : int
        Number of drones.
    seconds : float
        Length of each of the six measurements, s.
    rate : float
        Calls per second, Hz.
    others : int, optional
        Processes that use the machine meanwhile; as many as it has cores by default.
    realtime : bool
        Run under the operating system's real-time scheduler (Linux, with the right to).
    progress : callable, optional
        Called with the fraction that is done.

    Raises
    ------
    ColiftError
        Where real-time scheduling is asked for and not allowed.

    """
    count = (os.cpu_count() or 1) if others is None else others
    mu, team = scaled_mu(n), Team.uniform(n, load_mass=scaled_load(n))
    least = 30.0 if n <= 8 else 11.0
    cases = [
        (caller, name, part)
        for name, part in (("sqp", Sqp(mu=mu)), ("safe", Safe(mu=mu, min_angle_deg=least)))
        for caller in CALLERS
    ]
    rows = []
    with disturbed(count), scheduled(realtime):
        for k, (caller, name, part) in enumerate(cases):
            for _ in caller(part, team, 0.2, rate):  # warm-up
                pass
            some = []
            for ticks in caller(part, team, seconds, rate):
                some.append(ticks)
                if progress is not None:
                    progress((k + len(some) / max(seconds, 1.0)) / len(cases))
            found = judge(np.concatenate(some), 1.0 / rate)
            rows.append({"caller": CALLERS[caller], "allocator": name, **found})
    return {
        "schema": SCHEMA, "machine": machine(), "n": n, "rate_hz": rate, "seconds": seconds, "other_processes": count,
        "realtime": realtime,
        "rows": rows,
    }  # fmt: skip


def tables(result: dict[str, Any]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """The result as titled tables: header and rows of text."""
    n, rate, others = result["n"], result["rate_hz"], result["other_processes"]
    scheduler = "real-time" if result["realtime"] else "normal"
    rows = [
        [
            r["caller"], r["allocator"], f"{r['median_us']:.0f}", f"{r['p99_us']:.0f}",
            f"{r['p999_us']:.0f}", f"{r['worst_us']:.0f}", f"{r['missed']} of {r['ticks']}",
        ]
        for r in result["rows"]
    ]  # fmt: skip
    yield (
        f"From tick to answer, us: {n} cables, {rate:g} Hz, {result['seconds']:g} s each, "
        f"{others} busy processes, {scheduler} scheduling",
        ["caller", "with", "median", "p99", "p99.9", "worst", "missed"],
        rows,
    )
    rows = [
        [
            r["caller"], r["allocator"], *(f"{r['worst_is_us'][part]:.0f}" for part in PARTS),
            f"{r['collector_worst_us']:.0f}",
        ]
        for r in result["rows"]
    ]  # fmt: skip
    yield (
        "What the worst tick is made of, us; then the longest collection of all ticks",
        ["caller", "with", *PARTS, "longest gc"],
        rows,
    )
    rows = [
        [
            r["caller"], r["allocator"], f"{r['own_median_us']:.1f}", f"{r['own_p999_us']:.1f}",
            f"{r['own_worst_us']:.1f}", str(r["own_worst_iterations"]), str(r["most_iterations"]),
        ]
        for r in result["rows"]
    ]  # fmt: skip
    yield (
        "The allocator's own processor time, us; iterations of the longest call, and most of all",
        ["caller", "with", "median", "p99.9", "worst", "its iterations", "most"],
        rows,
    )
    edges = sorted({e for r in result["rows"] for e in r["histogram"]["edges_us"]})
    rows = []
    for low in edges[:-1]:
        row = [f"{low:g} to {2 * low:g}"]
        for r in result["rows"]:
            counts = dict(zip(r["histogram"]["edges_us"], r["histogram"]["ticks"], strict=False))
            row.append(str(counts.get(low, 0) or "."))
        if any(cell != "." for cell in row[1:]):
            rows.append(row)
    yield (
        "Histogram: ticks by time to answer, us",
        ["us", *(f"{r['caller']}\n{r['allocator']}" for r in result["rows"])],
        rows,
    )
