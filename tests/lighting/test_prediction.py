"""Predicted errors: exact where light has a closed form, and in step with what is measured."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import spearmanr

from lighting.adaptive import prediction
from lighting.adaptive.cell_tree import grow_tree, tree_sums
from lighting.blocks.block_grid import block_grid
from lighting.blocks.summed_area import block_sums, summed_area_tables
from lighting.measures.error_measures import behind_occluders, errors, truth
from lighting.reduce import reduce_to_lights
from lighting.simulation.sequences import SEQUENCES, Sequence, Source, frames
from lighting.sphere import harmonics
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions
from tests.environments import constant, environment, outdoors


def test_probes_face_everywhere_and_see_what_they_face():
    normals, axes, across, kinds = prediction.probes(96)
    for vectors in (normals, axes, across):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose((axes * across).sum(axis=1), 0, atol=1e-12)
    np.testing.assert_allclose(normals.sum(axis=0), 0, atol=1e-9)
    assert len(np.unique(kinds, return_counts=True)[1]) == 3
    # What is hidden lies above the surface, or hiding it would change nothing.
    assert ((axes * normals).sum(axis=1) <= 0).all()


def test_a_point_is_seen_or_not():
    normals, axes, _, kinds = prediction.probes(96)
    toward = cell_directions(16).reshape(-1, 3)
    received = prediction.responses(toward, np.zeros(len(toward)), 96)
    caps = kinds < 2
    is_seen = toward @ axes[caps].T > kinds[caps]
    cosine = (toward @ normals[caps].T).clip(0)
    off_edge = np.abs(toward @ axes[caps].T - kinds[caps]) > 2e-3
    np.testing.assert_allclose(received[:, caps][off_edge], (is_seen * cosine)[off_edge], atol=2e-3)


def test_a_comb_lets_half_of_the_light_through():
    # Under an even sky, half of π for a comb; for a wall at the angle t between its axis and the
    # normal, π (1 + cos t)/2: closed forms of the projected solid angle.
    normals, axes, _, kinds = prediction.probes(96)
    grid = block_grid(64)
    received = prediction.map_responses(block_sums(constant(64).radiance), grid, 96)
    combs, walls = kinds == 2, kinds == 0
    np.testing.assert_allclose(received[combs, 0].mean(), np.pi / 2, rtol=0.01)
    expected = np.pi * (1 + (axes * normals).sum(axis=1)[walls]) / 2
    np.testing.assert_allclose(received[walls, 0], expected, atol=0.03)


@pytest.mark.parametrize("radius_deg", [0.5, 5.0, 30.0, 80.0])
def test_a_disc_in_the_open_gives_its_closed_form(radius_deg):
    # One that the surface faces gives (1 + cos a)/2 of its ∫L dω; all that there are, wherever they
    # are, ∫ max(cos, 0) dω = π, whatever their radius.
    radius = np.radians(radius_deg)
    whole = prediction._disc_irradiance(1.0, np.cos(radius), np.sin(radius))
    assert whole == pytest.approx((1 + np.cos(radius)) / 2, rel=1e-9)
    cosine = np.linspace(-1, 1, 20001)[1:-1]
    received = [
        prediction._disc_irradiance(c, np.cos(radius), np.sin(radius))
        for c in cosine
        if c > -np.sin(radius)
    ]
    assert 2 * np.pi * np.sum(received) * (cosine[1] - cosine[0]) == pytest.approx(np.pi, rel=1e-3)


def test_a_fill_gives_what_its_map_does():
    fill = np.zeros((9, 3))
    fill[0], fill[1:4] = 2.0, 0.4
    sky = environment(harmonics.evaluate(fill, cell_directions(64)))
    grid = block_grid(64)
    from_map = prediction.map_responses(block_sums(sky.radiance), grid, 96)
    np.testing.assert_allclose(prediction.fill_responses(fill, grid, 96), from_map, rtol=0.01)


def test_sources_are_where_they_are_not_where_their_coarse_block_is():
    sun = Sequence((Source(4.0, lambda _: np.array([0.3, 0.5, 0.6]), SUN_RADIUS_RAD),), sky=1e-6)
    timed = next(iter(frames(sun, 128, 1)))
    received = prediction.map_responses(block_sums(timed.environment.radiance), block_grid(128), 96)
    (disc,) = timed.sources
    expected = prediction.responses(disc.direction[None], np.array([0.012]), 96).T * disc.irradiance
    seen_clearly = (expected[:, :1] == 0) | (expected[:, :1] > 0.2 * expected.max())
    error = np.abs(received - expected)[seen_clearly[:, 0]]
    assert np.quantile(error, 0.9) < 0.01 * expected.max()


@pytest.fixture(scope="module")
def made():
    """A tree of 40 leaves over a map, what its lights are, and made-up light of a fill."""
    blocks = block_sums(outdoors(32).radiance)
    grid = block_grid(32)
    tree, _ = grow_tree(*summed_area_tables(blocks), 40)
    sums = tree_sums(blocks, tree)
    directions = sums[:, 1:4] / np.linalg.norm(sums[:, 1:4], axis=1, keepdims=True)
    random = np.random.default_rng(5)
    true = prediction.map_responses(blocks, grid, 96)
    return SimpleNamespace(
        tree=tree,
        irradiance=sums[:, 4:],
        received=prediction.responses(directions, np.full(len(sums), 0.1), 96),
        true=true,
        fill=0.01 * true * random.uniform(0, 1, true.shape),
        shortage=random.uniform(0, 0.1, sums[:, 4:].shape),
    )


def all_errors(made, scale=1.0):
    return prediction.errors_by_count(
        made.tree.first_part,
        made.irradiance,
        made.received,
        made.true,
        made.fill,
        made.shortage,
        scale,
    )


@pytest.mark.parametrize("count", [1, 2, 7, 39, 40])
def test_errors_of_all_counts_are_those_of_each_by_itself(made, count):
    leaves = made.tree.prefix(count).leaves()
    lights = made.received[leaves].T @ made.irradiance[leaves]
    given = lights + made.fill * (1 - made.shortage[leaves].sum(axis=0))
    plain = np.sqrt(np.mean((given - made.true) ** 2)) / 2.5
    assert all_errors(made, 2.5)[count - 1] == pytest.approx(plain, rel=1e-9)
    alone = prediction.error_of(
        made.irradiance[leaves],
        made.received[leaves],
        made.true,
        made.fill,
        made.shortage[leaves],
        2.5,
    )
    assert alone == pytest.approx(plain, rel=1e-9)


def test_there_is_an_error_for_each_count(made):
    assert len(all_errors(made)) == len(made.tree.leaves())


def test_predicted_errors_do_not_depend_on_the_scale_of_light():
    plain = reduce_to_lights(outdoors(32), 20).predicted_error
    brighter = reduce_to_lights(environment(outdoors(32).radiance * 1e4), 20).predicted_error
    assert brighter == pytest.approx(plain, rel=1e-4)


def test_predictions_follow_what_is_measured():
    predicted, measured = [], []
    for name in ("hard sun over the seam", "one lamp for another", "light switch", "passer-by"):
        view = next(iter(frames(SEQUENCES[name], 32, 1))).environment
        true = {k: v for k, v in truth(view).items() if k != "open"}
        for count in (3, 10, 30, 100):
            lights = reduce_to_lights(view, count)
            predicted.append(lights.predicted_error)
            measured.append(behind_occluders(errors(lights, true)))
    ratio = np.array(measured) / np.array(predicted)
    assert spearmanr(predicted, measured).statistic > 0.9
    assert 0.6 < np.median(ratio) < 1.4
    assert (ratio < 2.5).all()
    assert (ratio > 0.3).all()
