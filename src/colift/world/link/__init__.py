"""Link: how the allocator's answer reaches the drones; one file per model."""
