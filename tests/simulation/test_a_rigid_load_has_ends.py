"""Where cables end on a load with an attitude, and what a body is."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from colift.errors import SettingError
from colift.kernel.load import add_wanted_arms, ends_of
from colift.kernel.math import quaternion
from colift.team import Body, Team
from colift.team.load import box_inertia, corners, usual_attachments

RHO = np.array([[0.3, 0.2, 0.1], [-0.3, 0.1, 0.0], [0.0, -0.2, 0.15]])


@numba.njit
def _ends(load, attitude, rates, rho):  # type: ignore[no-untyped-def]
    ends = np.zeros((3, 4, 3))
    ends_of(load, ends)
    add_wanted_arms(rho, attitude, rates, ends)
    return ends


@numba.njit
def _turn(q, v, s):  # type: ignore[no-untyped-def]
    return np.array(quaternion.turn(q[0], q[1], q[2], q[3], v[0] * s, v[1] * s, v[2] * s))


def test_each_row_is_the_derivative_of_the_row_before() -> None:
    rates0, rates1, rates2 = np.array([[0.7, -0.4, 0.9], [1.1, 0.3, -2.0], [0.5, -1.5, 0.8]])
    load = np.array([[1.0, 2, 3], [0.4, -0.2, 0.1], [1.0, 0.5, -0.3], [0.2, 0.1, 0.4]])
    q = np.array([0.9, 0.1, -0.3, 0.2])
    q /= np.linalg.norm(q)

    def at(t: float) -> np.ndarray:
        steps = 200
        attitude, h = q.copy(), t / steps
        for k in range(steps):  # middles of short turns: an error of h^2
            s = (k + 0.5) * h
            attitude = _turn(attitude, rates0 + s * rates1 + 0.5 * s * s * rates2, h)
        rates = np.array([rates0 + t * rates1 + 0.5 * t * t * rates2, rates1 + t * rates2, rates2])
        powers = np.array([1.0, t, t * t / 2, t**3 / 6])
        moved = np.array([powers[: 4 - m] @ load[m:] for m in range(4)])
        return np.asarray(_ends(moved, attitude, rates, RHO))

    h = 1e-3
    before, now, after = at(-h), at(0.0), at(h)
    slopes = (after[:, :3] - before[:, :3]) / (2.0 * h)
    assert np.abs(slopes - now[:, 1:]).max() < 1e-5
    assert np.abs(now[:, 1:] - load[1:]).max() > 0.1


def test_half_of_a_rope_at_an_attachment_moves_the_centre_of_mass() -> None:
    body = Body(
        box_inertia(2.0, [0.6, 0.4, 0.2]), RHO, centre=[0.01, 0.02, -0.03], size=[0.6, 0.4, 0.2]
    )
    heavier = body.with_masses(2.0, np.array([0.1, 0.2, 0.0]))
    masses, places = np.array([2.0, 0.1, 0.2]), np.vstack([body.centre, RHO[:2]])
    assert heavier.centre == pytest.approx(masses @ places / 2.3)
    about = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places, strict=True)
    )
    middle = heavier.centre
    whole = body.inertia + about - 2.3 * (middle @ middle * np.eye(3) - np.outer(middle, middle))
    assert heavier.inertia == pytest.approx(whole)


def test_who_leaves_takes_its_attachment_along() -> None:
    body = Body(np.diag([1.0, 1.0, 1.0]), RHO)
    team = replace(Team.uniform(3), body=body)
    assert np.array_equal(team.of([0, 2]).levers, RHO[[0, 2]])
    with pytest.raises(SettingError, match=r"one for each of 4 drones .found 3 points"):
        replace(Team.uniform(4), body=body)


@pytest.mark.parametrize(
    ("inertia", "says"),
    [
        (np.diag([1.0, 1.0, 2.1]), "none exceeds the sum"),
        (np.diag([1.0, -1.0, 1.0]), "above 0"),
        (np.array([[1.0, 0.1, 0], [0.0, 1, 0], [0, 0, 1]]), "symmetric"),
    ],
)
def test_an_inertia_that_no_body_has(inertia: np.ndarray, says: str) -> None:
    with pytest.raises(SettingError, match=says):
        Body(inertia, RHO)


def test_boxes_bars_and_their_corners() -> None:
    assert len(corners(np.array([0.6, 0.4, 0.2]))) == 8
    assert len(corners(np.array([2.0, 0.0, 0.0]))) == 2
    assert usual_attachments(2, np.array([2.0, 0.1, 0.1])) == pytest.approx(
        np.array([[1.0, 0, 0.05], [-1.0, 0, 0.05]])
    )
    assert np.diag(box_inertia(12.0, np.array([1.0, 2.0, 3.0]))) == pytest.approx([13, 10, 5])
