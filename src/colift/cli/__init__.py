"""The `colift` command: one file a command, found by looking.

A command's file imports :data:`colift.cli.base.app`, decorates one function with ``@app.command()``, and
imports what it needs inside it, so that help is instant.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from typing import Annotated

import typer
from rich.markup import escape

from colift.cli.base import EXIT_ERROR, EXIT_INTERRUPTED, EXIT_USAGE, app, err
from colift.errors import ColiftError, MissionError, UnknownNameError

FIRST = ("run", "compare", "replay", "fly")
"""Commands at the top of the help; the others follow by name."""


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


_found = [
    module.name
    for module in pkgutil.iter_modules(__path__)
    if module.name not in ("base", "campaign")
]
for _name in sorted(_found, key=lambda name: ((*FIRST, name).index(name), name)):
    importlib.import_module(f"{__name__}.{_name}")


def main() -> None:
    """Entry point: errors of ours become one clear message and an exit code."""
    try:
        app()
    except (MissionError, UnknownNameError) as error:
        err.print(f"[red]error[/red]: {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_USAGE)
    except ColiftError as error:
        err.print(f"[red]error[/red]: {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_ERROR)
    except OSError as error:
        said = error.strerror or str(error) or type(error).__name__
        where = "" if error.filename is None else f"{error.filename}: "
        err.print(f"[red]error[/red]: {escape(where + said)}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_ERROR)
    except SystemExit as done:  # which typer makes of an interrupt that no command answers itself
        if isinstance(getattr(done.__context__, "__cause__", None), KeyboardInterrupt):
            err.print("interrupted; nothing half-written was left")
        raise
    except KeyboardInterrupt:
        err.print("interrupted; nothing half-written was left")
        sys.exit(EXIT_INTERRUPTED)
