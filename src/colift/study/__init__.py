"""Many flights, or many calls of an allocator, and what they tell."""
