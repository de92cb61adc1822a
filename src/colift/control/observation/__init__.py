"""Observation: the forces on drones and load that thrust, weight and cables do not explain."""
