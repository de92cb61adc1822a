"""The rate loop: each body axis goes to its wanted rate as a first-order lag, however fast the drone turns about the others."""

import numpy as np

import colift
from colift.control.attitude_control.rates import Rates

WANTED = np.array([2.0, -1.0, 0.5])


def test_every_axis_decays_with_its_own_bandwidth():
    part, team, dt = Rates(bandwidth=(40.0, 30.0, 10.0)), colift.Team.uniform(4), 1e-4
    memory, J = part.memory(team), team.inertias
    rates = np.tile([0.0, 3.0, -8.0], (4, 1))
    error, steps = rates[0] - WANTED, 500
    for _ in range(steps):
        writes, _ = part.call(
            team, memory, estimated_rates=rates, desired_rates=np.tile(WANTED, (4, 1))
        )
        rates = rates + dt * (writes.torques - np.cross(rates, J * rates)) / J
    left = (1.0 - dt * np.array(part.bandwidth)) ** steps
    assert np.allclose(rates, WANTED + left * error, atol=1e-12)
