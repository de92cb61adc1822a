"""Plants: the simulated truth (paper section 2.1)."""
