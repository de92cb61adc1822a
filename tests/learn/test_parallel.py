"""One agent a drone: PettingZoo's own tests, and the same flight as the team's."""

import numpy as np
import pytest

pytest.importorskip("pettingzoo")
from pettingzoo.test import parallel_api_test, parallel_seed_test

from colift.learn import DronesEnv, TeamEnv


def drones(**options):
    return DronesEnv("Hover", worlds=2, level="motors", **options)


@pytest.mark.filterwarnings("error")
def test_pettingzoo_has_nothing_to_say_against_it():
    parallel_api_test(drones(drones=3), num_cycles=300)


def test_a_seed_repeats_an_episode():
    parallel_seed_test(drones, num_cycles=40)


def test_drones_fly_as_their_team_does():
    env, team = drones(), TeamEnv("Hover", worlds=2, level="motors", observation="drone")
    seen, _ = env.reset(seed=3)
    all_seen, _ = team.reset(seed=3)
    rng = np.random.default_rng(0)
    while env.agents:
        assert np.array_equal([*seen.values()], all_seen)
        assert np.array_equal(env.state(), all_seen.ravel())
        action = rng.uniform(-1.0, 1.0, (4, 4))
        seen, rewards, over, late, told = env.step(dict(zip(env.agents, action, strict=True)))
        all_seen, reward, all_over, all_late, _ = team.step(action)
        assert {*rewards.values()} == {reward}
        assert {*over.values()} == {all_over}
        assert {*late.values()} == {all_late}
    assert all_over
    assert {info["end"] for info in told.values()} <= {"far", "touched", "below"}
