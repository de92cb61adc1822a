"""The thread that flies a session against the clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from colift.show.live.session import Session


class Pilot:
    """Ticks a session until :meth:`stop`; what goes wrong in there ends it and is kept in ``error``."""

    def __init__(self, session: Session, ended: Callable[[], None] = lambda: None) -> None:
        self.session = session
        self.error: Exception | None = None
        self._ended = ended
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fly, name="colift-flight", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End after the present stretch, and wait for it."""
        self._stop.set()
        self._thread.join()

    def _fly(self) -> None:
        try:
            while not self._stop.wait(self.session.tick(time.monotonic())):
                pass
        except Exception as error:  # a part of the user's may raise anything
            self.error = error
        self._ended()
