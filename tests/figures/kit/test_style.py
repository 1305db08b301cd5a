from __future__ import annotations

from koopcli.figures.kit.style import plain


def test_a_text_of_others_is_drawn_as_it_stands():
    """An svg file may hold no control character, and matplotlib takes dollars for mathematics."""
    assert plain("5 $ and 6 $") == r"5 \$ and 6 \$"
    assert plain("\x1b[2Ja") == "�[2Ja"
    assert not plain("_hidden").startswith("_")
