"""A drawn figure as an address inside the page, in few bytes."""

from __future__ import annotations

import base64
import io
from urllib.parse import quote

from koopcli.figures.kit.figure import Drawing

IN_A_URI = " /:;=,()'-+.*!~@$?[]{}|^_"  # of SVG: what needs no escape inside an attribute
COLOURS, COMPRESSION = 256, 6  # of a shrunk PNG; more compression takes three times as long for a twelfth


def address(drawing: Drawing) -> str:
    """The image itself as an address: SVG as it is, PNG in the colours that the eye tells apart in it."""
    if drawing.format == "svg":
        drawn = " ".join(drawing.image.decode().split("\n"))
        return f"data:image/svg+xml,{quote(drawn[drawn.index('<svg') :], safe=IN_A_URI)}"
    return f"data:image/png;base64,{base64.b64encode(shrunk(drawing.image)).decode()}"


def shrunk(png: bytes) -> bytes:
    """A PNG with a palette of ``COLOURS``, if that is smaller."""
    from PIL import Image  # noqa: PLC0415  (as matplotlib: only when there is something to show)

    target = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        few = image.convert("RGB").quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(target, "PNG", compress_level=COMPRESSION)
    return min(png, target.getvalue(), key=len)
