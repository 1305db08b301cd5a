"""What all commands have in common: their help, and that they take no empty text."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, get_args

import typer
from typer.core import TyperCommand, TyperGroup

from koopcli.errors import InvalidValueError


class Command(TyperCommand):
    """A command that takes no empty text; its help says nothing of the values of flags, which take none."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, with nothing to show for the value of a flag."""
        return _without_values(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line, once it is known to hold no empty text."""
        if not ctx.resilient_parsing:
            given, _, _ = self.make_parser(ctx).parse_args(args=list(args))
            for parameter in self.params:
                _refuse_empty(parameter, given.get(parameter.name))
        return super().parse_args(ctx, args)


class Group(TyperGroup):
    """A group of commands with such help."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, likewise."""
        return _without_values(super().get_params(ctx))


def prepare(app: typer.Typer) -> None:
    """Make all that is registered with ``app`` a ``Command`` or ``Group``, whose help has no line breaks of its own."""
    app.info.cls = Group
    for command in app.registered_commands:
        command.cls = Command
        command.help = flowing(command.callback.__doc__ or "")
    for group in app.registered_groups:
        if group.typer_instance is not None:
            prepare(group.typer_instance)


def flowing(text: str) -> str:
    """Paragraphs of a docstring, each in one line, for the terminal to break."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in re.split(r"\n\s*\n", text.strip()))


def _without_values(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


def _refuse_empty(parameter: Any, given: Any) -> None:
    """Refuse an empty text: for a path it would come to be the working folder, for another option to be left out.

    Names that a shell completes are looked up, and no empty one is found.
    """
    kind = parameter.type_descriptor.annotation
    texts = not {str, Path}.isdisjoint((kind, *get_args(kind)))
    if given is None or not texts or parameter._custom_shell_complete is not None:
        return
    for text in [given] if isinstance(given, str) else given:
        if not text.strip():
            raise InvalidValueError(
                f"{'/'.join(parameter.opts)} '{text}': the text is empty, as a failed command leaves it: give one, or "
                "leave it out"
            )
