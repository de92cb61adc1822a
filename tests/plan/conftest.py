"""A plan that several tests look at."""

from __future__ import annotations

import numpy as np
import pytest
from windows import window

from colift.plan import planner


@pytest.fixture(scope="session")
def found():
    return planner.plan(window(), seed=1, attempts=4, seconds=np.inf)
