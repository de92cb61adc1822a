"""What breaks, who notices, and how the flight goes on."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.control.allocation.base import Allocator
from colift.control.detection.residuals import MEMORY, Residuals
from colift.control.detection.self_check import SelfCheck
from colift.control.reference.descent import Descent
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.signals import CYCLE_SIGNALS
from colift.kernel.status import Status
from colift.mission import load_mission
from colift.mission.outlook import bound, outlook
from colift.record.metrics import compute
from colift.team import Team
from colift.world.fault.base import LOAD
from colift.world.fault.battery_low import BatteryLow
from colift.world.fault.motor_degraded import MotorDegraded

AT = 3.0
REAL = ["ideal", "real"]


def mission(world, fault=None, n=4, seed=0, duration=5.0, **overrides):
    """The spiral with n drones; ``real`` has noise, delay, loss, motors, wind and turbulence."""
    table = load_mission("cut-in-flight").resolved()
    table["fault"] = [] if fault is None else [{"at": AT, "drone": 1, **fault}]
    table["drones"]["count"], table["seed"], table["timing"]["duration"] = n, seed, duration
    if world == "ideal":
        table["disturbance"] = []
        table["detection"]["frozen"] = 0.0
        for layer in ("sensing", "link", "actuation"):
            table[layer] = {"kind": "ideal"}
    return load_mission(table, {path.replace("__", "."): v for path, v in overrides.items()})


def fly(world, fault=None, **settings):
    flight = Flight(mission(world, fault, **settings))
    return flight, flight.run()


def error(recording):
    return np.linalg.norm(recording["load"][:, 0] - recording["reference"][:, 0], axis=1)


# ---------------------------------------------------------------- faults


def test_a_dead_drone_hangs_from_the_load_or_falls():
    for with_cable in (True, False):
        fault = {"kind": "drone-lost", "with_cable": with_cable}
        free = {"detection__kind": "none", "world__ground": "none"}
        _, r = fly("ideal", fault, duration=AT + 1.0, **free)
        assert r.outcome == "completed"
        assert r["attached"][-1, 1] == float(with_cable)
        assert (r["motor_health"][-1, 1] == 0.0).all()
        assert (r["applied_thrusts"][r.time >= AT, 1] == 0.0).all()
        falling = (r.time >= AT) & (r.time <= AT + 0.3)
        before, after = r["velocities"][falling][[0, -1], 1, 2]
        assert after - before == pytest.approx(-9.81 * 0.3, rel=0.02)  # first on a slack cable
        apart = np.linalg.norm(r["load"][:, 0] - r["positions"][:, 1], axis=1)
        if with_cable:
            assert apart.max() == pytest.approx(1.0, abs=1e-3)
            assert r["tensions"][r.time > AT + 0.3, 1].max() > 0.5 * 9.81
        else:
            assert apart.max() > 2.0


def test_battery_falls_in_equal_steps():
    changes = list(BatteryLow(health=0.6, duration=2.0, steps=5).changes(2, 1.0))
    assert [c.at for c in changes] == [1.0, 1.5, 2.0, 2.5, 3.0]
    np.testing.assert_allclose([c.value for c in changes], [0.92, 0.84, 0.76, 0.68, 0.6])
    assert {(c.signal, c.drone) for c in changes} == {("motor_health", 2)}


def test_a_weak_motor_needs_motors():
    """On rotors without motors it would only be a quarter less thrust, and would turn nothing."""
    weak = {"fault": [{"kind": "cable-cut", "at": 0.5}, {"kind": "motor-degraded", "at": 0.1}]}
    for changes in (weak, {**weak, "actuation": {"kind": "motors"}, "actuation.kind": "ideal"}):
        with pytest.raises(MissionError) as caught:
            load_mission("hover", changes)
        (problem,) = caught.value.problems
        assert problem.path == "fault.1.kind"
        assert 'actuation.kind = "ideal" has none' in problem.message
    load_mission("hover", {**weak, "actuation.kind": "motors"})
    # A battery and the loss of a whole drone are the same for all four.
    for kind in ("battery-low", "drone-lost"):
        load_mission("hover", {"fault": [{"kind": kind, "at": 0.1}]})


def test_a_dead_motor_turns_its_drone():
    """It is kicked with what the others give too much, and goes on turning: nothing can turn it back.

    The mixer stops the motor opposite within 0.1 s, which takes the torque away; only the dead motor could give
    one the other way. Two motors are left, at half their most, for the mixer wants the dead one at its most. They
    spin the same way. Until then the torque falls about evenly: the drone gains 0.5 rad/s on either axis.
    """
    changes = {"actuation.kind": "motors", "fault.0.at": 0.5, "timing.duration": 0.7}
    fault = [{"kind": "motor-degraded", "drone": 2, "motor": 0, "health": 0.0}]
    changes["detection.kind"] = "none"
    r = colift.run(mission("ideal").resolved(), overrides={"fault": fault, **changes}).recording
    drones, motors = r.mission.drones, r.mission.actuation
    before, after, late = r.time < 0.5, (r.time >= 0.5) & (r.time < 0.51), r.time >= 0.65
    lever = motors.arm_length / np.sqrt(2.0)
    kick = lever * 0.25 * r["thrusts"][after, 2].mean()
    np.testing.assert_allclose(
        r["applied_torques"][after, 2, :2].mean(axis=0), [-kick, kick], rtol=0.06
    )
    assert np.abs(r["applied_torques"][late, 2, :2]).max() < 0.05 * kick
    both = 2.0 * motors.max_thrust / 2.0
    np.testing.assert_allclose(r["applied_thrusts"][late, 2], both, rtol=0.05)
    assert both < 0.65 * drones.mass * 9.81
    np.testing.assert_allclose(
        r["applied_torques"][late, 2, 2], -motors.torque_ratio * both, rtol=0.05
    )
    rates = r["rates"][:, 2]
    gained = rates[late] - rates[before][-1]
    evenly = 0.5 * kick * 0.1 / np.array(drones.inertia[:2])
    np.testing.assert_allclose(gained[:, :2].mean(axis=0), [-evenly[0], evenly[1]], rtol=0.2)
    spin = np.gradient(rates[late, 2], r.time[late])
    np.testing.assert_allclose(spin, -motors.torque_ratio * both / drones.inertia[2], rtol=0.1)
    tilting = np.linalg.norm(r["rates"][:, :, :2], axis=2)
    assert tilting[late, 2].min() > 3.0 * tilting[before].max()
    assert (r["saturated_times"][-1, [0, 1, 3]] == 0.0).all()
    assert r["saturated_times"][-1, 2] > 0.1


def test_two_weak_motors_of_one_drone_keep_both_faults():
    table = mission("ideal").resolved()
    table["actuation"] = {"kind": "motors"}
    table["fault"] = [
        {"kind": "motor-degraded", "at": 0.1, "drone": 1, "motor": 0, "health": 0.9},
        {"kind": "motor-degraded", "at": 0.2, "drone": 1, "motor": 2, "health": 0.8},
    ]
    flight = Flight(load_mission(table))
    flight.advance(0.3)
    np.testing.assert_array_equal(flight.bus.motor_health[1], [0.9, 1.0, 0.8, 1.0])
    np.testing.assert_array_equal(flight.bus.motor_health[[0, 2, 3]], 1.0)
    assert next(iter(MotorDegraded(motor=3).changes(0, 1.0))).value == (None, None, None, 0.5)


def test_stuck_sensors_of_load_and_drone_come_back():
    for body, signal, row in (("drone", "measured_positions", 1), ("load", "measured_load", 0)):
        fault = {"kind": "sensor-stuck", "body": body, "duration": 0.2}
        _, r = fly("ideal", fault, duration=AT + 0.5, detection__kind="none")
        during = (r.time > AT) & (r.time < AT + 0.2)
        assert np.ptp(r[signal][during, row], axis=0).max() == 0.0
        truth = r["positions"][:, 1] if body == "drone" else r["load"][:, 0]
        assert np.ptp(truth[during], axis=0).max() > 0.02
        np.testing.assert_array_equal(r[signal][-1, row], truth[-1])
        stuck = r["stuck"][r.time > AT][0]
        assert stuck.sum() == 1.0
        assert stuck[LOAD if body == "load" else 1] == 1.0


def test_a_silent_allocator_leaves_the_drones_with_what_they_have():
    _, r = fly("ideal", {"kind": "allocator-silent", "duration": 0.3}, duration=AT + 1.0)
    during = (r.time > AT) & (r.time < AT + 0.3)
    assert np.ptp(r["received_directions"][during], axis=0).max() == 0.0
    assert (r["allocator_status"][(r.cycle_time > AT) & (r.cycle_time < AT + 0.29)] == 9).all()
    assert r["allocator_status"][-1] == 0
    assert error(r).max() < 0.05


def test_a_silent_cycle_measures_nothing_and_no_metric_takes_it_for_an_answer():
    fault = {"kind": "allocator-silent", "duration": 3.0}
    _, r = fly("ideal", fault, duration=AT + 1.5)
    silent = r["allocator_status"] == Status.SILENT
    assert silent.mean() > 0.3
    for name in (s.name for s in CYCLE_SIGNALS if s.name != "allocator_status"):
        assert np.isnan(r[name][silent]).all(), name
    numbers, times = compute(r), r["allocator_time"][~silent]
    assert (times > 0.0).all()
    assert numbers["allocator_silent"] == silent.sum() == 151
    assert numbers["allocator_failures"] == 0.0
    assert numbers["allocator_median_us"] == pytest.approx(1e6 * np.median(times))
    assert numbers["allocator_mean_us"] == pytest.approx(1e6 * times.mean())
    assert numbers["allocator_mean_iterations"] >= 1.0


def test_a_released_load_falls_freely_and_nobody_is_blamed():
    flight, r = fly("ideal", {"kind": "load-released"}, duration=AT + 0.5)
    assert flight.membership.found == []
    fall = r["load"][-1, 1, 2] - r["load"][r.time >= AT][0, 1, 2]
    assert fall == pytest.approx(-9.81 * 0.5, rel=0.01)


# ---------------------------------------------------------------- detection


@pytest.mark.parametrize("world", REAL)
@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "cable-cut"},
        {"kind": "drone-lost"},
        {"kind": "drone-lost", "with_cable": False},
    ],
    ids=["cable", "drone", "both"],
)
def test_lost_drones_are_found_and_the_others_carry_on(world, fault):
    for seed in range(3):
        flight, r = fly(world, fault, seed=seed, duration=AT + 2.5)
        assert r.outcome == "completed"
        assert [drone for _, drone in flight.membership.found] == [1]
        assert 0.0 < flight.membership.found[0][0] - AT <= 0.16
        assert flight.drones == [0, 2, 3]
        assert error(r).max() < 0.15
        metrics = compute(r)
        assert metrics["lost_drones"] == 1.0
        assert metrics["detection_delay_s"] == pytest.approx(
            flight.membership.found[0][0] - AT, abs=0.006
        )
        assert metrics["min_angle_deg"] > 20.0


def test_no_false_alarm_without_a_fault():
    """Twelve seeds of noise, delay, loss, motors, wind of 10 m/s and its turbulence."""
    worst = 0.0
    for seed in range(12):
        wind = {"disturbance.0.speed": 10.0, "disturbance.1.speed": 10.0}
        flight = Flight(load_mission(mission("real", seed=seed, duration=10.0).resolved(), wind))
        r = flight.run()
        assert flight.membership.found == []
        assert r.outcome == "completed"
        worst = max(worst, error(r).max())
    assert 0.02 < worst < 0.3
    metrics = compute(r)
    assert metrics["lost_drones"] == 0.0
    assert np.isnan(metrics["detection_delay_s"])


@pytest.mark.parametrize(
    "overrides",
    [
        {"truth.load_mass_factor": 1.5, "load_control.k_i": [6.0, 6.0, 6.0]},
        {"truth.cable_length_factor": [1.05, 0.95, 1.0, 1.03]},
        {"truth.drone_mass_factor": 1.1},
    ],
    ids=["load", "cables", "drones"],
)
def test_no_false_alarm_with_a_wrong_model(overrides):
    flight = Flight(load_mission(mission("real", duration=6.0).resolved(), overrides))
    assert flight.run().outcome == "completed"
    assert flight.membership.found == []


def test_stuck_sensors_of_the_load_are_nobodys_loss():
    flight, r = fly("real", {"kind": "sensor-stuck", "body": "load", "duration": 0.1})
    assert flight.membership.found == []
    assert r.outcome == "completed"


def test_a_drone_whose_sensors_stay_stuck_is_dropped():
    for frozen in (0.0, 0.06):
        fault = {"kind": "sensor-stuck", "duration": 5.0}
        flight, r = fly("real", fault, duration=AT + 2.0, detection__frozen=frozen)
        assert [drone for _, drone in flight.membership.found] == [1]
        assert r.outcome == "completed"
    assert flight.membership.found[0][0] - AT == pytest.approx(0.06, abs=0.012)
    assert error(r).max() < 0.1


def test_two_faults_one_after_the_other():
    table = mission("ideal", n=5, duration=7.0).resolved()
    table["fault"] = [
        {"kind": "cable-cut", "at": 2.0, "drone": 4},
        {"kind": "drone-lost", "at": 4.0, "drone": 0},
    ]
    flight = Flight(load_mission(table))
    r = flight.run()
    assert [drone for _, drone in flight.membership.found] == [4, 0]
    assert r.outcome == "completed"
    assert compute(r)["lost_drones"] == 2.0


def test_thresholds_are_settings():
    """With a huge threshold nobody notices."""
    flight = Flight(load_mission(mission("ideal", {"kind": "cable-cut"}, duration=3.5).resolved(),
                                 {"detection.speed": 10.0}))  # fmt: skip
    flight.run()
    assert flight.membership.found == []
    assert Residuals().params(colift.team.Team.uniform(3)).size == 14


def alarms(distances, dt=0.005, part=None, memory=None):
    """Whether a drone above its load is judged lost as the distance between them takes these values."""
    part, team = part or Residuals(), colift.team.Team.uniform(1)
    memory, carrying = part.memory(team) if memory is None else memory, np.ones(1)
    down, q = np.array([[0.0, 0.0, -1.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    found = []
    for d, speed in zip(distances, np.gradient(distances, dt), strict=True):
        load = np.array([[0.0, 0.0, -d], [0.0, 0.0, -speed]])
        hover = np.array([team.masses[0] * team.gravity])
        part.call(
            team, memory, dt=dt, estimated_ends=load[None], estimated_attitudes=q, thrusts=hover,
            received_directions=down, carrying=carrying,
        )  # fmt: skip
        found.append(carrying[0] == 0.0)
    return np.array(found)


def test_after_a_change_of_the_team_nobody_is_judged_for_a_while():
    """A rigid load's cables go slack and come taut until it hangs anew: what grows then is no sign, and afterwards it is."""
    t = np.arange(0.0, 1.5, 0.005)
    parting = 1.0 + 0.5 * np.maximum(t - 0.8, 0.0)
    at = {}
    for grace in (0.0, 1.2):
        part = Residuals(grace=grace)
        team = colift.team.Team.uniform(1)
        memory = part.carry_over(part.memory(team), part.memory(team), np.array([0]))
        found = alarms(parting, part=part, memory=memory)
        assert found.any()
        at[grace] = t[np.argmax(found)]
    assert 0.8 < at[0.0] < 0.9
    assert 1.19 < at[1.2] < 1.25
    box = load_mission("box-figure-eight").team
    assert Residuals().grace_of(box) == 4.0
    assert Residuals().grace_of(team) == 0.0


