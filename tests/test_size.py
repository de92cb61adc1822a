"""What a team carries: bounds by hand, order, one drone lost, for how long, and the command."""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colift.errors import ColiftError, MissionError
from colift.mission import load_mission
from colift.mission.warnings import warnings_of
from colift.study import size as study
from colift.team import Team
from terminal import colift

G = 9.81


def question(
    drones: int | None = 3, load: float | None = None, wind: float = 0.0, **numbers: Any
) -> study.Question:
    given = {"mass": 1.4, "max_thrust": 28.0, "cable_length": 2.0, **numbers}
    return study.Question({**study.BASE, "drones": given}, {}, drones, load, wind)


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return colift("size", *arguments)


THREE = ("--mass", "1.4", "--max-thrust", "28", "--cable", "2")


def test_one_drone_carries_what_its_thrust_less_reserve_and_weight_leaves() -> None:
    found = study.size(question(1))
    assert found.most["calm"].load == pytest.approx((0.95 * 28.0 - 1.4 * G) / G, rel=2e-3)
    assert found.most["calm"].limit == study.NAMES["max_thrust"]
    assert found.most_spare["calm"].load == 0.0
    assert not found.held_spare.ok


def test_two_and_three_drones_carry_what_cables_thirty_degrees_apart_leave() -> None:
    """All cables at one angle a to the vertical: |(T sin a, m g + T cos a)| = 0.95 F, the load is n T cos a."""
    usable, own = 0.95 * 28.0, 1.4 * G
    for n in (2, 3):
        a = math.asin(math.sin(math.radians(15.0)) / math.sin(math.pi / n))
        T = math.sqrt(usable**2 - (own * math.sin(a)) ** 2) - own * math.cos(a)
        T = min(T, usable - own)  # what a cable is allowed, by default
        found = study.size(question(n))
        assert found.most["calm"].load == pytest.approx(n * T * math.cos(a) / G, rel=3e-3), n
        assert "drones.max_thrust" in [each.path for each in found.most["calm"].binding]
        assert found.most["calm"].load == pytest.approx(found.most["calm"].optimum, rel=3e-3)


def test_one_that_is_lost_leaves_the_smaller_team() -> None:
    three, two = study.size(question(3)), study.size(question(2))
    assert three.most_spare["calm"].load == pytest.approx(two.most["calm"].load, rel=1e-9)
    assert three.most_spare["calm"].lost == 0
    assert three.most_spare["calm"].load < three.most["calm"].load


def test_more_thrust_carries_more_and_wind_less() -> None:
    weak, strong = (study.size(question(4, max_thrust=F, wind=6.0)) for F in (26.0, 30.0))
    for air in ("calm", "wind"):
        assert strong.most[air].load > 1.1 * weak.most[air].load
        assert strong.most_spare[air].load < strong.most[air].load
    for each in (weak, strong):
        assert each.most["wind"].load < 0.97 * each.most["calm"].load
        assert each.most["wind"].limit == study.IN_WIND["actuation"]
    windier = study.size(question(4, max_thrust=30.0, wind=9.0))
    assert windier.most["wind"].load < strong.most["wind"].load
    assert windier.wind == pytest.approx(9.0 * (1.0 + 0.35 + 0.36 * study.GUST))


def test_distances_of_wide_drones_on_short_cables_bind_by_name() -> None:
    slim, wide = (study.size(question(3, cable_length=1.0, radius=r, arm=0.2)) for r in (0.2, 0.45))
    assert wide.most["calm"].load < 0.97 * slim.most["calm"].load
    assert study.NAMES["radius"] in wide.most["calm"].limit
    assert study.NAMES["radius"] not in slim.most["calm"].limit


def test_the_heaviest_load_is_flown_and_of_a_little_more_is_warned() -> None:
    asked = question(3, wind=6.0)
    most = study.size(asked).most["wind"].load
    for share, more in ((0.995, False), (1.02, True)):
        mission = load_mission(asked.source, asked.changes(3, share * most))
        assert any("m/s of wind" in each.message for each in warnings_of(mission)) is more
    with pytest.raises(MissionError):
        load_mission(asked.source, asked.changes(3, 1.5 * most))


