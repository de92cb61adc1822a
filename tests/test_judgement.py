"""Allocators on recorded forces: answers are scaled back exactly, numbers are those of known motions."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import colift
import terminal
from colift.control.allocation.base import Status
from colift.errors import ColiftError, MissionError
from colift.record.recording import Recording
from colift.show.report.judgement import write_page
from colift.study import judge as judgement
from colift.study.judge import ACTUAL, ON_BOARD, Answers, judge, parts_for
from colift.team import Team
from colift.team.geometry import ring

QUICK = ("safe", "sqp", "ring", "min-norm", "internal-force")


@pytest.fixture(scope="module")
def flight() -> Recording:
    """A simulated flight of three drones: it has all that a recorded one has, and the true tensions."""
    overrides = {"drones.count": 3, "timing.duration": 3.0, "timing.recording": 0.01}
    return colift.run("figure-eight", overrides=overrides).recording


def scaled(recording: Recording, c: float) -> Recording:
    """The same flight with ``c`` times the masses and forces."""
    known = recording.mission.resolved()
    known["load"]["mass"] *= c
    known["drones"]["mass"] *= c
    forces = ("force", "tensions", "desired_tensions")
    arrays = recording.arrays | {name: c * recording[name] for name in forces}
    mission = recording.mission.model_copy(
        update={
            "load": recording.mission.load.model_copy(update={"mass": known["load"]["mass"]}),
            "drones": recording.mission.drones.model_copy(update={"mass": known["drones"]["mass"]}),
        }
    )
    return replace(recording, mission=mission, arrays=arrays)


@settings(max_examples=8, deadline=None)
@given(c=st.floats(1e-3, 1e3))
def test_answers_do_not_depend_on_the_size_of_the_team(flight: Recording, c: float) -> None:
    """A kilogram or a gram: the same directions, and tensions in proportion."""
    whole, small = judge(flight, QUICK), judge(scaled(flight, c), QUICK)
    assert small.scale == pytest.approx(whole.scale / c)
    for a, b in zip(whole.answers, small.answers, strict=True):
        np.testing.assert_allclose(b.directions, a.directions, atol=1e-6)
        np.testing.assert_allclose(b.tensions, c * a.tensions, rtol=1e-5, atol=1e-6 * c)


def test_allocators_that_promise_it_balance_the_recorded_force(flight: Recording) -> None:
    rows = {a.allocator: a for a in judge(flight, QUICK).answers}
    for kind in ("safe", "sqp", "ring", "internal-force"):
        assert rows[kind].numbers["residual_max_N"] < 1e-6, kind
        assert rows[kind].numbers["tension_ratio"] >= 1.0 - 1e-9
        assert rows[kind].status_counts == {"CONVERGED": len(flight.time)}, kind
    assert rows["safe"].numbers["min_angle_deg"] >= 30.0
    assert rows["min-norm"].numbers["turn_max_deg_s"] == pytest.approx(0.0, abs=1e-4)


def test_the_rows_of_what_flew_are_the_recording(flight: Recording) -> None:
    rows = {a.allocator: a for a in judge(flight, ("ring",)).answers}
    assert list(rows) == [ON_BOARD, ACTUAL, "ring"]
    np.testing.assert_array_equal(rows[ON_BOARD].tensions, flight["desired_tensions"])
    np.testing.assert_array_equal(rows[ACTUAL].directions, flight["directions"])
    assert math.isnan(rows[ON_BOARD].numbers["median_us"])


def test_every_allocator_starts_from_the_directions_that_flew(flight: Recording) -> None:
    turned = ring(3, math.radians(40.0), heading=1.0)
    arrays = flight.arrays | {"directions": np.broadcast_to(turned, (len(flight.time), 3, 3))}
    rows = {a.allocator: a for a in judge(replace(flight, arrays=arrays), ("min-norm",)).answers}
    np.testing.assert_allclose(rows["min-norm"].directions[0], turned, atol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4, 8])
def test_the_papers_weight_keeps_the_shape_of_the_papers_optimum(n: int) -> None:
    """Cone of the closed-form optimum for the scaled team: that of the paper's four cables."""
    team, _ = judgement.twin(Team.uniform(n, load_mass=0.01, cable_length=0.5), 0.1)
    mu = parts_for(n, ("sqp",))["sqp"].model_dump()["mu"]
    weight = team.load_mass * team.gravity
    (share,) = (r.real for r in np.roots([3.0, -1.0, 0.0, -(weight**2) / (mu * n**3)]) if abs(r.imag) < 1e-12)  # fmt: skip
    (paper,) = (r.real for r in np.roots([3.0, -1.0, 0.0, -(2.20725**2) / (0.15 * 64)]) if abs(r.imag) < 1e-12)  # fmt: skip
    assert share == pytest.approx(paper)
    assert team.cable_lengths == pytest.approx(1.0)


def answers(directions: np.ndarray, tensions: np.ndarray, time: np.ndarray) -> Answers:
    force = -np.einsum("ti,tik->tk", tensions, directions)
    return Answers(
        "made up", {}, time, force, tensions, directions, (Status.CONVERGED,) * len(time)
    )


