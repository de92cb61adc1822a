"""Disturbances: wind and forces from outside; one file each, as many at once as a mission likes."""
