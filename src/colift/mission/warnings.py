"""What is likely to go wrong in a mission that is valid: told before it flies.

Each part knows what it needs of the others (:meth:`colift.part.Part.warnings`); nothing is listed here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from colift.errors import Problem
from colift.part import FOLDERS, LISTS

if TYPE_CHECKING:
    from colift.mission.mission import Mission


def warnings_of(mission: Mission) -> list[Problem]:
    """Everything that the mission's parts warn of, by the path of the field."""
    found = []
    for folder in FOLDERS:
        chosen = getattr(mission, folder)
        named = (
            [(f"{folder}.{i}", part) for i, part in enumerate(chosen)]
            if folder in LISTS
            else [(folder, chosen)]
        )
        for path, part in named:
            for field, message in part.warnings(mission):
                value = getattr(part, field, "")
                shown = f"{value:g}" if isinstance(value, float) else str(value)
                found.append(Problem(f"{path}.{field}", shown, message))
    return found
