"""Real autopilots in the plant: simulated Betaflights, each a process of its own, in lock step with a flight."""
