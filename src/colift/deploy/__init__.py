"""What leaves Python: controllers for other machines."""
