"""The live page in a real browser, against the real server and a flight that is in the air."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from flown import PATIENCE, Open, Opened

pytest.importorskip("aiohttp", reason="needs the extra live")

from colift.mission import load_mission
from colift.record.recording import Recording
from colift.show.live.pilot import Pilot
from colift.show.live.server import Server
from colift.show.live.session import Session
from colift.team.geometry import pairwise_angles

SMALL = (700, 420)
"""Every frame is drawn in software: a second page waits until the first one's frames leave it some time."""


class Flying:
    """A session in the air behind its server, both in threads of their own."""

    def __init__(self, folder: Path) -> None:
        def write(recording: Recording) -> Path:
            return recording.save(folder / "flight.h5")

        mission = load_mission("paper-spiral", {"allocation.kind": "safe"})
        self.session = Session(mission, write)
        self.pilot = Pilot(self.session)
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self.thread.start()
        self.server = self.call(self._started())
        self.pilot.start()

    async def _started(self) -> Server:
        server = Server(self.session)
        await server.start()
        return server

    def call(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(PATIENCE)

    def ask(self, question: Callable[[Session], object]) -> object:
        """The answer to a question that the flying thread is asked between two stretches."""
        answer, done = [], threading.Event()

        def look(session: Session) -> None:
            answer.append(question(session))
            done.set()

        self.session.submit(look)
        assert done.wait(PATIENCE)
        return answer[0]

    def wait(self, opened: Opened, question: Callable[[Session], object]) -> None:
        for _ in range(int(PATIENCE / 0.05)):
            if self.ask(question):
                return
            opened.page.wait_for_timeout(50)
        pytest.fail("it never came")

    def end(self) -> None:
        self.call(self.server.stop())
        self.pilot.stop()
        self.session.end(save=False)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(PATIENCE)
        assert self.pilot.error is None


@pytest.fixture
def flying(tmp_path: Path) -> Iterator[Flying]:
    found = Flying(tmp_path)
    yield found
    found.end()


def turn(opened: Opened, name: str, value: float) -> None:
    opened.page.locator(f"input[data-name='{name}']").evaluate(
        "(input, value) => { input.value = value; input.dispatchEvent(new Event('input')); }", value
    )


def test_a_person_flies(flying: Flying, open_url: Open) -> None:
    opened = open_url(flying.server.url, size=SMALL)
    opened.wait("colift.state().flights[0].rows > 10")
    assert opened.page.locator(".role").inner_text() == "you steer"

    # A slider changes the allocator that flies, and its answer.
    tensions = flying.ask(lambda s: s.flight.bus.desired_tensions.sum())
    turn(opened, "allocation.mu", np.log(1.35))
    flying.wait(opened, lambda s: abs(s.flight.parts["allocation"].mu - 1.35) < 0.03)
    flying.wait(opened, lambda s: s.flight.bus.desired_tensions.sum() > 1.1 * tensions)
    place = flying.ask(lambda s: s.flight.bus.load[0].copy())
    assert np.linalg.norm(place) > 0.5

    # A cut cable: its drone has gone from the page too, and the others spread anew.
    opened.click("Cut cable 2")
    flying.wait(opened, lambda s: s.flight.drones == [0, 1, 3])
    opened.wait("!Number.isFinite(colift.state().flights[0].tensions[2])")

    def spread(session: Session) -> bool:
        return bool(np.ptp(pairwise_angles(session.flight.bus.directions)) < np.radians(10.0))

    flying.wait(opened, spread)

    # Another page may watch, with or without the token, and cannot steer.
    other = open_url(flying.server.url, size=SMALL)
    other.wait("colift.state().flights[0].rows > 10")  # it was told the past
    assert other.page.locator(".role").inner_text() == "watching"
    assert other.page.locator("[title='Cut cable 3']").is_disabled()

    # Saved from the page; what was done is in the file.
    opened.click("Save the recording")
    opened.wait("document.querySelector('.note').textContent.includes('flight.h5')")
    path = opened.page.locator(".note").inner_text().removeprefix("Saved as ")
    saved = Recording.load(path)
    fields = [event.field for event in saved.mission.events]
    assert "drones.lose" in fields
    assert "allocation.mu" in fields

    # Who steers leaves; the other one may steer then.
    opened.page.goto("about:blank")
    other.wait("!document.querySelector('.controls fieldset').disabled")
    other.click("Start the flight again")
    flying.wait(other, lambda s: len(s.flight.drones) == 4)


def test_the_page_asks_nobody_else(flying: Flying, open_url: Open) -> None:
    opened = open_url(flying.server.url)
    opened.wait("colift.state().flights[0].rows > 5")
    origin = flying.server.url.partition("/#")[0]
    assert opened.asked
    assert all(address.startswith((origin, "data:")) for address in opened.asked)
