"""What a plan says of accelerations, against the plant: ``python docs/figures/plan_exact.py`` writes two SVG files here and a line of docs/plan.md.

The plan is one through the window of ``docs/examples``. The published model, whose generated code the public benchmark brings, is
``(m_L + sum m) (a + g) = sum U - sum m L |omega|^2 alpha``: without the angular accelerations of the cables.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray
from pages import DOCS, fill

from colift.kernel.math import quaternion
from colift.mission.load import load_mission
from colift.plan import planner
from colift.plan.mission import mission_of
from colift.plan.scene import load_scene
from colift.world.plant.base import STATE
from colift.world.plant.rigid_cables import RigidCables

Array = NDArray[np.float64]
SEED = 72_000
STEP = 1e-5
"""Over which the plant is asked how it accelerates, and over half of it, s: what depends on the step in proportion cancels."""
SAMPLES = 200
ALLOWED = 1e-6
"""m/s^2."""


def speeds_after(part: RigidCables, team, state: Array, thrusts: Array, dt: float) -> Array:
    """Velocities of load and drones (n + 1, 3) once the plant has taken one step."""
    memory = part.memory(team)
    memory[: len(state)] = state
    part.call(
        team, memory, dt=dt, applied_thrusts=thrusts, attached=np.ones(team.n), external_forces=np.zeros((team.n + 1, 3))
    )  # fmt: skip
    return np.vstack([memory[3:6], STATE.view(memory[: len(state)], "velocity")])


def errors(plan: planner.Plan) -> tuple[Array, Array, Array]:
    """Time, s, and errors of the accelerations, m/s^2: the largest of load and drones of the plan, and the load's of the published model."""
    rows, limits, part = plan.sample(SAMPLES), plan.limits, RigidCables()
    team = load_mission(mission_of(plan)).team
    g, m, m_L = np.array([0.0, 0.0, limits.gravity]), limits.drone_mass, limits.load_mass
    own, published = np.empty(len(rows["time"])), np.empty(len(rows["time"]))
    for k in range(len(own)):
        U = rows["thrusts"][k]
        sizes = np.linalg.norm(U, axis=1)
        state = np.zeros(STATE.size(team.n))
        state[:3], state[3:6], state[6] = *rows["load"][k, :2], 1.0
        STATE.view(state, "position")[:] = rows["drones"][k, :, 0]
        STATE.view(state, "velocity")[:] = rows["drones"][k, :, 1]
        STATE.view(state, "attitude")[:] = [
            quaternion.from_thrust_direction(*u) for u in U / sizes[:, None]
        ]
        begin = np.vstack([rows["load"][k, 1], rows["drones"][k, :, 1]])
        whole, half = (
            (speeds_after(part, team, state, sizes, dt) - begin) / dt for dt in (STEP, 0.5 * STEP)
        )
        true = 2.0 * half - whole
        told = np.vstack([rows["load"][k, 2], rows["drones"][k, :, 2]])
        own[k] = np.linalg.norm(told - true, axis=1).max()
        d, d1 = (rows["drones"][k, :, i] - rows["load"][k, i] for i in range(2))
        inward = (d1**2).sum(axis=1, keepdims=True) / (d**2).sum(axis=1, keepdims=True) * d
        simple = (U + m * inward).sum(axis=0) / (m_L + m * team.n) - g
        published[k] = np.linalg.norm(simple - true[0])
    return rows["time"], own, published


def draw(ink: str, path: Path, time: Array, own: Array, published: Array) -> None:
    mpl.rcParams.update(
        {
            "svg.hashsalt": "colift", "svg.fonttype": "path", "font.size": 9, "text.color": ink,
            "axes.edgecolor": ink, "axes.labelcolor": ink, "xtick.color": ink, "ytick.color": ink,
            "axes.spines.top": False, "axes.spines.right": False,
        }
    )  # fmt: skip
    figure, axes = plt.subplots(figsize=(7.0, 2.8), layout="constrained")
    axes.semilogy(
        time, published, color="#d9822b", label="without the cables' angular acceleration"
    )
    axes.semilogy(time, np.maximum(own, 1e-12), color="#3b82c4", label="this plan")
    axes.axhline(ALLOWED, color=ink, lw=0.8, ls=":")
    axes.set(xlabel="time, s", ylabel="error of an acceleration, m/s²")
    axes.legend(fontsize=8, frameon=False, loc="center", bbox_to_anchor=(0.5, 0.63))
    figure.savefig(path, transparent=True, metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    scene = load_scene(DOCS / "examples" / "through-a-window.yaml")
    plan = planner.plan(scene, seed=SEED, attempts=4, seconds=np.inf)
    found = errors(plan)
    draw("#222222", DOCS / "figures" / "plan_exact_light.svg", *found)
    draw("#dddddd", DOCS / "figures" / "plan_exact_dark.svg", *found)
    _, own, published = found
    assert own.max() < ALLOWED
    fill(
        "plan.md", "plan-exact",
        f"Along a plan through the window of the examples load and drones accelerate as the plant does with its thrusts, to {own.max():.0e} m/s² at "
        f"each of {len(own)} samples. The published model drops the angular accelerations of the cables, and is off by up to {published.max():.2g} m/s², "
        f"{np.median(published):.2g} in the median.",
    )  # fmt: skip


if __name__ == "__main__":
    main()
