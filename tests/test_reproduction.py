"""Every claim of the paper: reproduced, bettered or explained, from runs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from colift import reproduction
from colift.geometry import pairwise_angles
from colift.mission.load import parse_override
from colift.runner import run


@pytest.fixture(scope="module")
def result() -> reproduction.Reproduction:
    return reproduction.reproduce()


def row(result: reproduction.Reproduction, start: str) -> reproduction.Row:
    (found,) = [r for r in result.rows if r.quantity.startswith(start)]
    return found


@pytest.mark.parametrize(("mu", "printed"), [(0.15, 26.8), (0.75, 32.1), (1.35, 33.7)])
def test_integrated_tension_over_ten_seconds(
    result: reproduction.Reproduction, mu: float, printed: float
) -> None:
    found = row(result, f"J_T over 10 s, mu = {mu}")
    assert found.ours == pytest.approx(printed, rel=0.02)
    assert found.verdict == "reproduced"


@pytest.mark.parametrize(("mu", "printed"), [(0.75, 47.8), (1.35, 47.9)])
def test_smallest_angles_are_those_of_the_start(
    result: reproduction.Reproduction, mu: float, printed: float
) -> None:
    assert row(result, f"smallest angle, SQP, mu = {mu}").ours == pytest.approx(printed, abs=0.3)
    later = row(result, f"smallest angle after 5 s, mu = {mu}")
    assert later.verdict == "differs"
    assert later.ours > 61.0


def test_tracking_is_better_than_printed(result: reproduction.Reproduction) -> None:
    found = next(r for r in result.rows if r.quantity == "RMS position error")
    assert found.ours <= 0.05
    assert found.verdict == "better"


def test_the_lopsided_baseline_gives_the_papers_bad_plots(
    result: reproduction.Reproduction,
) -> None:
    flown = result.flights["lopsided"]
    smallest = np.degrees(pairwise_angles(flown.recording["directions"]).min(axis=1))
    assert 17 < np.median(smallest) < 28
    assert 2.5 < flown.metrics["tension_imbalance"] < 3.3


def test_a_fixed_symmetric_ring_is_nearly_as_good_as_the_sqp(
    result: reproduction.Reproduction,
) -> None:
    assert row(result, "J_T over 10 s of the ring baseline").ours == pytest.approx(1.3, abs=0.2)


def test_the_printed_sign_cannot_hold_the_load(result: reproduction.Reproduction) -> None:
    assert row(result, "wanted vertical force").ours == pytest.approx(-0.225 * 9.81, rel=1e-6)


def test_two_cables_coincide_at_an_exact_global_optimum() -> None:
    directions, tensions = reproduction.coincident_optimum(0.15, 2.207)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert np.allclose(tensions @ directions, [0.0, 0.0, -2.207])
    assert (tensions > 0).all()
    gap, angle = reproduction.coincident_gap(0.15, 2.207)
    assert gap < 1e-12
    assert angle == 0.0


def test_every_row_has_a_verdict_and_a_reason_where_it_differs(
    result: reproduction.Reproduction,
) -> None:
    for found in result.rows:
        assert found.verdict in {"reproduced", "better", "differs", "shown"}
        assert np.isfinite(found.ours)
        assert found.reason or found.verdict == "reproduced", found
        assert found.command.startswith("colift ")


def test_the_commands_beside_the_rows_repeat_the_flights() -> None:
    import shlex

    for name, changes in reproduction.FLIGHTS.items():
        words = shlex.split(reproduction.command_of(name))
        assert words[:3] == ["colift", "run", "paper-spiral"]
        assert dict(parse_override(text) for text in words[4::2]) == changes, name


def test_verdicts_follow_the_numbers() -> None:
    assert reproduction.near(1.01, 1.0, 0.02)[0] == "reproduced"
    assert reproduction.near(1.03, 1.0, 0.02, "why") == ("differs", "why")
    assert reproduction.smaller_is_better(2.0, 1.0, "why")[0] == "differs"


def test_the_table_is_written_whole(result: reproduction.Reproduction, tmp_path: Path) -> None:
    files = reproduction.write(result, tmp_path)
    table = json.loads(files["table"].read_text())
    assert len(table["rows"]) == len(result.rows)
    page = files["report"].read_text()
    assert page.count("<figure>") == 7
    assert "http" not in page.replace("http://www.w3.org/", "")


def test_mu_can_be_changed_in_flight(result: reproduction.Reproduction) -> None:
    levels = result.flights["mu-online"].recording["desired_tensions"].sum(axis=1)
    fixed = run("paper-spiral", mu=0.75).recording["desired_tensions"].sum(axis=1)
    assert levels[1900] == pytest.approx(fixed[1900], rel=0.02)  # t = 9.5 s
