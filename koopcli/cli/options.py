"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from koopcli.cli.completion import complete_experiment, complete_setting, complete_vehicle


def names(literal: Any) -> str:
    """The allowed names of an option, as its placeholder in the help."""
    return "|".join(get_args(literal))


StoreOption = Annotated[
    Path | None,
    typer.Option("--store", metavar="DIR", help="Folder of artefacts ($KOOP_STORE or ./artefacts)."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the name or table.")]
DryRunOption = Annotated[
    bool,
    typer.Option(
        "--dry-run", help="Say what would be made or reused, how long that takes and how large it is; make nothing."
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="STAGE.KEY=VALUE",
        autocompletion=complete_setting,
        help="Change one setting of any stage behind this one, such as vehicle.Jzz=1731 or sample.box=[20,20,5]; "
        "docs/cli.md lists them. It may be repeated; the command's own options win.",
    ),
]
WorkersOption = Annotated[
    int,
    typer.Option("--workers", metavar="N", help="Processes that share the work; they do not change a result."),
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Share the work on a Dask cluster instead: the address of its scheduler, or the .json file that it wrote. "
        "It needs the extra 'dask' and a store that all workers see.",
    ),
]
ExperimentOption = Annotated[
    str,
    typer.Option(
        "--experiment",
        metavar="NAME|FILE",
        autocompletion=complete_experiment,
        help="Where settings come from: paper, best-edmd, best-eigen, quick-eigen, smoke or a TOML file.",
    ),
]
VehicleOption = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        metavar="NAME|FILE",
        autocompletion=complete_vehicle,
        help="A shipped vehicle (ctu-2020) or your own TOML file.",
    ),
]