def test_while_a_load_tumbles_nobody_is_judged_but_not_for_ever():
    """Two drones that are left with a box: what delay makes of ends that whirl is no sign of a cable, until they hang, or for four times the grace."""
    dt, grace = 0.01, 1.0
    team = load_mission("box-figure-eight", {"drones.count": 2}).team
    part = Residuals(grace=grace)
    q, down = np.tile([1.0, 0, 0, 0], (2, 1)), np.tile([0.0, 0.0, -1.0], (2, 1))
    judged = {}
    for calm_from in (0.0, 2.0, 9.0):
        memory = part.carry_over(part.memory(team), part.memory(team), np.array([0, 1]))
        carrying, judged[calm_from] = np.ones(2), np.nan
        for step in range(600):
            time = (step + 1) * dt  # since the change, when the step ends
            whirl = 6.0 if time < calm_from else 0.5
            ends = np.zeros((2, 2, 3))
            ends[:, 0, 0], ends[:, 1, 1] = (-0.3, 0.3), (-0.3 * whirl, 0.3 * whirl)
            parting = 1.0 + 0.5 * max(time - 0.8, 0.0)  # of the first cable
            ends[0, 0, 2], ends[0, 1, 2] = -parting, -0.5 * (time > 0.8)
            ends[1, 0, 2] = -1.0
            positions = ends[:, 0] + (0.0, 0.0, 1.0)
            positions[0, 2] = 0.0
            part.call(
                team, memory, dt=dt, estimated_ends=ends, estimated_positions=positions, estimated_velocities=ends[:, 1] * (1.0, 1.0, 0.0),
                estimated_attitudes=q, thrusts=team.masses * team.gravity, received_directions=down, carrying=carrying,
            )  # fmt: skip
            if not carrying[0]:
                judged[calm_from] = time
                break
    assert 1.0 <= judged[0.0] < 1.1
    assert 3.0 <= judged[2.0] < 3.1
    assert 4.0 <= judged[9.0] < 4.1


