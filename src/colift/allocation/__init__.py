"""Allocation: share the wanted load force among the cables (paper section 3)."""

from colift.allocation._status import Status

__all__ = ["Status"]
