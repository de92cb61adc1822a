"""`colift compare`, `sweep` and `results` from the command line."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "my_allocator.py"
SHORT = ("--set", "timing.duration=0.3")


def colift(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "colift", *arguments],
        capture_output=True, text=True, check=False, cwd=folder, timeout=300,
    )  # fmt: skip


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
        assert point["flights"] == point["completed"] == 2
        for numbers in point["metrics"].values():
            assert numbers["min"] <= numbers["mean"] <= numbers["max"]
    light, heavy = (result["points"][k]["metrics"]["mean_total_tension_N"]["mean"] for k in (0, 2))
    assert heavy > 1.2 * light
    assert Images((tmp_path / "s/report.html").read_text()).figures == 1

    told = colift("results", "s/campaign.sqlite", "--csv", "s.csv", folder=tmp_path)
    assert told.stdout == "s/campaign.sqlite: 8 flown\n"
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 9


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
        (("sweep", "hover", "--over", "load.mass=-1:1:2"), "load.mass: must be greater than 0"),
        (("sweep", "hover", "--over", "load.mas=1:2:2"), "did you mean 'mass'"),
        (("sweep", "hover"), "Missing option"),
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
