"""The example of a learned allocator: decides as the environment taught it, and whatever it is given."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import colift
from colift.control.allocation.base import Status
from colift.learn.kernels import SPAN as TAUGHT
from colift.learn.kernels import Eyes, command
from colift.learn.levels import LEVELS
from colift.learn.numbers import NUMBERS
from colift.learn.worlds import Setting, room_of
from colift.part import load_file
from terminal import colift as run

EXAMPLES = Path(__file__).parents[2] / "examples"


def module_of(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def part():
    (found,) = load_file(EXAMPLES / "learned.py")
    return found


@pytest.fixture
def policy(tmp_path):
    """A file with gains and bias."""

    def write(gains, bias):
        np.savez(tmp_path / "policy.npz", gains=gains, bias=bias)
        return str(tmp_path / "policy.npz")

    return write


def test_it_answers_what_the_environment_would_have_done(part, policy):
    rng = np.random.default_rng(4)
    gains, bias = rng.normal(0.0, 1.0, (3, 9)), rng.normal(0.0, 0.3, 3)
    setting = Setting.of("Hover", level="cables", observation="part")
    mission = setting.mission(1)
    flight, _ = room_of(mission)
    numbers, team = setting.numbers(mission), mission.team
    eyes = Eyes(*(getattr(flight.bus, name) for name in Eyes._fields))
    force, motion = np.array([0.3, -0.2, 2.6]), rng.normal(0.0, 2.0, (4, 3))
    learned = part(file=policy(gains, bias))
    writes, status = learned.call(
        team, learned.memory(team), force=force, reference=motion,
        desired_directions=mission.start_directions().copy(),
    )  # fmt: skip
    weight = team.load_mass * team.gravity
    pulls = NUMBERS.view(numbers, "pull")
    seen = [
        [*(force / weight - [0, 0, 1]), *(motion[2] / team.gravity), *row]
        for row in 4 * pulls / weight
    ]
    actions = np.clip(np.array(seen) @ gains.T + bias, -1.0, 1.0)
    assert (np.abs(actions) < 1.0).any()
    command(LEVELS["cables"].number, actions.ravel(), numbers, eyes)
    assert status == Status.CONVERGED
    assert np.allclose(writes.desired_tensions, flight.bus.desired_tensions, rtol=1e-9)
    assert np.allclose(writes.desired_directions, flight.bus.desired_directions, atol=1e-9)
    missing = writes.desired_tensions @ writes.desired_directions + force
    assert writes.allocator_info[4] == pytest.approx(np.linalg.norm(missing))


def test_the_part_says_what_an_action_spans():
    assert module_of("learned").SPAN == TAUGHT


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200, -1e308])
def test_nothing_makes_it_write_what_is_no_number(part, policy, bad):
    team = colift.Team.uniform(3)
    learned = part(file=policy(np.full((3, 9), 1e300), np.full(3, -1e300)))
    for given in ({"force": [0.0, bad, 0.0]}, {"reference": np.full((4, 3), bad)}):
        writes, status = learned.call(
            team, learned.memory(team), **{"force": [0.0, 0.0, 2.0], **given}
        )
        assert np.isfinite(writes.desired_tensions).all()
        assert np.isfinite(writes.desired_directions).all()
        if "force" in given:
            assert status == Status.INVALID_FORCE


@pytest.mark.parametrize(
    ("name", "told"),
    [("nowhere.npz", "is no policy"), ("shape.npz", "gains must be"), ("nan.npz", "bias must be")],
)
def test_a_file_that_is_no_policy_is_refused_by_name(part, tmp_path, name, told):
    np.savez(tmp_path / "shape.npz", gains=np.zeros((2, 9)), bias=np.zeros(3))
    np.savez(tmp_path / "nan.npz", gains=np.zeros((3, 9)), bias=np.array([0.0, np.nan, 0.0]))
    path = str(tmp_path / name)
    with pytest.raises(colift.MissionError, match=rf"allocation.file.*{name}.*{told}"):
        colift.load_mission("hover", {"allocation": {"kind": "learned", "file": path}})


def test_what_was_learned_holds_a_hover():
    part = str(EXAMPLES / "learned.py")
    done = run(
        "run", "hover", "--with", part, "--set", "allocation.kind=learned", "--no-report", "--json"
    )
    assert done.returncode == 0, done.stderr


def test_it_answers_on_when_a_drone_is_lost(part):
    recording = colift.run("four-to-three", allocator="learned").recording
    assert recording.outcome == "completed"
    assert set(recording["allocator_status"]) == {Status.CONVERGED}
    left = recording["desired_tensions"][-1]
    assert np.isfinite(left).sum() == 3


def test_learning_begins_with_a_policy_that_is_worse():
    pytest.importorskip("cma")
    pytest.importorskip("gymnasium")
    example = module_of("learn_hover")
    example.POLICIES, example.EACH = 6, 2
    _, curve = example.learn(10, told=str)
    (first, before, _), (last, after, _) = curve
    assert (first, last) == (0, 120)
    assert after > before
