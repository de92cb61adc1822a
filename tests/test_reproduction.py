"""Every claim of the paper: reproduced, bettered or explained, from runs."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from colift.flight.runner import run
from colift.mission.load import parse_override
from colift.show.report.reproduction import write_page
from colift.study import reproduction
from colift.team.geometry import pairwise_angles

pytestmark = pytest.mark.slow


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
    found = row(result, f"J_T, mu = {mu}; over 10 s, which is our reading")
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


def test_the_weight_changes_our_tracking_and_the_start_is_why(
    result: reproduction.Reproduction,
) -> None:
    """From the ring of 35 degrees the error grows with mu; from each optimum it falls, as for fixed rings as wide."""
    ring, optimum = (r for r in result.rows if r.quantity.startswith("largest over smallest RMS"))
    assert ring.verdict == optimum.verdict == "differs"
    errors = {
        name: result.flights[name].metrics["tracking_rms_m"] * 100
        for name in result.flights
        if name.startswith(("sqp", "optimum"))
    }
    grows, falls = (
        [errors[f"{kind}-{mu}"] for mu in reproduction.MUS] for kind in ("sqp", "optimum")
    )
    assert ring.ours == pytest.approx(100 * (max(grows) / min(grows) - 1))
    assert optimum.ours == pytest.approx(100 * (max(falls) / min(falls) - 1))
    assert grows[0] < grows[1] < grows[2]
    assert grows[2] > 4 * grows[0]
    assert falls[0] > falls[1] > falls[2]
    assert falls[0] < 1.6 * falls[2]
    for mu, error in zip(reproduction.MUS, falls, strict=True):
        cone = reproduction.FLIGHTS[f"optimum-{mu}"]["start.cone_deg"]
        fixed = {"allocation.kind": "ring", "allocation.cone_deg": cone, "start.cone_deg": cone}
        tracked = run("paper-spiral", overrides=fixed).metrics["tracking_rms_m"] * 100
        assert tracked == pytest.approx(error, rel=0.05)


def test_the_optimum_starts_are_those_of_the_closed_form() -> None:
    for mu in reproduction.MUS:
        cone = np.radians(reproduction.FLIGHTS[f"optimum-{mu}"]["start.cone_deg"])
        angle = np.degrees(pairwise_angles(reproduction.ring(4, cone)).min())
        assert angle == pytest.approx(reproduction._optimal_ring_angle(mu), abs=0.02)


def test_random_feasible_starts_are_feasible_and_differ() -> None:
    rng = np.random.default_rng(5)
    starts = [reproduction.feasible_start(rng, 2.2) for _ in range(500)]
    for directions, tensions in starts:
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(tensions @ directions, [0.0, 0.0, -2.2], atol=1e-11)
        assert (tensions >= 0.0).all()
        assert (directions[:, 2] < 0.0).all()
    angles = [np.degrees(pairwise_angles(directions).min()) for directions, _ in starts]
    assert min(angles) < 5.0
    assert max(angles) > 60.0


def test_the_heavy_load_hangs_on_cables(result: reproduction.Reproduction) -> None:
    recording = result.flights["heavy-load"].recording
    assert type(recording.mission.plant).__name__ == "SlackCables"
    assert recording["tensions"].min() >= 0.0


def test_a_rows_number_is_in_the_table_of_its_command(result: reproduction.Reproduction) -> None:
    """A row that no single flight's table holds names ``colift reproduce``."""
    names = {reproduction.command_of(name): name for name in reproduction.FLIGHTS}
    for found in result.rows:
        if found.command == "colift reproduce":
            assert not found.metric
            continue
        value = result.flights[names[found.command]].metrics[found.metric]
        scale = {"cm": 100.0, "ms": 1e-3}.get(found.unit, 1.0)
        assert found.ours == pytest.approx(scale * value, rel=1e-12), found.quantity
        unit = {"cm": "_m", "ms": "_us", "N s": "_Ns", "": "imbalance"}.get(
            found.unit, f"_{found.unit}"
        )
        assert found.metric.endswith(unit), found.quantity


def test_the_errata_name_the_flights_that_reproduce_flies() -> None:
    """On the page the mission is left out: it is the default."""
    page = (Path(__file__).parents[1] / "docs" / "errata.md").read_text()
    commands = re.findall(r"^colift run\b.*|(?<=`)colift run\b[^`]*", page, re.MULTILINE)
    flown = [
        dict(parse_override(text) for text in shlex.split(command)[3::2]) for command in commands
    ]
    assert len(flown) > 5
    for changes in flown:
        assert changes in reproduction.FLIGHTS.values(), changes
    for name in ("lopsided", "ring", "sqp-0.15", "no-feed-forward", "start-offset", "heavy-load"):
        assert reproduction.FLIGHTS[name] in flown, name


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
    for name, changes in reproduction.FLIGHTS.items():
        words = shlex.split(reproduction.command_of(name))
        assert words[:3] == ["colift", "run", "paper-spiral"]
        assert dict(parse_override(text) for text in words[4::2]) == changes, name


def test_verdicts_follow_the_numbers() -> None:
    assert reproduction.near(1.01, 1.0, 0.02)[0] == "reproduced"
    assert reproduction.near(1.03, 1.0, 0.02, "why") == ("differs", "why")
    assert reproduction.smaller_is_better(2.0, 1.0, "why")[0] == "differs"


def test_the_table_is_written_whole(result: reproduction.Reproduction, tmp_path: Path) -> None:
    table = json.loads(reproduction.write(result, tmp_path).read_text())
    assert len(table["rows"]) == len(result.rows)
    page = write_page(result, tmp_path).read_text()
    assert page.count("<figure>") == 7
    assert "http" not in page.replace("http://www.w3.org/", "")


def test_mu_can_be_changed_in_flight(result: reproduction.Reproduction) -> None:
    levels = result.flights["mu-online"].recording["desired_tensions"].sum(axis=1)
    fixed = run("paper-spiral", mu=0.75).recording["desired_tensions"].sum(axis=1)
    assert levels[1900] == pytest.approx(fixed[1900], rel=0.02)  # t = 9.5 s
