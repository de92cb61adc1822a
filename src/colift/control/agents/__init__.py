"""Agents: each drone decides its own pull, from what it wants and what it hears; one file per scheme."""
