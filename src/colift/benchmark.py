"""Timing of the allocator and of the closed loop, with a general solver in the same run.

Method. The force follows a circle of 2 m/s^2 with a vertical oscillation of 0.5 m/s^2, sampled at
1 kHz; load and ``mu`` are scaled with the number of drones so that the optimal cone stays that of the
paper's mission. Every call is timed by itself, warm-up excluded. A call counts as solved when its
status is ok; the worst KKT residual is shown, so that a fast wrong answer shows. SLSQP gets the same
forces, analytic derivatives, a warm start and one BLAS thread (on matrices so small, more threads only
wait for each other, which can make it tenfold slower on a busy machine); set ``OPENBLAS_NUM_THREADS``
and the like for another number.
"""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from colift.allocation._oracle import TensionProblem
from colift.allocation.base import INFO_SIZE, SIGNATURE
from colift.allocation.sqp import Sqp, SqpAllocator
from colift.geometry import Array, ring
from colift.jit import f8, kernel, matrix, monotonic_ns, vector, void
from colift.recording import versions
from colift.runner import run as fly
from colift.team import Team

if TYPE_CHECKING:
    from colift.simulation.flight import Progress

WARM_UP = 200
LARGEST_SLSQP = 64
"""Beyond this SLSQP needs seconds to minutes per call."""

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables that limit the threads of the BLAS libraries that SciPy is built with."""


@kernel(
    void(
        types.FunctionType(SIGNATURE),
        matrix,
        vector,
        f8,
        vector,
        vector,
        vector,
        matrix,
        vector,
        matrix,
    )
)
def _time_calls(  # type: ignore[no-untyped-def]
    allocate, forces, acceleration, dt, params, memory, tensions, directions, info, out
):
    """Call an allocator once per force; out: duration (ns), iterations, KKT residual, status."""
    for k in range(forces.shape[0]):
        begin = monotonic_ns()
        status = allocate(forces[k], acceleration, dt, params, memory, tensions, directions, info)
        end = monotonic_ns()
        out[k, 0] = end - begin
        out[k, 1] = info[0]
        out[k, 2] = info[1]
        out[k, 3] = status


def scaled_problem(n: int) -> tuple[float, float]:
    """Load mass (kg) and ``mu`` (N^2) that keep the paper's optimal cone for n drones."""
    return 0.225 * n / 4, 0.15 * 4 / n


def smooth_forces(n: int, count: int) -> Array:
    """Force commands (count, 3) along the benchmark's path, N, 1 ms apart."""
    t = np.arange(count) * 1e-3
    mass, _ = scaled_problem(n)
    return mass * np.column_stack(
        [2.0 * np.cos(1.4 * t), 2.0 * np.sin(1.4 * t), 9.81 + 0.5 * np.sin(3.0 * t)]
    )


def in_loop(n: int, calls: int) -> dict[str, float]:
    """Time calls from a compiled loop, as in a flight."""
    settings, team = Sqp(mu=scaled_problem(n)[1]), Team.uniform(n)
    directions, tensions = ring(n, np.radians(35.0)), np.zeros(n)
    out = np.zeros((calls + WARM_UP, 4))
    _time_calls(
        Sqp.kernel, smooth_forces(n, calls + WARM_UP), np.zeros(3), 1e-3, settings.params(team),
        settings.memory(team), tensions, directions, np.zeros(INFO_SIZE), out,
    )  # fmt: skip
    kept = out[WARM_UP:]
    microseconds = kept[:, 0] / 1e3
    return {
        "calls": calls,
        "median_us": float(np.median(microseconds)),
        "p99_us": float(np.percentile(microseconds, 99)),
        "worst_us": float(microseconds.max()),
        "mean_iterations": float(kept[:, 1].mean()),
        "max_iterations": float(kept[:, 1].max()),
        "worst_kkt_residual": float(kept[:, 2].max()),
        "not_ok": int(np.count_nonzero(kept[:, 3])),
    }


def from_python(n: int, calls: int) -> dict[str, float]:
    """Time ``SqpAllocator.allocate`` called from Python."""
    allocator = SqpAllocator(n, scaled_problem(n)[1])
    forces = smooth_forces(n, calls + WARM_UP)
    durations = []
    for force in forces:
        begin = time.perf_counter()
        allocator.allocate(force)
        durations.append(time.perf_counter() - begin)
    microseconds = np.array(durations[WARM_UP:]) * 1e6
    return {
        "median_us": float(np.median(microseconds)),
        "p99_us": float(np.percentile(microseconds, 99)),
        "worst_us": float(microseconds.max()),
    }


