"""What holds for every figure: a new file in the folder is covered at once."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import fields, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from koopcli.config.pictures import ImageFormat, Plot
from koopcli.config.shipped import called
from koopcli.errors import InvalidValueError
from koopcli.figures import module_of
from koopcli.figures.kit import style
from koopcli.figures.kit.figure import TAKES, Drawing, drawing, sources_of
from koopcli.figures.kit.registry import FIGURES
from koopcli.figures.kit.style import COLOURS
from koopcli.stages.fits import FITS, LIFTED
from koopcli.stages.naming import AXES
from koopcli.stages.registry import STAGES
from tests.stages.toys import figure_records, figure_settings

SKETCHES = ("single-track",)  # drawn without axes
EVALUATED = [name for name, kind in FIGURES.items() if kind.takes == "evaluation"]


@cache
def drawn(name):
    module = module_of(name)
    settings = figure_settings(name)
    shown = module.select(sources_of(settings, figure_records(name)), settings)
    return module.draw(shown), module.numbers(shown)


@cache
def laid_out(name):
    """The figure, drawn once: before that, panels that share an axis do not know their labels; twice moves labels."""
    figure, _ = drawn.__wrapped__(name)
    canvas = FigureCanvasAgg(figure)
    with style.style():
        canvas.draw()
    return figure, canvas.get_renderer()


@cache
def pictured(name, image):
    before = dict(mpl.rcParams)
    made = drawing(replace(figure_settings(name), format=image), figure_records(name), "9.8.7").image
    assert dict(mpl.rcParams) == before, "nothing is left behind"
    return made


@pytest.mark.parametrize("name", FIGURES)
def test_it_declares_what_there_is(name):
    kind = FIGURES[name]
    assert not kind.about.endswith(".")
    assert set(kind.stages) <= set(STAGES)
    assert set(kind.behind) <= {"predictor", "trajectories", "training"}
    assert kind.against in AXES
    assert set(kind.told) <= {field.name for field in fields(Plot)}
    assert not (kind.usual and kind.only)
    assert bool(kind.usual or kind.only) == (kind.takes in ("evaluation", "predictor", "fit", "sweep"))
    assert f"| `{name}` |" in (Path(__file__).parents[2] / "docs" / "figures.md").read_text()


def test_figures_are_listed_without_matplotlib():
    code = (
        "import sys; from koopcli.__main__ import main; main(['plot', '--list']); "
        "print(sorted({'matplotlib', 'mpl_toolkits', 'scipy', 'h5py'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(FIGURES) <= set(done.stdout.split())
    assert done.stdout.endswith("[]\n")


def test_what_a_figure_takes_is_what_stages_make():
    assert (TAKES["predictor"], TAKES["fit"]) == (tuple(FITS), LIFTED)


@pytest.mark.parametrize(
    ("name", "image"),
    [
        *(("tyre", image) for image in ImageFormat.__args__),
        *(pytest.param(name, "svg", marks=pytest.mark.slow) for name in FIGURES if name != "tyre"),
    ],
)
def test_the_same_records_give_the_same_bytes(name, image):
    """Text tells most: every number and every name that a figure makes up stands in an svg."""
    assert pictured(name, image) == pictured.__wrapped__(name, image)


@pytest.mark.parametrize(("name", "image"), [(name, "svg") for name in FIGURES] + [("tyre", "png"), ("tyre", "pdf")])
def test_it_has_no_date_and_leaves_nothing_behind(name, image):
    one = pictured(name, image)
    assert re.search(rb"20[2-9]\d-\d\d-\d\d", one) is None  # no date inside
    start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[image]
    assert one.startswith(start)


@pytest.mark.parametrize("name", FIGURES)
def test_it_fits_one_column_and_every_axis_has_its_unit(name):
    figure, _ = laid_out(name)
    width, height = figure.get_size_inches()
    assert width == style.COLUMN
    assert height <= 1.8 * width
    if name in SKETCHES:
        return
    axes = [one for one in figure.axes if one.get_visible()]
    along = [axis for one in axes for axis in (one.xaxis, one.yaxis, getattr(one, "zaxis", one.xaxis))]
    numbered = [axis for axis in along if any(tick.get_text() for tick in axis.get_ticklabels())]
    written = [axis.get_label_text() for axis in numbered if axis.get_label_text()]
    assert written
    assert [label for label in written if not re.search(r"\(.+\)$|order of the polynomial basis$", label)] == []
    assert figure.get_suptitle() == ""


@pytest.mark.parametrize("name", FIGURES)
def test_no_label_is_cut_off_or_lies_over_another(name):
    figure, renderer = laid_out(name)
    boxes = {text.get_text(): text.get_window_extent(renderer) for text in _labels(figure)}
    assert boxes
    for text, box in boxes.items():
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
        assert inside, f"{text!r} leaves the figure"
        over = [other for other, there in boxes.items() if other != text and box.overlaps(there)]
        assert not over, f"{text!r} lies over {over}"


def _labels(figure):
    """Axis labels, the names of panels and rows, legends, and the words of a sketch."""
    for axes in figure.axes:
        yield from axes.texts
        if axes.axison or hasattr(axes, "zaxis"):
            named = [axes.xaxis.label, axes.yaxis.label, axes.title]
            named += [axes.zaxis.label] if hasattr(axes, "zaxis") else []
            yield from (label for label in named if label.get_text())
    for legend in figure.legends:
        yield from legend.get_texts()
        if legend.get_title().get_text():
            yield legend.get_title()


@pytest.mark.parametrize("name", FIGURES)
def test_a_line_says_what_it_is_of_below_all_that_is_drawn(name):
    """Vehicle, predictor and version, in a strip that is added for them, so that nothing can lie over the line."""
    picture = ElementTree.fromstring(pictured(name, "svg"))
    own = called(figure_settings(name).of.vehicles[0])
    assert re.fullmatch(r"own vehicle [0-9a-f]{4}", own)
    (line,) = [one for one in picture.iter() if (one.text or "") == f"{own} · EDMD, order 1 · koop 9.8.7"]
    whole = float(picture.get("viewBox").split()[3])
    assert whole - 72 * (style.LINE + 2 * style.GAP) < float(line.get("y")) < whole
    others = [float(one.get("y")) for one in picture.iter() if one is not line and one.get("y") and one.text]
    assert max(others, default=0.0) < whole - 72 * (style.LINE + style.GAP)


@pytest.mark.parametrize("name", FIGURES)
def test_its_numbers_are_columns_that_survive_the_store(name):
    _, numbers = drawn(name)
    assert numbers
    for array in numbers.values():
        assert array.values.ndim == len(array.axes) == 1
        assert array.values.dtype == float
        assert array.units
    made = Drawing(name, "png", numbers, b"image")
    back = Drawing.unpack(made.pack())
    assert back.image == b"image"
    assert back.table() == made.table()
    header, rows = made.table()
    assert len(rows) == max(len(array.values) for array in numbers.values())
    assert all(len(row) == len(header) for row in rows)


@pytest.mark.parametrize("name", EVALUATED)
def test_an_evaluation_without_any_error_is_refused(name):
    def lost(record):
        if not hasattr(record, "diverged"):
            return record
        return replace(record, diverged=np.ones(len(record.rmse), dtype=bool))

    records = {role: lost(record) for role, record in figure_records(name).items()}
    with pytest.raises(InvalidValueError, match="diverged: there is no error to draw"):
        drawing(figure_settings(name), records)


@pytest.mark.parametrize("name", EVALUATED)
def test_single_lost_trajectories_are_left_out(name):
    """A diverged prediction has errors beyond all numbers, which no axis may follow."""

    def one_lost(record):
        if not hasattr(record, "diverged"):
            return record
        rmse = np.where(record.diverged, np.inf, record.rmse)
        return replace(record, rmse=rmse)

    records = {role: one_lost(record) for role, record in figure_records(name).items()}
    module, settings = module_of(name), figure_settings(name)
    numbers = module.numbers(module.select(sources_of(settings, records), settings))
    assert all(np.isfinite(array.values).all() for array in numbers.values())


BESIDE = [name for name, kind in FIGURES.items() if kind.draws == "beside" and kind.takes == "evaluation"]


@pytest.mark.parametrize("name", BESIDE)
def test_one_lost_among_several_is_named_and_costs_the_others_nothing(name):
    records = figure_records(name)
    whole = records["1/evaluation"]
    lost = {**records, "0/evaluation": replace(whole, diverged=np.ones(len(whole.rmse), dtype=bool))}
    settings = figure_settings(name)
    module = module_of(name)
    (first, second), (_, alone) = (module.select(sources_of(settings, inputs), settings) for inputs in (lost, records))
    for field in vars(alone).keys() - {"edges", "share"}:  # bins are those of all that is drawn
        assert np.array_equal(getattr(second, field), getattr(alone, field)), field
    figure = module.draw([first, second])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    said = [text.get_text() for text in _labels(figure)] + [t.get_text() for t in figure.axes[0].get_yticklabels()]
    assert sum("all diverged" in text.replace("\n", " ") for text in said) == 1


def test_a_users_own_style_changes_nothing():
    settings, records = figure_settings("tyre"), figure_records("tyre")
    plain = drawing(settings, records).image
    with mpl.rc_context({"axes.facecolor": "black", "lines.linewidth": 9, "savefig.bbox": "tight", "font.size": 20}):
        assert drawing(settings, records).image == plain


def test_a_changed_drawing_has_another_key(monkeypatch):
    """Pictures are not compared, so the code that draws them, and what it takes numbers from, is in their recipe."""
    from koopcli import figures

    everything = {path for name in FIGURES for path in figures.drawing_code(name)}
    names = {f"{path.parent.name}/{path.name}" for path in everything}
    assert names >= {
        "figures/orders.py",
        "kit/style.py",
        "config/paper.py",
        "simulation/sampling.py",
        "vehicles/tyre.py",
    }
    assert all(path.is_file() for path in everything)
    digest, read = figures.source_digest.__wrapped__, Path.read_bytes
    before = {name: digest(name) for name in FIGURES}
    assert len(set(before.values())) == len(FIGURES)
    for changed in everything:
        monkeypatch.setattr(Path, "read_bytes", lambda path, changed=changed: read(path) + b"#" * (path == changed))
        moved = {name for name in FIGURES if digest(name) != before[name]}
        assert moved == {name for name in FIGURES if changed in figures.drawing_code(name)}
        if changed.parent.name == "figures":  # that of a figure, and of those that take from it
            assert changed.stem.replace("_", "-") in moved
            assert len(moved) < 5


def test_many_lines_are_all_different():
    found = style.looks(18)
    assert len({tuple(look.values()) for look in found}) == 18


def test_colours_are_told_apart_in_print():
    """The first two, which most figures use alone, differ in lightness, so that they do in black and white too."""
    linear = [
        [(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) for c in mpl.colors.to_rgb(colour)]
        for colour in COLOURS[:2]
    ]
    one, other = (116 * (np.array([0.2126, 0.7152, 0.0722]) @ c) ** (1 / 3) - 16 for c in linear)
    assert abs(one - other) > 8  # of CIE L*, where 2 is just seen


def test_short_columns_end_in_empty_cells():
    numbers = {
        "a": SimpleNamespace(values=np.arange(2.0), units="m"),
        "b": SimpleNamespace(values=np.ones(1), units="s"),
    }
    assert Drawing("x", "png", numbers, b"").table() == (["a (m)", "b (s)"], [[0.0, 1.0], [1.0, ""]])


def test_a_png_is_as_wide_as_a_column_in_print():
    from matplotlib.image import imread

    image = imread(BytesIO(drawing(figure_settings("tyre"), {}).image))
    assert image.shape[1] == round(style.COLUMN * 300)
