"""`colift compare`, `sweep` and `results` from the command line."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import pytest

from colift.study.campaign.store import Store
from terminal import colift

EXAMPLE = Path(__file__).parents[2] / "examples" / "my_allocator.py"
SHORT = (
    "--workers", "1", "--set", "timing.duration=0.3", "--set", "criteria.max_tilt_deg.max=180",
)  # fmt: skip
"""A start out of balance, and the paper's gains, turn a drone over at once; a worker takes longer to start than to fly."""


class Images(HTMLParser):
    """Counts figures and whatever the page would load from elsewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.figures, self.loads = 0, 0
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.figures += tag == "figure"
        self.loads += tag in ("script", "link")
        source = dict(attributes).get("src") or "data:"
        self.loads += not source.startswith("data:")


@pytest.mark.slow
def test_who_decides_is_compared_over_one_radio(tmp_path: Path) -> None:
    chosen = ("--agents", "--missions", "hover", "--seeds", "2", *SHORT)
    done = colift("compare", *chosen, "--out", "out", "--json", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert {"central", "leaderless", "exchange-admm", "leader", "distributed-mpc"} <= {
        *result["agents"]
    }
    for found in result["agents"].values():
        assert found["flights"] == found["held"] == 2
        low, high = found["intervals"]["tracking_rms_m"]
        assert low < found["values"]["tracking_rms_m"] < high
    assert "Kinds of agents compared" in (tmp_path / "out/report.html").read_text()
    again = colift("compare", *chosen, "--out", "out", folder=tmp_path)
    assert f"All {result['flown']} flights were there already." in again.stdout
    both = colift("compare", "--schemes", "central", "--allocators", "safe")
    assert both.returncode == 2
    assert "compares allocators" in both.stderr


@pytest.mark.slow
def test_an_allocator_of_ones_own_takes_part_without_touching_the_package(tmp_path: Path) -> None:
    assert len(EXAMPLE.read_text().splitlines()) < 40
    chosen = (
        "--allocators",
        "sqp,ring",
        "--missions",
        "hover,figure-eight",
        "--seeds",
        "2",
        *SHORT,
    )
    arguments = ("compare", *chosen, "--with", str(EXAMPLE), "--out", "out", "--json")
    done = colift(*arguments, "--csv", "all.csv", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert list(result["allocators"]) == ["sqp", "ring", "my-allocator"]
    assert all(c["flights"] == c["held"] == 4 for c in result["allocators"].values())
    # The example has no setting to sweep; of either other's five values one is the default, flown already.
    assert result["flown"] == 3 * 2 * 2 + 4 + 4
    assert any("my-allocator" in sentence for sentence in result["words"])
    assert json.loads((tmp_path / "out/compare.json").read_text()) == result
    page = (tmp_path / "out/report.html").read_text()
    assert (Images(page).figures, Images(page).loads) == (4, 0)
    assert all(sentence.split(":")[0] in page for sentence in result["words"])
    with (tmp_path / "all.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * 2 * 2 + 5 + 5
    assert len({row["key"] for row in rows}) == result["flown"]
    assert {row["setting"] for row in rows} == {"", "mu", "cone_deg"}

    again = colift(*arguments[:-1], folder=tmp_path)  # in words this time
    assert again.returncode == 0, again.stderr
    assert f"All {result['flown']} flights were there already." in again.stdout
    words = " ".join(again.stdout.split())
    assert all(" ".join(sentence.split()) in words for sentence in result["words"])


def test_a_sweep_prints_json_and_results_reads_its_file(tmp_path: Path) -> None:
    over = ("--over", "load.mass=0.2:0.3:2", "--over", "allocation.kind=sqp,ring")
    done = colift(
        "sweep", "hover", *over, *SHORT, "--seeds", "2", "--out", "s", "--json", folder=tmp_path
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["flown"] == 8
    assert [point["values"] for point in result["points"]] == [
        {"load.mass": mass, "allocation.kind": kind}
        for mass in (0.2, 0.3)
        for kind in ("sqp", "ring")
    ]
    for point in result["points"]:
        assert point["flights"] == point["held"] == 2
        assert point["fates"] == {"held": 2}
        assert point["interval"] == pytest.approx([0.1581, 1.0], abs=1e-4)
        for numbers in point["metrics"].values():
            assert numbers["min"] <= numbers["mean"] <= numbers["max"]
    light, heavy = (result["points"][k]["metrics"]["mean_total_tension_N"]["mean"] for k in (0, 2))
    assert heavy > 1.2 * light
    assert Images((tmp_path / "s/report.html").read_text()).figures == 1

    told = colift("results", "s/campaign.sqlite", "--csv", "s.csv", folder=tmp_path)
    assert told.stdout == "s/campaign.sqlite: 8 flown\n"
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 9


@pytest.mark.slow
def test_a_sweep_shows_what_cannot_be_flown_and_judges_the_rest(tmp_path: Path) -> None:
    """A negative load is refused, one of 4 kg cannot be held by these drones' criteria, the others fly on."""
    arguments = ("sweep", "hover", "--over", "load.mass=-1,0.2", *SHORT, "--out", "s")
    tight = (*arguments, "--set", "criteria.min_angle_deg.min=80")
    done = colift(*arguments, "--json", "--csv", "s.csv", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 flights cannot be set up and are left out:" in done.stderr
    assert "load.mass: must be greater than 0" in done.stderr
    first, second = json.loads(done.stdout)["points"]
    assert (first["fates"], second["fates"]) == ({"refused": 1}, {"held": 1})
    assert "load.mass: must be greater than 0" in first["reasons"][0]
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["status"], row["level"]) for row in rows] == [("refused", ""), ("flown", "pass")]
    assert colift(*arguments, "--strict", folder=tmp_path).returncode == 1  # one was refused

    judged = ("sweep", "hover", "--over", "load.mass=0.2", *tight[4:])
    done = colift(*judged, "--strict", folder=tmp_path)
    assert done.returncode == 4
    words = " ".join(done.stdout.split())
    assert "missed" in words
    assert "load.mass 0.2: 1 missed: min_angle_deg is " in words
    assert colift(*judged, folder=tmp_path).returncode == 0


