"""The same campaign on a real Dask cluster: scheduler and workers are processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from campaign_helpers import fly, hover

from colift.errors import ColiftError, MissingExtraError
from colift.study.campaign import workers
from colift.study.campaign.engine import Options, Progress
from colift.study.campaign.plan import Source, plan
from colift.study.campaign.store import Store

distributed = pytest.importorskip("distributed", reason="needs the extra cluster")


@contextmanager
def process(*arguments: str, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("w") as file:
        started = subprocess.Popen([sys.executable, "-m", *arguments], stdout=file, stderr=file)
    try:
        yield started
    finally:
        started.kill()
        started.wait()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.slow
def test_a_dask_cluster_flies_the_campaign_though_a_worker_is_killed(
    tmp_path: Path, allocator: Callable[[str], Path]
) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    sources = [Source.read(allocator(name)) for name in ("slow", "broken")]
    for name in ("slow", "broken"):
        (tmp_path / f"{name}.py").unlink()  # so that workers must use the text that travelled
    cases = [hover("slow", seed) for seed in range(12)] + [hover("broken"), hover("sqp")]
    file = tmp_path / "c.sqlite"
    with ExitStack() as stack:
        port = address.rpartition(":")[2]
        at = ["--host", "127.0.0.1", "--no-dashboard"]
        stack.enter_context(
            process("distributed.cli.dask_scheduler", *at, "--port", port, log=tmp_path / "s.log")
        )
        for name in ("a", "b"):
            options = ["--nthreads", "1", "--no-nanny", *at, "--name", name]
            stack.enter_context(
                process(
                    "distributed.cli.dask_worker", address, *options, log=tmp_path / f"{name}.log"
                )
            )
        with distributed.Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
            pids = sorted(client.run(os.getpid).values())

        killed = threading.Event()

        def kill_one(progress: Progress) -> None:
            if progress.done >= 4 and not killed.is_set():
                os.kill(pids[0], signal.SIGKILL)
                killed.set()

        options = Options(file, scheduler=address, progress=kill_one)
        outcome = fly(cases, options, sources)
        assert killed.is_set()
        assert outcome.flown == len(outcome.rows) == 14
        flown = [row for row in outcome.rows if row["allocator"] != "broken"]
        assert all(row["status"] == "flown" and row["outcome"] == "completed" for row in flown)
        (broken,) = (row for row in outcome.rows if row["allocator"] == "broken")
        assert broken["error"].startswith("ValueError: not today")
        who = {int(row["worker"].rpartition(":")[2]) for row in outcome.rows}
        assert who == set(pids), "each worker has flown something"
        with Store(file) as store:
            assert len(store.finished()) == 14
        assert fly(cases, Options(file, scheduler=address), sources).flown == 0


def test_a_cluster_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    address = f"tcp://127.0.0.1:{free_port()}"
    with pytest.raises(ColiftError, match=f"no Dask scheduler answers at {address}"):
        workers.DaskPool(address, timeout=0.5)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"package distributed: .*pip install 'dask"):
        workers.DaskPool("tcp://127.0.0.1:1")


def test_a_worker_with_other_code_does_not_fly() -> None:
    ((_, job),) = plan([hover("ring")])
    assert not workers.fly(job).error
    assert "the worker's colift is another one" in workers.fly(replace(job, code="other")).error
