"""Write how the plants approach rigid cables (docs/theory/plant.md): ``python docs/figures/plant_convergence.py [--fly]``.

From ``plant_convergence.json`` beside this file. With ``--fly`` the paper's spiral is flown first for 5 s on elastic
cables of growing stiffness, on beads of growing number and of falling density, and on MuJoCo with a hardening limit: the
load's largest distance from where it is on rigid cables at the same time.
"""

import numpy as np
from pages import fill, stored, table

import colift

SERIES = (
    ("elastic-cables", "stiffness", (1e4, 1e5, 1e6, 1e7), {"damping_ratio": 0.1}),
    ("bead-cables", "beads", (1, 3, 7, 15), {}),
    ("bead-cables", "density", (1e-3, 2e-4, 5e-5), {"drag_coefficient": 0.0, "damping_ratio": 0.1}),
    ("mujoco", "time_constant", (0.04, 0.02, 0.01, 0.005), {"impedance": 0.9}),
)


def load(kind, **settings):
    """Positions of the load (rows, 3), m."""
    plant = {f"plant.{name}": value for name, value in settings.items()}
    changes = {"plant.kind": kind, **plant, "timing.duration": 5.0}
    return colift.run("paper-spiral", overrides=changes).recording["load"][:, 0]


def fly():
    rigid = load("rigid-cables")
    return [
        {
            "kind": kind, "setting": name, "values": values, "others": others,
            "far_m": [
                float(np.linalg.norm(load(kind, **{name: v}, **others) - rigid, axis=1).max())
                for v in values
            ],
        }
        for kind, name, values, others in SERIES
    ]  # fmt: skip


def main():
    rows = []
    for each in stored(__file__, fly):
        fixed = "".join(f", `{key} = {value:g}`" for key, value in each["others"].items())
        values = ", ".join(f"{value:g}" for value in each["values"])
        far = ", ".join(f"{1e3 * each_far:.2g}" for each_far in each["far_m"])
        rows.append([f"`{each['kind']}`{fixed}", f"`{each['setting']}` = {values}", far])
    header = ["plant", "setting", "from rigid cables (mm)"]
    fill("theory/plant.md", "convergence", table(header, rows))


if __name__ == "__main__":
    main()
