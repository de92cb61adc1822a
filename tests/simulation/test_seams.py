"""What a supervisor, a plan and a program outside may do to a flight: clock, nominal forces, external layers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.control.allocation.base import AllocatorPart
from colift.control.reference.base import ReferencePart
from colift.control.supervision.base import SupervisionPart
from colift.errors import ColiftError, SettingError
from colift.flight.flight import Flight
from colift.kernel.jit import JIT_ENABLED
from colift.kernel.status import Status
from colift.mission import load_mission
from colift.part import register

IDEAL = {"plant.kind": "rigid-cables", "timing.recording": 0.001}


# ---------------------------------------------------------------- a clock that can be held


def _hold(now, sees, params, memory, writes):
    """From 1 s to 2 s the clock stands."""
    writes.phase[0] = 1.0 if 1.0 <= now.time < 2.0 else 0.0
    writes.clock[0] = min(now.time, 1.0) if now.time < 2.0 else now.time - 1.0
    writes.clock[1] = 0.0 if 1.0 <= now.time < 2.0 else 1.0


class Holding(SupervisionPart):
    """Stands still for a second."""

    kernel = staticmethod(_hold)


def test_the_reference_goes_by_the_clock_that_a_supervisor_holds():
    register("holding", Holding)
    settings = {**IDEAL, "timing.duration": 3.0, "reference": {"kind": "spiral"}}
    free = Flight(load_mission("hover", settings)).run()
    flight = Flight(load_mission("hover", {**settings, "supervision.kind": "holding"}))
    held = flight.run()
    wait = (held.time > 1.0) & (held.time < 1.9995)
    after = held.time > 2.0
    assert (held["phase"][wait] == 1.0).all()
    assert not held["phase"][~wait & (held.time != 1.0)].any()
    assert (held["reference"][wait, 0] == held["reference"][1000, 0]).all()
    assert not held["reference"][wait, 1:].any()  # what stands has no speed
    np.testing.assert_allclose(
        held["reference"][after], free["reference"][1001 : 1001 + after.sum()], atol=1e-12
    )
    assert flight.clock == pytest.approx(flight.time - 1.0)
    assert Flight(load_mission("hover", settings)).clock == 0.0


def test_derivatives_follow_a_clock_that_runs_slowly():
    def slow(now, sees, params, memory, writes):
        writes.clock[0], writes.clock[1] = 0.5 * now.time, 0.5

    class Slow(SupervisionPart):
        """Half as fast."""

        kernel = staticmethod(slow)

    register("slow", Slow)
    settings = {**IDEAL, "timing.duration": 1.0, "reference": {"kind": "spiral"}}
    held = Flight(load_mission("hover", {**settings, "supervision.kind": "slow"})).run()
    for order in range(3):
        change = np.gradient(held["reference"][:, order], 0.001, axis=0)
        np.testing.assert_allclose(
            held["reference"][5:-5, order + 1], change[5:-5], rtol=1e-3, atol=1e-3
        )


def test_what_is_set_once_follows_the_clock_once():
    """A reference that is not written anew is not slowed down again at each step."""

    def half(now, sees, params, memory, writes):
        writes.clock[0], writes.clock[1] = 0.5 * now.time, 0.5

    class Half(SupervisionPart):
        """Half as fast."""

        kernel = staticmethod(half)

    register("half", Half)
    flight = Flight(
        load_mission("hover", {"supervision.kind": "half", "reference": {"kind": "external"}})
    )
    course = np.arange(12.0).reshape(4, 3)
    pulls = _pulls(0.3, 4)
    flight.act("reference", reference=course, nominal_forces=pulls)
    before = flight.snapshot()
    for _ in range(2):
        flight.advance(0.05)
        powers = np.array([1.0, 0.5, 0.25, 0.125])
        assert np.array_equal(flight.bus.reference, powers[:, None] * course)
        assert np.array_equal(flight.bus.nominal_forces, powers[:3, None] * pulls)
        assert flight.clock == pytest.approx(0.5 * flight.time)
        flight.regroup(flight.drones)
        flight.act("reference", nominal_forces=pulls)  # a new team, a new plan
    flight.restore(before)
    assert np.array_equal(flight.wires.reference.writes.reference, course)


# ---------------------------------------------------------------- a plan's nominal forces

WEIGHT, TURN = 0.225 * 9.81, 2.0


def _pulls(time, n):
    """Pulls (n, 3, 3) of cables that swing about the vertical, with two derivatives."""
    cone = math.radians(35.0)
    out = np.zeros((n, 3, 3))
    tension = WEIGHT / (n * math.cos(cone))
    swing, rate = 0.5 * (1.0 - math.cos(TURN * time)), 0.5 * TURN * math.sin(TURN * time)
    gain = 0.5 * TURN**2 * math.cos(TURN * time)
    for i in range(n):
        a = 2.0 * math.pi * i / n + swing
        c, s = -math.sin(cone) * math.cos(a), -math.sin(cone) * math.sin(a)
        out[i, 0] = [c, s, -math.cos(cone)]
        out[i, 1, :2] = [-s * rate, c * rate]
        out[i, 2, :2] = [-s * gain - c * rate**2, c * gain - s * rate**2]
    return tension * out


class Planned(AllocatorPart):
    """Gives what is planned, whether it was told the plan or knows it by heart."""

    @staticmethod
    def kernel(now, sees, params, memory, writes):  # noqa: ARG004
        n = len(writes.desired_tensions)
        told = not np.isnan(sees.nominal_forces).any()
        pulls = sees.nominal_forces[:, 0] if told else _pulls(now.time, n)[:, 0]
        memory[0] = told
        writes.desired_tensions[:] = np.linalg.norm(pulls, axis=1)
        writes.desired_directions[:] = pulls / writes.desired_tensions[:, None]
        return int(Status.CONVERGED)

    def memory(self, team):
        return np.zeros(1)


class Still(ReferencePart):
    """A load that stands while its cables move; says how they move if asked to."""

    tells: bool = True

    @staticmethod
    def kernel(now, sees, params, memory, writes):  # noqa: ARG004
        writes.reference[:] = 0.0
        writes.reference[0, 2] = 2.0
        if params[0]:
            writes.nominal_forces[:] = _pulls(now.time, len(writes.nominal_forces))

    def params(self, team):
        return np.array([float(self.tells)])


@pytest.mark.parametrize("controller", ["feed-forward", "disturbance-observer"])
def test_planned_motion_of_the_cables_is_fed_forward_unfiltered(controller):
    register("planned", Planned)
    register("still", Still)
    off = {}
    for tells in (True, False):
        flight = Flight(load_mission("hover", {
            **IDEAL, "timing.duration": 1.5, "allocation": {"kind": "planned"},
            "reference": {"kind": "still", "tells": tells}, "position_control": {"kind": controller},
            "start.load_offset": [0.0, 0.0, 0.0], "start.cone_deg": 35.0,
        }))  # fmt: skip
        r = flight.run()
        assert flight.wires.allocation.memory[0] == float(tells)
        wanted = r["load"][:, None, 0] - r["desired_directions"]  # cables of 1 m
        off[tells] = float(np.abs(r["positions"] - wanted).max())
    assert off[False] > 0.02  # the filter lags
    assert off[True] < 0.2 * off[False]


# ---------------------------------------------------------------- layers driven from outside


def test_an_external_layer_does_what_it_is_told():
    settings = {**IDEAL, "timing.duration": 1.0, "load_control.kind": "external"}
    flight = Flight(load_mission("hover", settings))
    assert flight.compiled == JIT_ENABLED
    for factor in (1.01, 0.9):
        force = [0.0, 0.0, factor * WEIGHT]
        flight.act("load_control", force=force)
        flight.advance(0.5)
        assert flight.bus.force.tolist() == force
        given = -flight.bus.desired_tensions @ flight.bus.desired_directions
        np.testing.assert_allclose(given, force, atol=1e-9)


@pytest.mark.parametrize(
    ("layer", "signals"),
    [
        ("reference", {"reference": np.eye(4, 3)}),
        ("supervision", {"clock": [2.0, 0.0]}),
        ("estimation", {"estimated_load": np.zeros((2, 3))}),
        ("allocation", {"desired_tensions": np.full(4, 0.7)}),
        ("position_control", {"thrusts": np.full(4, 5.0)}),
        ("attitude_control", {"torques": np.zeros((4, 3))}),
    ],
)
def test_every_layer_of_the_controllers_can_be_driven(layer, signals):
    flight = Flight(load_mission("hover", {"timing.duration": 0.1, f"{layer}.kind": "external"}))
    flight.act(layer, **signals)
    flight.advance(0.05)
    for name, value in signals.items():
        assert np.array_equal(getattr(flight.bus, name), value)
    assert flight.compiled == JIT_ENABLED


def test_what_nobody_drives_from_outside_is_refused():
    flight = Flight(load_mission("hover", {"load_control.kind": "external"}))
    with pytest.raises(ColiftError, match='only a layer of kind "external"'):
        flight.act("allocation", desired_tensions=np.ones(4))
    with pytest.raises(
        ColiftError,
        match="writes force, moment, learned_load, steady_force, steady_moment, not thrusts",
    ):
        flight.act("load_control", thrusts=np.ones(4))
    with pytest.raises(SettingError, match="force"):
        flight.act("load_control", force=[0.0, 0.0])
    with pytest.raises(SettingError, match="force"):
        flight.act("load_control", force=[0.0, 0.0, math.nan])
    assert not flight.bus.force.any()
