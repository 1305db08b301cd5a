"""The line inside every figure that says what it is of: vehicle, predictor, and the koop that drew it."""

from __future__ import annotations

from collections.abc import Sequence

from koopcli.config.pictures import Subject
from koopcli.config.shipped import called

BETWEEN = " · "
LONGEST = 60  # letters that a line has room for in one column


def signature(of: Subject, version: str) -> str:
    """The line of a figure that this ``version`` draws; of what there is several is counted, and named where there is
    room for it.

    Names of vehicles are looked up when it is drawn. Neither they nor the version are in the key of a stored figure,
    which keeps the line that it was drawn with.
    """
    vehicles = [called(vehicle) for vehicle in of.vehicles]
    long, short = (
        BETWEEN.join(
            part
            for part in (
                _counted("vehicles", vehicles, vehicles if named else ()),
                _counted("predictors", of.predictors, _families(of.predictors) if named else ()),
                f"koop {version}".strip(),
            )
            if part
        )
        for named in (True, False)
    )
    return long if len(long) <= LONGEST else short


def _counted(what: str, names: Sequence[str], shown: Sequence[str]) -> str:
    """One by its name, several by how many there are and what is ``shown`` of their names."""
    if len(names) < 2:
        return "".join(names)
    return f"{len(names)} {what}: {', '.join(shown)}" if shown else f"{len(names)} {what}"


def _families(predictors: Sequence[str]) -> list[str]:
    """What predictors are called without their settings, each once."""
    return list(dict.fromkeys(name.partition(",")[0] for name in predictors))
