"""Plans for the whole team: load, cables and drones through a scene of obstacles, exact and certified."""
