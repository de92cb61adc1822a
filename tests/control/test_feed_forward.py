"""The reference filter on the sphere, and the controller that feeds cable motion forward."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import colift
from colift.kernel.jit import inline
from colift.kernel.math.sphere import follow


@inline
def track(memory, targets, omega, dt, out):
    for k in range(targets.shape[0]):
        follow(memory, 0, targets[k, 0], targets[k, 1], targets[k, 2], omega, dt)
        for j in range(9):
            out[k, j] = memory[j]


def filtered(start, targets, omega=10.0, dt=0.001):
    out = np.zeros((len(targets), 9))
    memory = np.zeros(9)
    memory[:3] = np.asarray(start, dtype=float) / np.linalg.norm(start)
    track(memory, np.ascontiguousarray(targets, dtype=float), omega, dt, out)
    return out[:, :3], out[:, 3:6], out[:, 6:]


def circle(count, dt=0.001):
    t = dt * np.arange(count)
    return np.column_stack([0.5 * np.cos(t), 0.5 * np.sin(t), np.full(count, -np.sqrt(0.75))])


unit_vectors = hnp.arrays(float, (3,), elements=st.floats(-1, 1)).filter(
    lambda v: np.linalg.norm(v) > 0.1
)


@settings(max_examples=50, deadline=None)
@given(unit_vectors, unit_vectors, st.floats(0.5, 50.0))
def test_direction_is_unit_rate_is_tangent_and_the_target_is_reached(start, target, omega):
    aim = target / np.linalg.norm(target)
    a, b, _ = filtered(start, np.tile(aim, (4000, 1)), omega, 0.01)
    assert np.abs(np.linalg.norm(a, axis=1) - 1.0).max() < 1e-12
    assert np.abs(np.sum(a * b, axis=1)).max() < 1e-9
    if np.dot(aim, start / np.linalg.norm(start)) > -0.999:
        assert np.linalg.norm(a[-1] - aim) < 1e-6


def test_direction_rate_and_acceleration_are_derivatives_of_each_other():
    a, b, c = filtered([0.5, 0.0, -0.9], circle(3000))
    middle = slice(200, -200)
    rate, acceleration = np.gradient(a, 0.001, axis=0), np.gradient(b, 0.001, axis=0)
    assert np.abs(rate - b)[middle].max() < 2e-3
    assert np.abs(acceleration - c)[middle].max() < 2e-2
    assert np.abs(c)[middle].max() > 0.1


def test_a_jump_is_followed_without_overshoot():
    target = np.array([np.sin(0.5), 0.0, -np.cos(0.5)])
    a, _, _ = filtered([0.0, 0.0, -1.0], np.tile(target, (3000, 1)))
    turned = np.arctan2(a[:, 0], -a[:, 2])
    assert np.all(np.diff(turned) >= -1e-9)
    assert turned[-1] == pytest.approx(0.5, abs=1e-6)


def test_the_opposite_direction_gives_finite_numbers():
    a, b, c = filtered([0.0, 0.0, -1.0], np.tile([0.0, 0.0, 1.0], (100, 1)))
    assert np.isfinite([a, b, c]).all()


@pytest.mark.parametrize("mission", ["figure-eight", "from-rest", "four-to-three"])
def test_tracks_better_than_the_papers_controller(mission):
    ours = colift.run(mission, overrides={"position_control.kind": "feed-forward"}).metrics
    paper = colift.run(mission, overrides={"position_control.kind": "pid"}).metrics
    assert ours["tracking_rms_m"] < paper["tracking_rms_m"]


def test_hover_needs_no_correction():
    settings_ = {"position_control.kind": "feed-forward", "start.load_offset": [0.0, 0.0, 0.0]}
    run = colift.run("hover", allocator="ring", overrides={**settings_, "timing.duration": 1.0})
    assert run.compiled
    assert run.metrics["tracking_max_m"] < 1e-9


def test_a_lost_drone_leaves_the_others_memory_in_place():
    run = colift.run("four-to-three")
    assert run.recording.outcome == "completed"
    assert run.metrics["tracking_max_m"] < 0.02
    assert run.metrics["min_angle_deg"] > 35.0
