"""The benchmark reports what it says; it never asserts wall time."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from colift import benchmark


def test_a_quick_benchmark_gives_every_figure() -> None:
    pytest.importorskip("scipy")
    done = subprocess.run(
        [sys.executable, "-m", "colift", "bench", "--quick", "--sizes", "2,4", "--json"],
        capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    result = json.loads(done.stdout)
    assert [row["n"] for row in result["allocator"]] == [2, 4]
    for row in result["allocator"]:
        assert row["loop"]["not_ok"] == 0
        assert row["loop"]["worst_kkt_residual"] <= 1e-8
        assert row["loop"]["max_iterations"] <= 3
        assert row["slsqp"]["failures"] == 0
        assert row["slsqp"]["median_objective_excess"] > -1e-8  # SLSQP finds nothing better
    assert result["closed_loop"]["simulated_s"] == 20.0
    assert result["machine"]["numba"]


def test_the_problem_keeps_the_papers_cone() -> None:
    from colift.allocation._sqp_newton import optimal_alignment

    for n in (3, 4, 16, 1024):
        mass, mu = benchmark.scaled_problem(n)
        share = optimal_alignment(n, mu / (mass * 9.81) ** 2) / n
        assert share == pytest.approx(0.689, abs=0.001)
