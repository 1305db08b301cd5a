"""Kinds of sample: initial states and inputs. A new kind is one file in this folder, with its settings."""

from __future__ import annotations

from koopcli.choices import import_files

import_files(__name__, __path__)
