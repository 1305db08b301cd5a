"""Bases of observables ψ(x). A new basis is one file in this folder: a frozen class, and its choice with settings."""

from __future__ import annotations

from koopcli.choices import import_files
from koopcli.koopman.bases.basis import BasisChoice

import_files(__name__, __path__)

STORED = {choice.makes.stored: choice.makes.unpack for choice in BasisChoice.kinds().values()}
