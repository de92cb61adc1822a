"""Allocation: share the wanted load force among the cables (paper section 3)."""
