"""Trials of a certificate that are done, in a file beside it until it is written: who is interrupted goes on from there.

A line each, of JSON: first what all of them have in common, then every trial as soon as it is over. A line that was cut off is no trial.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

from colift.errors import ColiftError

T = TypeVar("T", bound=tuple[Any, ...])


def file_beside(certificate: Path) -> Path:
    """Where the trials of a certificate are until it is written."""
    return certificate.with_name(f"{certificate.name}.part")


class Kept(dict[int, T], Generic[T]):
    """Trials by their seed; one that is put in is on the disk when that returns."""

    def __init__(self, file: IO[str] | None = None) -> None:
        super().__init__()
        self._file = file

    def __setitem__(self, seed: int, trial: T) -> None:
        super().__setitem__(seed, trial)
        if self._file is not None:
            _append(self._file, list(trial))

    def take(self, rows: list[Any], make: Callable[..., T]) -> None:
        """What the file holds already."""
        self.update({row[0]: make(*row) for row in rows})


def _append(file: IO[str], line: Any) -> None:
    file.write(json.dumps(line) + "\n")
    file.flush()
    os.fsync(file.fileno())


@contextmanager
def keeping(path: Path | None, about: Mapping[str, Any], make: Callable[..., T]) -> Iterator[Kept[T]]:  # fmt: skip
    """Trials of a file, which is removed when the block ends well or without any; without a path they are kept in memory alone.

    Raises
    ------
    ColiftError
        For a file of something else, or into which another process writes.

    """
    if path is None:
        yield Kept()
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ColiftError(f"{path}: another process is at this certificate") from None
        kept: Kept[T] = Kept(file)
        head, *rows = _lines(path, file) or [None]
        if head is None:
            _append(file, dict(about))
        elif head != json.loads(json.dumps(about)):
            raise ColiftError(f"{path}: {_differs(head, about)}; remove it, or write elsewhere")
        try:
            kept.take(rows, make)
        except (TypeError, IndexError, KeyError) as error:
            raise ColiftError(f"{path}: holds no trials of a certificate ({error})") from error
        try:
            yield kept
        except BaseException:
            if not kept:
                path.unlink()
            raise
        path.unlink()


def _lines(path: Path, file: IO[str]) -> list[Any]:
    """Whole lines of a file, which ends after them from now on."""
    file.seek(0)
    text = file.read()
    whole = text[: text.rfind("\n") + 1]
    file.truncate(len(whole.encode()))
    try:
        return [json.loads(line) for line in whole.splitlines()]
    except ValueError as error:
        raise ColiftError(f"{path}: holds no trials of a certificate ({error})") from error


def _differs(head: Any, about: Mapping[str, Any]) -> str:
    if not isinstance(head, dict):
        return "holds no trials of a certificate"
    names = [
        name for name, value in json.loads(json.dumps(about)).items() if head.get(name) != value
    ]
    return f"holds trials of another certificate (other {', '.join(names) or 'version'})"  # fmt: skip
