"""How the plants approach rigid cables: ``python docs/figures/plant_convergence.py``.

Flies the paper's spiral for 5 s on elastic cables of growing stiffness, on beads of growing number and of falling
density, and on MuJoCo with a hardening limit. Prints a Markdown table of the load's largest distance from where it is on
rigid cables at the same time.
"""

import numpy as np

import colift
from colift.part import find

SERIES = (
    ("elastic-cables", "stiffness", (1e4, 1e5, 1e6, 1e7), {"damping_ratio": 0.1}),
    ("bead-cables", "beads", (1, 3, 7, 15), {}),
    ("bead-cables", "density", (1e-3, 2e-4, 5e-5), {"drag_coefficient": 0.0, "damping_ratio": 0.1}),
    ("mujoco", "time_constant", (0.04, 0.02, 0.01, 0.005), {"impedance": 0.9}),
)


def load(kind: str, **settings: float) -> np.ndarray:
    """Positions of the load (rows, 3), m."""
    plant = {f"plant.{name}": value for name, value in settings.items()}
    flown = colift.run(
        "paper-spiral", overrides={"plant.kind": kind, **plant, "timing.duration": 5.0}
    )
    return flown.recording["load"][:, 0]


rigid = load("rigid-cables")
print("| plant | setting | from rigid cables (mm) |\n|---|---|---|")
for kind, name, values, others in SERIES:
    if find("plant", kind).missing():
        continue
    for value in values:
        far = np.linalg.norm(load(kind, **{name: value}, **others) - rigid, axis=1).max()
        fixed = "".join(f", `{key} = {other:g}`" for key, other in others.items())
        print(f"| `{kind}` | `{name} = {value:g}`{fixed} | {1e3 * far:.2g} |")