def test_a_cable_that_was_slack_for_long_catches_without_an_alarm():
    taut, slack = np.full(400, 1.0), np.full(800, 0.97)
    catching = np.linspace(0.97, 1.0, 12)
    assert not alarms(np.concatenate([taut, slack, catching, taut])).any()
    gone = 1.0 + 0.5 * 1.3 * (0.005 * np.arange(40)) ** 2  # pulled away by what it carried
    lost = alarms(np.concatenate([taut, slack, catching, taut, gone]))
    assert not lost[:1612].any()
    assert lost[1612 + 30]


def test_a_length_that_nobody_knows_yet_alarms_nobody():
    """A cable 5 % longer than thought, slack at the start."""
    falling = np.minimum(1.0 + 0.5 * 1.3 * (0.005 * np.arange(200)) ** 2, 1.05)
    assert not alarms(falling).any()


class Hovering:
    """Drones held in place under their tilted thrusts by wind, weight and cables; told to the kernel as a flight."""

    DT = 0.005

    def __init__(self, winds, **settings):
        """``winds``: forces on the drones over their weight, (n, 3)."""
        self.part, n = Residuals(**settings), len(winds)
        self.team = colift.team.Team.uniform(n)
        self.m, self.g = self.team.masses[0], self.team.gravity
        self.wind = self.m * self.g * np.array(winds, dtype=float)
        turns = 2.0 * np.pi * np.arange(n) / n
        cone = 0.0 if n == 1 else np.radians(30.0)
        self.directions = -np.stack([np.sin(cone) * np.cos(turns), np.sin(cone) * np.sin(turns),
                                     np.full(n, np.cos(cone))], axis=1)  # fmt: skip
        self.tensions = np.full(n, 0.7)
        wanted = -self.wind - self.tensions[:, None] * self.directions
        wanted[:, 2] += self.m * self.g
        self.thrusts = np.linalg.norm(wanted, axis=1)
        x, y, z = (wanted / self.thrusts[:, None]).T
        quaternions = np.stack([1.0 + z, -y, x, np.zeros(n)], axis=1)
        self.attitudes = quaternions / np.linalg.norm(quaternions, axis=1)[:, None]
        self.ends, self.velocities = np.zeros((n, 2, 3)), np.zeros((n, 3))
        self.ages, self.silent = np.zeros((n + 1, 3)), []
        self.positions = -self.directions
        self.memory = self.part.memory(self.team)
        self.carrying = np.ones(n)

    def fly(self, duration, forces=None, moving=True):
        """These forces (n, 3) push them on; the time at which the first is judged lost, and who is."""
        for step in range(round(duration / self.DT)):
            self.ages[self.silent] += self.DT
            if forces is not None:
                self.velocities += self.DT / self.m * forces
            if moving:
                self.positions += self.DT * self.velocities
            self.part.call(
                self.team, self.memory, dt=self.DT, estimated_ends=self.ends,
                estimated_positions=self.positions, estimated_velocities=self.velocities,
                estimated_attitudes=self.attitudes, estimated_ages=self.ages, thrusts=self.thrusts,
                received_tensions=self.tensions, received_directions=self.directions,
                carrying=self.carrying,
            )  # fmt: skip
            assert np.isfinite(self.memory).all()
            if not self.carrying.all():
                return (step + 1) * self.DT, np.flatnonzero(self.carrying == 0.0).tolist()
        return None

    def without_thrust(self, lost, share=1.0):
        """The forces that act when these drones lack a share of their thrust, and their cables' tension."""
        wanted = self.wind + self.tensions[:, None] * self.directions
        wanted[:, 2] -= self.m * self.g
        thrust = -wanted
        forces = np.zeros_like(wanted)
        for i in lost:
            forces[i] = -share * thrust[i] - self.tensions[i] * self.directions[i]
        return forces


