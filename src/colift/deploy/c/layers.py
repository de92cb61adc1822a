"""What can be exported, and how Numba computes what C computes; apart, as it is needed before Numba is imported."""

import os

LAYERS = (
    "estimation", "supervision", "reference", "load_control", "allocation", "observation", "position_control",
    "detection", "attitude_control",
)  # fmt: skip
"""In the order in which they are called."""


def pinned() -> None:
    """Let Numba make code for any processor of this kind, which fuses nothing; here and in processes started from here."""
    os.environ["NUMBA_CPU_NAME"] = "generic"


SINGLE = {"sqp": {"tolerance": 1e-4}, "safe": {"tolerance": 3e-5}}
"""Settings of allocators for which single precision was tried: what it reaches, where the mission does not say otherwise."""
EMBEDDED = {
    "sqp": {"tolerance": 1e-4, "max_iterations": 8},
    "safe": {"tolerance": 3e-5, "max_iterations": 7},
}
"""The same with a bound on the work of a call, which the next call goes on with: at most 168,000 instructions of a
Cortex-M4F for up to four drones."""
FAST = ("-O3", "-fno-math-errno")
"""For gcc, the same answers with a sixth less instructions of a Cortex-M4F: more is inlined, and no root asks whether its number was negative."""
