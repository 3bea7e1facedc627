"""Files of mrcal, read and written, and splines that are those of mrcal."""

import ast
from pathlib import Path

import numpy as np
import pytest

from calibration.camera import Calibration
from calibration.formats import FORMATS
from calibration.models.stereographic import Stereographic
from tests.calibration.format_texts import read_text


def test_a_file_that_mrcal_wrote_is_read(tmp_path: Path) -> None:
    text = (
        "# a note\n{\n    'lensmodel':  'LENSMODEL_STEREOGRAPHIC',\n\n"
        "    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n"
        "    'intrinsics': [ 300, 301, 320, 240,],\n\n    # extrinsics are rt_fromref\n"
        "    'extrinsics': [ 0, 0, 0, 0, 0, 0,],\n\n    'imagersize': [ 640, 480,],\n\n\n}\n"
    )
    name, read = read_text(tmp_path, text)
    assert (name, read.image_size_px) == ("mrcal", (640, 480))
    # What mrcal 2.2 itself projects the direction to, and with LONLAT in its place.
    ray = np.array([0.3, 0.2, -0.5])
    np.testing.assert_allclose(read.model.project(ray)[0], [1865.84193887, 1273.99649689])
    _, round_about = read_text(tmp_path, text.replace("STEREOGRAPHIC", "LONLAT"))
    np.testing.assert_allclose(round_about.model.project(ray)[0], [1100.351946, 339.45721702])


@pytest.mark.slow
def test_mrcals_splines_are_those_of_mrcal(tmp_path: Path) -> None:
    number = np.arange(2 * 11 * 8)
    corrections = np.round(0.03 * np.sin(1.7 * number) + 0.02 * np.cos(0.31 * number), 4)
    text = (
        "{'lensmodel': 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=11_Ny=8_fov_x_deg=190',\n"
        f"'intrinsics': {[300, 301, 320, 240, *corrections.tolist()]}, 'imagersize': [640, 480]}}"
    )
    name, read = read_text(tmp_path, text)
    assert name == "mrcal"
    rays = np.array([[0.3, 0.2, 0.5], [-0.6, 0.4, 0.1], [0.9, -0.1, -0.05], [0.0, 0.0, 1.0]])
    pixels, valid = read.model.project(rays)
    assert valid.all()
    # What mrcal 2.2 itself projects them to.
    expected = [
        [487.23306790913546, 355.98729600118827],
        [-118.63605752776232, 530.4706236311508],
        [950.9730193691139, 172.12177794687048],
        [320.6639583333333, 240.08120729166666],
    ]
    np.testing.assert_allclose(pixels, expected, rtol=1e-12)
    back, valid = read.model.unproject(pixels)
    assert valid.all()
    np.testing.assert_allclose(back, rays / np.linalg.norm(rays, axis=1)[:, None], atol=1e-12)
    # It ends at the outermost but one of the control values: 95° to the right, less downward.
    edge = np.radians([94.9, 95.1])
    to_the_right = np.stack([np.sin(edge), 0 * edge, np.cos(edge)], axis=-1)
    np.testing.assert_array_equal(read.model.project(to_the_right)[1], [True, False])
    down = to_the_right[:, [1, 0, 2]]
    assert not read.model.project(down)[1].any()
    written = Calibration(read.model, (640, 480), 1.2)
    _, again = read_text(tmp_path, FORMATS["mrcal"].write(written))
    np.testing.assert_array_equal(again.model.project(rays)[0], pixels)


def test_mrcal_is_told_where_the_lens_holds() -> None:
    camera = Calibration(Stereographic((200.5, 150.0), 120.0), (400, 300), 1.0)
    content = ast.literal_eval(FORMATS["mrcal"].write(camera))
    outline = np.array(content["valid_intrinsics_region"])
    np.testing.assert_array_equal(outline[0], outline[-1])
    # 2 f tan ½ is 131 px: all around, for the picture's edge is farther.
    radius_px = np.linalg.norm(outline - (200.5, 150.0), axis=1)
    np.testing.assert_allclose(radius_px, 240 * np.tan(0.5), atol=1.1)
