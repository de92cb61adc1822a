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
