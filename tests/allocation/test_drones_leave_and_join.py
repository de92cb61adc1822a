"""An allocator called by hand goes on when a drone leaves or joins, and when the time between calls varies."""

from __future__ import annotations

import math

import numpy as np
import pytest

import colift
from colift.control.allocation.base import Allocator
from colift.errors import SettingError
from colift.flight.flight import Flight, start_state
from colift.part import find
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring, widest_gap

FORCE = np.array([0.2, 0.1, 2.2])
KINDS = ("safe", "sqp", "min-norm", "internal-force", "ring")


def fly(kind: str, **overrides):
    """A spiral in which drone 1 of four leaves at 0.5 s and comes back at 1 s, every cycle recorded."""
    step = 0.002
    table = {
        "name": "test",
        "reference": {"kind": "spiral", "ramp": 1.0},
        "allocation": {"kind": kind},
        "timing": {
            "duration": 1.5, "step": step, "allocation": 5 * step, "recording": step,
            "load_control": step, "position_control": step, "attitude_control": step,
        },
        "events": [
            {"at": 0.5, "field": "drones.lose", "value": 1},
            {"at": 1.0, "field": "drones.join", "value": 1},
        ],
    }  # fmt: skip
    mission = colift.load_mission(table, overrides)
    return mission, Flight(mission).run()


@pytest.mark.parametrize("kind", KINDS)
def test_answers_are_those_of_the_flight(kind):
    mission, flight = fly(kind)
    start, _ = start_state(mission)
    every = mission.timing.multiples()["allocation"]
    allocator = Allocator(mission.allocation, mission.team, dt=mission.timing.allocation)
    allocator.reset(directions=start.directions)
    for row in range(0, len(flight.time), every):
        time = flight.time[row]
        if time == pytest.approx(0.5):
            allocator.lose(1)
            assert allocator.drones == (0, 2, 3)
        if time == pytest.approx(1.0):
            cone = mission.start_cone
            gap = widest_gap(flight["directions"][row - 1][[0, 2, 3]], cone)
            assert allocator.join(direction=gap) == 1
            assert allocator.drones == (0, 1, 2, 3)
        answer = allocator.allocate(flight["force"][row], flight["reference"][row, 2])
        carry = list(allocator.drones)
        # To rounding: by hand, the start's and a gap's directions are normalised once more.
        for found, signal in (
            (answer.tensions, "desired_tensions"),
            (answer.directions, "desired_directions"),
        ):
            np.testing.assert_allclose(found, flight[signal][row, carry], rtol=0.0, atol=1e-9)
        assert answer.status == flight["allocator_status"][row // every]


def within_limits(answer, n: int, least: float, low: float, high: float, cone: float) -> None:
    assert answer.tensions.shape == (n,)
    assert np.degrees(pairwise_angles(answer.directions)).min() >= least - 1e-6
    assert (answer.tensions >= low - 1e-9).all()
    assert (answer.tensions <= high + 1e-9).all()
    assert (-answer.directions[:, 2] >= math.cos(math.radians(cone)) - 1e-9).all()


@pytest.mark.parametrize("n", [4, 5, 6, 9])
def test_limits_hold_through_every_change(n):
    least = {4: 40.0, 5: 35.0, 6: 30.0, 9: 25.0}[n]
    allocator = colift.SafeAllocator(n, min_angle_deg=least, tension_max=3.0, max_cone_deg=70.0)
    before = allocator.allocate(FORCE)
    rng = np.random.default_rng(n)
    for _ in range(12):
        if allocator.n > 3 and (allocator.n == n or rng.random() < 0.5):
            allocator.lose(int(rng.choice(allocator.drones)))
        else:
            allocator.join()
        for _ in range(60):
            answer = allocator.allocate(FORCE)
            within_limits(answer, allocator.n, least, 0.05, 3.0, 70.0)
        # The force may give way while cables turn to their new places, not for long.
        np.testing.assert_allclose(answer.tensions @ answer.directions, -FORCE, atol=1e-8)
    assert before.status.ok


def test_who_stays_keeps_its_place():
    """One control period turns a cable by at most max_rate dt: a cold start would jump."""
    allocator = colift.SafeAllocator(5, max_rate=2.0, dt=0.01)
    for _ in range(50):
        before = allocator.allocate(FORCE)
    allocator.lose(3)
    after = allocator.allocate(FORCE)
    turned = np.arccos(
        np.sum(before.directions[[0, 1, 2, 4]] * after.directions, axis=1).clip(-1, 1)
    )
    assert turned.max() <= 0.02 + 1e-9
    allocator.join(3)
    again = allocator.allocate(FORCE)
    turned = np.arccos(
        np.sum(again.directions[[0, 1, 2, 4]] * after.directions, axis=1).clip(-1, 1)
    )
    assert turned.max() <= 0.02 + 1e-9
    np.testing.assert_allclose(again.tensions @ again.directions, -FORCE, atol=1e-9)


def test_values_per_cable_go_with_their_drone():
    allocator = colift.SafeAllocator(
        4, tension_max=[0.6, 0.9, 1.2, 1.5], weights=[1.0, 2.0, 3.0, 4.0]
    )
    allocator.lose(0)
    for _ in range(200):
        answer = allocator.allocate([0.0, 0.0, 2.2])
    assert (answer.tensions <= [0.9, 1.2, 1.5]).all()
    assert answer.tensions[0] > answer.tensions[2]  # the cheapest carries most
    settled = colift.SafeAllocator(3, tension_max=[0.9, 1.2, 1.5], weights=[2.0, 3.0, 4.0])
    settled.reset(answer.directions, answer.tensions)
    assert settled.allocate([0.0, 0.0, 2.2]).objective == pytest.approx(answer.objective, rel=1e-6)
    allocator.update(
        tension_max=[0.6, 0.8, 1.2, 1.5]
    )  # one value for each of the team, who flies or not
    for _ in range(200):
        answer = allocator.allocate([0.0, 0.0, 2.2])
    assert (answer.tensions <= [0.8, 1.2, 1.5]).all()


def test_a_cable_joins_where_it_is_said():
    allocator = colift.SafeAllocator(4)
    allocator.lose(2)
    allocator.join(2, direction=[0.3, 0.2, -2.0])
    wanted = np.array([0.3, 0.2, -2.0]) / np.linalg.norm([0.3, 0.2, -2.0])
    np.testing.assert_allclose(allocator._directions[2], wanted, atol=1e-15)


def test_the_team_shrinks_for_those_who_ask():
    team = Team(0.3, np.array([0.4, 0.5, 0.6]), np.full((3, 3), 0.01), np.array([1.0, 2.0, 3.0]))
    allocator = Allocator(find("allocation", "ring")(), team)
    allocator.lose(1)
    assert allocator.n == 2
    assert allocator.team.masses.tolist() == [0.4, 0.6]
    assert allocator.team.cable_lengths.tolist() == [1.0, 3.0]
    allocator.reset(ring(2, 0.5))
    allocator.lose(0)
    assert allocator.drones == (2,)


def test_who_cannot_leave_or_join_is_refused_and_nothing_changes():
    allocator = colift.SafeAllocator(3)
    allocator.lose(1)
    before = allocator.drones, allocator._tensions.tobytes(), allocator._memory.tobytes()
    for call, message in [
        (lambda: allocator.lose(1), r"drone: must be one of those that carry: 0, 2 \(found 1\)"),
        (lambda: allocator.lose(7), r"drone: .*found 7"),
        (
            lambda: allocator.join(0),
            r"drone: must be one of those that do not carry: 1 \(found 0\)",
        ),
        (lambda: allocator.join(3), r"drone: .*found 3"),
        (lambda: allocator.join(1, [0.0, 0.0]), r"direction: must have shape \(3,\)"),
        (lambda: allocator.join(1, [0.0, 0.0, 0.0]), r"direction: .*not zero"),
    ]:
        with pytest.raises(SettingError, match=message):
            call()
        assert before == (
            allocator.drones, allocator._tensions.tobytes(), allocator._memory.tobytes()
        )  # fmt: skip
    allocator.join()
    with pytest.raises(SettingError, match="do not carry: none"):
        allocator.join()
    allocator.lose(0)
    allocator.lose(1)
    with pytest.raises(SettingError, match="the last one"):
        allocator.lose(2)


def test_the_time_since_the_last_call_limits_the_turn():
    rate = 3.0
    allocator = colift.SafeAllocator(4, max_rate=rate)
    before = allocator.allocate(FORCE).directions
    rng = np.random.default_rng(0)
    most = 0.0
    for dt in rng.uniform(0.002, 0.05, 60):
        force = FORCE + rng.normal(0.0, 0.6, 3)
        after = allocator.allocate(force, dt=dt).directions
        turned = np.arccos(np.sum(before * after, axis=1).clip(-1.0, 1.0)).max()
        assert turned <= rate * dt * (1.0 + 1e-6)
        most = max(most, turned / (rate * dt))
        before = after
    assert most > 0.5  # the limit was at work


def test_a_time_given_equals_that_of_the_constructor():
    one, other = colift.SafeAllocator(4, dt=0.02), colift.SafeAllocator(4, dt=0.5)
    for k in range(20):
        force = FORCE + [0.1 * math.sin(k), 0.0, 0.05 * k]
        np.testing.assert_array_equal(
            one.allocate(force).directions, other.allocate(force, dt=0.02).directions
        )


@pytest.mark.parametrize("dt", [0.0, -0.01, math.nan, -math.inf])
def test_a_time_that_is_none_lets_nothing_turn(dt):
    allocator = colift.SafeAllocator(4)
    before = allocator.allocate(FORCE).directions
    answer = allocator.allocate([1.0, -0.5, 2.0], dt=dt)
    assert np.isfinite(answer.tensions).all()
    assert np.abs(answer.directions - before).max() < 1e-5
    assert np.isfinite(allocator.allocate(FORCE, dt=math.inf).directions).all()
