"""What names a run, and what is found before anything is flown."""

from __future__ import annotations

from pathlib import Path

import pytest

from colift.errors import ColiftError, MissionError
from colift.mission.load import load_mission
from colift.study.campaign import plan as module
from colift.study.campaign.plan import HEADING, OFFSET, Case, Source, plan, problems, sift, varied


def key(overrides: dict[str, object], sources: tuple[Source, ...] = ()) -> str:
    ((_, job),) = plan([Case({}, "hover", overrides)], sources)
    return job.key


def test_the_key_is_that_of_the_resolved_mission_however_it_is_written() -> None:
    plain = key({})
    assert len(plain) == 64
    assert key({"allocation.mu": 0.15}) == plain  # the default, spelled out
    assert key({"load": {"mass": 0.3}, "seed": 2}) == key({"seed": 2, "load.mass": 0.3})


@pytest.mark.parametrize(
    "change", [{"seed": 1}, {"load.mass": 0.3}, {"allocation.kind": "sqp"}, {"name": "other"}]
)
def test_whatever_is_changed_changes_the_key(change: dict[str, object]) -> None:
    assert key(change) != key({})


def test_other_code_is_another_run(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key({})
    monkeypatch.setattr(module, "code_digest", lambda: "another")
    assert key({}) != before


def test_a_part_of_ones_own_is_part_of_the_key_of_its_own_runs_only(tmp_path: Path) -> None:
    text = Path(__file__).parents[2].joinpath("examples/my_allocator.py").read_text()
    keys = []
    for comment in ("", "# changed\n"):
        path = tmp_path / "contestant.py"
        path.write_text(text + comment)
        source = Source.read(path)
        keys.append((key({"allocation.kind": "contestant"}, (source,)), key({}, (source,))))
    assert keys[0][0] != keys[1][0]
    assert keys[0][1] == keys[1][1] == key({})


def test_a_file_that_is_not_there_is_loaded_from_the_text_that_travelled(tmp_path: Path) -> None:
    path = tmp_path / "traveller.py"
    path.write_text((Path(__file__).parents[2] / "examples/my_allocator.py").read_text())
    source = Source.read(path)
    path.unlink()
    (part,) = source.load()
    assert part.layer == "allocation"
    assert key({"allocation.kind": "traveller"}, (source,))
    assert source.load() == [part]  # once a process


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ColiftError, match=r"nowhere\.py: not a Python file"):
        Source.read(tmp_path / "nowhere.py")


def test_every_mistake_is_named_once_with_the_first_case_that_has_it() -> None:
    cases = [Case({"seed": s}, "hover", {"load.mass": -1, "seed": s}) for s in range(3)]
    cases.append(Case({"seed": 9}, "hover", {"load.mas": 1}))
    with pytest.raises(MissionError) as caught:
        plan(cases)
    first, second = map(str, caught.value.problems)
    assert first.startswith("[seed 0 and 2 more] load.mass: must be greater than 0")
    assert second.startswith("[seed 9] load.mas: unknown key")


def test_what_cannot_be_flown_is_sifted_out_unless_nothing_else_is_left() -> None:
    cases = [Case({"mass": m}, "hover", {"load.mass": m}) for m in (-1, 0.2, 0.3, -2)]
    planned, refused = sift(cases)
    assert [labels["mass"] for labels, _ in planned] == [0.2, 0.3]
    assert [each.row["mass"] for each in refused] == [-1, -2]
    assert all(each.row["status"] == "refused" for each in refused)
    assert "load.mass: must be greater than 0" in refused[0].row["error"]
    assert [str(problem).partition(" load")[0] for problem in problems(refused)] == [
        "[mass -1]",
        "[mass -2]",
    ]
    with pytest.raises(MissionError, match="nothing was flown"):
        sift([cases[0], cases[3]])
    with pytest.raises(MissionError):
        plan(cases)


def test_seed_zero_flies_the_mission_and_others_start_a_little_off() -> None:
    nominal = load_mission("hover")
    assert varied(nominal, 0) == nominal
    starts = set()
    for seed in range(1, 30):
        changed = varied(nominal, seed)
        assert changed == varied(nominal, seed)  # repeatable
        assert changed == load_mission(changed.resolved())
        assert changed.seed == seed
        off = [
            a - b for a, b in zip(changed.start.load_offset, nominal.start.load_offset, strict=True)
        ]
        assert max(map(abs, off)) <= OFFSET
        assert abs(changed.start.heading_deg - nominal.start.heading_deg) <= HEADING
        starts.add(changed.start.heading_deg)
        assert changed.model_copy(update={"start": nominal.start, "seed": 0}) == nominal
    assert len(starts) == 29
