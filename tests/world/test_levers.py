"""What pushes a rigid load beside its centre of mass turns it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.team import Body, Team
from colift.team.geometry import Array, matrix_of
from colift.team.load import box_inertia, usual_attachments
from colift.world.disturbance.drag import Drag
from colift.world.disturbance.push import Push

SIZE = np.array([0.6, 0.4, 0.2])
CENTRE = np.array([0.02, -0.01, 0.03])
BOX = Body(
    inertia=box_inertia(0.5, SIZE), attachments=usual_attachments(4, SIZE), size=SIZE, centre=CENTRE
)
TEAM = replace(Team.uniform(4), load_mass=0.5, body=BOX)
TURNED = np.array([0.8, 0.0, 0.6, 0.0])
NONE = {"drone_area": 0.0, "cable_diameter": 0.0}


def acted(part: Push | Drag, team: Team = TEAM, **signals: object) -> tuple[Array, Array]:
    """Force on the load and moment about its centre of mass."""
    seen = {"load_attitude": TURNED, "attitudes": np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)), **signals}
    writes, _ = part.call(team, part.memory(team), **seen)
    return writes.external_forces[-1].copy(), writes.external_moment.copy()


def test_a_push_turns_about_the_centre_of_mass_by_where_it_acts() -> None:
    force, point = (1.0, 2.0, -0.5), (0.3, 0.2, 0.1)
    pushed, moment = acted(Push(force=force, point=point))
    np.testing.assert_allclose(pushed, force)
    np.testing.assert_allclose(moment, np.cross(matrix_of(TURNED) @ (point - CENTRE), force))
    assert not acted(Push(force=force))[1].any()


def test_the_wind_pushes_the_middle_of_a_load_unless_it_is_told_where() -> None:
    wind = np.array([6.0, 1.0, 0.0])
    for where in ((0.0, 0.0, 0.0), (0.1, 0.0, 0.05)):
        pushed, moment = acted(Drag(load_area=0.05, load_centre=where, **NONE), wind=wind)
        np.testing.assert_allclose(pushed, 0.5 * 1.225 * 0.05 * np.linalg.norm(wind) * wind)
        np.testing.assert_allclose(moment, np.cross(matrix_of(TURNED) @ (where - CENTRE), pushed))


def test_the_drag_of_a_cable_pulls_at_its_end() -> None:
    """A cable across the wind, alone: what it leaves on the load acts there."""
    ends = np.zeros((4, 2, 3))
    ends[:, 0] = BOX.attachments @ matrix_of(TURNED).T
    attached = np.array([1.0, 0.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    pushed, moment = acted(
        Drag(load_area=0.0, drone_area=0.0), ends=ends, positions=ends[:, 0] + up, attached=attached,
        directions=np.tile(-up, (4, 1)), wind=np.array([5.0, 0.0, 0.0]),
    )  # fmt: skip
    assert pushed[0] > 0.0
    np.testing.assert_allclose(
        moment, np.cross(ends[0, 0] - matrix_of(TURNED) @ CENTRE, pushed), atol=1e-15
    )


def test_a_point_is_turned_by_nothing() -> None:
    team = Team.uniform(4)
    _, moment = acted(Push(force=(1.0, 0.0, 0.0), point=(1.0, 0.0, 0.0)), team)
    assert not moment.any()
    _, moment = acted(Drag(), team, wind=np.array([5.0, 0.0, 0.0]))
    assert not moment.any()


def test_a_push_turns_about_the_centre_of_mass_that_is_there_not_the_one_that_is_told() -> None:
    force, point, off = [0.1, 0.2, 0.0], np.array([0.3, -0.2, 0.1]), np.array([0.03, 0.02, 0.0])
    push = {"kind": "push", "force": force, "point": point.tolist(), "duration": 60.0}
    changes = {
        "reference": {"kind": "hover"}, "disturbance": [push], "truth.centre_of_mass_offset": off.tolist(),
    }  # fmt: skip
    flight = Flight(load_mission("box-figure-eight", changes))
    flight.advance(flight.mission.timing.step)
    about = np.cross(point - off, force)
    np.testing.assert_allclose(flight.bus.external_moment, about, atol=1e-6)
    flight.change("disturbance.0.force", [0.0, 0.0, 0.3])
    flight.advance(flight.mission.timing.step)
    about = np.cross(point - off, [0.0, 0.0, 0.3])
    np.testing.assert_allclose(flight.bus.external_moment, about, atol=1e-6)


@pytest.mark.parametrize(
    ("part", "field"),
    [({"kind": "push", "point": [0.1, 0, 0]}, "point"), ({"kind": "drag", "load_centre": [0, 0, 0.1]}, "load_centre")],
)  # fmt: skip
def test_a_place_on_a_load_that_is_a_point_is_refused(part: dict[str, object], field: str) -> None:
    with pytest.raises(MissionError, match=f"disturbance.0.{field}.*load.kind"):
        load_mission("hover", {"disturbance": [part]})


@pytest.mark.parametrize("law", ["pose", "pose-robust"])
def test_a_box_that_is_pushed_at_a_corner_is_turned_and_held(law: str) -> None:
    force, point = [0.1, 0.1, 0.0], [0.3, -0.2, 0.1]
    push = {"kind": "push", "force": force, "point": point, "at": 2.0, "duration": 60.0}
    changes = {
        "reference": {"kind": "hover"}, "timing.duration": 40.0, "disturbance": [push], "load_control.kind": law,
    }  # fmt: skip
    recording = Flight(load_mission("box-figure-eight", changes)).run()
    turned = np.degrees(np.linalg.norm(metrics.attitude_error(recording), axis=1))
    assert recording.outcome == "completed"
    np.testing.assert_allclose(recording["external_moment"][-1], np.cross(point, force), atol=2e-3)
    assert turned[recording.time < 2.0].max() < 0.1
    assert turned.max() > 1.0
    assert turned[recording.time > 38.0].max() < 1.0
