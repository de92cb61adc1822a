"""All that is simulated; it never sees the controllers."""
