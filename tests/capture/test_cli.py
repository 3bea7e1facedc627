"""The commands import, inspect and merge, as a shell calls them."""

import numpy as np
import pytest

from capture.arguments import parse_exposures
from capture.errors import InputError
from capture.pictures import read_picture
from capture.radiance_files import read_radiance
from capture.recording import open_recording
from tests.capture.command_line import run
from tests.capture.photo_files import scene_picture, write_photograph

TIMES_S = (0.4, 0.1, 0.025)


@pytest.fixture
def photos(tmp_path):
    folder = tmp_path / "photos"
    folder.mkdir()
    for index, time_s in enumerate(TIMES_S * 2):
        write_photograph(folder / f"{index}.jpg", time_s)
    return folder


def test_import_inspect_merge(tmp_path, photos, capsys):
    run("import", photos, "-o", tmp_path / "r", "--licence", "CC0", "--source", "a test")
    assert "brackets 2, frames 6, 48×32 px" in capsys.readouterr().out
    run("inspect", tmp_path / "r", "--thumbnails", tmp_path / "sheet.png")
    lines = capsys.readouterr().out.splitlines()
    assert "licence: CC0" in lines
    assert "source: a test" in lines
    assert read_picture(tmp_path / "sheet.png").shape[2] == 3
    run("merge", tmp_path / "r", "-o", tmp_path / "r.exr", "--bracket", 1)
    assert "from 3 exposures" in capsys.readouterr().out
    run("merge", *sorted(photos.iterdir()), "-o", tmp_path / "p.exr")
    from_recording, from_photos = (
        read_radiance(tmp_path / name)[0].radiance for name in ("r.exr", "p.exr")
    )
    # Both brackets show the same scene, and both ways lead through the same door.
    assert np.array_equal(from_recording, from_photos)
    # The scene's red: L = ramp, and Exposure.signal = t / f² with f = 8.
    middle = from_photos[10:20, :, 0] / 64
    ramp = np.geomspace(0.01, 100.0, 48 * 32).reshape(32, 48)[10:20]
    error_ev = np.abs(np.log2(middle / ramp))
    assert np.median(error_ev) < 0.03  # 8 bits and JPEG
    assert error_ev.max() < 0.25


def test_exposures_replace_exif(tmp_path, photos, capsys):
    paths = sorted(photos.iterdir())[:3]
    run("merge", *paths, "-o", tmp_path / "a.exr")
    run("merge", *paths, "-o", tmp_path / "b.exr", "--exposures", "4, 1, 1/4")
    first, second = (read_radiance(tmp_path / f"{name}.exr")[0].radiance for name in "ab")
    # Ten times the time and no f/8: 640 times less radiance.
    np.testing.assert_allclose(first, 640 * second, rtol=1e-5)


@pytest.mark.parametrize(
    ("tokens", "told"),
    [
        (("import", "-o", "out"), "nothing to import"),
        (("merge", "-o", "out.exr"), "nothing to merge"),
        (("import", "gone", "-o", "out"), "gone: no such file"),
        (("import", "gone", "-o", "no/where/out"), "is not a folder"),
        (("import", "photos", "-o", "out", "--exposures", "0.1,x,1"), "'x' is no time"),
        (("import", "photos", "-o", "out", "--exposures", "0.1,nan,1"), "--exposures.*nan"),
        (("import", "photos", "-o", "out", "--exposures", "1,2,3,4"), "brackets of 4"),
        (("import", "photos", "-o", "out", "--calibration", "gone.json"), "gone.json"),
        (("merge", "photos", "-o", "out.exr", "--bracket", "7"), "no bracket 7"),
        (("merge", "gone", "-o", "out.txt"), "out.txt"),
        (("merge", "gone", "-o", "no/where/out.exr"), "is not a folder"),
        (("merge", "photos", "-o", "out.exr", "--exposures", "1e-40,1,2"), "--exposures.*1e-40"),
        (("inspect", "photos"), "manifest.json"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_nothing(tmp_path, photos, monkeypatch, tokens, told):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=told) as caught:
        run(*tokens)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


def test_a_recording_is_merged_by_its_own_exposures(tmp_path, photos):
    run("import", photos, "-o", tmp_path / "r")
    for tokens, told in (
        (("--exposures", "1,2,3"), "import it again"),
        (("--bracket", "2"), "no bracket 2"),
    ):
        with pytest.raises(InputError, match=told):
            run("merge", tmp_path / "r", "-o", tmp_path / "a.exr", *tokens)


def test_outputs_are_replaced_only_by_force(tmp_path, photos):
    (tmp_path / "a.exr").write_text("older")
    (tmp_path / "sheet.png").write_text("older")
    run("import", photos, "-o", tmp_path / "r")
    commands = (
        ("import", photos, "-o", tmp_path / "r"),
        ("merge", photos, "-o", tmp_path / "a.exr"),
        ("inspect", tmp_path / "r", "--thumbnails", tmp_path / "sheet.png"),
    )
    for tokens in commands:
        with pytest.raises(InputError, match="--force"):
            run(*tokens)
    assert (tmp_path / "a.exr").read_text() == (tmp_path / "sheet.png").read_text() == "older"
    for tokens in commands:
        run(*tokens, "--force")
    assert len(open_recording(tmp_path / "r")) == 2


def test_an_existing_output_is_refused_before_the_merge(tmp_path, photos, monkeypatch):
    (tmp_path / "a.exr").write_text("older")
    monkeypatch.setattr("capture.merge_cli.merge_bracket", None)  # calling it would be an error
    with pytest.raises(InputError, match="--force"):
        run("merge", photos, "-o", tmp_path / "a.exr")


def test_inspect_shows_the_rest_and_then_fails_on_a_damaged_frame(tmp_path, photos, capsys):
    run("import", photos, "-o", tmp_path / "r")
    (tmp_path / "r" / "frames" / "000001.jpg").unlink()
    with pytest.raises(InputError, match=r"1 of 2 brackets: .*000001\.jpg"):
        run("inspect", tmp_path / "r")
    assert "frames: 6; brackets that cannot be read: 1" in capsys.readouterr().out


def test_a_sheet_is_a_png(tmp_path, photos):
    run("import", photos, "-o", tmp_path / "r")
    with pytest.raises(InputError, match=r"sheet\.jpg: wanted a file named \.png"):
        run("inspect", tmp_path / "r", "--thumbnails", tmp_path / "sheet.jpg")


def test_doubts_about_exposures_are_told_on_stderr(tmp_path, photos, capsys):
    paths = sorted(photos.iterdir())[:3]
    run("import", *paths, "-o", tmp_path / "r", "--exposures", "0.4,0.1,0.0125")
    assert "EV" in capsys.readouterr().err


def test_exposure_lists():
    assert parse_exposures("0.001, 1/4,2e1") == (0.001, 0.25, 20.0)


def test_scene_pictures_are_what_the_tests_take_them_for():
    # Red of the first pixel: L = 0.01, t = 1 s: 0.01 linear is 25.5 of 255 in sRGB.
    assert scene_picture(1.0)[0, 0, 0] == 25
