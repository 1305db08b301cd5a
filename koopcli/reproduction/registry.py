"""The methods of the paper by name."""

from __future__ import annotations

from koopcli.reproduction import beyond, edmd, eigen
from koopcli.reproduction.report import Method

BEYOND = beyond.METHOD  # only where it is asked for

METHODS: dict[str, Method] = {module.METHOD.name: module.METHOD for module in (edmd, eigen)}
