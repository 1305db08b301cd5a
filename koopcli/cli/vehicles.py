"""The commands that look into vehicle files: vehicle ls, show, check."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopcli.cli.completion import complete_vehicle
from koopcli.cli.invocation import print_json
from koopcli.cli.options import JsonOption
from koopcli.config.data import locate
from koopcli.config.settings import Simulate
from koopcli.console import Console, show_line, show_table
from koopcli.errors import InvalidValueError

if TYPE_CHECKING:
    from koopcli.vehicles.parameters import VehicleFile

vehicle = typer.Typer(
    no_args_is_help=True, help="Look into vehicle files: their parameters and what follows from them."
)


NameArgument = Annotated[
    str,
    typer.Argument(metavar="NAME|FILE", autocompletion=complete_vehicle, help="A shipped vehicle or your TOML file."),
]
DtOption = Annotated[float, typer.Option(help="Sampling period in s that substeps are counted for.")]


@vehicle.command("ls")
def ls(as_json: JsonOption = False) -> None:
    """List the shipped vehicles.

    Example: koop vehicle ls
    """
    from koopcli.config.shipped import vehicles
    from koopcli.simulation.portrait import plants_of

    files = vehicles()
    if as_json:
        print_json({name: {"title": file.title, "plants": plants_of(file.parameters)} for name, file in files.items()})
        return
    rows = []
    for name, file in files.items():
        p = file.parameters
        grip = "–" if p.lateral is None else f"{p.mu_scale * p.lateral.mu:.3g}"
        rows.append([name, file.title, " ".join(plants_of(p)), f"{p.m:g} kg", f"{p.l_f + p.l_r:.3f} m", grip])
    show_table(["vehicle", "title", "plants", "mass", "wheelbase", "lateral grip"], rows, left=3)


@vehicle.command("show")
def show(name: NameArgument, dt: DtOption = Simulate.dt, as_json: JsonOption = False) -> None:
    """Show a vehicle: every parameter with its unit, its source, and the numbers that follow from it.

    Example: koop vehicle show bmw-320i
    """
    from koopcli.vehicles.parameters import read_vehicle_file

    _print(read_vehicle_file(locate("vehicles", name, "vehicle")), dt, [], as_json=as_json)


@vehicle.command("check")
def check(file: NameArgument, dt: DtOption = Simulate.dt, as_json: JsonOption = False) -> None:
    """Check a vehicle file, say what is unusual about it, and show the numbers that follow from it.

    A file that cannot be used ends with the one line that says why; docs/vehicles.md has the schema.

    Example: koop vehicle check ./my-car.toml
    """
    from koopcli.simulation.portrait import plants_of, remarks
    from koopcli.vehicles.parameters import read_vehicle_file

    vehicle, console = read_vehicle_file(locate("vehicles", file, "vehicle")), Console()
    texts = list(remarks(vehicle.parameters))
    if not vehicle.source:
        texts.append('no source: say where the numbers come from with source = "…"')
    _print(vehicle, dt, texts, as_json=as_json)
    for remark in texts:
        console.warn(remark)
    plants = ", ".join(plants_of(vehicle.parameters))
    console.note(f"{file} can be used with the plants {plants}" + ("" if texts else "; nothing about it is unusual"))


def _print(vehicle: VehicleFile, dt: float, texts: list[str], *, as_json: bool) -> None:
    """The vehicle as tables or as JSON."""
    from koopcli.simulation.portrait import derived, plants_of

    if not (math.isfinite(dt) and 0 < dt <= 10):
        raise InvalidValueError(f"--dt must be above 0 and at most 10 s, got {dt:g}")
    p = vehicle.parameters
    numbers = derived(p, dt)
    if as_json:
        following = {number.name: {"value": number.value, "unit": number.unit} for number in numbers}
        about = {"title": vehicle.title, "source": vehicle.source, "plants": plants_of(p), "remarks": texts}
        print_json({**about, "parameters": asdict(p), "derived": following})
        return
    show_line(vehicle.title or "a vehicle without a title")
    show_table(["parameter", "meaning", "value", "unit"], list(_parameters(p)), left=2)
    rows = [[number.name, _shown(number.name, number.value), number.unit] for number in numbers]
    show_table(["what follows", "value", "unit"], rows, left=1)
    if vehicle.source:
        show_line(f"source: {vehicle.source}")


def _shown(name: str, value: float) -> str:
    """A derived number; zero and infinity have names of their own."""
    if name == "understeer gradient" and value == 0:
        return "0 (neutral)"
    return "none" if not math.isfinite(value) else f"{value:.5g}"


def _parameters(table: Any, prefix: str = "") -> list[list[str]]:
    """The parameters that are given, row by row, those of a tyre under its name."""
    rows: list[list[str]] = []
    for f in fields(table):
        value = getattr(table, f.name)
        if value is None or (f.name == "S_h" and value == 0):
            continue
        if f.metadata.get("unit"):
            rows.append([f"{prefix}{f.name}", f.metadata["help"], f"{value:g}", f.metadata["unit"]])
        else:
            rows += _parameters(value, f"{f.name}.")
    return rows


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.add_typer(vehicle, name="vehicle")