def slsqp(n: int, calls: int) -> dict[str, float] | None:
    """Time SciPy's SLSQP on the same forces, warm-started; None where SciPy is not installed."""
    for name in BLAS_THREADS:  # read when SciPy loads its library, so set before the import
        os.environ.setdefault(name, "1")
    try:
        from scipy.optimize import minimize
    except ImportError:
        return None
    mu = scaled_problem(n)[1]
    ours = SqpAllocator(n, mu)
    forces = smooth_forces(n, calls)
    first = ours.allocate(forces[0])
    z = np.concatenate([first.tensions, first.directions.ravel()])
    durations, excess, failures = [], [], 0
    for force in forces:
        asked = TensionProblem(n, mu, force)
        begin = time.perf_counter()
        answer = minimize(
            asked.objective, z, jac=asked.gradient, method="SLSQP", bounds=asked.bounds(),
            constraints=[{"type": "eq", "fun": asked.equalities, "jac": asked.equalities_jacobian}],
            options={"ftol": 1e-10, "maxiter": 300},
        )  # fmt: skip
        durations.append(time.perf_counter() - begin)
        failures += not answer.success
        z = answer.x
        excess.append(answer.fun - ours.allocate(force).objective)
    return {
        "calls": calls,
        "median_us": statistics.median(durations) * 1e6,
        "worst_us": max(durations) * 1e6,
        "failures": failures,
        "median_objective_excess": statistics.median(excess),
    }


def closed_loop(repetitions: int) -> dict[str, float]:
    """Time the loop of the 20 s paper mission, recorded."""
    fly("paper-spiral", timing__duration=0.5)
    times = [fly("paper-spiral").loop_time for _ in range(repetitions)]
    return {
        "simulated_s": 20.0,
        "physics_steps": 20_001,
        "repetitions": repetitions,
        "median_s": statistics.median(times),
        "worst_s": max(times),
    }


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    model = platform.processor()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            model = next(
                line.split(":", 1)[1].strip() for line in file if line.startswith("model name")
            )
    except (OSError, StopIteration):
        pass
    return {"processor": model, "cores": os.cpu_count(), **versions()}


def run(
    counts: list[int], *, quick: bool = False, progress: Progress | None = None
) -> dict[str, Any]:
    """All benchmarks as plain data."""
    rows = []
    report: Callable[[float], None] = progress or (lambda _: None)
    for k, n in enumerate(counts):
        budget = 2_000 if quick else 20_000
        row: dict[str, Any] = {"n": n, "loop": in_loop(n, max(200, budget * 16 // max(16, n)))}
        row["python"] = from_python(n, 500 if quick else 3_000)
        if n <= LARGEST_SLSQP:
            row["slsqp"] = slsqp(n, max(3, (20 if quick else 200) // n))
            if row["slsqp"]:
                row["slsqp_ratio"] = row["slsqp"]["median_us"] / row["loop"]["median_us"]
        rows.append(row)
        report((k + 1) / (len(counts) + 1))
    result = {
        "machine": machine(),
        "allocator": rows,
        "closed_loop": closed_loop(3 if quick else 9),
    }
    report(1.0)
    return result


def show(result: dict[str, Any], console: Console) -> None:
    """Print the benchmarks as tables."""
    table = Table(
        title="The paper's problem, warm-started along a smooth force; times in us",
        title_justify="left",
        caption="median, p99, worst: one call in a compiled loop; iter.: mean iterations; KKT: worst residual. "
        "Python, SLSQP: medians of calls from Python. ratio: SLSQP to median.",
        caption_justify="left",
        box=SIMPLE,
    )
    for name in ("n", "median", "p99", "worst", "iter.", "KKT", "Python", "SLSQP", "ratio"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in result["allocator"]:
        loop, other = row["loop"], row.get("slsqp")
        table.add_row(
            str(row["n"]),
            f"{loop['median_us']:.2f}",
            f"{loop['p99_us']:.2f}",
            f"{loop['worst_us']:.0f}",
            f"{loop['mean_iterations']:.1f}",
            f"{loop['worst_kkt_residual']:.0e}",
            f"{row['python']['median_us']:.1f}",
            f"{other['median_us']:.0f}" if other else "-",
            f"{row['slsqp_ratio']:.0f}" if other else "-",
        )
    console.print(table)
    for row in result["allocator"]:
        if row.get("slsqp") and row["slsqp"]["failures"]:
            other = row["slsqp"]
            console.print(
                f"n = {row['n']}: SLSQP failed {other['failures']} of {other['calls']} times."
            )
    if any(row["n"] <= LARGEST_SLSQP and row.get("slsqp") is None for row in result["allocator"]):
        console.print("The comparison with SLSQP needs SciPy: pip install scipy.")
    loop = result["closed_loop"]
    console.print(
        f"Closed loop, paper-spiral, {loop['simulated_s']:g} s recorded: median {loop['median_s']:.3f} s "
        f"of {loop['repetitions']}, worst {loop['worst_s']:.3f} s."
    )
    console.print(
        ", ".join(f"{key} {value}" for key, value in result["machine"].items()), style="dim"
    )
