"""Off-board control over MAVLink: set-points for PX4 and ArduPilot, and a simulated vehicle that flies by them."""
