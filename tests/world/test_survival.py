"""The survey of single faults: which flights it makes, and how it judges them."""

from __future__ import annotations

import numpy as np
import pytest

from colift.mission import load_mission
from colift.study import survival
from colift.team.geometry import pairwise_angles


def test_every_fault_at_every_drone_at_every_time():
    faults = {"cut": {"kind": "cable-cut"}, "dead": {"kind": "drone-lost"}}
    cases = list(survival.cases(counts=(3, 4), times=(1.0, 2.0), faults=faults))
    assert len(cases) == 2 * 2 * (3 + 4)
    assert len({case.mission.seed for case in cases}) == len(cases)
    for case in cases:
        (fault,) = case.mission.resolved()["fault"]
        assert (fault["drone"], fault["at"]) == (case.drone, case.at)
        assert case.mission.timing.duration == case.at + 6.0
    whole = survival.WHOLE_TEAM[0]
    assert len(list(survival.cases(counts=(5,), faults={whole: survival.FAULTS[whole]}))) == 3
    assert set(survival.WHOLE_TEAM) <= set(survival.FAULTS)


@pytest.mark.parametrize("n", range(3, 9))
def test_each_drone_carries_the_same_share_from_a_start_within_the_limits(n):
    mission = load_mission(survival.team_table("cut-in-flight", n))
    assert mission.load.mass == pytest.approx(0.225 * n / 4)
    assert mission.drones.count == n
    directions = mission.start_directions()
    assert np.degrees(pairwise_angles(directions).min()) > mission.allocation.min_angle_deg


def test_four_drones_survive_the_loss_of_one():
    """Any of them, cable or drone: back on the path within 3 s, no pair of cables below 20 degrees."""
    names = ("cable cut", "drone dead, on its cable", "drone dead, cable cut")
    faults = {name: survival.FAULTS[name] for name in names}
    results = [survival.fly(c) for c in survival.cases(counts=(4,), times=(3.0,), faults=faults)]
    assert len(results) == 12
    for result in results:
        assert result.survived, result
        assert 0.0 < result.delay < 0.16
    rows = survival.summary(results)
    assert [row["survived"] for row in rows] == [4, 4, 4]
    assert max(row["worst_error_m"] for row in rows) == max(result.error for result in results)


def test_a_load_that_is_let_go_is_no_survival():
    faults = {"released": {"kind": "load-released"}}
    deep = load_mission("cut-in-flight", {"world.ground": "none"}).resolved()
    case = next(survival.cases(deep, counts=(4,), times=(1.0,), faults=faults))
    result = survival.fly(case)
    assert not result.survived
    assert result.error > survival.ERROR
    assert result.height < 0.0
    assert np.isnan(result.delay)