WINDS = [(0.0, 0.0), (0.7, 0.0), (0.0, -1.2), (0.9, 0.9)]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("wind", WINDS)
def test_wind_as_strong_as_weight_is_no_lack_of_thrust(n, wind):
    """Rotors that give more drag more: a quarter about the mean. A dead drone is found in the same wind."""
    shares = np.linspace(0.75, 1.25, n) if n > 1 else np.ones(1)
    winds = np.column_stack([np.outer(shares, wind), np.zeros(n)])
    assert Hovering(winds).fly(3.0) is None
    for lost in range(n):
        flight = Hovering(winds)
        assert flight.fly(1.0) is None
        after, who = flight.fly(0.3, flight.without_thrust([lost]))
        assert who == [lost]
        # One that is blown along its cable does not slacken it at once.
        assert after <= (0.1 if np.hypot(*wind) < 1.0 else 0.2)


def test_a_gust_pushes_all_and_nobody_is_lost():
    """Force of the weight within 0.3 s, which nobody has tilted against yet."""
    flight = Hovering(np.zeros((4, 3)))
    assert flight.fly(1.0) is None
    push = np.tile([flight.m * flight.g, 0.0, 0.0], (4, 1))
    for share in np.linspace(0.0, 1.0, 60):
        flight.ends[:, 1] = flight.velocities[0]  # which takes the load along
        flight.ends[:, 0] = flight.positions.mean(axis=0) + [0.0, 0.0, flight.directions[0, 2]]
        assert flight.fly(flight.DT, share * push) is None


