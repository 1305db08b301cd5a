"""koop: Koopman predictors of vehicle dynamics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["__version__", "load"]
__version__ = "0.1.0"


def load(name: str, store: str | Path | None = None) -> Any:
    """Load an artefact by name or unambiguous prefix: a predictor, trajectories, a sample or an evaluation.

    >>> predictor = koopcli.load("fit-edmd/3f2a9c01d4e5")   # doctest: +SKIP
    >>> x = predictor.predict(x0, u)                        # doctest: +SKIP

    The store is ``store``, else ``$KOOP_STORE``, else ``./artefacts``; every byte is verified. Raises
    ``UnknownNameError`` for an unknown or ambiguous name, ``DamagedArtefactError`` for a damaged object.
    """
    from koopcli.paths import require_posix  # noqa: PLC0415

    require_posix()
    from koopcli.stages import read  # noqa: PLC0415  (numpy and h5py only when asked for)

    return read(name, store)
