"""Teams without a leader: each drone's agent decides from what it wants and what it hears."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import colift
from colift.control.agents.base import AgentPart, Status
from colift.flight.agents import ALONE, decide, has_left
from colift.flight.flight import Flight
from colift.kernel.layout import Layout
from colift.kernel.math import message
from colift.kernel.signals import MESSAGE
from colift.mission import load_mission
from colift.part import load_file, register
from colift.record.metrics import tracking_error
from colift.team import Team
from colift.world.network.base import NetworkPart
from colift.world.network.perfect import Perfect

(MeanWish,) = load_file(Path(__file__).parents[2] / "docs" / "examples" / "my_agent.py")
THREE = {"drones.count": 3, "timing.duration": 2.0, "agents.kind": "my-agent"}


class Plain(MeanWish):
    """The same agent, not compiled."""

    kernel = getattr(MeanWish.kernel, "py_func", MeanWish.kernel)


def deaf_to_the_first(now, sees, params, memory, writes):
    getattr(Perfect.kernel, "py_func", Perfect.kernel)(now, sees, params, memory, writes)
    writes.heard[:, 0] = 0.0


class Jammed(NetworkPart):
    """Nobody hears drone 0."""

    kernel = deaf_to_the_first


heard: list[tuple[int, int, list[int], list[float]]] = []
"""Number, cycle, first byte of each message and what is new, of each call of the agent ``told``."""


def told(now, sees, params, memory, writes):
    """Broadcasts its number and its count of cycles; notes what it hears; bears an equal share."""
    number = int(sees.number[0])
    memory[0] += 1.0
    writes.outbox[:] = int(10 * number + memory[0])
    heard.append((number, now.step, sees.inbox[:, 0].tolist(), sees.heard.tolist()))
    writes.tension[0] = sees.steady_wish[2] / (sees.members.size * abs(writes.direction[2]))
    return 7 + number


class Told(AgentPart):
    """Plain Python, with one number of its own."""

    kernel = told
    remembers = Layout(drone={"cycles": 1})


@pytest.fixture(scope="module", autouse=True)
def _registered():
    for kind, made in (("plain", Plain), ("told", Told), ("jammed", Jammed)):
        register(kind, made)


def flown(**settings):
    return Flight(load_mission("hover", THREE | settings)).run()


def test_a_team_of_three_hovers_compiled_and_not():
    compiled = colift.run("hover", overrides=THREE)
    assert compiled.compiled
    assert compiled.recording.outcome == "completed"
    assert compiled.metrics["tracking_max_m"] < 0.1
    assert compiled.metrics["tracking_rms_m"] < 0.03
    flight = Flight(load_mission("hover", {**THREE, "agents.kind": "plain"}))
    assert not flight.compiled
    plain = flight.run()
    for name in ("load", "desired_tensions", "received_directions", "agent_status"):
        np.testing.assert_allclose(plain[name], compiled.recording[name], atol=1e-9)


def test_each_drone_flies_what_its_agent_says_and_no_allocator_is_asked():
    recording = flown(
        **{"link": {"kind": "radio", "delay": 0.5}}
    )  # which carries an allocator's answers
    for what in ("tensions", "directions"):
        np.testing.assert_array_equal(recording[f"received_{what}"], recording[f"desired_{what}"])
    pulls = recording["desired_tensions"][..., None] * recording["desired_directions"]
    # Wishes are those of the cycle before, rounded to a millinewton; that of the first is known at once.
    error = np.linalg.norm(pulls.sum(axis=1)[1:] + recording["force"][:-1], axis=1)
    assert error.max() < 0.05
    assert np.median(error) < 2e-3
    assert np.isnan(recording["allocator_status"]).all()
    assert (recording["allocator_time"] > 0.0).all()


def test_a_message_is_heard_one_cycle_later_by_all_others():
    heard.clear()
    recording = flown(**{"agents.kind": "told", "timing.duration": 0.05, "timing.allocation": 0.01})
    assert [(number, step) for number, step, _, _ in heard] == [
        (drone, cycle) for cycle in range(6) for drone in range(3)
    ]
    for drone, cycle, inbox, new in heard:
        others = [float(j != drone and cycle > 0) for j in range(3)]
        assert new == others
        for j in range(3):
            if others[j]:
                assert inbox[j] == 10 * j + cycle
    assert (recording["agent_status"][-1] == [7.0, 8.0, 9.0]).all()


def test_who_is_not_heard_is_held_and_its_silence_recorded():
    recording = flown(**{"network.kind": "jammed"})
    after = recording["agent_status"][2:]
    assert (after[:, 0] == Status.FREE).all()
    assert (after[:, 1:] == Status.HOLDING).all()
    assert recording.outcome == "completed"


def test_a_drone_that_left_neither_sends_nor_hears():
    heard.clear()
    settings = {**THREE, "agents.kind": "told", "timing.allocation": 0.01}
    flight = Flight(load_mission("hover", settings))
    flight.advance(0.03)
    flight.lose([1])
    begin = len(heard)
    flight.advance(0.03)
    later = heard[begin:]
    assert {number for number, *_ in later} == {0, 2}
    for drone, step, inbox, new in later:
        assert new == [float(drone != 0), float(drone != 2)]
        assert (
            inbox[int(drone == 0)] == 10 * (2 - drone) + step
        )  # also across the change, with its memory
    assert flight.bus.members.tolist() == [0.0, 2.0]
    recording = flight.recording()
    assert np.isnan(recording["agent_status"][-1, 1])
    assert (recording["agent_status"][-1, [0, 2]] == [7.0, 9.0]).all()


def test_who_carries_is_told_to_all_or_each_knows_it_of_itself():
    for kind, told in (("none", 0.0), ("self-check", 1.0)):
        flight = Flight(load_mission("hover", THREE | {"detection.kind": kind}))
        flight.advance(0.03)
        bus, leaderless = flight.bus, flight._legs[-1].circuit.leaderless
        bus.carrying[1] = 0.0
        bus.views[:] = 1.0
        decide(
            *(getattr(flight.wires, name) for name in ("network", "agents", "allocation")),
            bus,
            leaderless,
            3,
            0.03,
            0.01,
        )
        np.testing.assert_array_equal(bus.evidences[:, 1], [told, 0.0, told])
        np.testing.assert_array_equal(bus.evidences[:, [0, 2]], 1.0)
        left = [has_left(bus, leaderless, j) for j in range(3)]
        assert left == [False, told == 0.0, False]
        bus.views[[0, 2], 1] = 0.0  # now the others know it, whatever it takes itself for
        assert has_left(bus, leaderless, 1)


def test_an_agent_that_does_not_judge_is_told_at_once():
    flight = Flight(load_mission("hover", THREE | {"detection.kind": "self-check"}))
    flight.advance(0.5)
    flight.bus.carrying[1] = 0.0
    flight.advance(0.01)
    assert flight.drones == [0, 2]


def test_a_snapshot_holds_what_is_on_its_way():
    flight = Flight(load_mission("hover", THREE))
    flight.advance(0.5)
    before = flight.snapshot()
    flight.advance(0.2)
    once, outbox = flight.bus.row.copy(), flight.bus.outboxes.copy()
    flight.restore(before)
    assert not (flight.bus.outboxes == outbox).all()
    flight.advance(0.2)
    np.testing.assert_array_equal(flight.bus.row, once)
    np.testing.assert_array_equal(flight.bus.outboxes, outbox)


def test_one_agent_is_called_by_hand():
    team = Team.uniform(3)
    part = MeanWish()
    memory = part.memory(team)
    own = memory[: memory.size // 3]
    writes, status = part.call(
        team, own, wish=[0.0, 0.0, 3.0], direction=[0.6, 0.0, -0.8], members=[0.0, 1.0, 2.0],
        number=[1.0],
    )  # fmt: skip
    assert status == Status.HOLDING
    assert writes.outbox.dtype == np.uint8
    assert message.get(writes.outbox, 4) == 3000.0
    np.testing.assert_allclose(writes.tension, 1.25)
    np.testing.assert_allclose(writes.direction, [0.6, 0.0, -0.8])


def test_a_memory_that_is_not_the_same_for_each_drone_is_refused():
    class Shared(MeanWish):
        remembers = Layout(team={"secret": 1}, drone={"own": 2})

    assert Shared().check(Team.uniform(3))
    assert not MeanWish().check(Team.uniform(3))
    assert MeanWish().check(Team.uniform(9))


@pytest.mark.parametrize("number", [0.0, 1.0, -1.0, 255.0, 256.0, -256.0, 32767.0, -32767.0])
def test_numbers_survive_a_message(number):
    sent = np.zeros(MESSAGE, np.uint8)
    message.put(sent, 3, number)
    assert message.get(sent, 3) == number
    message.put(sent, 5, number + 0.4)
    assert message.get(sent, 5) == max(-32767.0, min(32767.0, number))


def test_no_number_fits_beyond_the_largest_and_none_is_sent_as_nothing():
    sent = np.zeros(MESSAGE, np.uint8)
    for value, read in ((1e300, 32767.0), (-np.inf, -32767.0), (np.nan, 0.0)):
        message.put(sent, 0, value)
        assert message.get(sent, 0) == read


def test_optimal_exchange_balances_the_force_that_all_want():
    recording = flown(**{"agents.kind": "exchange-admm", "timing.duration": 4.0})
    assert recording.outcome == "completed"
    pulls = recording["desired_tensions"][..., None] * recording["desired_directions"]
    error = np.linalg.norm(pulls.sum(axis=1) + recording["force"], axis=1)
    weight = recording["force"][-1, 2]
    assert np.median(error[-500:]) < 0.02 * weight


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["drone-lost", "cable-cut"])
@pytest.mark.parametrize(("n", "drone"), [(4, 0), (4, 1), (4, 2), (4, 3), (6, 5)])
def test_any_one_drone_may_die_and_nobody_is_told(fault, n, drone):
    """In the wind of real-world, with half of the messages lost, by what each finds itself and says over the radio."""
    at = 6.0 + drone
    settings = {
        "drones.count": n, "load.mass": 0.225 / 4 * n, "seed": 17 + drone, "timing.duration": at + 6.0,
        "fault": [{"kind": fault, "at": at, "drone": drone}],
    }  # fmt: skip
    flight = Flight(load_mission("leaderless", settings))
    assert flight._legs[-1].circuit.leaderless == ALONE
    recording = flight.run()
    assert recording.outcome == "completed"
    ((found, who),) = flight.membership.found
    assert who == drone
    assert at < found < at + 0.4
    away = np.linalg.norm(tracking_error(recording), axis=1)
    assert away.max() < 0.5
    assert away[recording.time > at + 4.0].max() < 0.15


@pytest.mark.slow
def test_what_the_others_know_of_a_death_they_have_heard():
    """Who hears nobody keeps the dead in its team, until it hears or misses it; the flight goes on meanwhile."""
    deaf = {
        "network": {"kind": "radio", "loss": [0.0, 1.0, 0.0, 0.0], "delay": 0.01, "jitter": 0.0}
    }
    settings = {
        **deaf,
        "fault": [{"kind": "cable-cut", "at": 2.0, "drone": 0}],
        "disturbance": [],
        "seed": 3,
    }
    flight = Flight(load_mission("leaderless", settings))
    flight.advance(2.0)
    views = []
    while flight.bus.members.size == 4 and flight.time < 4.0:
        flight.advance(0.01)
        if flight.bus.members.size == 4:
            views.append(
                (
                    flight.time,
                    *flight.bus.views[1:, 0],
                    flight.bus.carrying[0],
                    flight.bus.attached[0],
                )
            )
    views = np.array(views)
    own = views[views[:, 4] == 0.0, 0].min()
    heard = [views[views[:, k] == 0.0, 0].min(initial=9.0) for k in (2, 3)]
    assert own < heard[0] == heard[1] <= own + 0.04
    assert (views[views[:, 0] <= heard[0], 1] == 1.0).all()  # the deaf one does not know it yet