def test_the_fewest_drones_are_the_first_team_that_carries_it() -> None:
    found = study.size(question(None, 5.0))
    assert (found.few, found.few_spare) == (5, 6)
    assert found.crew.team.n == 6
    assert found.ok
    assert found.held_spare.ok
    fewer = study.size(question(4, 5.0))
    assert not fewer.held.ok
    assert fewer.most["calm"].load < 5.0
    assert study.size(question(5, 5.0)).held.ok
    none = study.size(study.Question(question().source, {}, None, 5.0, 0.0, at_most=4))
    assert none.few is None
    assert not none.ok


def test_no_team_of_less_than_four_is_safe_against_a_loss() -> None:
    assert study.size(question(None, 0.3)).few_spare == 4
    said = {n: " ".join(study.remarks(study.size(question(n, 0.8)))) for n in (1, 2, 3, 4)}
    assert "no spare" in said[1]
    # 1.4 kg and 0.8 kg on the motors of one.
    assert f"{2.2 * G:.4g} N in hover, of the 28 N" in said[2]
    assert "swings across the plane" in said[3]
    assert "not safe" not in said[4]
    heavy = " ".join(study.remarks(study.size(question(2, 2.0))))
    assert "does not carry it" in heavy


def test_the_worst_drone_of_an_unlike_team_is_the_one_that_is_lost() -> None:
    found = study.size(question(4, 1.0, max_thrust=[28.0, 28.0, 34.0, 28.0]))
    assert found.most_spare["calm"].lost == 2
    assert found.few is None  # of drones that are not alike none is asked for more of
    assert found.lost == 2


def test_endurance_is_that_of_momentum_theory() -> None:
    team = Team.uniform(
        2,
        mass=1.4,
        max_thrust=28.0,
        arm=0.25,
        rotor_radius=0.12,
        rotors=4,
        energy=2e5,
        efficiency=0.5,
    )
    area = 4 * math.pi * 0.12**2
    power = 20.0 * math.sqrt(20.0 / (2 * 1.225 * area)) / 0.5
    assert study.powers(team, np.array([20.0, 20.0])) == pytest.approx([power, power])
    assert study.endurance(team, np.array([20.0, 10.0])) == pytest.approx(2e5 / power)
    assert study.unknown(team) == []


def test_endurance_follows_the_thrust_and_names_what_it_lacks() -> None:
    numbers = {"arm": 0.25, "rotor_radius": 0.12, "rotors": 4, "energy": 2e5, "efficiency": 0.5}
    found = study.size(question(4, 1.5, **numbers))
    whole, left = study.lasts(found.crew, found.held), study.lasts(found.others, found.held_spare)
    area = 4 * math.pi * 0.12**2
    power = max(found.held.thrusts) ** 1.5 / math.sqrt(2 * 1.225 * area) / 0.5
    assert whole == pytest.approx(2e5 / power)
    assert left < whole
    del numbers["energy"]
    lacking = study.size(question(4, 1.5, **numbers))
    assert math.isnan(study.lasts(lacking.crew, lacking.held))
    assert "drones.energy." in " ".join(study.remarks(lacking))


def test_a_mission_gives_its_own_load_wind_and_limits() -> None:
    found = study.size(study.Question("hover", {"allocation.max_cone_deg": 60.0}))
    assert found.asked == pytest.approx(load_mission("hover").team.load_mass)
    assert found.crew.allocation.max_cone_deg == 60.0
    assert found.crew.team.n == 4
    windy = study.size(study.Question("real-world", {}))
    assert windy.wind > 10.0
    calm = study.size(study.Question("real-world", {}, wind=0.0))
    assert calm.wind == 0.0
    assert calm.most["calm"].load == pytest.approx(windy.most["calm"].load)


def test_an_allocator_without_limits_is_refused() -> None:
    with pytest.raises(ColiftError, match=r"allocation\.kind=safe"):
        study.size(study.Question("paper-spiral", {}))


