"""Processor time of a live flight with pages looking on: ``python benchmarks/live.py [seconds]``.

Each page is a WebSocket that acknowledges what it gets, in a process of its own, as a browser would be.
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import sys
import threading
import time
from pathlib import Path

import aiohttp

from colift.errors import ColiftError
from colift.mission import load_mission
from colift.record.recording import Recording
from colift.show.live.pilot import Pilot
from colift.show.live.server import Server
from colift.show.live.session import Session

PAGES = (0, 1, 5)


def no_file(recording: Recording) -> Path:
    raise ColiftError("nothing is saved here")


def look(url: str, count: int) -> None:
    """Be so many pages until the server says good-bye."""
    asyncio.run(_look(url, count))


async def _look(url: str, count: int) -> None:
    address, _, token = url.partition("/#")

    async def page(session: aiohttp.ClientSession) -> None:
        async with session.ws_connect(f"{address}/live", origin=address) as socket:
            await socket.send_json({"type": "hello", "token": token})
            async for message in socket:
                said = json.loads(message.data)
                if said["type"] == "rows":
                    await socket.send_json({"type": "ack", "seq": said["seq"]})

    async with aiohttp.ClientSession() as session:
        await asyncio.gather(*(page(session) for _ in range(count)))


async def measure(count: int, seconds: float) -> tuple[float, float, float, float]:
    """Shares of a core of the flying thread and of the whole process; speed and largest lag (s)."""
    session = Session(load_mission("paper-spiral"), no_file)
    pilot, server = Pilot(session, lambda: None), Server(session)
    await server.start()
    before = set(threading.enumerate())
    pilot.start()
    (thread,) = set(threading.enumerate()) - before
    clock = time.pthread_getcpuclockid(thread.ident or 0)
    pages = multiprocessing.get_context("spawn").Process(target=look, args=(server.url, count))
    if count:
        pages.start()
    await asyncio.sleep(3.0)
    begin, whole, flown = time.clock_gettime(clock), time.process_time(), session.flight.time
    end, lag = time.monotonic() + seconds, 0.0
    while time.monotonic() < end:
        await asyncio.sleep(0.05)
        lag = max(lag, session.state["lag"])
    own, all_ = time.clock_gettime(clock) - begin, time.process_time() - whole
    speed = (session.flight.time - flown) / seconds
    await server.stop()
    await asyncio.to_thread(pilot.stop)
    session.end(save=False)
    if count:
        pages.join()
    return own / seconds, all_ / seconds, speed, lag


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    print(
        "| pages | flying thread, % of a core | whole process, % of a core | speed | largest lag, ms |"
    )
    print("|---|---|---|---|---|")
    for count in PAGES:
        own, whole, speed, lag = asyncio.run(measure(count, seconds))
        print(f"| {count} | {100 * own:.1f} | {100 * whole:.1f} | {speed:.3f} | {1e3 * lag:.0f} |")


if __name__ == "__main__":
    main()
