"""Allocation: share the wanted load force among the cables (paper section 3)."""

from colift.kernel.status import Status

__all__ = ["Status"]
