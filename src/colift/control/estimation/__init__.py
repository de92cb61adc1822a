"""Estimation: a better guess of the state from what the sensors say; one file per estimator."""
