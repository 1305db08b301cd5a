"""The command reference docs/cli.md, written from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from textwrap import fill
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from koopcli.cli.app import root
from koopcli.config.pictures import PlotOptions
from koopcli.config.samples import SAMPLES
from koopcli.config.settings import About, Baseline, Evaluate, FitEdmd, FitEigen, Reproduce, Simulate
from koopcli.vehicles.parameters import VehicleParameters

DECLARED: tuple[tuple[str, Any], ...] = (
    ("experiment", About),
    ("vehicle", VehicleParameters),
    *((f"sample.{kind}", cls) for kind, cls in SAMPLES.items()),
    ("simulate", Simulate),
    ("fit-edmd", FitEdmd),
    ("fit-eigen", FitEigen),
    ("baseline", Baseline),
    ("evaluate", Evaluate),
    ("plot", PlotOptions),
    ("reproduce", Reproduce),
)

WIDTH = 116  # letters of a line
HEAD = """# Command reference

Written by `make docs` from the commands' own help. Every making command prints the name of its artefact on stdout and
everything else on stderr; with `--json` it prints one JSON object.
"""


def reference() -> str:
    """The whole page as Markdown."""
    commands = [line for name, command in root().commands.items() for line in _command(name, command)]
    return "\n".join([HEAD, *commands, *_settings(), ""])


def _settings() -> Iterator[str]:
    """Every setting that --set and an experiment file take, from the declarations themselves."""
    yield "## Settings\n"
    yield "For `--set SECTION.KEY=VALUE` and for experiment files. Values are TOML; `--set` also takes numbers such as"
    yield ".5, as options do, and one name for a list of names. `vehicle.name` chooses a vehicle.\n"
    yield "`test.box`, `test.point`, `test.ball`, `test.drive-test` and `test.manoeuvre` take what samples of those"
    yield "kinds take; a setting without its kind, such as `sample.seed`, holds for the kind in use.\n"
    yield "| setting | default | allowed | meaning |\n|---|---|---|---|"
    for section, cls in DECLARED:
        hints = get_type_hints(cls)
        for f in fields(cls):
            if f.metadata:
                default = "" if f.default is MISSING or f.default is None else _plain(f.default)
                allowed = _allowed(hints[f.name], f.metadata)
                yield f"| {section}.{f.name} | {default} | {allowed} | {f.metadata['help']} |"


def _plain(value: Any) -> str:
    return f"[{', '.join(map(str, value))}]" if isinstance(value, tuple) else str(value)


def _allowed(kind: Any, bounds: Mapping[str, Any]) -> str:
    if get_origin(kind) in (Union, UnionType):
        (kind,) = [one for one in get_args(kind) if one is not type(None)]
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
