"""Actuation: from commands to the thrust and torque that act; one file per model."""
