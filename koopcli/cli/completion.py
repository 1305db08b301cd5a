"""What a shell completes besides options: names that are known, but for settings without numerics.

A completion never complains: where names cannot be listed there are none.
"""

from __future__ import annotations

from collections.abc import Iterable

import typer

from koopcli.config.data import data_folder
from koopcli.errors import KoopError
from koopcli.figures import NAMES, module_of

STAGES = (
    *("sample", "simulate", "import", "fit-edmd", "fit-eigen", "baseline"),
    *("evaluate", "select", "score", "predict", "control", "sweep", "plot"),
)  # heavy to ask for


def complete_name(ctx: typer.Context, incomplete: str) -> list[str]:
    """Artefacts in the store, that of ``--store`` where it stands before; of a figure those that it takes."""
    from koopcli.store.names import index, is_name, short_name, store_root

    try:
        stored = index(store_root(ctx.params.get("store")))
    except (KoopError, OSError):
        return []
    figure = ctx.params.get("figure")
    taken = module_of(figure).FIGURE.stages if figure in NAMES else None
    names = [f"{stage}/{key}" for stage, key in stored if taken is None or stage in taken]
    return _beginning(map(short_name, filter(is_name, names)), incomplete)


def complete_stage(incomplete: str) -> list[str]:
    """Stages."""
    return _beginning(STAGES, incomplete)


def complete_figure(incomplete: str) -> list[str]:
    """Figures."""
    return _beginning(NAMES, incomplete)


def complete_setting(incomplete: str) -> list[str]:
    """Settings by the names that hold for the kind in effect, or for the kind that is named, then their values."""
    from koopcli.cli.derived import values_of
    from koopcli.config.declared import entries, every_setting

    settings = list(every_setting())
    name, equals, _ = incomplete.partition("=")
    if equals:
        named = [setting for setting in settings if name in (setting.short_name, setting.full_name)]
        values = [value for setting in named for value in values_of(setting.hint)]
        return _beginning(dict.fromkeys(f"{name}={value}" for value in values), incomplete)
    short = [f"{setting.short_name}=" for setting in settings]
    full = [f"{setting.full_name}=" for setting in settings]
    full += [f"{setting.full_name}.{entry}=" for setting in settings for entry in entries(setting)]
    return _beginning(dict.fromkeys([*short, "vehicle.name="]), incomplete) or _beginning(full, incomplete)


def complete_experiment(incomplete: str) -> list[str]:
    """Shipped experiments; a shell completes files itself."""
    return _beginning(_shipped("experiments"), incomplete)


def complete_vehicle(incomplete: str) -> list[str]:
    """Shipped vehicles; a shell completes files itself."""
    return _beginning(_shipped("vehicles"), incomplete)


def _shipped(folder: str) -> list[str]:
    return sorted(path.stem for path in (data_folder() / folder).glob("*.toml"))


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
