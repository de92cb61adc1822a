"""A session flown by a clock that the test turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from colift.mission import load_mission
from colift.record.recording import Recording
from colift.show.live.session import Session


class Hand:
    """Turns a session's clock and gives it commands."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.now = 100.0
        self.refusals: list[str] = []

    def fly(self, seconds: float) -> None:
        """Let so much clock time pass, each tick when the session asked for it."""
        end = self.now + seconds
        while self.now < end:
            self.now = min(end, self.now + self.session.tick(self.now) + 1e-9)

    def do(self, command: Callable[[Session], None], seconds: float = 0.2) -> None:
        """Give a command and fly on."""
        self.session.submit(command, self.refusals.append)
        self.fly(seconds)


Start = Callable[..., Hand]
Write = Callable[[Recording], Path]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """``start("hover", speed=1.0, **overrides)``: a session of a mission; saves into the test's folder, or by ``write``."""
    hands: list[Hand] = []

    def begin(
        mission: str = "hover", *, speed: float = 1.0, write: Write | None = None, **overrides: Any
    ) -> Hand:
        def save(recording: Recording) -> Path:
            return recording.save(tmp_path / f"flight-{len(list(tmp_path.iterdir()))}.h5")

        changes = {name.replace("__", "."): value for name, value in overrides.items()}
        hand = Hand(Session(load_mission(mission, changes), write or save, speed))
        hands.append(hand)
        return hand

    yield begin
    for hand in hands:
        hand.session.end(save=False)
