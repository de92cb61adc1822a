"""The safe allocator's promises under attack and in flight, beside the paper's allocator."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import colift
import terminal
from colift.control.allocation.sqp import Sqp
from colift.kernel.status import Status
from colift.mission import load_mission, mission_names
from colift.study import safety
from colift.team.geometry import pairwise_angles


@pytest.mark.parametrize("family", safety.FAMILIES)
@pytest.mark.parametrize("n", [2, 3, 4, 6, 8])
def test_every_limit_holds_in_every_cycle(n: int, family: str) -> None:
    found = safety.attack(n, family, 4_000, safety.problem(n)[1])
    assert found.smallest_angle >= found.least_angle - safety.ANGLE_TOLERANCE
    assert found.limits_broken_by <= 1e-6
    assert found.not_finite == 0
    assert found.unflagged_imbalance == 0


@pytest.mark.parametrize("family", ["smooth", "noise", "coloured"])
@pytest.mark.parametrize("n", [3, 4, 6, 8])
def test_the_force_is_balanced_in_every_smooth_or_noisy_cycle(n: int, family: str) -> None:
    found = safety.attack(n, family, 4_000, safety.problem(n)[1])
    assert found.yield_share == 0.0
    assert found.unflagged_imbalance == 0


@pytest.mark.parametrize("family", safety.FAMILIES)
@pytest.mark.parametrize("n", [2, 3, 4, 6, 8])
def test_every_distance_holds_in_every_cycle(n: int, family: str) -> None:
    ours, angles = (
        safety.attack(n, family, 2_000, part, metres=True) for part in safety.metric_parts(n)
    )
    assert ours.drone_room >= 0.0
    assert ours.cable_room >= 0.0
    assert ours.holds
    if family == "adversary":
        assert angles.drone_room < -0.02  # the same forces without these limits
        assert not angles.holds


@pytest.mark.parametrize("n", [4, 8])
def test_the_papers_allocator_breaks_the_limit_under_the_same_forces(n: int) -> None:
    mu = safety.problem(n)[1].mu
    worst = min(safety.attack(n, f, 4_000, Sqp(mu=mu)).smallest_angle for f in safety.FAMILIES)
    assert worst < 29.0  # the safe allocator keeps 30 under each of them


def test_an_attack_is_repeatable_and_its_slices_do_not_matter(monkeypatch) -> None:
    part = safety.problem(4)[1]
    first = safety.attack(4, "adversary", 1_500, part)
    assert safety.attack(4, "adversary", 1_500, part).smallest_angle == first.smallest_angle
    assert safety.attack(4, "adversary", 1_500, part, seed=1).smallest_angle != first.smallest_angle


@pytest.mark.parametrize("title", [t for t in safety.FLIGHTS if "hour" not in t])
def test_every_flight_keeps_apart_and_tracks_no_worse_than_the_papers(title: str) -> None:
    ours, paper = safety.fly(title, "safe"), safety.fly(title, "sqp")
    assert ours.survives
    assert ours.separated
    assert ours.failures == 0
    assert ours.tracking_rms < paper.tracking_rms


@pytest.mark.parametrize(
    "title", ["one drone starts below the load", "twice the load", "four times the load"]
)
def test_flights_that_the_papers_allocator_does_not_survive(title: str) -> None:
    assert not safety.fly(title, "sqp").survives


@pytest.mark.parametrize(
    "mission",
    [
        name
        for name in mission_names()
        # a plan keeps its own distances, which its mission's criteria ask for
        if name not in {"paper-spiral", "through-a-window"} and not load_mission(name).team.body
    ],
)
def test_actual_cables_keep_the_limit_less_a_margin_in_every_shipped_mission(mission: str) -> None:
    flown = colift.run(mission)
    assert flown.mission.kinds["allocation"] == "safe"
    settled = 2.0 if mission == "from-rest" else 0.0  # it starts with cables 7 degrees apart
    kept = flown.recording["directions"][flown.recording.time >= settled]
    least = flown.mission.allocation.min_angle_deg - safety.ACTUAL_MARGIN
    if kept.shape[1] > 1:
        assert np.degrees(np.nanmin(pairwise_angles(kept))) >= least
    # Where an overload ends, the first cycle in balance may be cut short at the cap: its force is whole all the same.
    codes = flown.recording["allocator_status"]
    short = codes == Status.ITERATION_LIMIT
    if mission == "leaderless":
        assert not short.any()  # no allocator answers for all, so none can be counted
        return
    assert short.sum() == flown.metrics["allocator_failures"] <= (mission == "cut-in-flight")
    assert (flown.recording["allocator_force_residual"][short] < 1e-6).all()


def test_the_verdict_names_every_fault() -> None:
    good = safety.Flown("t", "safe", "completed", 40.0, 40.0, 0.01, 0.05, 0.0, 0, 0)
    assert safety._verdict(good, good) == "holds"
    far = replace(good, tracking_max=0.5)
    assert "does not survive" in safety._verdict(far, good)
    assert "falls to 20.0 deg" in safety._verdict(replace(good, smallest_angle_later=20.0), good)
    assert "2.0 times worse" in safety._verdict(replace(good, tracking_rms=0.02), good)
    assert safety._verdict(good, far) == "holds; the paper's allocator does not survive"


@pytest.mark.slow
def test_commands_print_one_object_and_tell_by_exit_code() -> None:
    good = terminal.colift("feasibility", "hover", "--json")
    assert good.returncode == 0
    found = json.loads(good.stdout)
    assert found["feasible"]
    assert found["lightest_N"] < found["weight_N"] < found["heaviest_N"]
    heavy = terminal.colift("feasibility", "hover", "--set", "load.mass=3.0")
    assert heavy.returncode != 0
    assert "tension_max" in heavy.stderr + heavy.stdout
    none = terminal.colift("feasibility", "paper-spiral")
    assert none.returncode == 1
    assert "allocation.kind=safe" in none.stderr
    shown = terminal.colift("safety", "--sizes", "4", "--cycles", "1000", "--quick", "--json")
    assert shown.returncode == 0, shown.stderr
    result = json.loads(shown.stdout)
    assert len(result["attacks"]) == 2 * len(safety.FAMILIES)
    assert len(result["distances"]) == 2 * len(safety.FAMILIES)
    assert all(found["holds"] for found in result["distances"][::2])
    assert len(result["flights"]) == 2 * len(safety.FLIGHTS)
