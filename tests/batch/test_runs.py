"""Names of results: the same for the same, another for whatever makes a difference."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from capture.errors import InputError
from lighting.stream.light_stream import LightPlan
from render.batch.runs import Settings, next_link, open_job, run_at
from tests.batch.turning_sky import record

SETTINGS = Settings(("remap", "lights"), LightPlan(6), 16)


@pytest.fixture(scope="module")
def sky(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("sky") / "sky", 3)


def names(recording: Path, settings: Settings = SETTINGS, calibration: Path | None = None):
    """Return the digests of each frame's radiance, map and lights."""
    job, brackets = open_job(recording, recording.parent / "out", settings, calibration)
    images = run_at(job, brackets, 0).image_digests
    link, lights = job.first_link, []
    for image in images:
        link = next_link(link, image)
        lights.append(link)
    return list(images), [job.map_digest(image) for image in images], lights


def changed(recording: Path, folder: Path, change) -> Path:
    shutil.copytree(recording, folder / recording.name)
    path = folder / recording.name / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))
    return folder / recording.name


def differences(one: list[str], other: list[str]) -> list[int]:
    return [index for index, pair in enumerate(zip(one, other, strict=True)) if len(set(pair)) > 1]


def test_a_copy_elsewhere_has_the_same_names(sky, tmp_path):
    assert names(changed(sky, tmp_path, lambda _: None)) == names(sky)


def test_another_exposure_changes_its_frame_and_the_lights_that_follow(sky, tmp_path):
    def change(manifest) -> None:
        manifest["frames"][2]["time_s"] *= 2  # the first of bracket 1

    images, maps, lights = zip(names(sky), names(changed(sky, tmp_path, change)), strict=True)
    assert differences(*images) == [1]
    assert differences(*maps) == [1]
    assert differences(*lights) == [1, 2]


def test_another_sensor_changes_all(sky, tmp_path):
    def change(manifest) -> None:
        manifest["sensor"]["read_noise_e"] += 1

    for one, other in zip(names(sky), names(changed(sky, tmp_path, change)), strict=True):
        assert differences(one, other) == [0, 1, 2]


def test_another_calibration_changes_maps_and_lights(sky, tmp_path):
    calibration = tmp_path / "cal.json"
    text = (sky / "calibration.json").read_text()
    calibration.write_text(text + " ")
    images, maps, lights = zip(names(sky), names(sky, calibration=calibration), strict=True)
    assert not differences(*images)
    assert differences(*maps) == differences(*lights) == [0, 1, 2]


@pytest.mark.parametrize(
    ("settings", "maps_differ", "lights_differ"),
    [
        (replace(SETTINGS, plan=LightPlan(7)), False, True),
        (replace(SETTINGS, plan=LightPlan(6, is_steady=False)), False, True),
        (replace(SETTINGS, map_height=32), True, False),
    ],
    ids=["count", "steady", "height"],
)
def test_settings_change_what_depends_on_them(sky, settings, maps_differ, lights_differ):
    images, maps, lights = zip(names(sky), names(sky, settings), strict=True)
    assert not differences(*images)
    assert bool(differences(*maps)) == maps_differ
    assert bool(differences(*lights)) == lights_differ


def test_lights_that_are_found_in_maps_depend_on_their_height(sky):
    plan = LightPlan(6, "inverse-cdf")
    low, high = (names(sky, replace(SETTINGS, plan=plan, map_height=n))[2] for n in (16, 32))
    assert differences(low, high) == [0, 1, 2]


def test_what_travels_holds_no_more_than_one_bracket(sky):
    job, brackets = open_job(sky, sky.parent / "out", SETTINGS)
    assert (len(brackets), len(job.recording), job.recording.manifest.frames) == (3, 1, ())


def test_settings_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="stages are some of merge, remap, lights, preview"):
        Settings(("merge", "bake"))
    with pytest.raises(InputError, match="no time budget"):
        Settings(plan=LightPlan(error=0.05, budget_ms=10.0))


def test_without_a_calibration_frames_can_only_be_merged(sky, tmp_path):
    bare = changed(sky, tmp_path, lambda manifest: manifest.update(calibration=None))
    with pytest.raises(InputError, match="names no calibration; give one with --calibration"):
        open_job(bare, tmp_path, SETTINGS)
    job, _ = open_job(bare, tmp_path, Settings(("merge",)))
    assert job.calibration_path is None
