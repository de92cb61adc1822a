"""Who takes part in a comparison, with which settings, and what all are judged by."""

from __future__ import annotations

import pytest

from colift.errors import ColiftError
from colift.mission.load import load_mission
from colift.study import compare


def contest(*arguments, **options):
    options = {"spread": False, **options}
    found = compare.cases(*arguments, **options)
    return {(case.labels["allocator"], case.labels["mission"]): case.load() for case in found}


def test_each_flies_with_its_own_defaults_and_all_are_judged_alike() -> None:
    flown = contest(["safe", "ring", "sqp"], ["real-world", "paper-spiral"], [0])
    own = load_mission("real-world").criteria
    for name in ("safe", "ring", "sqp"):
        mission = flown[name, "real-world"]
        assert mission.kinds["allocation"] == name
        assert mission.allocation == type(mission.allocation)().filled(mission.team)
        assert {k: mission.criteria[k] for k in own} == own
        assert mission.criteria["max_tilt_deg"].max == 90.0
        # The paper's allocator asks for no angle; a contest does.
        assert flown[name, "paper-spiral"].criteria["min_angle_deg"].min == 30.0
        assert flown[name, "paper-spiral"].criteria["tracking_max_m"].max == 0.5


def test_what_the_missions_own_allocator_was_asked_for_is_asked_of_all() -> None:
    flown = contest(["ring"], ["eight-drones", "hover"], [0], {"criteria.tracking_max_m.max": 0.1})
    for mission in flown.values():
        assert mission.criteria["min_angle_deg"].min == 30.0
        assert mission.criteria["tracking_max_m"].max == 0.1


def test_drones_on_a_rigid_load_keep_a_distance_and_its_cables_no_angle() -> None:
    flown = contest(["wrench-min-norm"], ["box-figure-eight"], [0])[
        "wrench-min-norm", "box-figure-eight"
    ]
    assert flown.criteria["min_drone_distance_m"].min == pytest.approx(0.518)
    assert "min_angle_deg" not in flown.criteria
    assert flown.criteria["attitude_max_deg"].max == 2.0


def test_a_setting_may_be_that_of_one_or_of_all() -> None:
    changes = {"allocation.mu": 0.5, "safe.min_angle_deg": 25.0, "safe.mu": 0.7, "drones.mass": 0.6}
    flown = contest(["safe", "sqp"], ["hover"], [0], changes)
    safe, sqp = flown["safe", "hover"], flown["sqp", "hover"]
    assert (safe.allocation.mu, safe.allocation.min_angle_deg) == (0.7, 25.0)
    assert sqp.allocation.mu == 0.5
    assert safe.drones.mass == sqp.drones.mass == 0.6
    later = contest(["safe"], ["hover"], [0], {"safe.mu": 0.7, "allocation.mu": 0.5})
    assert later["safe", "hover"].allocation.mu == 0.5
    with pytest.raises(ColiftError, match="--allocators"):
        compare.cases(["safe"], ["hover"], [0], {"allocation": {"kind": "safe"}})


def test_an_allocator_may_fly_as_in_the_mission() -> None:
    flown = contest(["safe", "sqp"], ["real-world-adaptive"], [0], as_in_mission=True)
    assert (
        flown["safe", "real-world-adaptive"].allocation
        == load_mission("real-world-adaptive").allocation
    )
    sqp = flown["sqp", "real-world-adaptive"].allocation
    assert sqp == type(sqp)()
    plain = contest(["safe"], ["real-world-adaptive"], [0])[
        "safe", "real-world-adaptive"
    ].allocation
    assert plain != load_mission("real-world-adaptive").allocation


def test_agents_fly_over_one_radio_whoever_decides() -> None:
    changes = {"network.loss": 0.4, "leaderless.patience": 0.2}
    found = compare.cases(
        ["central", "leaderless"], ["hover", "leaderless"], [3], changes, layer="agents"
    )
    assert {case.labels["study"] for case in found} == {compare.CONTEST}
    flown = {(case.labels["agents"], case.labels["mission"]): case.load() for case in found}
    for name in ("hover", "leaderless"):
        central, agents = flown["central", name], flown["leaderless", name]
        for mission in (central, agents):
            assert mission.kinds["network"] == mission.kinds["link"] == "radio"
            for field in ("delay", "jitter", "loss"):
                assert getattr(mission.link, field) == getattr(mission.network, field)
            assert (mission.network.loss, mission.network.delay) == (0.4, 0.01)
            assert (
                mission.criteria["min_angle_deg"].min == {"hover": 30.0, "leaderless": 25.0}[name]
            )
        assert (central.kinds["agents"], agents.kinds["agents"]) == ("central", "leaderless")
        assert agents.agents.patience == 0.2
        assert central.allocation == agents.allocation
    deaf = compare.radio("hover", {"network.loss": 1.0})
    assert deaf["link"]["loss"] == compare.MOST_LOST
    told = compare.radio("hover", {"network": {"kind": "perfect"}})
    assert told["link"] == {"kind": "perfect"}
    with pytest.raises(ColiftError, match="--schemes"):
        compare.cases(["central"], ["hover"], [0], {"agents.kind": "leaderless"}, layer="agents")
    (said, *_) = compare.protocol(["hover"], [0], {}, layer="agents")
    assert "loses 20% of messages and takes 10 to 30 ms" in said


def test_the_spread_is_swept_over_whatever_else_is_set() -> None:
    found = compare.cases(["safe"], ["hover"], [7], {"safe.mu": 0.7}, as_in_mission=True)
    swept = [case for case in found if case.labels["study"] == compare.SPREAD]
    assert [case.load().allocation.mu for case in swept] == [case.labels["value"] for case in swept]
    assert {case.seed for case in found} == {7}
    assert found[0].load().allocation.mu == 0.7


def test_the_protocol_says_what_held_means() -> None:
    said = compare.protocol(["hover", "paper-spiral"], range(1000, 1003), {"safe.mu": 1.0})
    (bounds,) = [sentence for sentence in said if sentence.startswith("Held")]
    assert bounds.startswith("Held means to the end with tracking_max_m <= 0.5, ")
    assert "min_angle_deg >= 30" in bounds
    assert any("Seeds 1000 to 1002" in sentence for sentence in said)
    assert said[-1] == "Changed: safe.mu = 1.0."
    several = compare.protocol(["hover", "real-world"], [0], {})
    assert sum(sentence.startswith("Held in ") for sentence in several) == 2
