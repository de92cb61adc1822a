"""The replay page in a real browser."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown import Open, Opened, fly, payload_of
from PIL import Image

from colift.mission.load import load_mission
from colift.record import metrics
from colift.record.recording import Recording
from colift.record.verdict import judge
from colift.show.report import html
from colift.show.viewer.data import payload
from colift.show.viewer.page import write_page
from colift.team.geometry import pairwise_angles

EVIL = "</script><img src=x onerror=\"document.title='owned'\"><b>bold</b>"


@pytest.fixture(scope="module")
def cut() -> Recording:
    return fly("four-to-three")


def colours(opened: Opened) -> int:
    """Number of colours in the picture of the scene."""
    picture = Image.open(io.BytesIO(opened.page.locator(".stage").first.screenshot()))
    return len(picture.convert("RGB").getcolors(1 << 24) or [])


def test_page_draws_and_asks_for_nothing(open_replay: Open, spiral: Recording) -> None:
    opened = open_replay(spiral)
    assert len(opened.asked) == 1
    assert opened.asked[0].startswith("file:")
    assert colours(opened) > 300
    for plot in opened.page.locator(".plot canvas").all():
        picture = Image.open(io.BytesIO(plot.screenshot())).convert("RGB")
        assert len(picture.getcolors(1 << 24) or []) > 5


def test_the_picture_follows_the_time(open_replay: Open, spiral: Recording) -> None:
    opened = open_replay(spiral)
    stage = opened.page.locator(".stage").first
    opened.seek(0.2)
    before = stage.screenshot()
    opened.seek(1.7)
    after = stage.screenshot()
    opened.seek(0.2)
    assert before != after
    assert stage.screenshot() == before


def test_play_moves_the_time_and_stops_at_the_end(open_replay: Open, spiral: Recording) -> None:
    opened = open_replay(spiral)
    opened.page.keyboard.press("Space")
    opened.wait("colift.state().time > 0.1")
    assert opened.state()["playing"]
    opened.page.locator("select").select_option("8")
    opened.wait("!colift.state().playing")
    assert opened.state()["time"] == pytest.approx(spiral.time[-1])


@pytest.mark.parametrize("row", [0, 137, 400])
def test_scrub_agrees_with_the_file(
    open_replay: Open, spiral: Recording, tmp_path: Path, row: int
) -> None:
    read = Recording.load(spiral.save(tmp_path / "flight.h5"))
    time = read.time[row - row % 4]  # every fourth row, at 50 Hz, is in the page
    row = int(np.searchsorted(read.time, time))
    flight = open_replay(read).seek(float(time))["flights"][0]
    assert flight["load"] == pytest.approx(read["load"][row, 0], abs=1e-6)
    assert flight["tensions"] == pytest.approx(read["tensions"][row], abs=1e-6)
    assert flight["positions"] == pytest.approx(read["positions"][row].ravel(), abs=1e-6)
    assert np.abs(flight["attitudes"]) == pytest.approx(
        np.abs(read["attitudes"][row].ravel()), abs=1e-6
    )
    angles = np.degrees(pairwise_angles(read["directions"][row]))
    assert flight["angle"][0] == pytest.approx(angles.min(), abs=1e-3)
    error = np.linalg.norm(metrics.tracking_error(read)[row])
    assert flight["error"][0] == pytest.approx(error, abs=1e-6)


def test_dragging_on_the_track_scrubs(open_replay: Open, spiral: Recording) -> None:
    opened = open_replay(spiral)
    box = opened.page.locator(".track").bounding_box()
    middle = box["y"] + box["height"] / 2
    opened.page.mouse.move(box["x"] + 0.25 * box["width"], middle)
    opened.page.mouse.down()
    assert opened.state()["time"] == pytest.approx(0.5, abs=0.02)
    opened.page.mouse.move(box["x"] + 0.75 * box["width"], middle)
    opened.page.mouse.up()
    assert opened.state()["time"] == pytest.approx(1.5, abs=0.02)


def test_keys_step_jump_and_choose_views(open_replay: Open, cut: Recording) -> None:
    opened = open_replay(cut)
    press = opened.page.keyboard.press
    press("ArrowRight")
    assert opened.state()["time"] == pytest.approx(0.02)
    press("Period")
    assert opened.state()["time"] == pytest.approx(1.0)
    press("Home")
    assert opened.state()["time"] == 0.0
    press("End")
    assert opened.state()["time"] == pytest.approx(2.0)
    for key, view in zip("4321", ("side", "top", "follow", "orbit"), strict=True):
        press(key)
        assert opened.state()["view"] == view
    press("w")
    assert opened.state()["shown"]["downwash"]
    press("]")
    assert opened.state()["speed"] == 2


def test_events_can_be_clicked(open_replay: Open, cut: Recording) -> None:
    opened = open_replay(cut)
    opened.page.get_by_title("1.00 s, fault: Cable of drone 0 cut").click()
    state = opened.state()
    assert state["time"] == pytest.approx(1.0)
    opened.seek(0.0)
    opened.click("Events")
    opened.page.locator(".events button", has_text="Cable of drone 0 cut").click()
    after = opened.seek(1.5)["flights"][0]
    lost = cut.mission.events[0].value
    assert after["tensions"][lost] is None or np.isnan(after["tensions"][lost])
    assert np.isfinite(np.delete(np.array(after["tensions"], dtype=float), lost)).all()


def test_hovering_a_plot_reads_its_values_and_clicking_goes_there(
    open_replay: Open, spiral: Recording
) -> None:
    opened = open_replay(spiral)
    area = opened.page.locator(".plot .u-over").first
    box = area.bounding_box()
    area.hover(position={"x": 0.5 * box["width"], "y": 20})
    shown = [
        float(t) for t in opened.page.locator(".plot").first.locator(".key b").all_inner_texts()
    ]
    wanted = spiral["tensions"][np.searchsorted(spiral.time, 1.0 + 1e-9) - 1]
    assert shown == pytest.approx(wanted, abs=2e-3)
    assert opened.state()["time"] == 0.0
    area.click(position={"x": 0.5 * box["width"], "y": 20})
    assert opened.state()["time"] == pytest.approx(1.0, abs=0.02)


def test_two_flights_run_in_step(open_replay: Open, spiral: Recording, cut: Recording) -> None:
    opened = open_replay(spiral, cut)
    assert opened.page.locator("canvas[aria-label^='3D']").count() == 2
    one, other = opened.seek(1.5)["flights"]
    assert one["time"] == other["time"] == 1.5
    assert one["load"] != other["load"]
    box = opened.page.locator(".stage").first.bounding_box()
    second = opened.page.locator(".stage").nth(1)
    before = second.screenshot()
    opened.page.mouse.move(box["x"] + 200, box["y"] + 250)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 300, box["y"] + 250)
    opened.page.mouse.up()
    assert second.screenshot() != before


def test_narrow_angles_are_marked_and_written(open_replay: Open, spiral: Recording) -> None:
    directions = spiral["directions"].copy()
    directions[:, 1] = directions[:, 0] + 0.2 * (directions[:, 1] - directions[:, 0])
    directions[:, 1] /= np.linalg.norm(directions[:, 1], axis=1, keepdims=True)
    narrow = replace(spiral, arrays={**spiral.arrays, "directions": directions})
    opened = open_replay(narrow)
    angle = np.degrees(pairwise_angles(directions[100])).min()
    opened.seek(float(narrow.time[100]))
    assert f"{angle:.1f}°" in opened.page.locator(".label.angle").all_inner_texts()


def test_hostile_text_does_no_harm(open_replay: Open, spiral: Recording) -> None:
    mission = load_mission("paper-spiral", {"name": EVIL, "description": EVIL})
    opened = open_replay(replace(spiral, mission=mission))
    opened.click("Mission")
    page = opened.page
    assert page.title() == f"{EVIL} - colift"
    assert page.locator("#app img, #app h1 b").count() == 0
    assert page.locator("#app h2").first.inner_text() == EVIL
    assert page.locator("h1").inner_text() == EVIL


@pytest.mark.parametrize("size", [(390, 844), (1024, 700), (1440, 900)])
def test_nothing_sticks_out(
    open_replay: Open, spiral: Recording, cut: Recording, size: tuple[int, int]
) -> None:
    opened = open_replay(spiral, cut, size=size)
    for tab in ("Plots", "Events", "Numbers", "Mission"):
        opened.click(tab)
        assert opened.page.evaluate("document.documentElement.scrollWidth") == size[0], tab
    box = opened.page.locator(".stage").first.bounding_box()
    assert box["width"] > 150
    assert box["height"] > 200


def test_dark_and_light(open_replay: Open, spiral: Recording) -> None:
    opened = open_replay(spiral, theme="light")

    def background() -> Any:
        picture = Image.open(io.BytesIO(opened.page.locator(".stage").first.screenshot()))
        return picture.convert("L").resize((1, 1)).getpixel((0, 0))

    assert opened.state()["theme"] == "light"
    assert background() > 180
    opened.page.keyboard.press("t")
    assert opened.state()["theme"] == "dark"
    assert background() < 80


def test_unknown_signals_draw_what_there_is(open_replay: Open, spiral: Recording) -> None:
    unknown = ("tensions", "attitudes", "thrusts", "desired_tensions", "external_forces", "force")
    arrays = {**spiral.arrays, **{k: np.full_like(spiral[k], np.nan) for k in unknown}}
    with np.errstate(all="ignore"):
        opened = open_replay(replace(spiral, arrays=arrays))
    opened.seek(1.0)
    assert colours(opened) > 200
    labels = opened.page.locator(".label.drone:visible").all_inner_texts()
    assert labels == ["0", "1", "2", "3"]


@pytest.mark.parametrize("value", [np.nan, 1e300])
def test_a_diverged_flight_opens(open_replay: Open, spiral: Recording, value: float) -> None:
    arrays = {name: values.copy() for name, values in spiral.arrays.items()}
    for name in ("load", "positions", "directions", "tensions", "attitudes", "thrusts", "force"):
        arrays[name][200:] = value
    with np.errstate(all="ignore"):
        opened = open_replay(replace(spiral, arrays=arrays, outcome="diverged before t = 1 s"))
    for time in (0.5, 1.0, 1.5):
        opened.seek(time)
    assert colours(opened) > 50


@pytest.mark.parametrize("n", [1, 2, 20])
def test_any_number_of_drones_opens(open_replay: Open, n: int) -> None:
    opened = open_replay(fly(**{"drones.count": n, "timing.duration": 0.3}))
    assert len(opened.seek(0.2)["flights"][0]["tensions"]) == n
    assert colours(opened) > 200


def test_a_report_shows_its_replay(open_url: Open, spiral: Recording, tmp_path: Path) -> None:
    replay = write_page(tmp_path / "replay.html", payload_of(spiral))
    report = html.write_report(spiral, tmp_path, metrics=metrics.compute(spiral), replay=replay)
    text = report.read_text()
    assert "<script" not in text
    assert len(text) < 1_000_000
    browser = open_url(replay.as_uri()).page.context
    page = browser.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.goto(report.as_uri())
    frame = page.locator("iframe")
    frame.scroll_into_view_if_needed()
    frame.content_frame.locator(".stage canvas").wait_for()
    assert said == []


def test_the_verdict_is_shown_with_every_reason(open_replay: Open, spiral: Recording) -> None:
    numbers = metrics.compute(spiral) | {"min_angle_deg": 12.0, "slack_time_s": 0.5}
    opened = open_replay(data=payload([spiral], [numbers], ["x"]))
    banner = opened.page.locator("header .verdict")
    assert banner.locator(".badge").inner_text() == "fail"
    assert not banner.locator("ul").is_visible()
    banner.locator("summary").click()
    reasons = judge(spiral, numbers).reasons
    assert len(reasons) == 2
    assert banner.locator("li").all_inner_texts() == reasons


def test_every_moment_is_in_the_list_and_every_cause_on_the_timeline(open_replay: Open) -> None:
    broken = fly("cut-in-flight")
    opened = open_replay(broken, size=(390, 844))
    titles = [mark.get_attribute("title") for mark in opened.page.locator(".mark").all()]
    causes = [m for m in broken.moments if m.kind in ("fault", "departure")]
    assert len(causes) == 2
    for moment in causes:
        assert any(f": {moment.text}" in title for title in titles)
    assert len(titles) < len(broken.moments)  # the others are counted
    opened.click("Events")
    assert opened.page.locator(".events li").count() == len(broken.moments)


def test_without_a_limit_no_angle_is_low(open_replay: Open, spiral: Recording) -> None:
    free = replace(spiral, mission=load_mission("paper-spiral", {"criteria": {}}))
    opened = open_replay(free)
    opened.seek(1.0)
    assert opened.page.locator(".hud .low").count() == 0
    assert opened.page.locator(".label.angle:visible").count() == 0
