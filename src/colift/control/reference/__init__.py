"""References: where the load should be, with three derivatives."""
