"""The `colift` command: one file a command, found by looking.

A command's file imports :data:`colift.cli.base.app`, decorates one function with ``@app.command()``, and
imports what it needs inside it. The file is imported when its command is called, so that help is instant.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated, NoReturn

import typer

from colift.cli.base import EXIT_ERROR, EXIT_INTERRUPTED, EXIT_USAGE, app, console
from colift.errors import ColiftError, MissionError, UnknownNameError


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"colift {version('colift')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Several multirotors carry one load on cables: allocate, control, simulate, judge."""


def main() -> None:
    """Entry point: errors of ours become one clear message and an exit code."""
    gc.set_threshold(
        100_000, 20, 100
    )  # what is imported stays: looking through it again and again takes a tenth
    os.environ.setdefault(
        "PYDANTIC_DISABLE_PLUGINS", "1"
    )  # it would look through all packages for one
    try:
        app()
    except (MissionError, UnknownNameError) as error:
        _fail(error, EXIT_USAGE)
    except ColiftError as error:
        _fail(error, EXIT_ERROR)
    except OSError as error:
        said = error.strerror or str(error) or type(error).__name__
        _fail(said if error.filename is None else f"{error.filename}: {said}", EXIT_ERROR)
    except SystemExit as done:  # which typer makes of an interrupt that no command answers itself
        if isinstance(getattr(done.__context__, "__cause__", None), KeyboardInterrupt):
            console(stderr=True).print("interrupted; nothing half-written was left")
        raise
    except KeyboardInterrupt:
        console(stderr=True).print("interrupted; nothing half-written was left")
        sys.exit(EXIT_INTERRUPTED)


def _fail(said: object, code: int) -> NoReturn:
    from rich.markup import escape

    text = f"[red]error[/red]: {escape(str(said))}"
    console(stderr=True).print(text, highlight=False, soft_wrap=True)
    sys.exit(code)
