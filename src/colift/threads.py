"""How many threads the BLAS libraries use; they read it once, when they are loaded."""

from __future__ import annotations

import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""What the BLAS libraries read that NumPy and SciPy are built with."""


def one_blas_thread() -> None:
    """One BLAS thread, unless the environment says otherwise; before NumPy is imported.

    On matrices as small as those here, more threads only wait for each other.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
