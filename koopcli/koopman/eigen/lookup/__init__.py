"""From nodes with known values to any other place: which nodes, with what weights (docs/equations.md 7).

A new way is one file in this folder: a lookup, and its choice with settings.
"""

from __future__ import annotations

from koopcli.choices import import_files

import_files(__name__, __path__)
