"""Hard limits: the cycle that keeps them, and what a team can do within them."""
