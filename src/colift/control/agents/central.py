"""No agents of the drones' own: one allocator decides for all."""

from __future__ import annotations

from typing import ClassVar

from colift.control.agents.base import SIGNATURE, AgentPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold_answer


class Central(AgentPart):
    """The paper's team: the drones fly what the link brings of the allocator's answer; no settings."""

    decides: ClassVar[bool] = False
    kernel = kernel(SIGNATURE)(hold_answer)
