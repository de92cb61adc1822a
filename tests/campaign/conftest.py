"""The fixture that writes allocators which misbehave on demand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from campaign_helpers import write_allocator


@pytest.fixture
def allocator(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a file with an allocator of this name; see ``campaign_helpers.BODIES``."""
    return lambda name: write_allocator(tmp_path, name)
