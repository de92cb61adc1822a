"""What is told wrongly is found in flight: lengths of cables, how late measurements are; and ropes whose mass is told."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.observation.momentum import Momentum
from colift.flight.flight import Flight
from colift.kernel.math.quaternion import into_body
from colift.mission import load_mission
from colift.team import Team

CALM = {"disturbance": [], "truth.load_mass_factor": 1.0, "timing.duration": 3.0}


def flown(**overrides):
    names = {name.replace("__", "."): value for name, value in overrides.items()}
    return Flight(load_mission("real-world", {**CALM, **names})).run()


def error(run):
    return np.linalg.norm(run["load"][:, 0] - run["reference"][:, 0], axis=1)


def test_cables_of_other_lengths_than_told_are_measured():
    factors = [1.1, 0.9, 1.06, 1.0]
    found = flown(truth__cable_length_factor=factors)
    wanted = np.subtract(factors, 1.0)
    np.testing.assert_allclose(found["found_lengths"][found.time > 0.5] - wanted, 0.0, atol=0.004)
    believed = flown(truth__cable_length_factor=factors, observation__learning=0.0)
    assert not believed["found_lengths"].any()
    late = found.time > 1.5
    assert error(found)[late].max() < 0.5 * error(believed)[late].max()


def test_lengths_that_are_right_change_nothing():
    learnt, told = flown(truth__load_mass_factor=1.5), flown(observation__learning=0.0, truth__load_mass_factor=1.5)  # fmt: skip
    np.testing.assert_array_equal(learnt["load"], told["load"])


@pytest.mark.parametrize(("pull", "finds"), [(0.0, False), (1.0, True)])
def test_only_taut_cables_are_measured(pull, finds):
    """Drones hover 0.8 m away, with thrusts that hold their weight alone, or also the pull that is wanted."""
    part, team = Momentum(), Team.uniform(3)
    memory = part.memory(team)
    around = np.array([0.0, 2.1, 4.2])
    level, high = 0.48, 0.64
    x = np.column_stack([level * np.cos(around), level * np.sin(around), np.full(3, high)])
    down = -x / 0.8
    force = np.array([0.0, 0.0, 9.81 * 0.5]) - pull * down
    size = np.linalg.norm(force, axis=1)
    up = force / size[:, None]
    q = np.column_stack([1.0 + up[:, 2], -up[:, 1], up[:, 0], np.zeros(3)])
    q /= np.linalg.norm(q, axis=1)[:, None]
    felt = np.tile([0.0, 0.0, 1.0], (3, 1)) * size[:, None] / 0.5  # along the body's axis
    felt += pull * np.array([into_body(*q[i], *down[i]) for i in range(3)]) / 0.5
    for _ in range(200):
        writes, _ = part.call(
            team, memory, dt=0.01, estimated_positions=x, estimated_attitudes=q, thrusts=size,
            received_tensions=np.ones(3), received_directions=down,
            measured_specific_forces=felt,
        )  # fmt: skip
    np.testing.assert_allclose(writes.found_lengths, -0.2 if finds else 0.0, atol=1e-9)


@pytest.mark.parametrize("delay", [0.03, 0.01])
def test_the_predictor_reads_how_late_samples_are(delay):
    wrong = {f"sensing__{name}_delay": delay for name in ("load", "tracking")}
    wrong |= {"sensing__position_noise": 0.0, "sensing__velocity_noise": 0.0}

    def off(**more):
        run = flown(**wrong, **more)
        gap = run["estimated_positions"] - run["positions"]
        return np.sqrt(np.mean(gap[run.time > 1.0] ** 2))

    assert off() < 0.5 * off(estimation__delay_from="told")


def test_half_of_a_rope_weighs_on_each_end():
    roped = load_mission("hover", {"drones.cable_density": 0.1, "drones.cable_length": 2.0})
    assert roped.team.load_mass == pytest.approx(0.225 + 4 * 0.1)
    np.testing.assert_allclose(roped.team.masses, 0.5 + 0.1)
    for kind, own in (("slack-cables", False), ("bead-cables", True)):
        told, not_told = (
            Flight(load_mission("hover", {"plant.kind": kind, "drones.cable_length": 2.0, **more}))
            for more in ({"drones.cable_density": 0.1}, {})
        )
        same = np.array_equal(told.wires.plant.params, not_told.wires.plant.params)
        assert same == own  # beads weigh what they do, whatever is told


def test_ropes_that_are_told_are_not_found_as_a_push():
    """Half of a rope's weight, 0.2 N of each of four, hangs on the load and half on its drone: 1.6 N in all."""
    heavy = {"plant__kind": "bead-cables", "plant__density": 0.04, "plant__drag_coefficient": 0.0}
    heavy |= {"timing__duration": 1.5}

    def push(**told):
        run = flown(**heavy, **told)
        return run["estimated_forces"][run.time > 0.3, :, 2].sum(axis=1).mean()

    assert push() == pytest.approx(-4 * 0.04 * 9.81, rel=0.1)
    assert abs(push(drones__cable_density=0.04)) < 0.1
