"""Shadow maps: layout, projection, and what is drawn when."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from render.opengl.shadows import ShadowAtlas, texel_width, tile_size, world_to_tile
from render.scenes.casters import gather_casters
from render.scenes.default_scene import sphere
from render.scenes.scene import Material
from tests.render.light_sets import random_lights

CENTRE = np.array([0.3, 1.0, -2.0])
RADIUS_M = 1.5


def first_maps(atlas, count):
    """Depth of the first `count` tiles of the lowest row, (tile, count × tile)."""
    depth = np.frombuffer(atlas.texture.read(alignment=1), np.float32)
    return depth.reshape(atlas.side_px, -1)[: atlas.tile_px, : count * atlas.tile_px].copy()


@pytest.mark.parametrize(
    ("count", "expected_px"), [(1, 512), (64, 512), (65, 256), (256, 256), (257, 128), (5000, 128)]
)
def test_tiles_shrink_as_lights_grow_in_number(count, expected_px):
    assert tile_size(count, 4096, 512) == expected_px


@settings(deadline=None, max_examples=60)
@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 1e-3),
    st.sampled_from([128, 512]),
)
def test_the_projection_is_a_similarity_that_leaves_the_border_free(direction, size_px):
    direction = np.array(direction) / np.linalg.norm(direction)
    rows = world_to_tile(direction[None], CENTRE, RADIUS_M, size_px)[0]
    # Orthogonal rows of one length: squares stay squares, whatever the direction.
    gram = rows[:, :3] @ rows[:, :3].T
    texels = size_px * texel_width(RADIUS_M, size_px)
    assert_allclose(gram, np.eye(3) / texels**2, atol=1e-12)
    # Toward the light is nearer.
    assert rows[2, :3] @ direction < 0
    assert_allclose(rows @ [*CENTRE, 1.0], 0.5, atol=1e-12)
    # Points of the sphere stay two texels away from the edge.
    rim = CENTRE + RADIUS_M * texels * rows[0, :3]
    assert_allclose(rows[0] @ [*rim, 1.0], 1 - 2 / size_px, atol=1e-9)


def test_frames_of_neighbouring_lights_are_close_over_the_upper_hemisphere():
    phi = np.linspace(0, 2 * np.pi, 2000)
    directions = np.stack([np.cos(phi), np.full_like(phi, 0.2), np.sin(phi)], axis=-1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = world_to_tile(directions, np.zeros(3), 1.0, 512)
    assert np.abs(np.diff(rows, axis=0)).max() < 0.01


@pytest.mark.gl
def test_the_map_of_a_sphere_holds_its_depth(ctx):
    casters = gather_casters([sphere(tuple(CENTRE), 1.0, Material(), rings=128)])
    atlas = ShadowAtlas(ctx, casters, 4096, 512)
    assert atlas.draw(np.array([[0.6, 0.8, 0.0]])) == 1
    depth = first_maps(atlas, 1)
    centres = (np.arange(atlas.tile_px) + 0.5) / atlas.tile_px - 0.5
    width_m = atlas.tile_px * texel_width(atlas.radius_m, atlas.tile_px)
    u, v = np.meshgrid(centres * width_m, centres * width_m)
    # Depth ½ is the centre's; a sphere of radius 1 rises √(1 − u² − v²) from there to the light.
    inside = np.hypot(u, v) < 0.97
    rise = np.sqrt(1 - u[inside] ** 2 - v[inside] ** 2)
    assert_allclose(depth[inside], 0.5 - rise / width_m, atol=2e-3)
    assert_array_equal(depth[np.hypot(u, v) > 1.01], 1)
    assert_array_equal(depth[[0, 1, -2, -1]], 1)
    atlas.release()


@pytest.mark.gl
def test_only_lights_that_moved_are_drawn_again(ctx):
    atlas = ShadowAtlas(ctx, gather_casters([sphere((0, 1, 0), 1.0, Material(), 8)]), 4096, 512)
    directions = random_lights(10, seed=0).directions.copy()
    assert atlas.draw(directions) == 10
    assert atlas.draw(directions) == 0
    directions[3] = [0.0, 1.0, 0.0]
    assert atlas.draw(directions) == 1
    assert atlas.draw(directions[:5]) == 0
    # 65 lights need smaller tiles: all maps are new.
    assert atlas.draw(random_lights(65, seed=1).directions) == 65
    atlas.release()


def turned(directions, texels, atlas):
    """Directions turned so that the rim of the casters' sphere is off by so many texels."""
    axis = np.cross(directions, [0.3, 0.2, 0.9])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = texels * texel_width(1.0, atlas.tile_px)
    return np.cos(angle) * directions + np.sin(angle) * np.cross(axis, directions)


@pytest.mark.gl
def test_a_map_holds_for_half_a_texel(ctx):
    atlas = ShadowAtlas(ctx, gather_casters([sphere((0, 1, 0), 1.0, Material(), 8)]), 1024, 128)
    directions = random_lights(3, seed=4).directions
    atlas.draw(directions)
    before = atlas.rows(3)
    assert atlas.draw(turned(directions, 0.49, atlas)) == 0
    assert_array_equal(atlas.rows(3), before)  # looked up in as it was drawn
    assert atlas.draw(turned(directions, 0.51, atlas)) == 3
    assert np.abs(atlas.rows(3) - before).max() > 1e-4
    atlas.release()


@pytest.mark.gl
def test_of_maps_that_turned_those_that_matter_are_drawn(ctx):
    atlas = ShadowAtlas(ctx, gather_casters([sphere((0, 1, 0), 1.0, Material(), 8)]), 1024, 128)
    directions = random_lights(4, seed=5).directions
    assert atlas.draw(directions, most=0) == 4  # not there yet
    texels = np.array([[8.0], [4.0], [2.0], [1.0]])
    wanted = turned(directions, texels, atlas)
    weights = np.array([1.0, 1.0, 5.0, 1.0])
    assert atlas.draw(wanted, weights, most=2) == 2
    assert_allclose(atlas.rows(4)[:, 2, :3], old_or_new(atlas, directions, wanted, [0, 2]))
    # What waits is drawn in its turn.
    assert atlas.draw(wanted, weights, most=2) == 2
    assert atlas.draw(wanted, weights, most=2) == 0
    atlas.release()


def old_or_new(atlas, old, new, drawn):
    """Rows of depth of maps of which only those in `drawn` are new."""
    shown = old.copy()
    shown[drawn] = new[drawn]
    return world_to_tile(shown, atlas.centre, atlas.radius_m, atlas.tile_px)[:, 2, :3]


@pytest.mark.gl
def test_leaving_out_faces_turned_away_changes_no_map(ctx):
    closed = sphere((0, 0, 0), 1.0, Material(), 16)
    doubled = np.concatenate([closed.faces, closed.faces[40:41]])
    opened = type(closed)(closed.positions, closed.normals, doubled)
    maps = []
    for mesh in (closed, opened):
        casters = gather_casters([mesh])
        atlas = ShadowAtlas(ctx, casters, 4096, 512)
        atlas.draw(random_lights(4, seed=2).directions)
        maps.append(first_maps(atlas, 4))
        atlas.release()
    assert len(gather_casters([opened]).closed_faces) == 0
    assert len(gather_casters([closed]).open_faces) == 0
    # On the silhouette a texel may take its depth from a face seen edge-on.
    different = np.abs(maps[0] - maps[1]) > 1e-5
    assert different.mean() < 1e-4
