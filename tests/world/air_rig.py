"""Bodies in the air outside of any loop, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from colift.team import Team

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
DOWN = np.array([0.0, 0.0, -1.0])


class Air:
    """n drones and a load for one disturbance; :meth:`act` gives wind and forces of one step."""

    def __init__(self, part, n=1, *, key=7, dt=0.001, team=None):
        self.part, self.n, self.key, self.dt = part, n, key, dt
        self.team = team or Team.uniform(n)
        self.memory = part.memory(self.team)
        self.load = np.zeros((2, 3))
        self.positions = np.tile([0.0, 0.0, 1.0], (n, 1))
        self.velocities, self.attitudes = np.zeros((n, 3)), np.tile(UPRIGHT, (n, 1))
        self.directions, self.direction_rates = np.tile(DOWN, (n, 1)), np.zeros((n, 3))
        self.thrusts, self.attached = np.zeros(n), np.ones(n)
        self.ends, self.wind, self.forces = np.zeros((n, 2, 3)), np.zeros(3), np.zeros((n + 1, 3))
        self.call = part.wired(
            self.team, self.memory, key=key, load=self.load, ends=self.ends, positions=self.positions,
            velocities=self.velocities, attitudes=self.attitudes, directions=self.directions,
            direction_rates=self.direction_rates, applied_thrusts=self.thrusts, attached=self.attached,
            wind=self.wind, external_forces=self.forces,
        )  # fmt: skip

    def stretch(self):
        """Set the directions from the positions."""
        between = self.load[0] - self.positions
        self.directions[:] = between / np.linalg.norm(between, axis=1, keepdims=True)

    def act(self, step=0, wind=(0.0, 0.0, 0.0)):
        self.ends[:], self.wind[:], self.forces[:] = self.load, wind, 0.0
        self.call(step, 0.0, self.dt)
        return self.wind.copy(), self.forces.copy()
