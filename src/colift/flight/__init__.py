"""The closed loop: `signals` (what flows), `loop` (the block diagram), `flight` (running it)."""
