"""Where the rates of growth of eigenfunctions come from (docs/equations.md 7). A new way is one file in this folder."""

from __future__ import annotations

from koopcli.choices import import_files

import_files(__name__, __path__)
