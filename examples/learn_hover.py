"""Learn to hover: an evolution strategy tries 24 policies at a time, each on 8 of 192 teams that fly at once.

pip install cma && python examples/learn_hover.py

Writes ``learned.npz``, which ``learned.py`` beside it flies, and prints how the policy does in worlds that it never learns in.
"""

import time
from pathlib import Path

import numpy as np

from colift.learn import TeamVectorEnv

POLICIES, EACH, PERIOD = 24, 8, 0.02
SPREAD = 0.3
"""Of the gains of the policy that it begins with, which are random, and of those that are tried first."""
GENERATIONS = 60


def environment(teams, **options):
    """Each drone's pull follows from what an allocator sees, by the same gains for all drones."""
    return TeamVectorEnv(
        "Hover", teams, level="cables", observation="part", period=PERIOD, **options
    )


def returns(env, policies, seed):
    """Sum of the rewards of an episode of each team (policies, teams of each); policies are (k, actions, seen + 1)."""
    each = env.num_envs // len(policies)
    seen, _ = env.reset(
        seed=[seed + i % each for i in range(env.num_envs)]
    )  # the same for all policies
    total, flies = np.zeros(env.num_envs), np.ones(env.num_envs, dtype=bool)
    shape = len(policies), -1, env.single_observation_space.shape[-1]
    while flies.any():
        action = np.einsum("kas,kts->kta", policies[:, :, :-1], seen.reshape(shape))
        action += policies[:, None, :, -1]
        seen, reward, over, late, _ = env.step(action.reshape(env.action_space.shape))
        total += np.where(flies, reward, 0.0)
        flies &= ~(over | late)
    return total.reshape(len(policies), -1)


def learn(generations, *, seed=0, told=print):
    """The policy (actions, seen + 1) that is found, and the curve: episodes flown, mean and least return in new worlds."""
    import cma

    env = environment(POLICIES * EACH, worlds=32)
    new = environment(64, worlds=64, world_seed=1)
    shape = env.single_action_space.shape[-1], env.single_observation_space.shape[-1] + 1
    begin = SPREAD * np.random.default_rng(seed).standard_normal(shape)
    search = cma.CMAEvolutionStrategy(
        begin.ravel(), SPREAD, {"popsize": POLICIES, "seed": seed + 1, "verbose": -9}
    )
    curve, policy, clock = [], begin, time.process_time()
    for generation in range(generations + 1):
        if generation % 10 == 0:
            found = returns(new, policy[None], seed=10**6)
            row = generation * POLICIES * EACH, float(found.mean()), float(found.min())
            curve.append(row)
            told(f"{row[0]} episodes, {time.process_time() - clock:.0f} s of processor time: "
                 f"return {row[1]:.1f}, least {row[2]:.1f}")  # fmt: skip
        tried = search.ask()
        scores = returns(env, np.reshape(tried, (POLICIES, *shape)), seed=1000 * generation)
        search.tell(tried, (-scores.mean(axis=1)).tolist())
        policy = search.mean.reshape(shape)
    return policy, curve


def save(policy, path):
    """As ``learned.py`` reads it; the file is there whole or not at all."""
    partly = path.with_suffix(".part.npz")
    np.savez(partly, gains=policy[:, :-1], bias=policy[:, -1])
    partly.replace(path)


if __name__ == "__main__":
    policy, _ = learn(GENERATIONS, told=lambda text: print(text, flush=True))
    save(policy, Path(__file__).with_name("learned.npz"))