def test_two_drones_lost_at_once_are_both_found():
    flight = Hovering(np.tile([0.8, 0.0, 0.0], (4, 1)))
    assert flight.fly(1.0) is None
    forces, found = flight.without_thrust([0, 2]), set()
    for _ in range(20):
        _, who = flight.fly(flight.DT, forces) or (0.0, [])
        found |= set(who)
        flight.carrying[:] = 1.0
    assert found == {0, 2}


def test_a_share_of_thrust_below_the_threshold_is_none():
    for share, found in ((0.35, False), (0.6, True)):
        flight = Hovering(np.tile([0.8, 0.0, 0.0], (4, 1)))
        assert flight.fly(1.0) is None
        assert bool(flight.fly(0.5, flight.without_thrust([1], share))) == found


def test_a_taut_cable_that_pulls_too_much_is_no_lost_drone_at_once():
    """Its pull cannot be told from thrust that lacks: it holds the drone where thrust and wind would move it."""
    flight = Hovering(np.zeros((4, 3)))
    assert flight.fly(1.0) is None
    flight.thrusts[1] *= 2.5  # against more tension than anybody wanted
    after, who = flight.fly(1.0)
    assert who == [1]
    assert after == pytest.approx(flight.part.tug, abs=0.1)


def test_a_drone_that_says_it_moves_and_stands_is_not_measured_any_more():
    for speed in (0.4, 1.0):
        flight = Hovering(np.zeros((4, 3)))
        flight.fly(0.5)
        flight.velocities[:] = [speed, 0.0, 0.0]
        flight.ends[:, 1, 0] = speed
        flight.silent = [2]  # of the others there are new samples, which say the same
        _, who = flight.fly(1.0, moving=False)
        assert who == [2]
        still = MEMORY.view(flight.memory, "still")[2, 0]
        assert speed * still == pytest.approx(flight.part.astray, abs=1.1 * speed * flight.DT)
    # In balance it stands for as long as it likes, and so it may where this is not looked at.
    assert Hovering(np.zeros((4, 3))).fly(5.0) is None
    flight = Hovering(np.zeros((4, 3)), astray=0.0)
    flight.silent = [0, 1, 2, 3]
    flight.velocities[:, 0] = flight.ends[:, 1, 0] = 0.5
    assert flight.fly(2.0, moving=False) is None


