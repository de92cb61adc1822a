"""The robust moment on a rigid load: how large it is, what it does to a load that is pushed, and that nothing measured breaks it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from colift.control.load_control.pose import Pose
from colift.control.load_control.pose_robust import MEMORY, PoseRobust
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.team import Body, Team
from colift.team.geometry import Array
from colift.team.load import box_inertia, usual_attachments

SIZE = np.array([0.6, 0.4, 0.2])
BOX = Body(inertia=box_inertia(0.5, SIZE), attachments=usual_attachments(4, SIZE), size=SIZE)
TEAM = replace(Team.uniform(4), load_mass=0.5, body=BOX)
HOLD = 0.5 * 9.81 * 0.3
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def turned(angle: float, axis: int = 0) -> Array:
    q = np.zeros(4)
    q[0], q[1 + axis] = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return q


def beyond(
    law: PoseRobust, q: Array, rates: Any = (0.0, 0.0, 0.0), *, memory: Array | None = None
) -> Array:
    """What it adds in one cycle of no length to the moment of the law that it stands on, in the load's frame where it is level."""
    seen = {"estimated_load_attitude": q, "estimated_load_rates": np.array(rates), "dt": 0.0}
    kept = law.memory(TEAM) if memory is None else memory
    robust, _ = law.call(TEAM, kept, **seen)
    plain = Pose(integral=0.0)
    other, _ = plain.call(TEAM, plain.memory(TEAM), **seen)
    return np.array(robust.moment - other.moment)


def test_it_grows_with_the_error_within_the_layer_and_no_more_beyond() -> None:
    law = PoseRobust(robust=0.5, layer_deg=2.0)
    one, two, most, far = (
        abs(beyond(law, turned(math.radians(a)))[0]) for a in (0.5, 1.0, 2.0, 60.0)
    )
    assert one == pytest.approx(0.5 * HOLD * math.radians(0.5), rel=1e-3)
    assert two == pytest.approx(2.0 * one, rel=1e-3)
    assert most == pytest.approx(0.5 * HOLD * math.radians(2.0), rel=1e-3)
    assert far == pytest.approx(most, rel=1e-3)
    assert beyond(law, turned(math.radians(1.0)))[0] < 0.0  # back


@pytest.mark.parametrize("size", [1.0, 1e8, 1e300, math.inf, math.nan])
def test_whatever_is_measured_it_stays_within_its_bounds(size: float) -> None:
    law, rng = PoseRobust(), np.random.default_rng(3)
    memory = law.memory(TEAM)
    for _ in range(2000):
        q = rng.normal(size=4)
        writes, _ = law.call(
            TEAM, memory, estimated_load_attitude=q / np.linalg.norm(q), estimated_load_rates=size * rng.normal(size=3), dt=0.01
        )  # fmt: skip
        assert np.linalg.norm(memory[MEMORY.at.mu : MEMORY.at.mu + 3]) <= 0.2 * HOLD * (1.0 + 1e-12)
    writes, _ = law.call(TEAM, memory, estimated_load_attitude=UPRIGHT, dt=0.01)
    assert np.isfinite(writes.moment).all()


def test_a_load_that_stands_on_the_ground_teaches_it_nothing() -> None:
    law = PoseRobust()
    memory = law.memory(TEAM)
    for _ in range(100):
        law.call(TEAM, memory, estimated_load_attitude=turned(0.1), standing=np.ones(5), dt=0.01)
    assert not memory[MEMORY.at.mu : MEMORY.at.mu + 3].any()


def test_a_bar_on_two_cables_is_not_turned_about_the_line_through_their_ends() -> None:
    size = np.array([1.2, 0.06, 0.06])
    bar = Body(inertia=box_inertia(0.4, size), attachments=usual_attachments(2, size), size=size)
    team, law = replace(Team.uniform(2), load_mass=0.4, body=bar), PoseRobust()
    memory = law.memory(team)
    for axis, asked in ((0, False), (1, True), (2, True)):
        memory[:] = 0.0
        law.call(team, memory, estimated_load_attitude=turned(0.1, axis), dt=0.01)
        assert bool(memory[MEMORY.at.mu : MEMORY.at.mu + 3].any()) is asked


@pytest.mark.parametrize("pushed", [0.05, -0.12])
def test_a_load_that_turns_freely_comes_back_from_a_lasting_moment(pushed: float) -> None:
    """The proof's case: J dOmega/dt = M + d. The plain law without integral keeps an error of d over its stiffness."""
    J, dt = BOX.inertia, 0.002
    left = {}
    for law in (Pose(integral=0.0), PoseRobust()):
        memory, angle, rate = law.memory(TEAM), 0.0, 0.0
        for _ in range(round(20.0 / dt)):
            writes, _ = law.call(
                TEAM, memory, estimated_load_attitude=turned(angle, 1), estimated_load_rates=np.array([0.0, rate, 0.0]), dt=dt
            )  # fmt: skip
            rate += dt * (writes.moment[1] + pushed) / J[1, 1]
            angle += dt * rate
        left[type(law).__name__] = abs(math.degrees(angle))
    assert left["Pose"] > 10.0
    assert left["PoseRobust"] < 1e-3


def test_a_box_with_its_mass_aside_and_in_wind_turns_less_than_with_pose() -> None:
    def turning(kind: str, **changes: Any) -> float:
        given = {
            "load_control.kind": kind, "reference.period": 7.0, "timing.duration": 20.0, "timing.delay": 0.02, "sensing.kind": "noisy",
            "seed": 9, **changes,
        }  # fmt: skip
        recording = Flight(load_mission("box-figure-eight", given)).run()
        return float(np.sqrt(np.mean(np.sum(metrics.attitude_error(recording) ** 2, axis=1))))

    aside = {"truth.centre_of_mass_offset": [0.0, 0.03, 0.0]}
    wind = {"disturbance": [{"kind": "wind", "speed": 5.0}, {"kind": "dryden", "speed": 5.0}, {"kind": "drag"}]}  # fmt: skip
    for wrong, share in ((aside, 0.75), (wind, 0.9)):
        assert turning("pose-robust", **wrong) < share * turning("pose", **wrong)
