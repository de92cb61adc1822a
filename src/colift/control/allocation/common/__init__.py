"""What several allocators share."""