def test_the_kernel_stays_finite_at_any_period():
    """Also where the filter forgets all within a period."""
    for dt in (1e-4, 0.1, 1.0):
        flight = Hovering(np.tile([0.5, 0.0, 0.0], (3, 1)), filter=0.002)
        flight.DT = dt
        rng = np.random.default_rng(0)
        for _ in range(50):
            flight.velocities[:] = rng.normal(size=(3, 3))
            flight.fly(dt)
            assert np.isfinite(flight.memory).all()


@pytest.mark.parametrize("n", [2, 4])
def test_no_false_alarm_in_a_storm(n):
    """15 m/s with gusts on ``real-world``: the force of the wind nears a drone's weight."""
    for seed in range(3):
        storm = {"disturbance.0.speed": 15.0, "disturbance.1.speed": 15.0, "seed": seed}
        storm |= {"drones.count": n, "truth.load_mass_factor": 1.0}
        flight = Flight(load_mission("real-world", storm, must_fly=False))
        r = flight.run()
        assert flight.membership.found == []
        drones = r.mission.drones
        force = np.linalg.norm(r["external_forces"][:, :-1], axis=2).max()
        assert force > 0.6 * drones.mass * 9.81


# ---------------------------------------------------------------- controlled descent


def test_descent_is_smooth_starts_as_told_and_ends_at_rest():
    part = Descent(position=(1.0, 2.0, 3.0), velocity=(0.5, -0.4, 0.2), at=2.0, rate=0.5, ease=1.5)
    times = np.linspace(1.9, 14.0, 12_101)
    x = part.sample(times)
    np.testing.assert_allclose(part.sample(np.array([2.0]))[0, :2], [[1, 2, 3], [0.5, -0.4, 0.2]])
    np.testing.assert_allclose(x[-1, 0, 2], part.height, atol=1e-9)
    np.testing.assert_allclose(x[-1, 1:], 0.0, atol=1e-9)
    middle = np.argmin(np.abs(times - 5.0))
    np.testing.assert_allclose(x[middle, 1], [0.0, 0.0, -0.5], atol=1e-9)
    for order in range(2):  # each row is the derivative of the one above
        slope = np.gradient(x[200:, order], times[200:], axis=0)
        np.testing.assert_allclose(slope[2:-2], x[202:-2, order + 1], atol=2e-3)


