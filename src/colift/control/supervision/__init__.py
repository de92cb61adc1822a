"""Supervision: what the flight is about now, and the clock that it goes by."""
