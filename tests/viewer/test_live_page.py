"""The live page in a real browser, against a server that speaks the protocol and flies nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from flown import Open, Opened

from colift.record.recording import Recording

pytest.importorskip("aiohttp", reason="needs the extra live")

from fake_server import TOKEN, FakeServer

STATE = {
    "type": "state", "paused": False, "speed": 1.0, "lag": 0.0, "values": {}, "viewers": 1,
    "metrics": {}, "level": "", "reasons": [], "saved": None,
}  # fmt: skip


@pytest.fixture
def server(spiral: Recording) -> Iterator[FakeServer]:
    with FakeServer(spiral).running() as running:
        running.rows(0, 100)
        yield running


@pytest.fixture
def steering(server: FakeServer, open_url: Open) -> Opened:
    return open_url(server.url(TOKEN), size=(1300, 800))


def turn(opened: Opened, name: str, value: float) -> None:
    """Move a slider, as a hand would, to a position on its own scale."""
    opened.page.locator(f"input[data-name='{name}']").evaluate(
        "(input, value) => { input.value = value; input.dispatchEvent(new Event('input')); }", value
    )


def test_rows_move_the_scene_and_are_acknowledged(
    server: FakeServer, steering: Opened, spiral: Recording
) -> None:
    server.wait_told(type="ack", seq=1)
    stage = steering.page.locator(".stage")
    before, picture = steering.state(), stage.screenshot()
    assert before["time"] == pytest.approx(spiral.time[99])
    server.rows(100, 300)
    server.wait_told(type="ack", seq=2)
    after = steering.state()
    assert after["time"] == pytest.approx(spiral.time[299])
    assert after["flights"][0]["rows"] == 300
    assert after["flights"][0]["tensions"] == pytest.approx(spiral["tensions"][299], abs=1e-5)
    assert stage.screenshot() != picture


def test_a_slider_sets_and_shows_what_the_loop_says(server: FakeServer, steering: Opened) -> None:
    turn(steering, "allocation.mu", np.log(0.5))
    told = server.wait_told(type="set", name="allocation.mu")
    assert told["value"] == pytest.approx(0.5, rel=0.02)
    turn(steering, "load.mass", 0.4)
    assert server.wait_told(type="set", name="load.mass")["value"] == pytest.approx(0.4, abs=2e-3)
    steering.page.wait_for_timeout(900)  # the hand has left
    server.send(**{**STATE, "values": {"allocation.mu": 2.5}})
    output = steering.page.locator(".knob", has_text="mu").locator("output")
    steering.wait("document.querySelector('.knob output').textContent.startsWith('2.50')")
    assert output.inner_text() == "2.50 N^2"


def test_buttons_say_what_they_do(server: FakeServer, steering: Opened) -> None:
    steering.page.get_by_role("combobox", name="Allocator").select_option("safe")
    server.wait_told(type="choose", name="allocation.kind", value="safe")
    steering.click("Pause or go on (space)")
    server.wait_told(type="do", action="pause")
    server.send(**{**STATE, "paused": True})
    steering.wait("document.querySelector('.controls button').textContent === 'Go on'")
    steering.page.keyboard.press("Space")
    server.wait_told(type="do", action="resume")
    steering.click("Push the load for half a second")
    push = server.wait_told(type="do", action="push")
    assert (push["force"], push["seconds"]) == (pytest.approx([1.0, 0.0, 0.0]), 0.5)
    steering.click("Cut cable 2")
    server.wait_told(type="do", action="cut", drone=2)
    for title, action in (("Start the flight again", "reset"), ("Save the recording", "save")):
        steering.click(title)
        server.wait_told(type="do", action=action)


def test_held_keys_steer_and_released_ones_hold(server: FakeServer, steering: Opened) -> None:
    steering.page.keyboard.press("3")  # from the top, up is along y
    steering.page.keyboard.down("ArrowUp")
    velocity = server.wait_told(type="do", action="steer")["velocity"]
    assert velocity == pytest.approx([0.0, 1.0, 0.0], abs=0.01)
    steering.page.keyboard.up("ArrowUp")
    server.wait_told(type="do", action="steer", velocity=[0, 0, 0])


def test_a_drag_in_the_scene_sends_a_target(server: FakeServer, steering: Opened) -> None:
    steering.page.keyboard.press("3")
    steering.page.locator(".controls button[aria-pressed]").click()
    box = steering.page.locator(".stage").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    steering.page.mouse.move(x, y)
    steering.page.mouse.down()
    steering.page.mouse.move(x + 80, y)
    steering.page.mouse.up()
    position = server.wait_told(type="do", action="target")["position"]
    load = steering.state()["flights"][0]["reference"]
    assert position[2] == pytest.approx(load[2], abs=1e-3)
    assert 0.1 < position[0] - load[0] < 3.0
    assert position[1] == pytest.approx(load[1], abs=0.3)


def test_a_cut_cable_cannot_be_cut_again(open_url: Open, spiral: Recording) -> None:
    arrays = {name: values.copy() for name, values in spiral.arrays.items()}
    for name in ("tensions", "positions", "attitudes", "directions", "thrusts"):
        arrays[name][50:, 1] = np.nan
    flown = Recording(spiral.mission, spiral.time, spiral.cycle_time, arrays)
    with FakeServer(flown).running() as server:
        server.rows(0, 100)
        opened = open_url(server.url(TOKEN))
        cuts = opened.page.locator(".cuts button")
        opened.wait("document.querySelectorAll('.cuts button')[1].disabled")
        assert [cuts.nth(i).is_disabled() for i in range(4)] == [False, True, False, False]


def test_who_watches_cannot_use_the_controls(server: FakeServer, open_url: Open) -> None:
    opened = open_url(server.url("wrong"))
    server.wait_told(type="hello", token="wrong")
    assert opened.page.locator(".role").inner_text() == "watching"
    controls = opened.page.locator(".controls :is(button, input, select)").all()
    assert len(controls) > 10
    assert all(control.is_disabled() for control in controls)
    opened.page.keyboard.press("ArrowUp")
    opened.page.keyboard.press("Space")
    opened.page.wait_for_timeout(300)
    assert not [message for message in server.told if message["type"] in ("do", "set", "choose")]
    server.send(type="role", role="steer")
    opened.wait("!document.querySelector('.controls fieldset').disabled")


def test_the_token_stays_in_the_fragment(server: FakeServer, steering: Opened) -> None:
    server.wait_told(type="hello", token=TOKEN)
    assert not [address for address in steering.asked if TOKEN in address.split("#")[0]]


def test_a_lost_connection_comes_back(
    server: FakeServer, steering: Opened, spiral: Recording
) -> None:
    server.wait_told(type="ack", seq=1)
    server.drop()
    steering.wait("document.querySelector('.line').dataset.line === 'lost'")
    steering.wait("document.querySelector('.line').dataset.line === 'open'")
    server.wait_greeted(2)
    server.rows(100, 200)
    server.wait_told(type="ack", seq=2)
    assert steering.state()["time"] == pytest.approx(spiral.time[199])


def test_events_refusals_and_metrics_are_shown_as_text(
    server: FakeServer, steering: Opened
) -> None:
    evil = "<img src=x onerror='document.title=1'>"
    server.send(type="events", events=[{"time": 0.2, "kind": "slack", "text": evil, "drone": 0}])
    server.send(**{**STATE, "metrics": {"min_angle_deg": 31.25, evil: None}, "saved": evil})
    server.send(type="refused", reason=evil)
    steering.wait("document.querySelectorAll('.mark').length === 1")
    steering.wait("!document.querySelector('.toast').hidden")
    assert steering.page.locator(".toast").inner_text() == evil
    assert evil in steering.page.locator(".note").inner_text()
    server.rows(100, 110)
    steering.click("Numbers")
    steering.page.locator(".numbers td", has_text="31.25").wait_for()
    assert steering.page.locator("img").count() == 0
    steering.page.locator(".mark").click()
    assert steering.state()["time"] == pytest.approx(0.2)


def test_the_past_can_be_looked_at_while_the_flight_goes_on(
    server: FakeServer, steering: Opened, spiral: Recording
) -> None:
    steering.seek(0.1)
    server.rows(100, 200)
    server.wait_told(type="ack", seq=2)
    assert steering.state()["time"] == pytest.approx(0.1)
    steering.page.keyboard.press("End")
    server.rows(200, 220)
    server.wait_told(type="ack", seq=3)
    assert steering.state()["time"] == pytest.approx(spiral.time[219])


def test_reset_forgets_the_past(server: FakeServer, steering: Opened) -> None:
    server.wait_told(type="ack", seq=1)
    server.send(type="reset")
    server.rows(0, 20)
    server.wait_told(type="ack", seq=2)
    assert steering.state()["flights"][0]["rows"] == 20


@pytest.mark.parametrize("size", [(390, 844), (1024, 700), (1440, 900)])
def test_nothing_sticks_out(server: FakeServer, open_url: Open, size: tuple[int, int]) -> None:
    opened = open_url(server.url(TOKEN), size=size)
    assert opened.page.evaluate("document.documentElement.scrollWidth") == size[0]
    for part in (".stage", ".controls", ".panel", ".timeline"):
        box: Any = opened.page.locator(part).bounding_box()
        assert box["width"] >= 150, part
        assert box["height"] >= 40, part
