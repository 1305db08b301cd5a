"""The metadata of a built package that depend on where the project lives: the links of its README, and its URLs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"(!?)(\[[^\]]*\]\()(?![a-z]+:|#)")  # the beginning of a link that leads into the repository


class ProjectMetadata(MetadataHookInterface):
    """Adds what ``pyproject.toml`` declares dynamic, from ``address`` in the hook's own table there."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the README, and the URLs where there is an address."""
        address = self.config["address"].rstrip("/")
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(text, address)}
        metadata["urls"] = urls(address)


def absolute(text: str, address: str) -> str:
    """The Markdown ``text`` with links into the repository at ``address``; without one, as it is."""
    if not address:
        return text
    return RELATIVE.sub(lambda link: f"{link[1]}{link[2]}{address}/{'raw' if link[1] else 'blob'}/HEAD/", text)


def urls(address: str) -> dict[str, str]:
    """What an index of packages shows beside the README."""
    if not address:
        return {}
    return {"Homepage": address, "Changelog": f"{address}/blob/HEAD/CHANGELOG.md", "Issues": f"{address}/issues"}
