"""The commands as the command line looks for them: known by their files, imported when they are called."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer.core import TyperGroup
from typer.main import get_command_from_info, get_command_name

if TYPE_CHECKING:
    from typer._click import Command, Context, HelpFormatter

FIRST = ("run", "compare", "replay", "fly")
"""Commands at the top of the help; the others follow by name."""


def files() -> dict[str, str]:
    """Name of each command, in the order of the help, and of the module that holds it."""
    modules = [
        module.name
        for module in pkgutil.iter_modules([str(Path(__file__).parent)])
        if not module.name.startswith("_") and module.name not in ("base", "campaign")
    ]
    found = {module.rstrip("_").replace("_", "-"): module for module in modules}
    return {name: found[name] for name in sorted(found, key=lambda n: ((*FIRST, n).index(n), n))}


def summary(module: str) -> str:
    """First sentence of what a command's file says of it, without importing the file."""
    tree = ast.parse((Path(__file__).parent / f"{module}.py").read_text(encoding="utf-8"))
    command = next(
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any("app.command" in ast.unparse(decorator) for decorator in node.decorator_list)
    )
    paragraph = (ast.get_docstring(command) or "").partition("\n\n")[0]
    return " ".join(paragraph.split()).partition(". ")[0].removesuffix(".")


class Commands(TyperGroup):
    """All commands of colift by name."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = dict.fromkeys(files())  # type: ignore[assignment]  # filled when they are called

    def get_command(self, ctx: Context, name: str) -> Command | None:
        """Import the command's file, which makes it known to the application."""
        from colift.cli.base import app

        if name in self.commands and self.commands[name] is None:
            module = importlib.import_module(f"colift.cli.{files()[name]}")
            (info,) = (
                each
                for each in app.registered_commands
                if each.callback is not None and each.callback.__module__ == module.__name__
            )
            assert info.callback is not None
            assert name == (info.name or get_command_name(info.callback.__name__))
            self.commands[name] = get_command_from_info(
                info, pretty_exceptions_short=False, rich_markup_mode=self.rich_markup_mode
            )
        return self.commands.get(name)

    def format_help(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Plain text, for the sake of its speed."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        self.format_options(ctx, formatter)

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary(module)) for name, module in files().items()])
