"""Rendered pictures as files."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from capture.errors import InputError
from capture.exr import read_exr
from capture.pictures import read_picture
from render.output.pictures import write_picture
from render.output.view import to_display

PICTURE = np.random.default_rng(0).gamma(1.0, 10.0, (5, 7, 4)).astype(np.float32)


def test_an_exr_holds_the_radiance_as_it_is(tmp_path):
    write_picture(tmp_path / "p.exr", PICTURE, exposure_ev=3.0)
    channels = read_exr(tmp_path / "p.exr").channels
    assert_array_equal(np.stack([channels[name] for name in "RGBA"], axis=-1), PICTURE)


def test_a_png_holds_the_view(tmp_path):
    write_picture(tmp_path / "p.png", PICTURE, exposure_ev=-4.0)
    assert_array_equal(read_picture(tmp_path / "p.png"), to_display(PICTURE, -4.0))


def test_other_suffixes_and_existing_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.png or \.exr"):
        write_picture(tmp_path / "p.jpg", PICTURE, 0.0)
    write_picture(tmp_path / "p.png", PICTURE, 0.0)
    with pytest.raises(InputError, match="--force"):
        write_picture(tmp_path / "p.png", PICTURE, 0.0, force=False)
