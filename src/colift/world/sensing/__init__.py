"""Sensing: what the controllers are told of the truth; one file per sensor model."""
