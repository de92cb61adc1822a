"""Network: how messages get from each drone to each other; one file per model."""
