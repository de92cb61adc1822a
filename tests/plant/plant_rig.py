"""A plant and its team outside of any loop, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from colift.kernel.ports import PORTS
from colift.team import Team
from colift.world.plant._bodies import BODY, DRONE, LOAD, MASS, state_size
from colift.world.plant._chain import BEAD, CABLE
from colift.world.plant._params import P
from colift.world.plant.base import Start
from colift.world.plant.rigid_cables import RigidCables

E3 = np.array([0.0, 0.0, 1.0])
DOWN = np.array([[0.0, 0.0, -1.0]])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def rotation(q):
    """Rotation matrix of a unit quaternion wxyz, by Rodrigues' formula."""
    w, v = q[0], q[1:]
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew


class Rig:
    """A plant and its team; ``load`` (2, 3), ``drones`` (n, 13) and ``beads`` (n, k, 6) are views of its state."""

    def __init__(self, team, directions, part=None, *, spin=None, attitudes=None, body_rates=None):
        n = team.n
        self.team, self.n, self.part = team, n, part or RigidCables()
        self.params = self.part.params(team)
        attitudes = np.tile(UPRIGHT, (n, 1)) if attitudes is None else attitudes
        start = Start(np.zeros(3), np.zeros(3), np.asarray(directions), attitudes)
        self.memory = self.part.initial(team, start)
        self.state = self.memory[: state_size(n)]
        self.load = self.state[:6].reshape(2, 3)
        self.drones = self.state[LOAD:].reshape(n, DRONE)
        k, size = getattr(self.part, "bead_count", 0), self.state.size
        self.beads = self.memory[size : size + BEAD * k * n].reshape(n, k, BEAD)
        if spin is not None:  # angular velocities of the cables
            self.drones[:, 3:6] = -team.cable_lengths[:, None] * np.cross(spin, directions)
        if body_rates is not None:
            self.drones[:, 10:13] = body_rates
        self.straighten()
        self.thrusts, self.torques = np.zeros(n), np.zeros((n, 3))
        self.external, self.attached = np.zeros((n + 1, 3)), np.ones(n)
        self.moment = np.zeros(3)
        self.tensions, self.slack_times = np.zeros(n), np.zeros(n)
        self.peak_tensions, self.catch_impulses = np.zeros(n + 1), np.zeros(n)
        self.winches, self.time = np.zeros((n, 4)), 0.0
        self.ground_forces, self.touch_speeds = np.zeros((n + 1, 3)), np.zeros(n + 1)

    def straighten(self):
        """Put beads evenly between drone and load, in motion with them."""
        k = self.beads.shape[1]
        down = np.arange(1, k + 1)[:, None] / (k + 1)
        ends = self.observe()["ends"].reshape(self.n, 1, BEAD)
        self.beads[:] = (1.0 - down) * self.drones[:, None, :BEAD] + down * ends

    def step(self, dt=0.001, count=1):
        port = PORTS["plant"]
        wire = port.wire(type(self.part).kernel, self.params, self.memory, self._signals())
        for _ in range(count):
            port.invoke(wire, 0, self.time, dt)
            self.time += dt
        return self

    def _signals(self):
        return {
            "applied_thrusts": self.thrusts, "applied_torques": self.torques,
            "external_forces": self.external, "external_moment": self.moment, "winches": self.winches, "attached": self.attached, "tensions": self.tensions,
            "peak_tensions": self.peak_tensions, "catch_impulses": self.catch_impulses,
            "slack_times": self.slack_times, "ground_forces": self.ground_forces,
            "touch_speeds": self.touch_speeds,
        }  # fmt: skip

    def observe(self):
        port = PORTS["plant_observe"]
        signals = port.signals(self.n)
        port.invoke(
            port.wire(type(self.part).observe, self.params, self.memory, signals), 0, 0.0, 1e-3
        )
        return signals

    def points(self):
        """Masses (N,), positions and velocities (N, 3) of everything that has mass."""
        masses = [self.params[:1], self.params[MASS : MASS + BODY * self.n : BODY]]
        states = [self.state[None, :6], self.drones[:, :6]]
        if self.beads.size:
            cables = self.params[MASS + BODY * self.n :][: CABLE * self.n].reshape(self.n, CABLE)
            masses.append(np.repeat(cables[:, 3], self.beads.shape[1]))
            states.append(self.beads.reshape(-1, BEAD))
        x = np.concatenate(states)
        return np.concatenate(masses), x[:, :3], x[:, 3:]

    def kinetic_energy(self):
        """Of the bodies as points, J; the attitudes' is separate."""
        m, _, v = self.points()
        return 0.5 * m @ np.sum(v**2, axis=1)

    def strain_energy(self):
        """Of elastic segments, J; zero for plants without."""
        if not hasattr(self.part, "stiffness"):
            return 0.0
        nodes = [self.drones[:, None, :3], self.beads[:, :, :3]]
        nodes = np.concatenate([*nodes, self.observe()["ends"][:, :1]], axis=1)
        lengths = np.linalg.norm(np.diff(nodes, axis=1), axis=2)
        rest = self.team.cable_lengths[:, None] / lengths.shape[1]
        stretch = np.maximum(lengths - rest, 0.0)
        stretch[:, -1] *= self.attached  # a cut is at the load's end
        return 0.5 * np.sum(self.part.tautness(self.team)[:, None] / rest * stretch**2)

    def energy(self):
        """Translational, potential and elastic energy, J; that of attitudes is separate."""
        m, x, _ = self.points()
        return self.kinetic_energy() + self.team.gravity * m @ x[:, 2] + self.strain_energy()

    def momentum(self):
        m, _, v = self.points()
        return m @ v

    def angular_momentum(self):
        """Of all bodies as points, about the world's origin."""
        m, x, v = self.points()
        return m @ np.cross(x, v)

    def turning(self):
        """Kinetic energy, J, and angular momentum (3,), world, of a rigid load about its centre of mass."""
        rates = self.state[10:13]
        momentum = self.params[P.inertia : P.inverse].reshape(3, 3) @ rates
        return 0.5 * rates @ momentum, rotation(self.state[6:10]) @ momentum

    def spin_momentum(self):
        """J Omega of each drone, turned into the world frame."""
        s = self.observe()
        body = self.team.inertias * s["rates"]
        return np.array([rotation(q) @ h for q, h in zip(s["attitudes"], body, strict=True)])


