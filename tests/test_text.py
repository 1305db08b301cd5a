from __future__ import annotations

import pytest

from koopcli.text import one_line, printable, read_text


def test_nothing_steers_a_terminal():
    assert printable("m/s²\x1b[2J\u202e\n\x9b\ud800") == "m/s²�[2J����"
    assert one_line("two\nlines\x1b[31m") == "two lines�[31m"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_utf_8_with_a_mark_and_without(tmp_path, encoding):
    (tmp_path / "x").write_text("grün", encoding=encoding)
    assert read_text(tmp_path / "x") == "grün"


@pytest.mark.parametrize(
    ("encoding", "told"),
    [
        ("utf-16", "it is UTF-16: save it as UTF-8"),
        ("utf-16-be", "it is UTF-16: save it as UTF-8"),
        ("utf-32", "it is UTF-32: save it as UTF-8"),
        ("latin-1", "line 2 is not UTF-8: save the file as UTF-8"),
    ],
)
def test_another_encoding_is_named(tmp_path, encoding, told):
    mark = "\ufeff" if encoding.endswith("be") else ""
    (tmp_path / "x").write_bytes(f"{mark}a\ngrün".encode(encoding))
    with pytest.raises(ValueError, match=told):
        read_text(tmp_path / "x")
