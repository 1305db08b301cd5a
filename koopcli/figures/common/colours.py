"""The colours and marks of all figures; no drawing library is needed to know them."""

from __future__ import annotations

# Okabe and Ito's palette: distinct to every common form of colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
DASHES = ("-", "--", ":")
PAPER = "#000000"
TRAINING = "#bbbbbb"
GUIDE = "#888888"  # what is not data: axes through zero, the unit circle, restarts
OTHERS = ("#555555", "#999999")  # lines that another one is set beside
BAND = "#b9d7ea"  # what most of the data lie in
SHADES = "viridis_r"  # even in lightness, dark where errors are large