def random_team(rng, n, *, gravity=9.81):
    first = rng.uniform(0.01, 0.05, (n, 3))
    inertias = np.stack([first[:, 0], first[:, 1], 0.7 * (first[:, 0] + first[:, 1])], axis=1)
    return Team(
        load_mass=rng.uniform(0.05, 3.0),
        masses=rng.uniform(0.1, 2.0, n),
        inertias=inertias,
        cable_lengths=rng.uniform(0.2, 3.0, n),
        gravity=gravity,
    )


def slack_rig(seed, n, part=None, *, gravity=9.81, speed=2.0):
    """Drones anywhere within reach of the load, all bodies in motion."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rig = Rig(random_team(rng, n, gravity=gravity), directions, part)
    rig.drones[:, :3] *= rng.uniform(0.3, 1.0, (n, 1))
    rig.drones[:, 3:6] = speed * rng.normal(size=(n, 3))
    rig.load[1] = speed * rng.normal(size=3)
    rig.straighten()
    return rig, rng


def random_rig(seed, n, part=None, *, gravity=9.81, spin=2.0):
    """Any state with taut cables."""
    rng = np.random.default_rng(seed)
    team = random_team(rng, n, gravity=gravity)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    omega = rng.normal(size=(n, 3)) * spin
    omega -= np.sum(omega * directions, axis=1, keepdims=True) * directions
    attitudes = rng.normal(size=(n, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    rates = rng.normal(size=(n, 3))
    rig = Rig(team, directions, part, spin=omega, attitudes=attitudes, body_rates=rates)
    shift = rng.normal(size=6)
    rig.load.ravel()[:] += shift
    rig.drones[:, :6] += shift
    rig.straighten()
    return rig, rng
