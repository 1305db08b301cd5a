from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as some

from koopcli.console import LEAST, Console, cut_widths, show_line, show_table

HEADER = ["artefact", "pinned as", "settings", "took"]
NAME = "fit-edmd/3f2a9c01d4e5"
ROWS = [[NAME, "a label", "order=7 " * 40, "1.2 s"], ["sample/0123456789ab", "", "seed=1", "3600.0 s"]]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch):
    """Make a terminal of so many columns."""

    def of(columns: int) -> Terminal:
        for name, value in {"COLUMNS": str(columns), "TERM": "xterm", "NO_COLOR": "1"}.items():
            monkeypatch.setenv(name, value)
        return Terminal()

    return of


def lines(file: io.StringIO) -> list[str]:
    return file.getvalue().replace("\x1b[1m", "").replace("\x1b[0m", "").splitlines()


@given(some.lists(some.integers(0, 200), min_size=1, max_size=8), some.integers(0, 300))
def test_the_widest_columns_are_cut_to_one_width_and_the_first_never(widths, room):
    cut = cut_widths(widths, room)
    assert cut[0] == widths[0]
    assert sum(cut) <= room or cut[1:] == [min(width, LEAST) for width in widths[1:]]
    lost = {after for before, after in zip(widths, cut, strict=True) if after < before}
    assert len(lost) <= 1
    assert all(after <= min(lost) for after in cut[1:] if lost)


@pytest.mark.parametrize("columns", [120, 80, 70])
def test_a_table_fits_the_terminal_with_its_names_in_one_piece(terminal, columns):
    screen = terminal(columns)
    show_table(HEADER, ROWS, title="a title", left=3, file=screen)
    shown = lines(screen)
    assert max(map(len, shown)) <= columns
    assert sum(NAME in line for line in shown) == 1
    assert "order=7 order=7" in screen.getvalue()
    assert "…" in screen.getvalue()
    assert "3600.0 s" in screen.getvalue()
    assert len(shown) == 8  # a title, a head, two rows and the lines between: none is folded


def test_a_terminal_that_is_too_narrow_still_has_the_names(terminal):
    screen = terminal(20)
    show_table(HEADER, ROWS, left=3, file=screen)
    assert sum(line.startswith(f" {NAME} ") for line in lines(screen)) == 1


def test_elsewhere_nothing_is_cut():
    file = io.StringIO()
    show_table(HEADER, [[NAME, "x" * 700, "order=7 " * 400, "1.2 s"]], file=file)
    (row,) = [line for line in lines(file) if NAME in line]
    assert row.split() == [NAME, "x" * 700, *["order=7"] * 400, "1.2", "s"]


def test_what_others_wrote_steers_no_terminal(terminal, capsys):
    steering = "a\x1b]0;owned\x07\x9b2J\u202eb"
    screen = terminal(80)
    show_table([steering], [[steering]], title=steering, file=screen)
    show_line(steering)
    console = Console()
    console.note(steering)
    console.warn(steering)
    captured = capsys.readouterr()
    for text in ("".join(lines(screen)), captured.out, captured.err):
        assert "�]0;owned��2J�b" in text
        assert text.replace("\n", "").isprintable()


def test_a_note_between_bars_is_the_text_itself(monkeypatch, terminal):
    """Neither markup nor names of pictures in it mean anything."""
    screen = terminal(80)
    monkeypatch.setattr("sys.stderr", screen)
    console = Console()
    with console.progress("work"):
        console.note("[red]:car:\x07")
    assert "[red]:car:�" in screen.getvalue()


def test_lines_of_a_cell_stand_below_one_another():
    file = io.StringIO()
    show_table(["claim", "here"], [["first\nsecond", "1 %\n\x1b[2J"], ["third", "3 %"]], lines=True, file=file)
    assert [line.split() for line in file.getvalue().splitlines()[-4:-1]] == [
        ["first", "1", "%"],
        ["second", "\ufffd[2J"],
        ["third", "3", "%"],
    ]
