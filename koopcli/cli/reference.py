"""The command reference docs/cli.md, written from the commands themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from koopcli.cli.app import app

if TYPE_CHECKING:
    from collections.abc import Iterator

HEAD = """# Command reference

Written by `make docs` from the commands' own help. Every making command prints the name of its artefact on stdout and
everything else on stderr; with `--json` it prints one JSON object.
"""


def reference() -> str:
    """The whole page as Markdown."""
    root: Any = typer.main.get_command(app)
    return "\n".join([HEAD, *(line for name, command in root.commands.items() for line in _command(name, command))])


def _command(name: str, command: Any) -> Iterator[str]:
    about, _, example = command.help.partition("Example: ")
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option"]
    words = [_metavar(p) for p in arguments]
    yield f"## koop {name}\n"
    yield f"    koop {' '.join([name, *words, '[OPTIONS]'])}\n"
    yield f"{about.strip()}\n"
    yield f"    {example.strip()}\n"
    for parameter in arguments:
        yield f"* `{_metavar(parameter)}`: {parameter.help}"
    for parameter in options:
        yield f"* `{' / '.join(parameter.opts)}{_value(parameter)}`: {parameter.help}"
    yield ""


def _metavar(parameter: Any) -> str:
    text = parameter.metavar or parameter.name.upper()
    text += " ..." if parameter.nargs == -1 else ""
    return text if parameter.required else f"[{text}]"


def _value(parameter: Any) -> str:
    return "" if parameter.is_flag else f" {parameter.metavar or 'N'}"


if __name__ == "__main__":
    print(reference(), end="")