@pytest.mark.slow
def test_a_comparison_outlives_a_side_study_that_cannot_be_set_up_and_a_field_that_holds_nothing(
    tmp_path: Path,
) -> None:
    chosen = ("compare", "--allocators", "safe,ring", "--missions", "hover", "--seeds", "1", *SHORT)
    nobody = (*chosen, "--set", "criteria.min_angle_deg.min=89", "--out", "n", "--json")
    done = colift(*nobody, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert all((c["held"], c["missed"]) == (0, 1) for c in told["allocators"].values())
    assert told["words"][0].startswith("0 of 2 flights were held to the end within every criterion")
    assert "No flight was held." in (tmp_path / "n/report.html").read_text()
    assert colift(*nobody, "--strict", folder=tmp_path).returncode == 4

    # A spread that goes past what the mission's own team can do is left out, and said.
    part = tmp_path / "picky.py"
    part.write_text(
        EXAMPLE.read_text()
        + """
    spread_setting = ("size", (0.1, 2.0))
    size: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
"""
    )
    done = colift(*chosen, "--with", "picky.py", "--out", "p", "--json", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 flights cannot be set up and are left out:" in done.stderr
    assert "value 2.0] allocation.size: must be less than 1" in done.stderr
    assert json.loads(done.stdout)["allocators"]["picky"]["flights"] == 1
    assert "1 flights could not be set up" in (tmp_path / "p/report.html").read_text()


def test_ctrl_c_ends_a_campaign_and_says_how_to_go_on(tmp_path: Path) -> None:
    words = ["sweep", "hover", "--over", "load.mass=0.1:0.3:200", "--workers", "1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "colift", *words], cwd=tmp_path, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 240.0

    def kept() -> int:
        for file in tmp_path.glob("runs/*/campaign.sqlite"):
            with Store(file) as store:
                return len(store.finished())
        return 0

    while kept() < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to the workers as well
    _, said = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert "Traceback" not in said
    (folder,) = tmp_path.glob("runs/*")
    line = next(line for line in said.splitlines() if line.startswith("  colift"))
    assert line.split()[1:] == [*words, "--out", f"runs/{folder.name}"]
    assert f"interrupted: {kept()} of 200 flights are kept" in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("compare", "--allocators", "sqq"), "did you mean 'sqp'"),
        (("compare", "--missions", "hovr"), "did you mean 'hover'"),
        (("compare", "--set", "allocation.kind=sqp"), "allocation.kind is what compare varies"),
        (
            ("compare", "--allocators", "ring", "--set", "allocation.mu=1"),
            "allocation.mu: unknown key",
        ),
        (("compare", "--with", "nowhere.py"), "not a Python file"),
        (("sweep", "hover", "--over", "load.mass=-2:-1:2"), "load.mass: must be greater than 0"),
        (("sweep", "hover", "--over", "load.mas=1:2:2"), "did you mean 'mass'"),
        (("sweep", "hover"), "Missing option"),
        (("sweep", "hover", "--over", "seed=1,2"), "--first-seed"),
        (("results", "nowhere.sqlite"), "no such file"),
    ],
)
def test_a_mistake_is_named_and_nothing_is_written(
    tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    done = colift(*arguments, folder=tmp_path)
    assert done.returncode in (1, 2)
    assert says in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []
