"""What networks do to messages."""

from __future__ import annotations

import numpy as np
import pytest

from colift.team import Team
from colift.world.network.radio import Radio

TEAM = Team.uniform(3)
DT = 0.01


def carried(radio: Radio, cycles: int, key: int = 3, dt: float = DT):
    """Whether each message was heard, (cycles, 3, 3), and in which cycle it was said."""
    memory = radio.memory(TEAM)
    outboxes = np.zeros((3, 30), np.uint8)
    heard, said = np.zeros((cycles, 3, 3)), np.zeros((cycles, 3, 3), int)
    for cycle in range(cycles):
        writes, _ = radio.call(
            TEAM, memory, step=cycle, dt=dt, key=key, outboxes=outboxes, members=[0.0, 1.0, 2.0]
        )
        heard[cycle] = writes.heard
        said[cycle] = writes.inboxes[:, :, 0] + 256 * writes.inboxes[:, :, 1].astype(int)
        outboxes[:, 0], outboxes[:, 1] = cycle & 255, cycle >> 8
    return heard, said


def test_all_is_heard_one_cycle_later_where_nothing_is_lost_or_late():
    heard, said = carried(Radio(delay=0.0, jitter=0.0, loss=0.0), 50)
    assert (heard[0] == 0.0).all()
    assert (heard[1:] == 1.0 - np.eye(3)).all()
    assert (said[1:, 0, 1] == np.arange(49)).all()


@pytest.mark.parametrize("burst", [0.0, 0.2])
def test_the_share_that_is_lost_is_that_of_the_setting(burst):
    heard, _ = carried(Radio(delay=0.0, jitter=0.0, loss=[0.0, 0.3, 1.0], burst=burst), 8000)
    shares = heard[1:].mean(axis=0)
    assert shares[0, 1] == shares[0, 2] == 1.0
    assert shares[2].sum() == 0.0
    width = 4.0 * np.sqrt(0.21 / (8000.0 if burst == 0.0 else 8000.0 / 20.0))
    assert abs(shares[1, 0] - 0.7) < width
    lost = heard[1:, 1, 0] == 0.0
    runs = np.diff(np.flatnonzero(np.diff(np.r_[0, lost, 0]))).reshape(-1)[::2]
    assert (runs.mean() > 10.0) == (burst > 0.0)


def test_messages_take_as_long_as_they_may_and_overtake_each_other():
    heard, said = carried(Radio(delay=0.02, jitter=0.03, loss=0.0), 3000)
    when, _, _ = np.nonzero(heard)
    late = when - said[heard > 0.0]
    assert {*late.tolist()} == {3, 4, 5}  # more than 20 ms, at most 50
    assert (np.diff(said[heard[:, 0, 1] > 0.0, 0, 1]) < 0).any()


def test_cycles_shorter_than_a_millisecond_hear_a_message_each_millisecond_as_late_as_it_may_be():
    heard, said = carried(Radio(delay=0.02, jitter=0.003, loss=0.0), 2000, dt=0.00025)
    when, _, _ = np.nonzero(heard)
    late = when - said[heard > 0.0]
    assert late.min() == 81  # more than 20 ms, at most 23
    assert late.max() == 92
    assert (said[heard > 0.0] % 4 == 0).all()
    assert 0.2 < heard[100:, 0, 1].mean() <= 0.25


def test_those_that_are_cut_off_hear_each_other_only():
    radio = Radio(delay=0.0, jitter=0.0, loss=0.0, split=(0, 1), split_at=0.5, split_for=0.5)
    heard, _ = carried(radio, 150)
    assert heard[60, 0, 1] == heard[60, 1, 0] == 1.0
    assert heard[60, 0, 2] == heard[60, 2, 0] == heard[60, 2, 1] == 0.0
    assert heard[40, 0, 2] == heard[110, 0, 2] == 1.0


def test_the_same_key_loses_the_same_messages():
    radio = Radio(loss=0.5)
    np.testing.assert_array_equal(carried(radio, 200)[0], carried(radio, 200)[0])
    assert (carried(radio, 200)[0] != carried(radio, 200, key=4)[0]).any()


def test_a_split_of_drones_that_are_not_there_is_refused():
    assert Radio(split=(3,)).check(TEAM)
    assert not Radio(split=(2,)).check(TEAM)