def cannot_carry(flight, rest):
    directions = flight.bus.desired_directions[[flight.drones.index(drone) for drone in rest]]
    parts = bound(flight.parts, rest)
    return outlook(flight.mission.team.of(rest), parts, directions, flight.clock, 10.0).reason


def too_heavy():
    """Three drones within the tension limit hold 0.225 kg, two do not."""
    limit = {"allocation.tension_max": 1.1, "drones.count": 3}
    return load_mission(mission("ideal", {"kind": "cable-cut"}, duration=12.0).resolved(), limit)


def test_the_load_comes_down_when_the_rest_cannot_carry_it():
    flight = Flight(too_heavy())
    r = flight.run()
    assert "tension_max" in flight.membership.descent
    assert r.outcome == flight.membership.descent
    assert r.outcome.startswith("descended from t = 3.")
    assert r["reference"][-1, 0, 2] == pytest.approx(Descent().height, abs=1e-6)
    assert (r["reference"][r.time > AT + 1.5, 1, 2] <= 1e-9).all()
    metrics = compute(r)
    assert metrics["min_height_m"] == pytest.approx(r["load"][:, 0, 2].min())
    assert metrics["min_height_m"] > 0.0
    arrived = np.argmax(r["load"][:, 0, 2] < 0.15)
    assert arrived > 0
    assert abs(r["load"][arrived, 1, 2]) < 1.5 * Descent().rate


