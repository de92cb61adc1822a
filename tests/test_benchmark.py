"""The benchmark's referee, order and report; nothing here asserts wall time."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from colift.control.allocation.base import Allocator
from colift.errors import ColiftError
from colift.part import find
from colift.study import bench as benchmark
from colift.study.bench import instructions, problems, solvers, tables, timing
from colift.study.bench.problems import Problem
from colift.study.bench.referee import TOLERANCES, judge
from colift.team.scaling import scaled_load, scaled_mu
from terminal import colift

SIZES = (2, 3, 4, 16)


@pytest.mark.parametrize("n", [3, 4, 16, 1024])
def test_the_problem_keeps_the_papers_cone(n) -> None:
    from colift.control.allocation.paper.newton import optimal_alignment

    mass, mu = scaled_load(n), scaled_mu(n)
    share = optimal_alignment(n, mu / (mass * 9.81) ** 2) / n
    assert share == pytest.approx(0.689, abs=0.001)


def test_noise_is_the_same_in_every_run_and_has_the_size_that_is_said() -> None:
    smooth, noisy = (problems.forces(4, 20_000, family=family) for family in problems.FAMILIES)
    assert np.array_equal(noisy, problems.forces(4, 20_000, family="noisy"))
    deviation = np.std(noisy - smooth, axis=0) / scaled_load(4)
    assert deviation == pytest.approx([problems.NOISE] * 3, rel=0.03)


@pytest.mark.parametrize("n", [*SIZES, 64])
@pytest.mark.parametrize("name", problems.NAMES)
def test_everyone_starts_from_a_right_answer(name, n) -> None:
    problem = Problem(name, n)
    verdict = judge(problem, problem.forces(1, "smooth")[0], *problem.start)
    assert verdict.faults(problem) == ()


def answered(name, n):
    """A problem, a force, and our answer to it."""
    problem = Problem(name, n)
    tensions, directions = problem.start
    return problem, problem.forces(1, "smooth")[0], tensions.copy(), directions.copy()


@pytest.mark.parametrize("n", SIZES)
def test_unbalanced_answers_are_flagged(n) -> None:
    problem, force, T, alpha = answered("paper", n)
    T[0] *= 1.01
    found = judge(problem, force, T, alpha)
    assert "unbalanced" in found.faults(problem)
    assert found.balance == pytest.approx(0.01 * T[0] / 1.01 / np.linalg.norm(force), rel=1e-6)


@pytest.mark.parametrize("n", SIZES)
def test_directions_that_are_not_unit_are_flagged(n) -> None:
    problem, force, T, alpha = answered("paper", n)
    alpha[0] *= 1.001
    T[0] /= 1.001  # the force is balanced
    assert judge(problem, force, T, alpha).faults(problem)[0] == "not unit"


@pytest.mark.parametrize("n", SIZES)
def test_a_cable_that_pushes_is_flagged(n) -> None:
    problem, force, T, alpha = answered("paper", n)
    T[0], alpha[0] = -T[0], -alpha[0]  # the same force
    faults = judge(problem, force, T, alpha).faults(problem)
    assert "tension" in faults
    assert "unbalanced" not in faults


@pytest.mark.parametrize("n", SIZES)
def test_a_balanced_answer_that_is_not_optimal_is_flagged(n) -> None:
    problem, force, _, _ = answered("paper", n)
    fixed = Allocator(find("allocation", "ring")(), problem.team).allocate(force)
    found = judge(problem, force, fixed.tensions, fixed.directions)
    assert found.balance < TOLERANCES["balance"]
    assert {"not stationary", "not optimal"} <= set(found.faults(problem))


def test_a_stationary_answer_that_is_not_the_global_optimum_is_flagged() -> None:
    problem, force, _, _ = answered("paper", 4)
    unit = -force / np.linalg.norm(force)
    parallel = judge(problem, force, np.full(4, np.linalg.norm(force) / 4), np.tile(unit, (4, 1)))
    assert parallel.stationarity < TOLERANCES["stationarity"]
    assert parallel.faults(problem) == ("not optimal",)


@pytest.mark.parametrize("n", SIZES)
def test_cables_below_the_angle_are_flagged(n) -> None:
    problem, force, T, alpha = answered("safe", n)
    middle = alpha[0] + alpha[1]
    middle /= np.linalg.norm(middle)
    apart = alpha[0] - middle * (alpha[0] @ middle)
    apart /= np.linalg.norm(apart)
    half = math.radians(0.5 * problems.least_angle_deg(n) - 0.25)
    alpha[0] = math.cos(half) * middle + math.sin(half) * apart
    alpha[1] = math.cos(half) * middle - math.sin(half) * apart
    found = judge(problem, force, T, alpha)
    assert "too close" in found.faults(problem)
    assert found.angle_deg >= 0.5 - 1e-9


def test_tensions_and_cones_beyond_their_limits_are_flagged() -> None:
    problem, force, T, alpha = answered("safe", 4)
    T[0] = problems.TENSION_MAX + 0.1
    tilt = math.radians(problems.WIDEST_CONE + 2.0)
    alpha[1] = [math.sin(tilt), 0.0, -math.cos(tilt)]
    found = judge(problem, force, T, alpha)
    assert {"tension", "cone"} <= set(found.faults(problem))
    assert found.tension == pytest.approx(0.1 * 4 / np.linalg.norm(force))
    assert found.cone_deg == pytest.approx(2.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_an_answer_that_is_not_finite_is_flagged(bad) -> None:
    problem, force, T, alpha = answered("paper", 4)
    T[2] = bad
    assert {"unbalanced", "not optimal"} <= set(judge(problem, force, T, alpha).faults(problem))


def test_an_active_limit_may_push_but_not_pull() -> None:
    """Two cables for a heavy load want to come closer than the least angle: stationary only with the limit."""
    problem = Problem("safe", 2)
    force = 3.0 * problem.forces(1, "smooth")[0] * [0.0, 0.0, 1.0]
    half = 0.5 * math.radians(problems.least_angle_deg(2))
    alpha = -np.array(
        [[math.sin(half), 0.0, math.cos(half)], [-math.sin(half), 0.0, math.cos(half)]]
    )
    T = np.full(2, 0.5 * force[2] / math.cos(half))
    found = judge(problem, force, T, alpha)
    assert found.faults(problem) == ()
    assert found.stationarity < 1e-9
    light = judge(
        problem, 0.3 * force, 0.3 * T, alpha
    )  # these want to spread, and the limit cannot pull
    assert light.stationarity > 1e-2


class Clerk:
    """Takes part in a race and writes down its turns."""

    def __init__(self, name, book, tensions, directions) -> None:
        self.name, self.book = name, book
        self.tensions, self.directions = tensions, directions

    def turn(self, forces):
        self.book.append((self.name, len(forces)))
        b = len(forces)
        return timing.Turn(
            np.full(b, 1e-4), np.full(b, 1e-4), np.ones(b), np.ones(b, dtype=bool),
            np.tile(self.tensions, (b, 1)), np.tile(self.directions, (b, 1, 1)),
        )  # fmt: skip


def test_solvers_take_turns_and_the_lead_changes(monkeypatch) -> None:
    problem, book = Problem("paper", 4), []
    monkeypatch.setattr(
        timing, "runner", lambda entrant, problem: Clerk(entrant.name, book, *problem.start)
    )
    entrants = [solvers.Entrant(name, "python", lambda _: None) for name in "abc"]
    racers, late = timing.race(problem, "smooth", entrants, rounds=4, budget=1.0)
    turns = [name for name, _ in book[6:]]  # after two warm-up turns each
    assert "".join(turns) == "abcbcacababc"
    assert not late
    assert {racer.place for racer in racers} == {22 + 4 * racers[0].block}
    assert all(racer.calls == 4 * racer.block for racer in racers)  # warm-up does not count


def test_a_solver_leaves_the_race_when_its_budget_is_spent(monkeypatch) -> None:
    problem, book = Problem("paper", 4), []
    monkeypatch.setattr(
        timing, "runner", lambda entrant, problem: Clerk(entrant.name, book, *problem.start)
    )
    entrants = [solvers.Entrant(name, "python", lambda _: None) for name in "ab"]
    racers, late = timing.race(problem, "smooth", entrants, rounds=100, budget=1e-3)
    assert [racer.calls for racer in racers] == [10, 10]
    _, late = timing.race(problem, "smooth", entrants, rounds=100, budget=2e-4)
    assert [one.entrant.name for one in late] == ["a", "b"]
    assert "one call takes 0.0001 s" in late[0].reason


@pytest.fixture(scope="module")
def quick():
    pytest.importorskip("scipy")
    done = colift("bench", "--quick", "--sizes", "2,4", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_json_has_its_schema(quick) -> None:
    assert quick["schema"] == benchmark.SCHEMA
    assert quick["machine"]["numba"]
    assert quick["closed_loop"]["simulated_s"] == 20.0
    fields = set(benchmark.Measurement.__dataclass_fields__)
    for row in quick["results"]:
        assert set(row) == fields
        assert 0 < row["judged"] <= row["calls"]
        assert 0.0 < row["median_us"] <= row["p99_us"] <= row["worst_us"]
    asked = {(r["problem"], r["family"], r["n"], r["solver"]) for r in quick["results"]}
    left = {(r["problem"], r["family"], r["n"], r["solver"]) for r in quick["skipped"]}
    assert not asked & left
    for name in problems.NAMES:
        for family in problems.FAMILIES:
            for n in (2, 4):
                everyone = {entrant.name for entrant in solvers.ENTRANTS[name]}
                assert everyone == {
                    s for p, f, m, s in asked | left if (p, f, m) == (name, family, n)
                }


def test_our_answers_are_right_and_nobody_finds_better_ones(quick) -> None:
    for row in quick["results"]:
        if row["solver"] == "sqp":
            assert row["faults"] == {}
            assert row["unsolved"] == 0
            assert row["worst"]["stationarity"] <= 1e-8
            assert row["excess"] <= 1e-9
        if row["solver"] == "safe":
            assert row["wrong"] == 0
            assert set(row["faults"]) <= {"unbalanced"}  # told by the status


def test_a_measure_that_was_not_taken_is_a_dash_in_the_tables(quick) -> None:
    row = {**quick["results"][0], "excess": None}
    row["worst"] = {**row["worst"], "stationarity": None}
    title, header, rows = list(tables.tables({"results": [row, {**row, "caller": "python"}]}))[2]
    assert "judged" in title
    assert [rows[0][header.index(name)] for name in ("KKT", "cost")] == ["-", "-"]


def test_every_size_has_a_row_in_the_tables(quick) -> None:
    found = {title: rows for title, _, rows in tables.tables(quick)}
    assert len(found) == 10
    for title, rows in found.items():
        if "judged" not in title:
            assert [row[0] for row in rows] == ["2", "4"]
    assert any("Closed loop" in note for note in tables.notes(quick))


def test_instructions_need_valgrind_and_its_kind_of_processor(monkeypatch) -> None:
    monkeypatch.setattr(instructions.shutil, "which", lambda _: None)
    monkeypatch.setattr(instructions.platform, "machine", lambda: "x86_64")
    assert "apt install valgrind" in instructions.count([2])["reason"]
    monkeypatch.setattr(instructions.platform, "machine", lambda: "arm64")
    assert "arm64" in instructions.count([2])["reason"]


@pytest.mark.slow
@pytest.mark.skipif(bool(instructions.reason_against()), reason="needs valgrind")
def test_instructions_are_those_of_the_calls() -> None:
    counted = instructions.count([2, 4])
    rows = {(r["problem"], r["family"], r["n"]): r["instructions"] for r in counted["rows"]}
    assert len(rows) == 8
    for problem in problems.NAMES:
        for family in problems.FAMILIES:
            assert 500 < rows[problem, family, 2] < rows[problem, family, 4] < 200_000
        assert rows[problem, "smooth", 4] < rows[problem, "noisy", 4]  # fewer iterations
    assert counted["target"] == "x86-64-v3"


def test_a_dump_without_a_count_is_an_error(tmp_path) -> None:
    dump = tmp_path / "dump.1"
    dump.write_text("version: 1\ntotals: 4711\n")
    assert instructions._total(dump) == 4711
    dump.write_text("version: 1\n")
    with pytest.raises(ColiftError, match=r"dump\.1"):
        instructions._total(dump)


def test_a_solver_that_grows_too_slow_is_left_out_with_the_reason() -> None:
    forecast = benchmark._Forecast(benchmark.Effort(rounds=10, budget=1.0, first=10.0, flights=1))
    entrant = solvers.Entrant("a", "python", lambda _: None)
    racer = timing.Racer(entrant, None, Problem("paper", 4), first=0.1, block=1, place=0)
    racer.cpu.append(np.full(5, 0.05))
    assert forecast.reason(entrant, 4) == ""
    forecast.note(racer)
    assert forecast.reason(entrant, 8) == ""  # 3 calls of 0.05 * 2^2 s
    assert forecast.reason(entrant, 16) == "about 0.8 s a call at n = 16"
    assert forecast.reason(entrant, 32) == "about 0.8 s a call at n = 16"
    builder = solvers.Entrant("c", "python", lambda _: None)
    racer.entrant, racer.first = builder, 2.0
    forecast.note(racer)
    assert forecast.reason(builder, 8) == "about 16 s to get going at n = 8"
    absent = solvers.Entrant("b", "python", lambda _: None, "no_such_package.part")
    assert forecast.reason(absent, 4) == "no_such_package is not installed"


@pytest.mark.parametrize("sizes", ["1,4", "four", "2000"])
def test_sizes_that_cannot_be_are_refused(sizes) -> None:
    done = colift("bench", "--sizes", sizes)
    assert done.returncode == 2
    assert "number" in done.stderr
