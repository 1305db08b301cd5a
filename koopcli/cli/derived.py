"""Options from declared settings: each is said once, by the class that uses it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import wraps
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import typer

from koopcli.choices import Choice, choices, hints_of, taken, without_none

Command = Callable[..., None]


class Use(NamedTuple):
    """One class that has a setting: the ``kind`` that it is, the ``hint`` and ``default`` of the setting, its help."""

    kind: str
    hint: Any
    default: Any
    help: str


def options_of(*classes: type, only: Sequence[str] = (), but: Sequence[str] = ()) -> Callable[[Command], Command]:
    """Give a command that takes ``given`` an option for every setting of ``classes`` that has one.

    The settings of the kinds that can be chosen are among them; several ``classes`` are kinds themselves. ``only``:
    some of them; ``but``: those left out.
    """
    every = _declared(classes)
    declared = {name: every[name] for name in only or every if name not in but}

    def decorate(command: Command) -> Command:
        own = inspect.signature(command, eval_str=True).parameters
        options = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_option(name, uses))
            for name, uses in declared.items()
        ]
        plain = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for name, p in own.items() if name != "given"]
        first = [p for p in plain if _is_first(p)]
        signature = inspect.Signature([*first, *options, *(p for p in plain if p not in first)])

        @wraps(command)
        def run(**values: Any) -> None:
            given = {name: values.pop(name, None) for name in declared}
            command(given={name: value for name, value in given.items() if value not in (None, [])}, **values)

        run.__signature__ = signature  # type: ignore[attr-defined]
        run.__annotations__ = {name: p.annotation for name, p in signature.parameters.items()}
        return run

    return decorate


def _is_first(parameter: inspect.Parameter) -> bool:
    """Whether a parameter comes before the settings: an argument, or the context."""
    annotation = parameter.annotation
    return annotation is typer.Context or any(
        isinstance(about, typer.models.ArgumentInfo) for about in getattr(annotation, "__metadata__", ())
    )


def _declared(classes: Sequence[type]) -> dict[str, list[Use]]:
    """The settings that have an option by name, with the classes that have them."""
    declared: dict[str, list[Use]] = {}
    for cls in classes:
        hints, kind = hints_of(cls), getattr(cls, "kind", "")
        for f in fields(cls):
            if f.name in taken(cls):
                continue
            if f.metadata.get("option"):
                unit = f", in {f.metadata['unit']}" if f.metadata["unit"] not in ("", "1") else ""
                use = Use(kind, hints[f.name], f.default, f"{f.metadata['help']}{unit}")
                declared.setdefault(f.name, []).append(use)
            if f.name in choices(cls):
                for name, uses in _declared(tuple(choices(cls)[f.name].kinds().values())).items():
                    declared.setdefault(name, []).extend(uses)
    return declared


def _option(name: str, uses: Sequence[Use]) -> Any:
    """The option of a setting, which several kinds may have."""
    hint, default = without_none(uses[0].hint), uses[0].default
    if isinstance(hint, type) and issubclass(hint, Choice):
        kinds = ordered(hint, default)
        usual = f" ({default.kind})" if isinstance(default, Choice) else ""
        return _annotated(name, Literal[tuple(kinds)], f"{_capital(uses[0].help)}. {said_of(kinds)}{usual}.")
    by_help: dict[str, list[str]] = {}
    for use in uses:
        by_help.setdefault(use.help, []).append(use.kind)
    parts = [f"{', '.join(kinds)}: {text}" if any(kinds) else _capital(text) for text, kinds in by_help.items()]
    return _annotated(name, hint, f"{'; '.join(parts)}{_default(uses)}.", denied=default is None)


def _annotated(name: str, hint: Any, text: str, *, denied: bool = False) -> Any:
    """The type of an option with its help. ``denied``: a flag has an option that denies it beside it."""
    if get_origin(hint) is tuple:
        names = list(get_args(get_args(hint)[0]))
        text = f"{text} The option may be given twice."
        option = typer.Option(metavar="|".join(names), autocompletion=lambda: names, help=text)
        return Annotated[list[str] | None, option]
    if hint is bool:
        flag = name.replace("_", "-")
        return Annotated[bool | None, typer.Option(f"--{flag}/--no-{flag}" if denied else f"--{flag}", help=text)]
    metavar = "|".join(get_args(hint)) if get_origin(hint) is Literal else None
    return Annotated[hint | None, typer.Option(metavar=metavar, help=text)]


def _default(uses: Sequence[Use]) -> str:
    """The defaults in parentheses, each with the kinds that have it where they are not the same."""
    by_default: dict[str, list[str]] = {}
    for use in uses:
        if use.default is not MISSING and not isinstance(use.default, (bool, tuple, type(None))):
            text = f"{use.default:g}" if isinstance(use.default, float) else str(use.default)
            by_default.setdefault(text, []).append(use.kind)
    if sum(map(len, by_default.values())) == len(uses) and len(by_default) == 1:
        return f" ({next(iter(by_default))})"
    told = [f"{', '.join(dict.fromkeys(kinds))}: {text}" for text, kinds in by_default.items()]
    return f" ({'; '.join(told)})" if told else ""


def ordered(base: type[Choice], default: object) -> Mapping[str, type[Choice]]:
    """The kinds of a choice, the ``default`` first."""
    kinds = base.kinds()
    return {name: kinds[name] for name in sorted(kinds, key=lambda name: name != getattr(default, "kind", None))}


def values_of(hint: Any) -> list[str]:
    """The values that a setting may have by name: kinds, enumerated values, true and false."""
    bare = without_none(hint)
    if get_origin(bare) is tuple:
        bare = get_args(bare)[0]
    if isinstance(bare, type) and issubclass(bare, Choice):
        return list(bare.kinds())
    return ["true", "false"] if bare is bool else [*get_args(bare)] if get_origin(bare) is Literal else []


def said_of(kinds: Mapping[str, type[Choice]]) -> str:
    """What every one of ``kinds`` is."""
    return "; ".join(f"{name}: {_said(kind)}" for name, kind in kinds.items())


def _said(kind: type[Choice]) -> str:
    """What a kind is: the first line of its docstring."""
    line = (kind.__doc__ or "").partition("\n")[0].rstrip(".")
    return f"{line[0].lower()}{line[1:]}" if line[1:2].islower() or line.startswith("A ") else line


def _capital(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}" if " " in text.partition(":")[0] or ":" not in text else text
