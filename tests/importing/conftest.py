"""The published real flights, where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture
def shared() -> Path:
    """The folder of published flights beside the repository; tests that need it skip where it is absent."""
    beside = Path(__file__).parents[2].parent / "shared"
    folder = Path(os.environ.get("COLIFT_SHARED", beside)) / "flights"
    if not folder.is_dir():
        pytest.skip(f"no recorded flights in {folder}")
    return folder
