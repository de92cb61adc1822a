"""Formats in which flights, teams and messages are exchanged with other programs, a file each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from colift.record.recording import Recording


def written(
    recording: Recording, kind: str, path: Path, progress: Callable[[float], None] | None = None
) -> list[Path]:
    """The files that a recording was written to, as a ``"bag"`` of ROS 2, with a layout of Foxglove's beside it, ``"csv"``, ``"parquet"`` or ``"rerun"``.

    Raises
    ------
    ColiftError
        For a bag that is there already.
    MissingExtraError
        Without the package that writes it.
    OSError
        If it cannot be written.

    """
    if kind == "bag":
        from colift.record.exchange.bag import topics_of, write_bag
        from colift.record.exchange.foxglove import write_layout

        bag = write_bag(recording, path, progress)
        return [bag, write_layout(topics_of(recording), recording.n, bag)]
    from colift.record.exchange import rerun, tables

    write = {"csv": tables.write_csv, "parquet": tables.write_parquet, "rerun": rerun.write_rerun}
    return write[kind](recording, path, progress)
