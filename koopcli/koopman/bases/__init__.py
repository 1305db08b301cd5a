"""Bases of observables ψ(x). A new basis is one file in this folder: a frozen class, and its choice with settings."""

from __future__ import annotations

from functools import partial

from koopcli.choices import import_files
from koopcli.koopman.bases.basis import BasisChoice
from koopcli.koopman.predictor.memory import Memory

import_files(__name__, __path__)

STORED = {choice.makes.stored: choice.makes.unpack for choice in BasisChoice.kinds().values()}
WITH_MEMORY = {Memory.stored: partial(Memory.unpack, bases=STORED)}  # chosen by no name: it goes about another basis
