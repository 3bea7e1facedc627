"""What the chart of renderers measures, remembers and sums up."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.measures.known import code_digest
from render.measures import chart, growth, truths
from render.measures import ways as measured_ways
from render.measures.chart_scenes import chart_maps, chart_scenes, map_digest, view_digest
from render.measures.picture_errors import Truth, away_from_outlines, mean_flip, relative_rmse
from render.measures.ways import MAIN_WAYS, RAYS, SHADOW_MAPS, TRANSPORT, turned, ways
from render.opengl.context import GlUnavailable
from render.scenes.casters import gather_casters
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Scene
from tests.environments import constant, outdoors
from tests.render import brute_force
from tests.render.boxes import box
from tests.render.chart_cases import BALL, CAMERA, EVEN, EXACT, MATT, SCENE, Painter, case, measured
from tests.render.light_sets import random_lights


def test_the_scenes_are_three_and_closed():
    scenes = chart_scenes((), (32, 24))
    assert list(scenes) == ["objects", "slats", "heap"]
    for scene, _ in scenes.values():
        assert len(gather_casters(scene.meshes).open_faces) == 0
    slats = scenes["slats"][0].meshes[0]
    corners = slats.positions[slats.faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.sum(facing * slats.normals[slats.faces[:, 0]], axis=1) > 0)


def test_the_maps_are_five_and_lit():
    maps = chart_maps(())
    assert list(maps) == ["indoor", "outdoor", "low sun", "overcast", "lamp"]
    assert all(found.radiance.any() for found in maps.values())
    assert len({map_digest(found) for found in maps.values()}) == 5


def test_a_digest_tells_views_apart_by_what_is_in_them():
    same = Scene((sphere(BALL.centre, BALL.radius_m, MATT, 24),), Ground(0.0, (0.5,) * 3, 20))
    assert view_digest(same, replace(CAMERA)) == view_digest(SCENE, CAMERA)
    [mesh] = SCENE.meshes
    texture = np.zeros((2, 2, 3), np.uint8)
    others = [
        (SCENE, replace(CAMERA, eye=CAMERA.eye + 1e-9)),
        (SCENE, replace(CAMERA, size_px=(24, 32))),
        (replace(SCENE, ground=None), CAMERA),
        (replace(SCENE, meshes=(replace(mesh, positions=mesh.positions + 1),)), CAMERA),
        (replace(SCENE, meshes=(replace(mesh, material=replace(MATT, roughness=0.9)),)), CAMERA),
        (
            replace(
                SCENE,
                meshes=(replace(mesh, material=replace(MATT, base_colour_texture=texture)),),
            ),
            CAMERA,
        ),
    ]
    digests = {view_digest(scene, camera) for scene, camera in [*others, (SCENE, CAMERA)]}
    assert len(digests) == len(others) + 1


def test_outlines_are_where_a_pixel_shows_more_than_one_thing():
    camera = replace(CAMERA, size_px=(64, 48))
    ours = away_from_outlines(SCENE, camera)
    theirs = brute_force.away_from_outlines(BALL, camera)
    # The ray caster's test looks at what is hit only, not at how it turns along the rim.
    assert np.all(theirs[1:-1, 1:-1] >= ours[1:-1, 1:-1])
    assert ours.sum() > 0.85 * theirs.sum()
    empty = brute_force.trace(BALL, camera, random_lights(1, 0))[..., 3] == 0
    assert not ours[empty].any()


def test_a_step_between_level_faces_is_an_outline():
    low, high = box((-1, 0, -1), (0, 0.2, 1)), box((0, 0, -1), (1, 0.6, 1))
    above = Camera(np.array([0.0, 9.0, 0.01]), np.zeros(3), 0.1, (16, 16))
    inside = away_from_outlines(Scene((low, high), None), above)
    assert not inside[:, 7:9].any()
    assert inside[1:-1, 1:7].all()
    assert inside[1:-1, 9:-1].all()


def test_relative_rmse_is_without_outlines_and_the_truths_own_error():
    rng = np.random.default_rng(0)
    true = rng.uniform(0.5, 1.5, (24, 32, 3)).astype(np.float32)
    compared = np.zeros((24, 32), bool)
    compared[4:20, 4:28] = True
    picture = np.where(compared[..., None], 1.1 * true, 7.0)
    assert relative_rmse(picture, Truth(true, EXACT, compared)) == pytest.approx(0.1, rel=1e-5)
    power = np.mean(true[compared] ** 2)
    error = np.full((24, 32, 3), 0.06 * np.sqrt(power), np.float32)
    error[:4] = 9.0  # where nothing is compared
    noisy = Truth(true, error, compared)
    assert relative_rmse(picture, noisy) == pytest.approx(0.08, rel=1e-4)
    assert relative_rmse(true, noisy) == 0


def test_flip_sees_nothing_of_outlines():
    compared = np.ones((24, 32), bool)
    compared[:, 16] = False
    truth = Truth(EVEN.radiance, EXACT, compared)
    picture = EVEN.radiance.copy()
    picture[:, 16] = 50.0
    assert mean_flip(picture, truth) == 0
    picture[:, 0] = 0.5
    assert mean_flip(picture, truth) > 0


def test_the_least_flip_is_that_of_the_truths_own_noise():
    assert EVEN.least_flip == 0
    rng = np.random.default_rng(3)
    noisy = Truth(EVEN.radiance, EXACT + np.float32(0.02), EVEN.is_compared)
    picture = EVEN.radiance + np.float32(0.02) * rng.standard_normal((24, 32, 1), np.float32)
    assert noisy.least_flip == pytest.approx(mean_flip(picture, noisy), rel=0.2)


def test_a_truth_is_traced_once(tmp_path, monkeypatch):
    traced = []

    def trace(scene, camera, light, **limits):
        traced.append(light)
        shape = (24, 32, 4)
        error = np.full((24, 32, 3), 0.1, np.float32)
        return SimpleNamespace(radiance=np.ones(shape, np.float32), standard_error=error)

    monkeypatch.setattr(truths, "render_reference", trace)
    first, again = (
        truths.truth_of(SCENE, CAMERA, light, tmp_path / "kept") for light in (constant(8),) * 2
    )
    assert len(traced) == 1
    assert_array_equal(first.radiance, again.radiance)
    assert first.variance == again.variance == pytest.approx(0.01)
    truths.truth_of(SCENE, CAMERA, outdoors(8), tmp_path / "kept")
    assert len(traced) == 2
    whole = next((tmp_path / "kept").iterdir()).read_bytes()
    for damaged in (b"no archive", b"", whole[:-9]):
        for path in (tmp_path / "kept").iterdir():
            path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"npz: not a kept reference picture .* remove it"):
            truths.truth_of(SCENE, CAMERA, outdoors(8), tmp_path / "kept")


def test_a_truth_is_traced_anew_when_any_code_that_it_depends_on_changed():
    reference, *others = truths._CODE
    sources = "".join(path.read_text() for path in reference.glob("*.py"))
    imported = set(re.findall(r"^from render\.(\w+)", sources, re.MULTILINE))
    assert imported <= {folder.name for folder in truths._CODE}
    assert all(folder.is_dir() for folder in others)


def test_lights_turn_about_the_vertical():
    lights = random_lights(5, seed=1)
    assert_array_equal(turned(lights, 0).directions, lights.directions)
    after = turned(lights, 3).directions
    assert_array_equal(after[:, 1], lights.directions[:, 1])
    across = np.arctan2(lights.directions[:, 0], lights.directions[:, 2])
    turn = np.degrees(np.arctan2(after[:, 0], after[:, 2]) - across)
    np.testing.assert_allclose((turn + 180) % 360 - 180, 1.5, atol=1e-9)


@pytest.mark.gl
@pytest.mark.slow
def test_every_way_draws_the_same_scene():
    lights = random_lights(4, seed=3)
    lights = LightSet(lights.directions, lights.irradiance, np.full(4, 0.01))
    inside = away_from_outlines(SCENE, CAMERA)
    true = brute_force.trace(BALL, CAMERA, brute_force.as_points(lights, 64))[inside, :3]
    with ways() as found:
        assert set(MAIN_WAYS) < set(found)
        for name, way in found.items():
            with way(SCENE, CAMERA) as draw:
                still, moved = (draw(lights, constant(8), frame)[inside, :3] for frame in (0, 4))
            rmse = np.sqrt(np.mean((still - true) ** 2) / np.mean(true**2))
            assert rmse < 0.1, name
            assert np.abs(moved - still).max() > 0.01, name


def test_without_opengl_the_other_ways_are_left(monkeypatch):
    def refuse():
        raise GlUnavailable("no EGL")

    monkeypatch.setattr(measured_ways, "create_context", refuse)
    with ways() as found:
        assert set(MAIN_WAYS) - set(found) == {SHADOW_MAPS}


def test_a_way_is_opened_once_and_each_count_drawn_and_timed():
    painter = Painter(1.25)
    rows = list(chart.measure([case()], {"paint": painter}, {"paint": [4, 8]}, {}))
    assert (painter.opened, painter.closed) == (1, 1)
    lights = {row.lights for row in rows}
    assert {(count, frame) for count in lights for frame in range(4)} == set(painter.frames)
    assert [row.rmse for row in rows] == pytest.approx([0.25, 0.25])
    assert all(0 < row.flip < 1 and row.ms > 0 and row.setup_ms > 0 for row in rows)


def test_what_is_known_is_not_measured_again():
    painter, known = Painter(), {}
    first = list(chart.measure([case()], {"paint": painter}, {"paint": [4]}, known))
    renamed = replace(case(), scene_name="another", map_name="name")
    [again] = chart.measure([renamed], {"paint": painter}, {"paint": [4]}, known)
    assert painter.opened == 1
    assert (again.scene, again.map_name, again.ms) == ("another", "name", first[0].ms)
    for other in (case(environment_map=constant(8)), case(scene=replace(SCENE, ground=None))):
        opened = painter.opened
        list(chart.measure([other], {"paint": painter}, {"paint": [4]}, known))
        assert painter.opened == opened + 1


def test_shaders_are_code_that_results_depend_on(monkeypatch):
    read = set()
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path.name) or b"")
    code_digest.__wrapped__(Path(chart.__file__).parents[1])
    assert {"chart.py", "shade.frag", "depth.vert", "lights.glsl"} <= read


def test_a_way_that_is_too_slow_is_spared_more_lights(monkeypatch):
    clock = iter(range(0, 1000, 3))
    monkeypatch.setattr(chart, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    rows = list(chart.measure([case()], {"slow": Painter()}, {"slow": [4, 8]}, {}))
    assert rows[0].ms == 3000
    assert rows[1] is None


def test_points_are_medians_over_cases_and_the_worst_of_them():
    rows = [measured(RAYS, ms=ms, rmse=ms / 10) for ms in (1.0, 2.0, 9.0)]
    rows += [measured(RAYS, count=8), measured(TRANSPORT, ms=4.0)]
    rows += [measured(TRANSPORT), measured(TRANSPORT)]
    ours, theirs = chart.points_of(rows)
    assert (ours.system, ours.count, ours.ms) == (RAYS, 4, 2.0)
    assert ours.errors == {chart.RMSE: 0.2, chart.FLIP: 0.05, chart.WORST: 0.9, chart.MS: 2.0}
    assert (theirs.system, theirs.ms) == (TRANSPORT, 1.0)


def test_settings_are_compared_with_what_they_are_settings_of():
    among_settings = {chart.SETTINGS_RMSE: 0.1, chart.SETTINGS_FLIP: 0.05}
    for count, settings in ((4, {}), (64, among_settings)):
        ways_of = (RAYS, TRANSPORT, "maps, 1×1")
        ours, settled, setting = chart.points_of(measured(way, count) for way in ways_of)
        assert chart.RMSE in ours.errors
        assert {chart.SETTINGS_RMSE, chart.SETTINGS_FLIP}.isdisjoint(settled.errors)
        assert settings.items() <= ours.errors.items()
        assert setting.errors == settings


def test_growth_is_by_triangles_and_by_pixels(monkeypatch):
    monkeypatch.setattr(growth, "COUNTS", {growth.TRIANGLES: (64, 1024), growth.PIXELS: (64, 300)})
    painter, known = Painter(), {}
    found = list(growth.measure(constant(8), {"paint": painter}, known))
    assert [(row.of, row.count) for row in found] == [
        (of, count) for of, counts in growth.COUNTS.items() for count in counts
    ]
    assert painter.opened == 4
    for of, view in growth.VIEWS.items():
        for count in growth.COUNTS[of]:
            scene, camera = view(count)
            triangles = sum(len(mesh.faces) for mesh in scene.meshes)
            pixels = camera.size_px[0] * camera.size_px[1]
            drawn = triangles if of == growth.TRIANGLES else pixels
            assert drawn == pytest.approx(count, rel=0.03)
    assert list(growth.measure(constant(8), {"paint": painter}, known)) == found
    assert painter.opened == 4
    assert growth.points_of(found)[0].errors == {growth.TRIANGLES: found[0].ms}
