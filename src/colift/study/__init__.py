"""Many flights, or many calls of an allocator or of agents, and what they tell."""