@settings(deadline=None)
@given(rate=st.floats(-30.0, 30.0), seed=st.integers(0, 99))
def test_the_rate_of_a_steady_turn_is_its_rate_whatever_the_gaps(rate: float, seed: int) -> None:
    time = np.cumsum(np.random.default_rng(seed).uniform(0.005, 0.05, 60))
    turn = math.radians(rate) * (time - time[0])
    level = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=-1)
    directions = np.stack([level, np.cross([0.0, 0.0, 1.0], level)], axis=1)
    found = answers(directions, np.ones((60, 2)), time).numbers
    assert found["turn_rms_deg_s"] == pytest.approx(abs(rate), abs=1e-6)
    assert found["turn_max_deg_s"] == pytest.approx(abs(rate), abs=1e-6)
    assert found["min_angle_deg"] == pytest.approx(90.0)
    assert found["residual_max_N"] == pytest.approx(0.0, abs=1e-12)


def test_means_are_over_time_and_not_over_rows() -> None:
    time = np.array([0.0, 0.1, 0.2, 1.0, 1.8])
    tensions = np.array([[1.0], [1.0], [1.0], [3.0], [3.0]])
    directions = np.tile([0.0, 0.0, -1.0], (5, 1, 1))
    found = answers(directions, tensions, time).numbers
    assert found["mean_total_tension_N"] == pytest.approx(
        (0.2 * 1.0 + 0.8 * 2.0 + 0.8 * 3.0) / 1.8  # trapezoids
    )
    assert found["tension_ratio"] == pytest.approx(1.0)
    assert math.isnan(found["min_angle_deg"])


def test_distances_are_those_on_the_flights_own_cables(flight: Recording) -> None:
    flown, judged = flight.mission.team.cable_lengths, judge(flight, ("safe",))
    for each in judged.answers:
        at = -flown[:, None] * each.directions
        one, other = np.triu_indices(flight.n, k=1)
        near = np.linalg.norm(at[:, one] - at[:, other], axis=-1).min()
        assert each.numbers["min_drone_distance_m"] == pytest.approx(near)
        assert 0.0 < each.numbers["min_cable_distance_m"] <= near + 1e-12


def test_findings_leave_out_who_drops_force(flight: Recording) -> None:
    judged = judge(flight, ("safe", "ring"))
    cheat = replace(judged.answers[2], allocator="cheat", tensions=0.5 * judged.answers[2].tensions)
    told = judgement.findings([replace(judged, answers=(*judged.answers, cheat))])
    assert not any("cheat" in sentence for sentence in told[:-1])
    assert told[-1] == "Left out more than 2 % of the force: cheat in 1 of 1."


def test_what_cannot_be_judged_is_refused(flight: Recording) -> None:
    silent = flight.arrays | {"force": np.full_like(flight["force"], np.nan)}
    with pytest.raises(ColiftError, match="no force commands"):
        judge(replace(flight, arrays=silent), QUICK)
    lost = flight.arrays | {"directions": flight["directions"].copy()}
    lost["directions"][5, 1] = np.nan
    with pytest.raises(ColiftError, match="directions of all cables"):
        judge(replace(flight, arrays=lost), QUICK)
    with pytest.raises(MissionError, match=r"safe\.min_angle"):
        judge(flight, ("safe",), {"safe": {"min_angle": 20.0}})
    with pytest.raises(ColiftError, match="safe"):
        judge(flight, ("safe",), {"safe": {"min_angle_deg": 140.0}})
    rigid = colift.run("box-figure-eight", overrides={"timing.duration": 0.1}).recording
    with pytest.raises(ColiftError, match=r"load\.kind.*only forces are judged"):
        judge(rigid, ["safe-wrench"])


def test_the_page_holds_every_flight_once(flight: Recording, tmp_path: Path) -> None:
    judged = [judge(flight, QUICK), judge(scaled(flight, 0.05), QUICK)]
    page = write_page(judged, {"ipopt": "needs <casadi>"}, tmp_path, "colift judge").read_text()
    assert page.count("<b>Smallest angle over time.</b>") == 2
    assert "needs &lt;casadi&gt;" in page
    assert "<script" not in page


@pytest.mark.slow
def test_the_command_prints_one_object(flight: Recording, tmp_path: Path) -> None:
    file = flight.save(tmp_path / "flight.h5")
    command = ["judge", str(file), "--allocators", "safe,ring"]
    command += ["--set", "safe.min_angle_deg=40", "--out", str(tmp_path / "out"), "--json"]
    done = terminal.colift(*command)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    rows = {row["allocator"]: row for row in result["flights"][0]["rows"]}
    assert rows["safe"]["settings"]["min_angle_deg"] == 40.0
    assert rows["safe"]["min_angle_deg"] >= 40.0
    assert all(Path(path).is_file() for path in result["files"].values())
    wrong = terminal.colift(*command[:2], "--allocators", "saef")
    assert wrong.returncode == 2
    assert "did you mean 'safe'?" in wrong.stderr
