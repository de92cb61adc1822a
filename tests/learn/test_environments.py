"""One team and many are the same flight, and environments keep Gymnasium's contract."""

import numpy as np
import pytest

from colift.errors import ColiftError, MissionError, UnknownNameError
from colift.learn.kernels import SPAN
from colift.learn.levels import LEVELS
from colift.learn.numbers import NUMBERS
from colift.learn.tasks import ENDS, TASKS

gymnasium = pytest.importorskip("gymnasium")

CHOICES = [
    ("cables", "part"),
    ("cables", "central"),
    ("forces", "drone"),
    ("motors", "central"),
]
LOADS = ["point", "rigid"]


def one(task="Hover", **options):
    from colift.learn import TeamEnv

    return TeamEnv(task, worlds=3, **options)


def many(count, task="Hover", **options):
    from colift.learn import TeamVectorEnv

    return TeamVectorEnv(task, count, worlds=3, **options)


def random_actions(env, steps):
    shape = (steps, *env.action_space.shape)
    return np.random.default_rng(1).uniform(-1.0, 1.0, shape).astype(np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_gymnasium_has_nothing_to_say_against_any_task(task):
    from gymnasium.utils.env_checker import check_env

    import colift.learn  # noqa: F401

    env = gymnasium.make(f"colift/{task}-v0", worlds=2)
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize(("level", "observation"), CHOICES)
def test_many_teams_are_the_same_as_each_alone_bit_for_bit(level, observation, load):
    options = {"level": level, "observation": observation, "load": load}
    options["changes"] = {"timing.duration": 0.5}
    count, steps = 5, 120
    teams = many(count, threads=2, **options)
    begun, _ = teams.reset(seed=7)
    actions = random_actions(teams, steps)
    told = [teams.step(action) for action in actions]
    alone = one(**options)
    ends = 0
    for i in range(count):
        seen, _ = alone.reset(seed=7 + i)
        assert np.array_equal(seen, begun[i])
        for action, (all_seen, reward, over, late, info) in zip(actions, told, strict=True):
            seen, own_reward, own_over, own_late, _ = alone.step(action[i])
            assert (own_reward, own_over, own_late) == (reward[i], over[i], late[i])
            if own_over or own_late:
                assert info["_final_obs"][i]
                assert np.array_equal(seen, info["final_obs"][i])
                seen, _ = alone.reset()
                ends += 1
            assert np.array_equal(seen, all_seen[i])
    assert ends >= count


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("level", LEVELS)
def test_an_episode_is_a_flight_bit_for_bit(level, load):
    env = one(level=level, load=load, changes={"sensing.kind": "noisy"})
    env.reset(seed=2)
    for action in random_actions(env, 12):
        env.step(0.3 * action)
    recording = env.replay()
    ((room, _),) = env._teams._rooms
    for name in ("load", "positions", "estimated_load", "thrusts", "torques"):
        # What the last physics step saw, which is when the last row was recorded.
        assert np.array_equal(recording.arrays[name][-1], getattr(room.eyes, name)), name


@pytest.mark.parametrize("task", [task for task in TASKS if task != "Hover"])
def test_every_task_is_a_flight_bit_for_bit(task):
    soon = {"fault.0.at": (0.043, 0.077)} if task == "LoseOne" else {}
    env = one(task, level="cables", ranges=soon)
    env.reset(seed=3)
    for _ in range(20):
        env.step(np.zeros(env.action_space.shape))
    recording = env.replay()
    ((room, _),) = env._teams._rooms
    for name in ("load", "positions", "estimated_load", "attached"):
        assert np.array_equal(recording.arrays[name][-1], getattr(room.eyes, name)), name
    cut = recording.arrays["attached"].min(axis=1)
    if task == "LoseOne":
        fault = env.setting.mission(env.world).fault[0].at
        assert recording.time[np.argmax(cut < 1.0)] == pytest.approx(fault, abs=0.01)
    else:
        assert cut.all()


def evened(teams, seen, narrower):
    """Each cable its share of the wanted force, beside the formation of the start, made narrower."""
    found = []
    for world, row in zip(teams.teams.world, seen, strict=True):
        if world not in KNOWN:
            KNOWN[world] = teams.setting.world(int(world)).numbers
        numbers = KNOWN[world]
        pulls, n = NUMBERS.view(numbers, "pull"), teams.setting.drones
        share = numbers[NUMBERS.at.weight] / n
        more = share * row[:, :3] - narrower * pulls * [1.0, 1.0, 0.0]
        found.append(more / (SPAN * share))
    return np.array(found)


KNOWN = {}


@pytest.mark.parametrize(("narrower", "passes"), [(0.0, False), (0.5, True)])
def test_the_window_is_passed_by_a_narrow_formation_only(narrower, passes):
    KNOWN.clear()
    teams = many(4, "Window", level="cables", observation="part", threads=1)
    seen, _ = teams.reset(seed=5)
    ends = []
    for _ in range(700):
        seen, _, over, late, info = teams.step(evened(teams, seen, narrower))
        done = np.flatnonzero(over | late)
        ends += [ENDS[int(info["end"][i])][0] if over[i] else "late" for i in done]
    first = ends[:4]
    assert first == ["late"] * 4 if passes else "touched" in first


def test_threads_change_no_number():
    found = []
    for threads in (1, 2, 3):
        teams = many(7, threads=threads, changes={"timing.duration": 0.3})
        teams.reset(seed=1)
        found.append([teams.step(action)[:2] for action in random_actions(teams, 60)])
    for (seen, reward), *others in zip(*found, strict=True):
        for other_seen, other_reward in others:
            assert np.array_equal(seen, other_seen)
            assert np.array_equal(reward, other_reward)


def test_a_seed_repeats_its_episodes_and_another_does_not():
    env = one()
    actions = random_actions(env, 5)

    def flown(seed):
        env.reset(seed=seed)
        first = [env.step(action)[0] for action in actions]
        env.reset()
        return np.array([*first, *(env.step(action)[0] for action in actions)])

    assert np.array_equal(flown(4), flown(4))
    assert any(not np.array_equal(flown(4), flown(seed)) for seed in (5, 6, 7))


def test_worlds_differ_in_what_is_drawn_and_are_missions():
    setting = one().setting
    masses = [setting.mission(number).truth.load_mass_factor for number in range(3)]
    assert len({*masses}) == 3
    assert all(0.9 <= mass <= 1.1 for mass in masses)
    assert setting.world(1).numbers.tolist() == setting.world(1).numbers.tolist()
    wide = one(ranges={"truth.load_mass_factor": (2.0, 2.5)}).setting
    assert 2.0 <= wide.mission(0).truth.load_mass_factor <= 2.5


@pytest.mark.parametrize("action", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("level", LEVELS)
def test_no_action_makes_an_observation_that_is_not_finite(level, action):
    teams = many(2, level=level, threads=1)
    teams.reset(seed=0)
    for _ in range(300):
        seen, reward, *_ = teams.step(np.full(teams.action_space.shape, action))
        assert np.isfinite(seen).all()
        assert (np.abs(reward) < 20.0).all()
        assert teams.observation_space.contains(seen)


def test_what_cannot_be_flown_ends_and_says_why():
    env = one(level="motors")
    env.reset(seed=0)
    for _ in range(200):
        *_, over, late, info = env.step(np.full(env.action_space.shape, -1.0))
        if over:
            break
    assert over
    assert not late
    assert info["end"] in {name for name, _ in ENDS.values()}
    with pytest.raises(ColiftError, match="reset first"):
        env.step(env.action_space.sample())


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"level": "wheels"}, "level"),
        ({"load": "liquid"}, "load"),
        ({"observation": "part", "level": "motors"}, "observation"),
        ({"observation": "part", "level": "wheels"}, "level"),
        ({"drones": 0}, "drones"),
        ({"period": 0.0103}, "period"),
        ({"changes": {"timing.step": "soon"}}, "timing.step"),
        ({"changes": {"detection.kind": "residuals"}}, "detection.kind"),
        ({"changes": {"events": [{"at": 1.0, "field": "load.mass", "value": 1.0}]}}, "events"),
    ],
)
def test_wrong_options_are_refused_by_name(options, told):
    with pytest.raises(MissionError, match=told):
        one(**options)
    with pytest.raises(UnknownNameError, match="Fly"):
        one("Fly")


def test_motors_of_drones_with_more_than_four_stand_where_the_mixer_has_them():
    from colift.learn.worlds import Setting

    setting = Setting.of("Hover", level="motors", changes={"drones.vehicle": "hexacopter-3kg"})
    mission = setting.mission(0)
    found = NUMBERS.view(setting.numbers(mission), "lever")[:, 0]
    np.testing.assert_array_equal(found, 0.5 * mission.team.arms)
