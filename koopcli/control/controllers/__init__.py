"""The controllers. A new one is one file in this folder: a frozen class with its settings, which makes it of a car."""

from __future__ import annotations

from koopcli.choices import import_files
from koopcli.control.controllers.controller import ControllerChoice

import_files(__name__, __path__)

CONTROLLERS = ControllerChoice.kinds()
