"""Published ways of teams without a leader's allocator, beside the project's own: a leader that nobody hears, and plans that are exchanged."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.agents.distributed_mpc import DistributedMpc
from colift.control.agents.leader import Leader
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.math.message import MOST
from colift.mission import load_mission
from colift.record.metrics import tracking_error
from colift.study.rehearsal import (
    PULL,
    STATUS,
    Asked,
    Rehearsal,
    force_error,
    formation_of,
    team_of,
)
from colift.world.network.radio import Radio

LOST = {"loss": 1.0, "delay": 0.0, "jitter": 0.0}
HEARD = {"loss": 0.0, "delay": 0.0, "jitter": 0.0}
CYCLES = 600


def held(n: int, push: float = 0.0) -> Asked:
    """All want the weight, and from the third second on a level push, N, as well."""
    team = team_of(n)
    wishes = np.zeros((CYCLES, n, 3))
    wishes[:, :, 2] = team.load_mass * team.gravity
    wishes[300:, :, 0] = push
    return Asked(wishes, wishes.copy(), np.zeros((CYCLES, n, 3)), np.zeros((CYCLES, n)))


def pulls(out: np.ndarray) -> np.ndarray:
    """Of all drones on the load, (rows, n, 3), N."""
    return -out[:, :, PULL, None] * out[:, :, PULL + 1 : STATUS]


def rehearsal(part, n: int, radio: dict[str, float]) -> Rehearsal:
    return Rehearsal(part, Radio(**radio), team_of(n), formation_of(n, 34.0), key=3)


@pytest.mark.parametrize("n", [2, 4, 8])
def test_followers_hold_their_pull_and_the_leader_gives_its_share_of_what_is_wanted_beside_the_weight(
    n,
):
    part = Leader(stiffness=0.5, leader=1)
    out = pulls(rehearsal(part, n, LOST).run(held(n, push=0.4)))
    start = -formation_of(n, 34.0)
    weight = team_of(n).load_mass * team_of(n).gravity
    np.testing.assert_allclose(out[0], weight / n * start / start[:, 2:], atol=1e-9)
    others = [i for i in range(n) if i != 1]
    np.testing.assert_array_equal(out[-1, others], out[0, others])
    np.testing.assert_allclose(out[-1, 1] - out[0, 1], [0.2, 0.0, 0.0], atol=1e-9)


def test_a_leader_needs_no_message():
    heard, lost = (rehearsal(Leader(), 4, radio).run(held(4, push=0.4)) for radio in (HEARD, LOST))
    np.testing.assert_array_equal(heard, lost)


def test_who_leads_must_be_there():
    with pytest.raises(MissionError, match=r"agents\.leader.*there is no drone 4"):
        load_mission("hover", {"agents": {"kind": "leader", "leader": 4}})


@pytest.mark.parametrize("n", [2, 4, 16])
def test_exchanged_plans_come_to_the_optimum_of_all(n):
    """At rest: sum_i (f_i - home_i) + q (F + sum f) = 0 for each, the optimum of the whole team's stage cost."""
    part = DistributedMpc(balance=30.0)
    asked = held(n, push=0.4)
    team = rehearsal(part, n, HEARD)
    out = np.concatenate(
        [team.run(asked), team.run(Asked(*(a[300:].repeat(12, axis=0) for a in asked)))]
    )
    f = -pulls(out)[-1]
    home = -pulls(out)[0]
    missing = f.sum(axis=0) + asked.wishes[-1, 0]
    gone = asked.wishes[-1, 0] + home.sum(axis=0)
    rounded = (
        0.5 * n * 4.0 * team_of(n).load_mass * team_of(n).gravity / MOST
    )  # of all that is read
    np.testing.assert_allclose(missing, gone / (1.0 + 30.0 * n), atol=rounded)
    np.testing.assert_allclose(f - home, np.tile(-30.0 * missing, (n, 1)), atol=30.0 * rounded)


def test_plans_that_are_not_heard_are_waited_for():
    out = rehearsal(DistributedMpc(), 4, LOST).run(held(4, push=0.4))
    assert (out[:, :, STATUS] == 1.0).all()
    np.testing.assert_array_equal(out[-1, :, :STATUS], out[0, :, :STATUS])


@pytest.mark.parametrize("part", [Leader(), DistributedMpc()])
def test_a_wish_that_is_no_number_moves_nothing_to_what_is_none(part):
    asked = held(4)
    asked.wishes[100:, 2] = np.nan
    asked.wishes[200:, 0, 1] = np.inf
    out = rehearsal(part, 4, HEARD).run(asked)
    assert np.isfinite(out).all()
    assert (force_error(held(4), out)[:100] < 0.05).all()


@pytest.mark.parametrize(("kind", "away"), [("leader", 0.03), ("distributed-mpc", 0.01)])
def test_the_spiral_is_flown(kind, away):
    recording = Flight(
        load_mission("paper-spiral", {"agents.kind": kind, "timing.duration": 12.0})
    ).run()
    assert recording.outcome == "completed"
    assert np.linalg.norm(tracking_error(recording), axis=1).max() < away
