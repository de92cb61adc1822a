"""Fly a mission behind a web server until somebody ends it."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from pathlib import Path

from colift.errors import ColiftError
from colift.mission.mission import Mission
from colift.record.recording import Recording
from colift.show.live.pilot import Pilot
from colift.show.live.server import Server
from colift.show.live.session import Session


def fly_live(
    mission: Mission,
    write: Callable[[Recording], Path],
    *,
    speed: float = 1.0,
    host: str = "127.0.0.1",
    port: int = 0,
    opened: Callable[[str], None] = lambda _: None,
    save: bool = True,
) -> list[str]:
    """Fly until SIGINT or SIGTERM.

    Parameters
    ----------
    mission
        What to fly.
    write
        Saves a recording and says where.
    speed
        Simulated over real time.
    host, port
        Where to serve; port 0 takes a free one.
    opened
        Called with the address of the page once it can be reached.
    save
        Save the flight at the end.

    Returns
    -------
    list of str
        What is worth saying at the end.

    Raises
    ------
    ColiftError
        If a part raises while it flies; what was flown has been saved then.

    """
    session = Session(mission, write, speed)
    return asyncio.run(_serve(session, host, port, opened, save))


async def _serve(
    session: Session, host: str, port: int, opened: Callable[[str], None], save: bool
) -> list[str]:
    loop, end = asyncio.get_running_loop(), asyncio.Event()

    def ended() -> None:
        loop.call_soon_threadsafe(end.set)

    pilot = Pilot(session, ended)
    server = Server(session, host, port)
    await server.start()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end.set)
    try:
        pilot.start()
        opened(server.url)
        await end.wait()
    finally:
        await server.stop()
        await asyncio.to_thread(pilot.stop)
        said = [session.end(save)]
    if pilot.error is not None:
        raise ColiftError(f"{type(pilot.error).__name__}: {pilot.error}") from pilot.error
    if server.refused:
        counts = ", ".join(f"{name} {count}" for name, count in server.refused.most_common())
        said.append(f"Refused: {counts}.")
    return said