def test_flights_are_counted_with_what_they_leave_open(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[tuple[str, int, int | None]] = []

    def judged(_: Any, __: Any, reference: str, seed: int, cut: int | None) -> tuple[str, float]:
        flown.append((reference, seed, cut))
        return ("cut", 3.0) if cut == 1 else ("", 0.1 * (1 + seed))

    monkeypatch.setattr(study, "_flight", judged)
    asked = question(3, 1.0)
    found = study.fly(asked, study.size(asked), 2, lambda _: None)
    assert [(each.good, each.flights, each.cut) for each in found] == [
        (2, 2, False), (2, 2, False), (4, 6, True), (4, 6, True)
    ]  # fmt: skip
    assert len(flown) == 16
    assert found[0].interval[0] == pytest.approx(math.sqrt(0.025))
    assert found[2].farthest == pytest.approx(0.2)
    assert found[2].first_bad == "cut"


@pytest.mark.slow
def test_four_drones_fly_on_with_a_cable_cut_and_a_load_beyond_them_does_not() -> None:
    asked = question(4, 1.2, 4.0, arm=0.25, rotor_radius=0.12)
    assert all(
        each.good == each.flights for each in study.fly(asked, study.size(asked), 1, lambda _: None)
    )
    heavy = question(4, 9.0)
    assert study._flight(heavy, study.size(heavy), "hover", 0, None)[0]


def test_the_engineers_two_questions_take_one_call_each() -> None:
    done = command(*THREE, "--drones", "3", "--load", "1.2", "--wind", "8", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["ok"]
    assert found["load"]["all"]["carried"]
    assert not found["load"]["one_lost"]["steady"]
    assert found["heaviest"]["wind"]["all"]["load_kg"] > 1.2
    assert found["endurance_needs"] == ["energy", "efficiency", "rotors", "rotor_radius"]
    assert found["load"]["all"]["endurance_s"] is None
    done = command(*THREE, "--load", "5")
    assert done.returncode == 0, done.stderr
    assert "Fewest drones for 5 kg: 5; if one may be lost: 6." in done.stdout


def test_a_load_that_is_not_carried_ends_with_one() -> None:
    done = command(*THREE, "--drones", "3", "--load", "5", "--json")
    assert done.returncode == 1
    found = json.loads(done.stdout)
    assert not found["ok"]
    assert found["fewest"] == {"all": 5, "one_lost": 6, "at_most": 12}
    assert "motors" in found["load"]["all"]["why"]
    assert found["load"]["all"]["thrusts_N"] == [None] * 3


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), ["--vehicle: is required", "--drones: is required"]),
        (("--mass", "-1", "--drones", "3"), ["drones.mass: must be greater than 0 (found -1.0)"]),
        (("--vehicle", "x50", "--drones", "3"), ["drones.vehicle", "x50", "x500"]),
        ((*THREE, "--drones", "3", "--load", "0"), ["load.mass: must be greater than 0"]),
        ((*THREE, "--drones", "3", "--rotors", "5"), ["drones.rotors", "4, 6", "5"]),
        (
            (*THREE, "--drones", "3", "--wind", "99"),
            ["--wind: must be between 0 and 60 (found 99)"],
        ),
        ((*THREE, "--drones", "65"), ["--drones: must be between 1 and 64 (found 65)"]),
        (("no-such-mission",), ["no-such-mission"]),
    ],
)
def test_mistakes_name_field_value_and_range(arguments: tuple[str, ...], says: list[str]) -> None:
    done = command(*arguments)
    assert done.returncode == 2
    text = " ".join(done.stderr.split())
    assert all(each in text for each in says), text
    assert done.stdout == ""


def test_the_pages_show_what_the_command_prints(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = Path(__file__).parents[1] / "docs" / "figures"
    monkeypatch.syspath_prepend(figures)
    spec = importlib.util.spec_from_file_location("size_figure", figures / "size.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    kept = json.loads((figures / "size.json").read_text(encoding="utf-8"))
    assert kept.keys() == (script.QUESTIONS | script.RIGID).keys()
    for name in ("carries", "how-many"):
        assert script.ask(script.QUESTIONS[name]) == kept[name]


def test_the_page_names_every_field_of_the_json() -> None:
    page = (Path(__file__).parents[1] / "docs" / "your-drones.md").read_text(encoding="utf-8")
    asked = question(2, 0.8)
    answer = study.size(asked)
    flown = [study.Flown("hover", False, 1, 1, 0.1, "")]

    def names(value: Any) -> set[str]:
        if isinstance(value, dict):
            return {*value} | {name for each in value.values() for name in names(each)}
        return (
            {name for each in value for name in names(each)} if isinstance(value, list) else set()
        )

    missing = {
        name for name in names(study.as_json(asked, answer, flown)) if f"`{name}`" not in page
    }
    assert not missing
