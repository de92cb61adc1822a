"""The allocator `planned`: the plan where it makes the wanted force, and little beside it where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift.control.allocation.base import Status
from colift.control.allocation.planned import Planned
from colift.team import Team
from colift.team.geometry import ring

TEAM = Team.uniform(4)
TEAM_DIRECTIONS = ring(4, 0.6)


def plan_of(seed, n=4):
    """Pulls on the drones that hold something up, none of them faint."""
    rng = np.random.default_rng(seed)
    pulls = rng.normal(0.0, 0.3, (n, 3))
    pulls[:, 2] = -rng.uniform(0.3, 0.9, n)
    return pulls


def answer(pulls, force, **more):
    part = Planned(**more)
    nominal = np.zeros((len(pulls), 3, 3))
    nominal[:, 0] = pulls
    team = Team.uniform(len(pulls))
    writes, status = part.call(
        team, part.memory(team), nominal_forces=nominal, force=np.array(force)
    )
    return writes.desired_tensions[:, None] * writes.desired_directions, Status(status), writes


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 8))
def test_a_plan_that_makes_the_force_is_given_as_it_is(seed, n):
    pulls = plan_of(seed, n)
    found, status, _ = answer(pulls, -pulls.sum(axis=0))
    assert status == Status.CONVERGED
    np.testing.assert_allclose(found, pulls, atol=1e-14)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 8), st.floats(0.01, 1.0))
def test_the_force_is_balanced_or_told_not_to_be_and_no_cable_goes_slack(seed, n, turning):
    pulls, rng = plan_of(seed, n), np.random.default_rng(seed + 1)
    force = -pulls.sum(axis=0) + rng.normal(0.0, 0.5, 3)
    found, status, writes = answer(pulls, force, turning=turning)
    missing = np.linalg.norm(found.sum(axis=0) + force)
    assert writes.allocator_info[4] == pytest.approx(missing, abs=1e-12)
    if status == Status.CONVERGED:
        assert missing < 1e-12
    else:
        assert status == Status.FORCE_REDUCED
    u = pulls / np.linalg.norm(pulls, axis=1, keepdims=True)
    least = min(0.1 * np.linalg.norm(force) / n, (pulls * u).sum(axis=1).min())
    assert (found * u).sum(axis=1).min() > least - 1e-12


def test_corrections_are_the_least_of_all():
    """Against the stationarity of the weighted least squares: d_i = W_i l for one l."""
    pulls = plan_of(3)
    found, _, _ = answer(pulls, -pulls.sum(axis=0) + [0.1, -0.05, 0.2], turning=0.3)
    u = pulls / np.linalg.norm(pulls, axis=1, keepdims=True)
    W = 0.3 * np.eye(3) + 0.7 * u[:, :, None] * u[:, None, :]
    each = np.linalg.solve(W, (found - pulls)[:, :, None])[:, :, 0]
    np.testing.assert_allclose(each, np.repeat(each[:1], 4, axis=0), atol=1e-12)


def test_a_heavier_load_pulls_more_and_hardly_turns_the_cables():
    pulls = plan_of(5)
    most = []
    for turning in (0.05, 1.0):
        _, _, writes = answer(pulls, -1.2 * pulls.sum(axis=0), turning=turning)
        cos = (writes.desired_directions * pulls).sum(axis=1) / np.linalg.norm(pulls, axis=1)
        most.append(np.degrees(np.arccos(cos)).max())
    assert most[0] < 0.5 * most[1]


def test_without_a_plan_the_cables_stay_where_they_are_and_share_equally():
    part, up = Planned(), np.array([0.0, 0.0, 2.2])
    told = {"force": up, "nominal_forces": np.full((4, 3, 3), np.nan)}
    before = TEAM_DIRECTIONS.copy()
    for _ in range(50):
        writes, status = part.call(
            TEAM, part.memory(TEAM), desired_directions=before.copy(), **told
        )
        assert status == Status.CONVERGED
        assert (writes.desired_directions * before).sum(axis=1).min() > np.cos(0.05)
        before = writes.desired_directions
    assert np.ptp(writes.desired_tensions) < 0.01