def test_the_load_is_not_brought_down_while_the_rest_can():
    flight, r = fly("ideal", {"kind": "cable-cut"})
    assert flight.membership.descent == ""
    assert r.outcome == "completed"


def test_weak_motors_bring_it_down_too():
    heavy = {"load.mass": 0.8, "allocation.tension_max": 8.0, "actuation.max_thrust": 1.8,
             "allocation.mu": 1.2, "allocation.max_thrust": 100.0}  # fmt: skip
    # Four would be refused before flight, for they have no reserve; in flight they hold it.
    flight = Flight(load_mission(mission("real", n=4).resolved(), heavy, must_fly=False))
    assert cannot_carry(flight, [0, 1, 2, 3]) == ""
    assert "3 drones lift less than 0.7018 kg" in cannot_carry(flight, [0, 1, 2])
    # With 1.95 N a motor they would lift 0.885 kg on vertical cables; 30 degrees apart they do not hold 0.88 kg.
    tilted = {**heavy, "load.mass": 0.88, "actuation.max_thrust": 1.95}
    flight = Flight(load_mission(mission("real", n=4).resolved(), tilted, must_fly=False))
    found = cannot_carry(flight, [0, 1, 2])
    assert "the drones' thrust (together 23.4 N) and min_angle_deg = 30" in found


def test_nobody_calls_the_allocator_to_ask_who_can_carry(monkeypatch):
    """A user's allocator must not be run in the middle of a flight, and the question is answered at once."""
    flight = Flight(too_heavy())
    flight.advance(1.0)

    def never(*arguments):
        raise AssertionError("the allocator was called")

    monkeypatch.setattr(Allocator, "allocate", never)
    assert "tension_max" in cannot_carry(flight, [0, 1])
    flight.lose([2])
    assert flight.membership.descent


def test_who_judges_itself_knows_nothing_of_the_others():
    """Rows of the others, and their number, change neither what a drone finds nor what it remembers."""
    rng, dt = np.random.default_rng(4), 0.01
    part, team = SelfCheck(), Team.uniform(3)
    memory, alone = part.memory(team), part.memory(team.of([1]))
    q = np.tile([1.0, 0, 0, 0], (3, 1))
    for step in range(200):
        lost = step >= 150
        signals = {
            "estimated_ends": rng.normal(size=(3, 2, 3)), "estimated_positions": rng.normal(size=(3, 3)),
            "estimated_velocities": rng.normal(size=(3, 3)), "estimated_attitudes": q, "thrusts": team.masses * team.gravity,
            "received_tensions": rng.uniform(0.5, 1.0, 3), "received_directions": np.tile([0.0, 0.0, -1.0], (3, 1)),
        }  # fmt: skip
        # Drone 1 hangs still on its cable, until it falls with motors that should hold it.
        fall = 9.81 * dt * max(step - 150, 0)
        signals["estimated_ends"][1] = [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]
        signals["estimated_positions"][1] = [0.0, 0.0, -0.5 * fall**2 / 9.81]
        signals["estimated_velocities"][1] = [0.0, 0.0, -fall]
        carrying, single = np.ones(3), np.ones(1)
        part.call(team, memory, dt=dt, carrying=carrying, **signals)
        own = {name: value[1:2] for name, value in signals.items()}
        part.call(team.of([1]), alone, dt=dt, carrying=single, **own)
        assert carrying[1] == single[0]
        np.testing.assert_array_equal(memory.reshape(3, -1)[1], alone)
        if not carrying[1]:
            break
        assert not lost or step < 165
    assert not carrying[1]
    assert 154 <= step < 165


def test_what_a_drone_remembers_of_itself_stays_its_own_when_another_leaves():
    part, team = SelfCheck(), Team.uniform(3)
    old = np.arange(part.memory(team).size, dtype=float)
    kept = part.carry_over(old, part.memory(team.of([0, 2])), np.array([0, 2])).reshape(2, -1)
    before = old.reshape(3, -1)[[0, 2]]
    assert (
        kept != before
    ).sum() == 4  # for both when the team changed, and whether the load tumbled
    fresh = part.carry_over(old, part.memory(team), np.array([-1, 0, 1])).reshape(3, -1)
    assert np.count_nonzero(fresh[0]) == 1  # of who joins as well
