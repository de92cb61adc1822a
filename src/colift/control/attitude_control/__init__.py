"""Attitude control: torques that turn a drone to its wanted attitude (paper section 2.4)."""
