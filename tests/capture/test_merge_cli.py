"""`fishlight merge` of brackets that moved, and with a response from a file."""

import msgspec
import numpy as np
import pytest

from capture.errors import InputError
from capture.manifest import sensor_record
from capture.merge import merge_bracket
from capture.pictures import write_png
from capture.radiance_files import read_radiance
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor_files import SCHEMA
from tests.capture.command_line import run
from tests.capture.simulated_bracket import LINEAR_16_BIT, SRGB_8_BIT
from tests.capture.test_alignment import MOTIONS, hand_held, scene
from tests.capture.test_fine_counts import ESTIMATED
from tests.capture.test_ghosts import disc, moving

STILL = [MOTIONS[0]] * 3


def recorded(folder, bracket, sensor):
    with create_recording(folder, "a camera", sensor) as writer:
        for frame in bracket.frames:
            writer.write_frame(frame.counts, frame.exposure, 0.0, 0)
    return folder


def test_a_still_bracket_is_what_the_merge_makes_of_it(tmp_path, capsys):
    bracket = hand_held(scene(), STILL, SRGB_8_BIT)
    run("merge", recorded(tmp_path / "r", bracket, SRGB_8_BIT), "-o", tmp_path / "a.exr")
    told = capsys.readouterr()
    assert "ghosts 0.000%" in told.out
    assert "moved" not in told.err
    image, _ = read_radiance(tmp_path / "a.exr")
    expected = merge_bracket(bracket, SRGB_8_BIT)
    assert image.radiance.tobytes() == expected.radiance.tobytes()
    assert image.variance.tobytes() == expected.variance.tobytes()


def test_a_hand_held_bracket_is_laid_straight_unless_told_not_to(tmp_path, capsys):
    bracket = hand_held(scene(), MOTIONS, LINEAR_16_BIT)
    recorded(tmp_path / "r", bracket, LINEAR_16_BIT)
    run("merge", tmp_path / "r", "-o", tmp_path / "a.exr")
    assert "had moved, by up to" in (told := capsys.readouterr().err)
    assert "2 of 3" in told
    run("merge", tmp_path / "r", "-o", tmp_path / "b.exr", "--no-align", "--no-ghosts")
    told = capsys.readouterr()
    assert "moved" not in told.err
    assert "ghosts" not in told.out
    image, _ = read_radiance(tmp_path / "b.exr")
    assert image.radiance.tobytes() == merge_bracket(bracket, LINEAR_16_BIT).radiance.tobytes()


def test_doubt_about_a_motion_is_told(tmp_path, capsys):
    flat = np.full_like(scene(), 0.05)
    bracket = hand_held(flat, STILL, LINEAR_16_BIT)
    run("merge", recorded(tmp_path / "r", bracket, LINEAR_16_BIT), "-o", tmp_path / "a.exr")
    assert "too little to tell" in (told := capsys.readouterr().err)
    assert "does: 1, 2" in told


def test_what_moved_is_taken_from_one_exposure(tmp_path, capsys):
    bracket, truth = moving(LINEAR_16_BIT, 0.03)
    run("merge", recorded(tmp_path / "r", bracket, LINEAR_16_BIT), "-o", tmp_path / "a.exr")
    share = float(capsys.readouterr().out.rsplit("ghosts ", 1)[1].rstrip("%\n")) / 100
    assert truth.mean() < share < 2 * truth.mean()
    image, _ = read_radiance(tmp_path / "a.exr")
    plain = merge_bracket(bracket, LINEAR_16_BIT)
    changed = (image.radiance != plain.radiance).any(axis=-1)
    assert changed[disc((160, 70), 10)].any()
    assert changed.mean() == pytest.approx(share, abs=1e-5)


@pytest.fixture
def response(tmp_path):
    path = tmp_path / "response.json"
    path.write_bytes(msgspec.json.encode({"schema": SCHEMA, "sensor": sensor_record(ESTIMATED)}))
    return path


def test_a_response_takes_the_place_of_the_assumed_one(tmp_path, response, capsys):
    bracket = hand_held(scene(), STILL, ESTIMATED)
    recorded(tmp_path / "r", bracket, SRGB_8_BIT)
    run("merge", tmp_path / "r", "-o", tmp_path / "a.exr", "--response", response)
    assert "sensor: estimated" in capsys.readouterr().err
    expected = merge_bracket(bracket, ESTIMATED).radiance
    np.testing.assert_array_equal(read_radiance(tmp_path / "a.exr")[0].radiance, expected)

    paths = [tmp_path / f"{k}.png" for k in range(3)]
    for path, frame in zip(paths, bracket.frames, strict=True):
        write_png(path, frame.counts)
    times = ("--exposures", ",".join(str(frame.exposure.time_s) for frame in bracket.frames))
    run("merge", *paths, "-o", tmp_path / "b.exr", "--response", response, *times)
    np.testing.assert_array_equal(read_radiance(tmp_path / "b.exr")[0].radiance, expected)
    run("import", *paths, "-o", tmp_path / "imported", "--response", response, *times)
    assert open_recording(tmp_path / "imported").sensor.source == "estimated"


def test_a_response_of_radiance_is_refused(tmp_path, response):
    bracket = hand_held(scene(), STILL, SRGB_8_BIT)
    run("merge", recorded(tmp_path / "r", bracket, SRGB_8_BIT), "-o", tmp_path / "a.exr")
    run("import", tmp_path / "a.exr", "-o", tmp_path / "imported")
    for source in (tmp_path / "a.exr", tmp_path / "imported"):
        with pytest.raises(InputError, match=f"{source} holds radiance, .*: no --response"):
            run("merge", source, "-o", tmp_path / "b.exr", "--response", response)


def test_a_recording_is_merged_alone(tmp_path):
    recording = recorded(tmp_path / "r", hand_held(scene(), STILL, SRGB_8_BIT), SRGB_8_BIT)
    for sources in ((recording, tmp_path / "a.jpg"), (tmp_path / "a.jpg", recording)):
        with pytest.raises(InputError, match="r is a recording; it is merged alone"):
            run("merge", *sources, "-o", tmp_path / "a.exr")


def test_a_response_of_other_counts_is_refused(tmp_path, response):
    bracket = hand_held(scene(), STILL, LINEAR_16_BIT)
    recorded(tmp_path / "r", bracket, LINEAR_16_BIT)
    with pytest.raises(InputError, match=r"16-bit counts, but their sensor \(estimated\)"):
        run("merge", tmp_path / "r", "-o", tmp_path / "a.exr", "--response", response)
    assert not (tmp_path / "a.exr").exists()
