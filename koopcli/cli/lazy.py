"""Commands by name, each imported when it is called: the list of all of them needs no numerics."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand

from koopcli.cli.command import Group, prepare


class Entry(NamedTuple):
    """A command: the ``module`` of ``koopcli.cli`` that has it, its ``panel`` in the list, and what it does."""

    name: str
    module: str
    panel: str
    about: str


def group_of(entries: tuple[Entry, ...]) -> type[Group]:
    """A group of commands that stand for those of ``entries`` until one of them is called, or asked for."""

    class Lazy(Group):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**attributes)
            for entry in entries:
                stub = TyperCommand(entry.name, help=entry.about, rich_help_panel=entry.panel)
                self.commands[entry.name] = stub

        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            """The command that ``args`` begin with, imported."""
            self.load(args[0])
            return super().resolve_command(ctx, args)

        def load(self, name: str) -> Any:
            """The command ``name``, imported; None for one that there is not."""
            for entry in entries:
                if entry.name == name and type(self.commands[name]) is TyperCommand:
                    self.commands[name] = _commands(entry.module)[name]
            return self.commands.get(name)

    return Lazy


@cache
def _commands(module: str) -> dict[str, Any]:
    """The commands of a module of ``koopcli.cli``."""
    app = typer.Typer(rich_markup_mode="rich")
    app.callback()(lambda: None)
    import_module(f"koopcli.cli.{module}").register(app)
    prepare(app)
    commands: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return commands
