"""The command reference docs/cli.md, written from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from textwrap import fill
from typing import Any, Literal, get_args, get_origin

from koopcli.choices import Choice, without_none
from koopcli.cli.app import whole
from koopcli.cli.derived import ordered
from koopcli.config.declared import every_setting

WIDTH = 116  # letters of a line
HEAD = """# Command reference

Written by `make docs` from the commands' own help. Every making command prints the name of its artefact on stdout and
everything else on stderr; with `--json` it prints one JSON object.
"""


def reference() -> str:
    """The whole page as Markdown."""
    commands = [line for name, command in whole().items() for line in _command(name, command)]
    return "\n".join([HEAD, *commands, *_settings(), ""])


def _settings() -> Iterator[str]:
    """Every setting that --set and an experiment file take, from the declarations themselves."""
    yield "## Settings\n"
    yield "For `--set SECTION.KEY=VALUE` and for experiment files. Values are TOML; `--set` also takes numbers such as"
    yield ".5, as options do, and one name for a list of names. `vehicle.name` chooses a vehicle.\n"
    yield "A setting of a kind, such as `fit-edmd.basis.thin-plate.centres`, holds for that kind, in effect or not."
    yield "Without the kind, as `fit-edmd.centres` or `sample.seed`, it is a setting of the kind in effect.\n"
    yield "| setting | default | allowed | meaning |\n|---|---|---|---|"
    for declared in every_setting():
        f = declared.field
        default = "" if f.default is MISSING or f.default is None else _plain(f.default)
        allowed = _allowed(declared.hint, f.metadata, f.default)
        yield f"| {declared.full_name} | {default} | {allowed} | {f.metadata['help']} |"


def _plain(value: Any) -> str:
    if isinstance(value, Choice):
        return value.kind
    return f"[{', '.join(map(str, value))}]" if isinstance(value, tuple) else str(value)


def _allowed(hint: Any, bounds: Mapping[str, Any], default: object = None) -> str:
    kind = without_none(hint)
    if isinstance(kind, type) and issubclass(kind, Choice):
        return ", ".join(ordered(kind, default))
    if get_origin(kind) is tuple:
        return f"list: {_allowed(get_args(kind)[0], bounds)}"
    if get_origin(kind) is Literal:
        return ", ".join(get_args(kind))
    words = [("≥", bounds["low"]), (">", bounds["above"]), ("≤", bounds["high"])]
    return " ".join([*(f"{sign} {value:g}" for sign, value in words if value is not None), bounds["unit"]]).strip()


def _command(name: str, command: Any) -> Iterator[str]:
    if hasattr(command, "commands"):
        for part, inner in command.commands.items():
            yield from _command(f"{name} {part}", inner)
        return
    about, _, example = command.help.partition("Example: ")
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option"]
    words = [_metavar(p) for p in arguments]
    yield f"## koop {name}\n"
    yield f"    koop {' '.join([name, *words, '[OPTIONS]'])}\n"
    for paragraph in about.strip().split("\n\n"):
        yield f"{fill(paragraph, WIDTH, break_on_hyphens=False)}\n"
    yield f"    {example.strip()}\n"
    for parameter in arguments:
        yield f"* `{_metavar(parameter)}`: {parameter.help}"
    for parameter in options:
        yield f"* `{' / '.join([*parameter.opts, *parameter.secondary_opts])}{_value(parameter)}`: {parameter.help}"
    yield ""


def _metavar(parameter: Any) -> str:
    text = parameter.metavar or parameter.name.upper()
    text += " ..." if parameter.nargs == -1 else ""
    return text if parameter.required else f"[{text}]"


def _value(parameter: Any) -> str:
    return "" if parameter.is_flag else f" {parameter.metavar or 'N'}"


if __name__ == "__main__":
    print(reference(), end="")
