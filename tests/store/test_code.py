"""The digest of koop's own sources."""

from __future__ import annotations

import koopcli
from koopcli.store.code import code_digest, digest_of

SOURCES = {"__init__.py": "a = 1\n", "store/code.py": "b = 2\n", "zoo.py": ""}


def tree(folder, sources):
    for name, text in sources.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_a_wheel_and_a_checkout_have_the_same_code(tmp_path):
    """A wheel holds data beside the package, has been compiled, and lies in another folder."""
    wheel = {
        **SOURCES,
        "data/vehicles/car.toml": "m = 1",
        "__pycache__/zoo.cpython-311.pyc": "…",
        "store/.#code.py": "x",
    }
    assert digest_of(tree(tmp_path / "src" / "koopcli", SOURCES)) == digest_of(tree(tmp_path / "site", wheel))


def test_every_change_of_the_sources_is_seen(tmp_path):
    changed = [
        SOURCES,
        {**SOURCES, "zoo.py": "\n"},
        {**SOURCES, "store/code.py": "b = 3\n"},
        {**SOURCES, "new.py": ""},
        {"__init__.py": "a = 1\n", "zoo.py": ""},
        {"__init__.py": "a = 1\n", "code.py": "b = 2\n", "zoo.py": ""},  # moved
        {"__init__.py": "b = 2\n", "store/code.py": "a = 1\n", "zoo.py": ""},  # exchanged
        {"__init__.py": "a = 1\nb = 2\n", "store/code.py": "", "zoo.py": ""},  # cut elsewhere
    ]
    found = {digest_of(tree(tmp_path / str(i), sources)) for i, sources in enumerate(changed)}
    assert len(found) == len(changed)


def test_the_code_is_that_of_the_whole_package():
    (package,) = koopcli.__path__
    assert code_digest() == digest_of(package)
