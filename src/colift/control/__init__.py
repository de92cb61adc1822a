"""All that could run on a drone; it never sees the simulated world."""
