"""Noise, bias, sampling, delay and loss are what the settings say."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from colift.errors import ColiftError, MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.team import Team
from colift.world.link.radio import Radio
from colift.world.sensing.ideal import Ideal
from colift.world.sensing.noisy import Noisy

QUIET = {
    "load_position_noise": 0.0, "load_velocity_noise": 0.0, "position_noise": 0.0,
    "velocity_noise": 0.0, "attitude_noise_deg": 0.0, "rates_noise": 0.0, "attitude_bias": 0.0,
    "specific_force_noise": 0.0, "specific_force_bias": 0.0,
}  # fmt: skip
PROMPT = {
    f"{sensor}_{name}": value
    for sensor in ("load", "tracking", "attitude", "rates")
    for name, value in (("period", 0.001), ("delay", 0.0))
}
NAMES = ("load", "positions", "velocities", "attitudes", "rates")


class Sensors:
    """One sensor model and n drones; :meth:`read` gives what is measured at a step."""

    def __init__(self, part, n=2, *, key=11, dt=0.001):
        self.part, self.key, self.dt = part, key, dt
        self.team, self.memory = Team.uniform(n), part.memory(Team.uniform(n))
        shapes = [(2, 3), (n, 3), (n, 3), (n, 4), (n, 3)]
        self.truth, self.measured = [np.zeros(s) for s in shapes], [np.zeros(s) for s in shapes]
        self.truth[3][:, 0] = 1.0
        self.stuck, self.ages = np.zeros(n + 1), np.zeros((n + 1, 3))
        truth = dict(zip(NAMES, self.truth, strict=True))
        measured = {f"measured_{n}": m for n, m in zip(NAMES, self.measured, strict=True)}
        self.call = part.wired(
            self.team, self.memory, key=key, stuck=self.stuck, **truth, **measured, measured_ages=self.ages
        )  # fmt: skip

    def read(self, step):
        self.call(step, 0.0, self.dt)
        return dict(zip(NAMES, (m.copy() for m in self.measured), strict=True))

    def count(self, steps):
        """Read while the truth counts the steps: what is measured tells when it was true."""
        found = {name: [] for name in NAMES}
        for k in range(steps):
            for t in (0, 1, 2, 4):
                self.truth[t][:] = k
            half = 0.5 * 1e-3 * k
            self.truth[3][:] = [np.cos(half), 0.0, 0.0, np.sin(half)]
            now = self.read(k)
            now["attitudes"] = 2e3 * np.arctan2(now["attitudes"][:, 3], now["attitudes"][:, 0])
            for name in NAMES:
                assert np.ptp(now[name]) < 1e-6
                found[name].append(round(float(now[name].flat[0]), 6))
        return {name: np.array(values) for name, values in found.items()}


def test_delay_and_sampling_are_exact_in_steps():
    timing = {
        "load_period": 0.004, "load_delay": 0.010, "tracking_period": 0.005, "tracking_delay": 0.003,
        "attitude_period": 0.001, "attitude_delay": 0.002, "rates_period": 0.002, "rates_delay": 0.0,
    }  # fmt: skip
    found = Sensors(Noisy(**QUIET, **timing)).count(60)
    k = np.arange(60)
    for name, period, delay in (
        ("load", 4, 10), ("positions", 5, 3), ("velocities", 5, 3), ("attitudes", 1, 2),
        ("rates", 2, 0),
    ):  # fmt: skip
        wanted = np.maximum((k - delay) // period * period, 0)
        np.testing.assert_allclose(found[name], wanted, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("dt", [0.001, 0.0005])
def test_a_sample_says_when_it_was_taken(dt):
    """The truth counts seconds: less the age, whatever the sensor and whether it is stuck, that is what is measured."""
    timing = {
        "load_period": 0.004, "load_delay": 0.010, "tracking_period": 0.005, "tracking_delay": 0.003,
        "attitude_period": 0.001, "attitude_delay": 0.002, "rates_period": 0.002, "rates_delay": 0.0,
        "tracking_dropout": 0.3,
    }  # fmt: skip
    for part in (Noisy(**QUIET, **timing), Ideal()):
        sensors = Sensors(part, dt=dt)
        for k in range(200):
            sensors.stuck[:] = [0.0, 60 <= k < 90, 130 <= k < 150]
            for t in (0, 1, 2, 4):
                sensors.truth[t][:] = k * dt
            sensors.truth[3][:] = [np.cos(0.5 * k * dt), 0.0, 0.0, np.sin(0.5 * k * dt)]
            now, ages = sensors.read(k), sensors.ages
            turned = 2.0 * np.arctan2(now["attitudes"][:, 3], now["attitudes"][:, 0])
            taken = np.column_stack([now["positions"][:, 0], turned, now["rates"][:, 0]])
            np.testing.assert_allclose(k * dt - ages[:2], taken, rtol=0, atol=1e-12)
            assert k * dt - ages[2, 0] == pytest.approx(now["load"][0, 0], abs=1e-12)
        assert ages.any() == isinstance(part, Noisy)


def test_noise_has_its_size_is_white_and_differs_between_axes():
    part = Noisy(
        **PROMPT, load_position_noise=0.3, load_velocity_noise=0.5, position_noise=0.1,
        velocity_noise=0.2, attitude_noise_deg=1.0, rates_noise=0.4, attitude_bias=0.0,
    )  # fmt: skip
    sensors = Sensors(part)
    rows = []
    for k in range(6000):
        now = sensors.read(k)
        turn = 2.0 * now["attitudes"][:, 1:]  # small rotations
        rows.append(np.concatenate([now["load"].ravel(), now["positions"].ravel(),
            now["velocities"].ravel(), turn.ravel(), now["rates"].ravel()]))  # fmt: skip
    x = np.array(rows)
    wanted = np.repeat([0.3, 0.5, 0.1, 0.2, np.radians(1.0), 0.4], [3, 3, 6, 6, 6, 6])
    np.testing.assert_allclose(x.std(axis=0), wanted, rtol=4.5 / np.sqrt(2 * len(x)))
    assert (np.abs(x.mean(axis=0)) < 4.5 * wanted / np.sqrt(len(x))).all()
    z = x / wanted
    for lag in (1, 2, 7):
        assert np.abs((z[lag:] * z[:-lag]).mean(axis=0)).max() < 4.5 / np.sqrt(len(x))
    assert np.abs(np.corrcoef(z.T) - np.eye(30)).max() < 5.0 / np.sqrt(len(x))


class Falling(Sensors):
    """Drones that fall freely but for what ``lift`` (3,) accelerates them, m/s^2, at an attitude; what accelerometers say."""

    def feel(self, steps, lift, attitude=(1.0, 0.0, 0.0, 0.0)):
        found = []
        felt, ages = np.zeros((self.team.n, 3)), np.zeros(self.team.n)
        self.truth[3][:] = attitude
        for k in range(steps):
            self.part.call(
                self.team, self.memory, step=k, dt=self.dt, key=self.key, velocities=self.truth[2],
                attitudes=self.truth[3], measured_specific_forces=felt, specific_force_ages=ages,
            )  # fmt: skip
            found.append((felt.copy(), ages.copy()))
            self.truth[2] += self.dt * (np.asarray(lift) - [0.0, 0.0, self.team.gravity])
        return [np.array(each) for each in zip(*found, strict=True)]


@pytest.mark.parametrize("part", [Ideal(), Noisy(**QUIET)], ids=["ideal", "noisy"])
def test_an_accelerometer_feels_all_but_gravity_in_the_body_frame(part):
    felt, _ = Falling(part).feel(40, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(felt[20:], 0.0, atol=1e-12)
    yawed = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # by 90 degrees: the body's x is the world's y
    felt, ages = Falling(part).feel(40, (1.0, 2.0, 12.0), yawed)
    np.testing.assert_allclose(felt[20:], [[[2.0, -1.0, 12.0]] * 2] * 20, atol=1e-10)
    oldest = 0.0  # just before the next sample comes
    if isinstance(part, Noisy):
        oldest = part.specific_force_delay + part.specific_force_period - 1e-3
    assert ages.max() == pytest.approx(oldest)


def test_a_sample_is_the_mean_since_the_one_before_and_nothing_is_left_out():
    """Samples times their periods are the change of the velocity, whatever happened between them."""
    sensors = Falling(Noisy(**QUIET, specific_force_period=0.01, specific_force_delay=0.0))
    rng, change = np.random.default_rng(5), np.zeros((2, 3))
    felt, ages = np.zeros((2, 3)), np.zeros(2)
    for k in range(101):
        sensors.part.call(
            sensors.team, sensors.memory, step=k, velocities=sensors.truth[2], dt=sensors.dt,
            attitudes=sensors.truth[3], measured_specific_forces=felt, specific_force_ages=ages,
        )  # fmt: skip
        if k > 0 and k % 10 == 0:
            change += 0.01 * (felt - [0.0, 0.0, sensors.team.gravity])
        if k < 100:
            sensors.truth[2] += rng.normal(size=(2, 3))
    np.testing.assert_allclose(change, sensors.truth[2], atol=1e-9)


def test_noise_and_bias_of_an_accelerometer():
    part = Noisy(
        specific_force_noise=0.3, specific_force_bias=(0.5, -0.2, 0.1), specific_force_period=0.001,
        specific_force_dropout=0.2,
    )  # fmt: skip
    felt, ages = Falling(part).feel(4000, (0.0, 0.0, 9.81))
    fresh = felt[1:][np.ptp(np.diff(felt, axis=0), axis=(1, 2)) > 0.0]
    np.testing.assert_allclose(fresh.mean(axis=(0, 1)), [0.5, -0.2, 9.91], atol=4.5 * 0.3 / 60)
    np.testing.assert_allclose(fresh.std(axis=0), 0.3, rtol=0.06)
    assert (ages[10:] > 0.0025).mean() == pytest.approx(0.2, abs=0.03)


def test_attitudes_stay_unit_and_turn_about_the_body_axes():
    part = Noisy(**{**QUIET, "attitude_bias": (0.1, 0.0, 0.0)}, **PROMPT)
    sensors = Sensors(part)
    sensors.truth[3][:] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]  # yaw by 90 degrees
    q = sensors.read(0)["attitudes"][0]
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    c, s = np.cos(0.05), np.sin(0.05)
    np.testing.assert_allclose(q, np.sqrt(0.5) * np.array([c, s, s, c]), atol=1e-12)


def test_bias_is_constant_given_or_drawn_by_the_seed():
    part = Noisy(**QUIET, **PROMPT, load_position_bias=(0.1, -0.2, 0.3), position_bias=0.5)
    sensors = Sensors(part, n=400)
    first, later = sensors.read(0), sensors.read(1)
    np.testing.assert_allclose(first["load"][0], [0.1, -0.2, 0.3])
    assert_array_equal(first["load"][1], 0.0)
    assert_array_equal(first["positions"], later["positions"])
    assert first["positions"].std() == pytest.approx(0.5, rel=0.1)
    assert_array_equal(Sensors(part, n=400).read(5)["positions"], first["positions"])
    assert np.abs(Sensors(part, n=400, key=12).read(0)["positions"] - first["positions"]).max() > 1


def test_dropouts_have_their_share_and_leave_the_last_value():
    part = Noisy(**QUIET, **{**PROMPT, "tracking_dropout": 0.3, "rates_dropout": 0.8})
    found = Sensors(part, n=1).count(4000)
    k = np.arange(4000)
    for name, share in (("load", 0.0), ("positions", 0.3), ("attitudes", 0.0), ("rates", 0.8)):
        fresh = found[name] == k
        assert abs(1.0 - fresh.mean() - share) <= 4.5 * np.sqrt(share * (1 - share) / 4000)
        assert (np.diff(found[name]) >= 0.0).all()
    both = ((found["positions"] == k) & (found["rates"] == k)).mean()
    assert both == pytest.approx(0.7 * 0.2, abs=0.03)


def test_stuck_sensors_repeat_their_last_value():
    sensors = Sensors(Noisy(**QUIET, **PROMPT))
    for t in sensors.truth[:3]:
        t[:] = 1.0
    sensors.read(0)
    for t in sensors.truth[:3]:
        t[:] = 2.0
    sensors.stuck[:] = [0.0, 1.0, 0.0]
    now = sensors.read(1)
    assert_array_equal(now["positions"][:, 0], [2.0, 1.0])
    assert_array_equal(now["load"], 2.0)
    sensors.stuck[:] = [0.0, 0.0, 1.0]
    for t in sensors.truth[:3]:
        t[:] = 3.0
    now = sensors.read(2)
    assert_array_equal(now["positions"][:, 0], 3.0)
    assert_array_equal(now["load"], 2.0)


def noisy_table(**sensing):
    return {
        "name": "t", "reference": {"kind": "hover"}, "timing": {"duration": 0.3},
        "sensing": {"kind": "noisy", **sensing}, "link": {"kind": "radio"},
        "actuation": {"kind": "motors"},
    }  # fmt: skip


def test_flights_repeat_by_the_seed_in_one_stretch_or_many():
    table = noisy_table(tracking_dropout=0.1)
    whole = Flight(load_mission(table)).run()
    flight = Flight(load_mission(table))
    for _ in range(30):
        flight.advance(0.01)
    flight.advance(0.001)
    many = flight.recording()
    other = Flight(load_mission(table, {"seed": 1})).run()
    for name in ("measured_positions", "received_tensions", "applied_thrusts", "load"):
        assert_array_equal(whole[name], many[name])
        assert np.abs(whole[name] - other[name]).max() > 0.0


def test_a_drone_keeps_its_bias_when_another_leaves():
    table = noisy_table(**QUIET, **PROMPT, position_bias=0.01)
    flight = Flight(load_mission(table))
    flight.advance(0.1)
    before = (flight.bus.measured_positions - flight.bus.positions)[1:]
    flight.regroup([1, 2, 3])
    flight.advance(0.1)
    after = flight.bus.measured_positions - flight.bus.positions
    np.testing.assert_allclose(after, before, atol=2e-4)  # it moves a little within a step
    assert np.abs(before).max() > 5e-3


# ---------------------------------------------------------------- link


class Link:
    """A radio and n drones."""

    def __init__(self, part, n=1, *, key=3):
        self.part, self.n, self.key = part, n, key
        self.team, self.memory = Team.uniform(n), part.memory(Team.uniform(n))
        self.tensions, self.directions = np.zeros(n), np.zeros((n, 3))
        self.ages = np.zeros(n)
        self.wanted = np.zeros(n), np.zeros((n, 3))
        self.call = part.wired(
            self.team, self.memory, key=key, desired_tensions=self.wanted[0], desired_directions=self.wanted[1],
            received_tensions=self.tensions, received_directions=self.directions, received_ages=self.ages,
        )  # fmt: skip

    def count(self, steps):
        """What each drone knows while the allocator counts the steps; its age says when it was sent."""
        rows = []
        for k in range(steps):
            for wanted in self.wanted:
                wanted[:] = k
            self.call(k, 0.0, 1e-3)
            np.testing.assert_allclose(k - 1e3 * self.ages, self.tensions, rtol=0, atol=1e-6)
            assert_array_equal(self.directions[:, 2], self.tensions)
            rows.append(self.tensions.copy())
        return np.array(rows)


def test_link_delay_is_exact_in_steps():
    found = Link(Radio(period=0.005, delay=0.013, jitter=0.0, loss=0.0)).count(80)[:, 0]
    k = np.arange(80)
    assert_array_equal(found, np.maximum((k - 13) // 5 * 5, 0))


def test_link_jitter_is_even_and_nothing_overtakes():
    found = Link(Radio(period=0.02, delay=0.004, jitter=0.010, loss=0.0)).count(40_000)[:, 0]
    assert (np.diff(found) >= 0.0).all()
    arrivals = np.flatnonzero(np.diff(found)) + 1
    delays = arrivals - found[arrivals]
    assert len(delays) > 1990
    assert delays.min() == 4
    assert delays.max() == 14
    assert delays.mean() == pytest.approx(9.0, abs=4.5 * 2.9 / np.sqrt(len(delays)))
    crowded = Link(Radio(period=0.001, delay=0.0, jitter=0.02, loss=0.0)).count(5000)[:, 0]
    assert (np.diff(crowded) >= 0.0).all()


def test_link_loss_per_drone():
    part = Radio(period=0.001, delay=0.0, jitter=0.0, loss=[0.0, 0.2, 0.6])
    found = Link(part, 3).count(5000)
    fresh = found == np.arange(5000)[:, None]
    np.testing.assert_allclose(1.0 - fresh.mean(axis=0), [0.0, 0.2, 0.6], atol=0.03)
    together = np.corrcoef(fresh[:, 1], fresh[:, 2])[0, 1]
    assert abs(together) < 4.5 / np.sqrt(5000)
    assert part.of([2, 0]).loss == [0.6, 0.0]


# ---------------------------------------------------------------- before the flight


@pytest.mark.parametrize(
    ("section", "settings", "problem"),
    [
        ("sensing", {"tracking_period": 0.0004}, r"tracking_period.*whole multiple.*0\.001"),
        ("sensing", {"rates_period": 0.0015}, r"rates_period.*nearest 0\.002"),
        ("sensing", {"load_delay": 0.5}, r"load_delay.*shorter than timing\.duration = 0\.3"),
        ("sensing", {"position_noise": -0.1}, r"position_noise"),
        ("sensing", {"load_dropout": 1.0}, r"load_dropout"),
        ("link", {"period": 0.0005}, r"link\.period.*whole multiple"),
        ("link", {"delay": 0.4}, r"link\.delay.*shorter"),
        ("link", {"loss": [0.1, 0.1]}, r"link\.loss.*4 drones"),
    ],
)
def test_settings_that_cannot_work_are_refused(section, settings, problem):
    table = noisy_table()
    table[section] |= settings
    with pytest.raises(MissionError, match=problem):
        load_mission(table)


def test_a_delay_cannot_outgrow_its_buffer_in_flight():
    flight = Flight(load_mission(noisy_table()))
    flight.change("sensing.load_delay", 0.009)
    with pytest.raises(ColiftError, match="cannot change like this in flight"):
        flight.change("sensing.load_delay", 0.5)
