"""How many physics steps of a team a core flies in a second, beside MuJoCo with the same team in the same run."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from colift.flight.flight import start_state
from colift.learn.teams import Teams
from colift.learn.worlds import Setting
from colift.study.bench.machine import machine
from colift.world.plant.base import STATE
from colift.world.plant.mujoco import PLACES, SPEEDS, Mujoco, model_xml

SCHEMA = "colift bench --env 1"
SIZES = tuple(range(1, 9))
TEAMS, WORLDS = 256, 2
PLANTS = {"rods": "rigid-cables", "slack": "slack-cables"}
"""Cables that push, and cables that go slack."""
SHAKEN = {"": 0.0, " shaken": 1.0}
"""Largest action: none, so that all cables stay taut, or any, so that they go slack and are caught all the time."""
INTEGRATORS = ("RK4", "Euler")
"""Of MuJoCo; colift's plants take four slopes a step as its RK4 does."""
ROUNDS, QUICK = 15, 3

Progress = Callable[[float], None]
Table = tuple[str, list[str], list[list[str]]]


def run(
    sizes: Sequence[int] = SIZES, *, rounds: int = ROUNDS, progress: Progress | None = None
) -> dict[str, Any]:
    """Let all take turns, for each number of drones; what one physics step took, by processor time of the thread.

    Environments hover at the level ``forces``: truth observed, sensors, estimation, reference, attitude control, motors, plant,
    reward and observation count. MuJoCo's are its own steps of the same bodies from the same start, alone: nobody observes, controls or judges.

    Parameters
    ----------
    sizes
        Numbers of drones.
    rounds
        Turns of each.
    progress
        Called with the fraction that is done.

    """
    rows = []
    for number, n in enumerate(sizes):
        racers = {
            f"{name}{shaken}": _ours(n, plant, size)
            for name, plant in PLANTS.items()
            for shaken, size in SHAKEN.items()
        }
        if find_spec("mujoco") is not None:
            racers |= {f"MuJoCo {name}": _theirs(n, name) for name in INTEGRATORS}
        times: dict[str, list[float]] = {name: [] for name in racers}
        for _ in range(rounds + 1):
            for name, racer in racers.items():
                times[name].append(racer())
        own = {name: found[1:] for name, found in times.items()}  # the first warms up
        rows.append(
            {"n": n, "us": {name: 1e6 * statistics.median(each) for name, each in own.items()}}
        )
        if progress is not None:
            progress((number + 1) / (len(sizes) + 1))
    gain = _threads(rounds)
    if progress is not None:
        progress(1.0)
    return {
        "schema": SCHEMA,
        "machine": machine(),
        "teams": TEAMS,
        "rows": rows,
        "two_threads": gain,
    }


def _setting(n: int, plant: str) -> Setting:
    return Setting.of("Hover", drones=n, level="forces", changes={"plant.kind": plant})


def _ours(n: int, plant: str, size: float) -> Callable[[], float]:
    """A turn of the environment, under actions of up to this size."""
    teams = Teams(_setting(n, plant), TEAMS, worlds=WORLDS, threads=1)
    teams.reset(np.arange(TEAMS))
    rng = np.random.default_rng(0)

    def turn() -> float:
        actions = size * rng.uniform(-1.0, 1.0, (TEAMS, teams.actions))
        begin = time.thread_time()
        teams.step(actions)
        return (time.thread_time() - begin) / (TEAMS * teams.skip)

    return turn


def _theirs(n: int, integrator: str) -> Callable[[], float]:
    """A turn of MuJoCo: its own steps from the start on, in one call, under the thrusts of hover."""
    import mujoco

    mission = _setting(n, "mujoco").mission(0)
    start, thrusts = start_state(mission)
    assert isinstance(mission.plant, Mujoco)
    params = mission.plant.params(mission.true_team)
    model = mujoco.MjModel.from_xml_string(model_xml(params))
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = mission.timing.step
    data, state = mujoco.MjData(model), mission.plant.initial(mission.true_team, start)
    drones = STATE.at.rows + STATE.at.width * np.arange(n)[:, None]
    qpos, qvel = (np.append(own[:3], drones + own) for own in (PLACES, SPEEDS))
    count = TEAMS

    def turn() -> float:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[qpos], state[qvel]
        data.ctrl.reshape(n, 4)[:, 0] = thrusts
        begin = time.thread_time()
        mujoco.mj_step(model, data, count)
        return (time.thread_time() - begin) / count

    return turn


def _threads(rounds: int) -> dict[str, float]:
    """One thread against two: wall time of the best turn, which tells on idle cores only, and processor time, which always does."""
    teams = [Teams(_setting(4, PLANTS["rods"]), TEAMS, worlds=WORLDS, threads=k) for k in (1, 2)]
    actions = np.zeros((TEAMS, teams[0].actions))
    wall: list[list[float]] = [[], []]
    used: list[list[float]] = [[], []]
    for each in teams:
        each.reset(np.arange(TEAMS))
        each.step(actions)
    for _ in range(2 * rounds):
        for k, each in enumerate(teams):
            begin, cpu = time.perf_counter(), time.process_time()
            each.step(actions)
            wall[k].append(time.perf_counter() - begin)
            used[k].append(time.process_time() - cpu)
    return {
        "wall": min(wall[0]) / min(wall[1]),
        "processor": statistics.median(used[1]) / statistics.median(used[0]),
    }


def tables(result: dict[str, Any]) -> list[Table]:
    """Thousands of steps a second and core, and over MuJoCo's."""
    names = list(result["rows"][0]["us"])
    header = ["drones", *names]
    rates = [
        [str(row["n"]), *(f"{1e3 / row['us'][name]:.0f}" for name in names)]
        for row in result["rows"]
    ]
    found = [("Thousands of physics steps of a team a second, one core", header, rates)]
    rivals = [name for name in names if name.startswith("MuJoCo")]
    if rivals:
        pairs = [(own, rival) for own in PLANTS for rival in rivals]
        header = ["drones", *(f"{own} / {rival}" for own, rival in pairs)]
        ratios = [
            [str(row["n"]), *(f"{row['us'][rival] / row['us'][own]:.1f}" for own, rival in pairs)]
            for row in result["rows"]
        ]
        found.append(("Times as many as MuJoCo", header, ratios))
    return found
