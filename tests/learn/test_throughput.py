"""The measurement of throughput measures what it says; nothing here asserts wall time."""

import numpy as np
import pytest

pytest.importorskip("gymnasium")
from terminal import colift


def test_the_bench_of_environments_tells_every_racer_and_size(tmp_path):
    done = colift(
        "bench", "--env", "--quick", "--sizes", "1,2", "--out", str(tmp_path / "env.json")
    )
    assert done.returncode == 0, done.stderr
    assert "one core" in done.stdout


def test_mujoco_begins_as_the_environment_does_and_stays_there():
    mujoco = pytest.importorskip("mujoco")
    from colift.learn import throughput

    before = mujoco.mj_step
    seen = []

    def step(model, data, count):
        before(model, data, count)
        seen.append((data.qpos.copy(), count, model.opt.timestep))

    mujoco.mj_step = step
    try:
        throughput._theirs(4, "RK4")()
    finally:
        mujoco.mj_step = before
    ((qpos, count, dt),) = seen
    drones = qpos[3:].reshape(4, 7)
    assert count * dt > 0.2
    assert np.linalg.norm(drones[:, :3] - qpos[:3], axis=1) == pytest.approx(1.0, abs=0.05)
    assert abs(drones[:, 3:]).max(axis=1) == pytest.approx(1.0, abs=0.2)  # none tumbled
