"""The commands that make predictors: fit-edmd, fit-eigen, baseline."""

from __future__ import annotations

from typing import Annotated, get_args

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import begin
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
    WorkersOption,
    names,
)
from koopcli.config.changes import Changes, Values
from koopcli.config.sampled import Mirror
from koopcli.config.settings import (
    BaselineKind,
    BasisName,
    Boundary,
    Coordinates,
    Eigenvalues,
    FitEdmd,
    FitEigen,
    LiftName,
    Placement,
    Solver,
    Terms,
    Window,
)

DATA = ("sample", "vehicle", "simulate")  # the sections behind trajectories


def fit_edmd(
    trajectories: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TRAJECTORIES",
            autocompletion=complete_name,
            help="Trajectories, or several of one plant to fit together; made from the settings when left out.",
        ),
    ] = None,
    order: Annotated[int | None, typer.Option(help=f"Highest degree of each state ({FitEdmd.order}).")] = None,
    vehicle: VehicleOption = None,
    basis: Annotated[
        BasisName | None,
        typer.Option(
            metavar=names(BasisName),
            help="Family of observables: polynomials up to the order in each state (tensor), in total, or up to the "
            "order in the yaw rate and to --degree-velocity in the velocity (anisotropic); thin-plate splines; the "
            f"states alone, which is dynamic mode decomposition ({FitEdmd.basis}).",
        ),
    ] = None,
    degree_velocity: Annotated[
        int | None,
        typer.Option(help=f"anisotropic: highest degree of v_x and v_y together ({FitEdmd.degree_velocity})."),
    ] = None,
    centres: Annotated[int | None, typer.Option(help=f"thin-plate: number of splines ({FitEdmd.centres}).")] = None,
    placement: Annotated[
        Placement | None,
        typer.Option(
            metavar=names(Placement),
            help="thin-plate: centres at the means of clusters of the data, or drawn from a normal distribution with "
            f"its mean and spread ({FitEdmd.placement}).",
        ),
    ] = None,
    terms: Annotated[
        Terms | None,
        typer.Option(
            metavar=names(Terms),
            help="How inputs act: B u; B u and products u_i N_i z; or such a system in continuous time, whose held "
            f"inputs act exactly ({FitEdmd.terms}).",
        ),
    ] = None,
    ridge: Annotated[
        float | None,
        typer.Option(
            help=f"Penalty on the coefficients, of scaled columns; the constant and B stay free ({FitEdmd.ridge:g})."
        ),
    ] = None,
    solver: Annotated[
        Solver | None,
        typer.Option(
            metavar=names(Solver),
            help="Least squares in an orthonormal basis; cholesky-monomials solves the textbook's normal equations "
            f"instead, to show where their digits end ({FitEdmd.solver}).",
        ),
    ] = None,
    workers: WorkersOption = 1,
    cluster: ClusterOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a Koopman predictor z⁺ = A z + B u, x̂ = C z by extended dynamic mode decomposition.

    With --terms bilinear it is z⁺ = A z + B u + Σ u_i N_i z: the products of an input with powers of the yaw rate,
    which no constant B can hold. The basis anisotropic has the powers it needs with few functions. With --terms
    generator the same data give ż = (K_0 + Σ u_i K_i) z, whose step also has what is quadratic in large inputs.

    Data of any size are read in blocks; what is summed over them is committed part by part, shared by --workers or a
    --cluster, and gone on with after an interruption.

    Example: koop fit-edmd --basis anisotropic --order 8 --terms bilinear
    """
    fit: Values = {
        "order": order,
        "basis": basis,
        "degree_velocity": degree_velocity,
        "centres": centres,
        "placement": placement,
        "terms": terms,
        "ridge": ridge,
        "solver": solver,
    }
    given: Changes = {"fit-edmd": fit, "vehicle": {"name": vehicle}}
    call = begin(store, experiment, set_, (*DATA, "fit-edmd"), given, workers, cluster)
    from koopcli.stages import recipes

    of = [call.named(name, ["simulate"], "the TRAJECTORIES", ("fit-edmd",)) for name in trajectories or []]
    call.run(recipes.fit_edmd(call.experiment, *of), as_json=as_json, dry_run=dry_run)


def fit_eigen(
    trajectories: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="Trajectories; made from the settings when left out."),
    ] = None,
    eigenvalues: Annotated[
        Eigenvalues | None,
        typer.Option(
            metavar=names(Eigenvalues),
            help="Rates of growth: sums of the data's own (dmd), as in the paper; a comb of frequencies, which needs "
            f"no data; the best ones for the data, by variable projection ({FitEigen.eigenvalues}).",
        ),
    ] = None,
    degree: Annotated[
        int | None,
        typer.Option(
            help="dmd: rates are sums of up to this many of the data's three: 1, 2, 3 give 4, 10, 20 of them "
            f"({FitEigen.degree})."
        ),
    ] = None,
    pairs: Annotated[
        int | None, typer.Option(help="comb, varpro: pairs of complex rates, beside two real ones (10, 6).")
    ] = None,
    window: Annotated[
        Window | None,
        typer.Option(
            metavar=names(Window),
            help="What a lifted state is fitted to: the whole trajectory from Γ, as in the paper, or the horizon ahead "
            f"of each sample ({FitEigen.window}).",
        ),
    ] = None,
    boundary: Annotated[
        Boundary | None,
        typer.Option(
            metavar=names(Boundary),
            help="window trajectory: values of the eigenfunctions at the initial states, thin-plate splines of the "
            f"state, as in the paper, or the best ones for each trajectory ({FitEigen.boundary}).",
        ),
    ] = None,
    centres: Annotated[int | None, typer.Option(help=f"thin-plate: number of splines ({FitEigen.centres}).")] = None,
    cut: Annotated[
        float | None,
        typer.Option(
            help="Smallest singular value kept, relative to the largest; the errors depend on it (1e-14 for "
            "thin-plate, working precision for optimal)."
        ),
    ] = None,
    lift: Annotated[
        LiftName | None,
        typer.Option(
            metavar=names(LiftName),
            help="How a state is looked up: the nearest sample, linear between samples (Delaunay), moving least "
            f"squares, or local polyharmonic splines ({FitEigen.lift}).",
        ),
    ] = None,
    coordinates: Annotated[
        Coordinates | None,
        typer.Option(
            metavar=names(Coordinates),
            help="window horizon: interpolate states, or the motion as seen from outside, turned back by the predicted "
            f"yaw ({FitEigen.coordinates}).",
        ),
    ] = None,
    tabulate: Annotated[
        float | None,
        typer.Option(
            help="Seconds of each trajectory in which a state is looked up; what is simulated beyond is the longest "
            f"prediction ({FitEigen.tabulate:g})."
        ),
    ] = None,
    mirror: Annotated[
        list[str] | None,
        typer.Option(
            metavar=names(Mirror),
            autocompletion=lambda: list(get_args(Mirror)),
            help="Mirror images of the trajectories are data too: of a car that is the same to the left and to the "
            "right, or at both axles. The option may be given twice.",
        ),
    ] = None,
    trust: Annotated[
        bool | None,
        typer.Option(
            "--trust", help="window horizon: estimate errors from data held back, for a bound at every state."
        ),
    ] = None,
    vehicle: VehicleOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a Koopman predictor whose lifted states are eigenfunctions, built from trajectories without inputs.

    The trajectories start on a surface Γ of one kinetic energy (kind ellipsoid) and never return to it. Along each of
    them an eigenfunction grows as exp(rate · time) from its value on Γ; a new state takes the values of the nearest
    sample. Inputs have no effect on the prediction.

    That is the paper's predictor. The experiment best-eigen has the best one: initial states in the volume (kind
    greedy), a comb of rates, lifted states fitted to the horizon ahead, splines in world coordinates.

    Example: koop fit-eigen --experiment best-eigen --vehicle bmw-320i
    """
    fit: Values = {
        "eigenvalues": eigenvalues,
        "degree": degree,
        "pairs": pairs,
        "window": window,
        "boundary": boundary,
        "centres": centres,
        "cut": cut,
        "lift": lift,
        "coordinates": coordinates,
        "tabulate": tabulate,
        "mirror": mirror or None,
        "trust": trust,
    }
    call = begin(store, experiment, set_, (*DATA, "fit-eigen"), {"fit-eigen": fit, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    of = call.optional(trajectories, ["simulate"], "the TRAJECTORIES", ("fit-eigen",))
    call.run(recipes.fit_eigen(call.experiment, of), as_json=as_json, dry_run=dry_run)


def baseline(
    kind: Annotated[
        BaselineKind,
        typer.Argument(
            metavar=names(BaselineKind),
            help="hold: the first state; rotation: turned at its yaw rate; linearisation: of the plant at it.",
        ),
    ],
    trajectories: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="Trajectories whose plant it predicts; made when left out."),
    ] = None,
    vehicle: VehicleOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a baseline: a prediction without any fit, which a predictor has to beat.

    Example: koop evaluate "$(koop baseline rotation)"
    """
    call = begin(
        store, experiment, set_, (*DATA, "baseline"), {"baseline": {"kind": kind}, "vehicle": {"name": vehicle}}
    )
    from koopcli.stages import recipes

    of = call.optional(trajectories, ["simulate"], "the TRAJECTORIES", ("baseline",))
    call.run(recipes.baseline(call.experiment, of), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("fit-edmd", rich_help_panel="Make")(fit_edmd)
    app.command("fit-eigen", rich_help_panel="Make")(fit_eigen)
    app.command("baseline", rich_help_panel="Make")(baseline)
