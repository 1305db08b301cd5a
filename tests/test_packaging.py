"""What an index of packages is told: the metadata that the build backend makes of this checkout."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[1]
ADDRESS = "https://example.org/koop"


def metadata(folder: Path, address: str) -> dict:
    (folder / "koopcli").mkdir()
    for name in ("README.md", "LICENSE", "hatch_build.py", "koopcli/__init__.py"):
        shutil.copy(TOP / name, folder / name)
    settings = (TOP / "pyproject.toml").read_text()
    assert settings.count('\naddress = ""') == 1
    (folder / "pyproject.toml").write_text(settings.replace('\naddress = ""', f'\naddress = "{address}"'))
    command = [sys.executable, "-m", "hatchling", "metadata"]
    return json.loads(subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout)


def targets(text: str) -> list[str]:
    return re.findall(r"\]\(([^)]+)\)", text)


@pytest.mark.parametrize("address", ["", ADDRESS, f"{ADDRESS}/"])
def test_links_of_the_readme_lead_to_the_project_s_address_once_it_has_one(tmp_path, address):
    written = (TOP / "README.md").read_text(encoding="utf-8")
    assert all((TOP / target.partition("#")[0]).exists() for target in targets(written))
    built = metadata(tmp_path, address)
    if not address:
        assert built["readme"]["text"] == written
        assert "urls" not in built
        return
    folders = ["raw" if target.endswith(".png") else "blob" for target in targets(written)]  # a picture as it is
    expected = [f"{ADDRESS}/{folder}/HEAD/{target}" for folder, target in zip(folders, targets(written), strict=True)]
    assert targets(built["readme"]["text"]) == expected
    assert built["urls"]["Homepage"] == ADDRESS
