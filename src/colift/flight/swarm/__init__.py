"""A team without a leader as processes of their own: one a drone, one for the world, over UDP on this machine."""
