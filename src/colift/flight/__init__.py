"""The closed loop: `loop` (the block diagram), `flight` (running it), `runner` (from a mission to its numbers)."""
