"""Detection: which drones still carry, judged from measurements; one file per method."""
