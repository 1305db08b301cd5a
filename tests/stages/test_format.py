"""The format of what is stored: named axes, units, plain attributes, nothing that no checksum guards."""

from __future__ import annotations

import io
import re
from collections import defaultdict
from pathlib import PurePosixPath

import h5py
import numpy as np
import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.figures.kit import style
from koopcli.records import CHANNELS, OF_STATES, Array, Packed
from koopcli.stages import recipes
from koopcli.stages.labels import labels
from koopcli.stages.registry import STAGES
from koopcli.store import image
from koopcli.store.identity import data_digest
from tests.stages.toys import made


@pytest.fixture(scope="module", params=STAGES)
def packed_toys(request):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "render", lambda figure, image, line: b"image")
        return [packed for packed, _ in made(request.param).values()]


def test_an_axis_name_has_one_length_within_a_group(packed_toys):
    """In the file as others read it, where the facts are an array too."""
    for packed in packed_toys:
        lengths = defaultdict(set)

        def note(path, item, lengths=lengths):
            if isinstance(item, h5py.Dataset):
                axes = item.attrs["axes"].decode().split(", ")
                assert len(set(axes)) == len(axes)
                for axis, length in zip(axes, item.shape, strict=True):
                    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", axis)
                    lengths[PurePosixPath(path).parent, axis].add(length)

        with h5py.File(io.BytesIO(image.to_bytes(packed))) as file:
            file.visititems(note)
        assert {key: seen for key, seen in lengths.items() if len(seen) > 1} == {}


def test_units_are_one_or_one_for_each_channel(packed_toys):
    for packed in packed_toys:
        for path, array in packed.arrays.items():
            units = array.units.split(", ")
            assert all(unit and unit != OF_STATES for unit in units), path
            channels = [n for axis, n in zip(array.axes, array.values.shape, strict=True) if axis in CHANNELS]
            assert len(units) == 1 or channels == [len(units)], path


def test_no_text_of_variable_length_is_in_any_object(packed_toys):
    told = {"dt": 0.01, "plant": "forces", "vehicle": "Škoda"}
    for packed in packed_toys:
        content = image.to_bytes(packed, told)
        assert b"GCOL" not in content
        with h5py.File(io.BytesIO(content)) as file:
            assert file.attrs["vehicle"].decode() == "Škoda"
            assert file.attrs["dt"] == 0.01
        assert image.from_bytes(content) == image.loaded(packed)


def test_labels_are_in_the_file_and_in_no_digest():
    packed = Packed({"x": Array(np.arange(3.0), ("row",), "m")}, {"a": 1})
    plain, labelled = image.to_bytes(packed), image.to_bytes(packed, {"plant": "forces"})
    assert plain != labelled
    assert data_digest(image.from_bytes(labelled)) == data_digest(packed)


def test_labels_say_what_was_simulated():
    experiment = load_experiment("paper", {})
    told = labels(recipes.evaluation(experiment), Packed({}))
    assert (told["dt"], told["plant"]) == (0.01, "forces")
    assert "CTU 2020" in told["vehicle"]
    assert set(labels(recipes.sample(experiment.sample("grid")), Packed({}))) == {"koop"}
    slips = recipes.fit_eigen(experiment)
    lighter = load_experiment("paper", parse_set(["vehicle.m=900"]))
    test = recipes.test_set(lighter, recipes.fit_eigen(lighter).ancestor("simulate").settings)
    told = labels(recipes.evaluation(experiment, slips, test), Packed({}))
    assert (told["plant"], "vehicle" in told) == ("slips", False)  # two vehicles are behind it
