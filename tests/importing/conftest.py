"""The published real flights, where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

BESIDE = Path(os.environ.get("COLIFT_SHARED", Path(__file__).parents[2].parent / "shared"))
"""The folder beside the repository with what others have recorded; tests that need it skip where it is absent."""


@pytest.fixture
def shared() -> Path:
    """The published flights."""
    folder = BESIDE / "flights"
    if not folder.is_dir():
        pytest.skip(f"no recorded flights in {folder}")
    return folder


@pytest.fixture
def cases() -> Path:
    """Logs with something wrong."""
    folder = BESIDE / "cases" / "flights"
    if not folder.is_dir():
        pytest.skip(f"no logs in {folder}")
    return folder
