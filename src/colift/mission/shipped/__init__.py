"""Shipped missions, one TOML file each."""
