"""What a team carries of a rigid load: the verdict is that of a flight, ends lie where they are said to, mistakes are named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colift.errors import ColiftError, MissionError
from colift.mission import load_mission
from colift.mission.outlook import losses
from colift.study import rigid_size as study
from colift.study.size import Question
from colift.team.load import edge_attachments, usual_attachments
from terminal import colift

SIZE = (0.6, 0.4, 0.2)
BOX: dict[str, Any] = {
    "name": "box", "reference": {"kind": "hover"}, "load": {"kind": "rigid", "size": SIZE},
    "drones": {"mass": 0.5, "max_thrust": 12.0, "arm": 0.15},
}  # fmt: skip


def rigid(
    source: Any = BOX, n: int | None = 4, load: float | None = None, **more: Any
) -> study.Rigid:
    return study.Rigid(Question(source, more, n, load), lambda: None)


def test_the_heaviest_box_is_flown_and_a_little_more_is_refused_for_the_reason_that_is_given() -> (
    None
):
    asked = rigid()
    for place in study.PLACES:
        most = asked.heaviest(place, 4, 4 * (12.0 / 9.81 - 0.5), spare=False)
        assert 1.0 < most.load < 4 * (12.0 / 9.81 - 0.5)
        load_mission(BOX, asked.changes(place, 4, most.load, None))
        with pytest.raises(MissionError) as refused:
            load_mission(BOX, asked.changes(place, 4, 1.004 * most.load, None))
        name = most.why.partition(":")[0]
        assert name == str(refused.value.problems[0]).partition(":")[0]


def test_a_box_that_one_may_be_lost_of_is_one_that_a_flight_carries_on_with() -> None:
    asked, place = rigid(), study.AS_USUAL
    spare = asked.heaviest(place, 4, 3.0, spare=True)
    whole = asked.heaviest(place, 4, 3.0, spare=False)
    assert 0.0 < spare.load < 0.9 * whole.load
    assert spare.why.startswith("without drone")
    for load, carried in ((0.99 * spare.load, True), (1.02 * spare.load, False)):
        mission = load_mission(BOX, asked.changes(place, 4, load, None))
        assert all(each.carries for each in losses(mission).values()) is carried


def test_the_fewest_are_the_first_team_that_is_not_refused() -> None:
    asked = rigid(load=3.0)
    place = "edges, from a corner"
    few, spare = asked.fewest(place, 3.0)
    assert few is not None
    assert spare is not None
    assert 4 < few < spare
    load_mission(BOX, asked.changes(place, few, 3.0, None))
    with pytest.raises(MissionError):
        load_mission(BOX, asked.changes(place, few - 1, 3.0, None))


def test_what_a_reference_asks_counts_with_the_weight() -> None:
    still = rigid("box-figure-eight", reference={"kind": "hover"})
    flown = rigid("box-figure-eight")
    most = [each.heaviest(study.AS_USUAL, 4, 2.9, spare=False) for each in (flown, still)]
    assert most[0].load < most[1].load
    assert most[0].why.startswith("reference")


def test_wind_takes_its_share() -> None:
    blown = study.Rigid(Question(BOX, {}, 4, None, 8.0), lambda: None)
    calm, windy = (each.heaviest(study.AS_USUAL, 4, 2.9, spare=False) for each in (rigid(), blown))
    assert windy.load < 0.97 * calm.load
    assert "of wind" in windy.why


def test_a_heavier_load_keeps_its_shape() -> None:
    own = rigid(
        **{
            "load.inertia": [0.01, 0.02, 0.025],
            "load.mass": 0.5,
            "load.products": [0.0, 0.001, 0.0],
        }
    )
    found = load_mission(BOX, own.changes(study.AS_USUAL, 4, 1.0, None)).team.body
    assert found is not None
    np.testing.assert_allclose(np.diag(found.inertia), [0.02, 0.04, 0.05])
    assert found.inertia[0, 2] == pytest.approx(0.002)


@pytest.mark.parametrize("n", [3, 4, 5, 8])
@pytest.mark.parametrize("first", [0.0, np.pi / 4.0])
def test_ends_on_the_edges_lie_on_them_around_the_middle(n: int, first: float) -> None:
    ends = edge_attachments(n, np.array(SIZE), first)
    over = np.abs(ends) / (0.5 * np.array(SIZE))
    np.testing.assert_allclose(over[:, :2].max(axis=1), 1.0)
    np.testing.assert_allclose(ends[:, 2], 0.1)
    angles = np.sort(np.arctan2(ends[:, 1] / 0.2, ends[:, 0] / 0.3))
    assert np.max(np.diff(np.append(angles, angles[0] + 2.0 * np.pi))) < np.pi
    if (n, first) == (4, np.pi / 4.0):
        np.testing.assert_allclose(ends, usual_attachments(4, np.array(SIZE)))


def test_the_command_answers_for_a_box_and_a_mission() -> None:
    done = colift("size", "--mass", "0.5", "--max-thrust", "12", "--arm", "0.15", "--drones", "4", "--load", "0.8",
                  "--box", "0.6", "0.4", "0.2", "--at-most", "5", "--json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["ok"]
    page = (Path(__file__).parents[1] / "docs" / "rigid-loads.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in page for name in (*found, *found["one_lost"]["0"]))
    assert [*found["attachments"]] == [*study.PLACES]
    assert all(f"`{name}`" in page for name in found["attachments"][study.AS_USUAL])
    assert [*found["one_lost"]] == ["0", "1", "2", "3"]
    assert 0.2 <= found["shortest_cable_m"] < 1.0
    assert min(found["tensions_N"]) > 0.0
    heavy = colift("size", "box-through-poses", "--load", "9", "--at-most", "3")
    assert heavy.returncode == 1, heavy.stderr
    assert "9 kg: " in heavy.stdout


@pytest.mark.parametrize("n", [1, 2, 6])
def test_a_mission_is_asked_for_another_number_of_drones(n: int, tmp_path: Path) -> None:
    source = tmp_path / "box.toml"
    source.write_text(
        'name = "box"\nreference.kind = "hover"\nload = {kind = "rigid", size = [0.6, 0.4, 0.2]}\n'
        "drones = {count = 4, mass = 0.5, max_thrust = 12.0, arm = 0.15}\n"
    )
    answer = study.size(Question(source, {}, n, 0.3, at_most=3))
    assert answer.ok
    assert len(answer.limits) == len(answer.thrusts) == answer.mission.team.n == n
    most = answer.places[study.AS_USUAL].most.load
    assert 0.8 < most / (n * (12.0 / 9.81 - 0.5)) < 1.0
    assert [*answer.held.losses] == [*range(n)]
    assert answer.held.spares == (n == 6)


def test_what_cannot_be_asked_is_refused_by_name() -> None:
    done = colift("size", "box-figure-eight", "--fly")
    assert done.returncode == 2
    assert "--fly" in done.stderr
    done = colift("size", "--vehicle", "x500", "--load", "1", "--box", "-1", "0.4", "0.2")
    assert done.returncode == 2
    assert "load.size" in done.stderr
    unlimited = {**BOX, "drones": {"mass": 0.5}, "actuation": {"kind": "ideal"}}
    with pytest.raises(ColiftError, match="max_thrust"):
        study.size(Question(unlimited, {}, 4, 0.5, at_most=3))
