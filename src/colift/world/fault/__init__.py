"""Faults: what breaks in flight, and when; one file each, as many at once as a mission likes."""
