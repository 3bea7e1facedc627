"""What every estimator keeps to: the truth in the mean, and a number for every map."""

import math
from functools import cache
from statistics import NormalDist

import numpy as np
import pytest

from capture.errors import InputError
from render.estimators.passes import estimate_picture
from render.estimators.registry import ESTIMATORS, PATHS, UNBIASED
from render.reference.surfaces import HIT, MATT
from render.scenes.scene import Camera, Ground, Scene
from tests.chi2 import sidak
from tests.render import estimator_scene

SAMPLES, COPIES = 16, 200
FIXED = ("lights-adaptive", "lights-kollig-keller")
BY_LIGHT = sorted(UNBIASED - {"cosine", "brdf", "resampling-brdf", "rejection-brdf"})


@pytest.fixture(scope="module")
def held():
    with estimator_scene.occluders() as held:
        yield held


def estimates(name, light, held, *, copies=COPIES, samples=SAMPLES, seed=0, surface=None):
    """Return as many estimates (copies, 3, 16) of a packet; independent, but for fixed lights."""
    surface = estimator_scene.packet() if surface is None else surface
    surfaces = np.repeat(surface, copies, axis=0)
    radiance = np.zeros((copies, 3, 16), np.float32)
    estimate = ESTIMATORS[name](estimator_scene.setting(light, held))
    rays = estimate(surfaces, samples, seed, radiance)
    assert rays >= 0
    if name in UNBIASED:
        assert rays <= (2 if name == PATHS else 1) * 16 * samples * copies
    return radiance.astype(float)


@cache
def truth():
    return estimator_scene.brute_force(estimator_scene.uneven_map(), estimator_scene.packet()[0])


@pytest.mark.parametrize("name", sorted(UNBIASED))
def test_the_mean_is_the_sum_over_the_sky(name, held):
    # What is rarely kept is far from normal in few copies.
    copies = 4 * COPIES if name.startswith("rejection") else COPIES
    drawn = estimates(name, estimator_scene.uneven_map(), held, copies=copies)
    mean, error = drawn.mean(axis=0), drawn.std(axis=0, ddof=1) / math.sqrt(copies)
    known = error > 0
    np.testing.assert_allclose(mean[~known], truth()[~known], rtol=1e-3, atol=1e-6)
    z = ((mean - truth())[known]) / error[known]
    limit = NormalDist().inv_cdf(1 - sidak(1e-4, z.size) / 2)
    assert np.abs(z).max() < limit
    # All surfaces together, each as what part of the truth it is.
    scale = np.where(truth() > 0, truth(), 1)
    whole = (drawn / scale).sum(axis=(1, 2))
    expected = (truth() > 0).sum()
    assert abs(whole.mean() - expected) < 4 * whole.std() / math.sqrt(copies) + 0.003 * expected


def test_one_or_two_directions_have_the_truth_as_their_mean(held):
    expected = (truth() > 0).sum()
    scale = np.where(truth() > 0, truth(), 1)
    # What is rarely kept is far from normal, and has its test above.
    for name in sorted(name for name in UNBIASED if not name.startswith("rejection")):
        for samples in (1, 2):
            drawn = estimates(
                name, estimator_scene.uneven_map(), held, copies=4 * COPIES, samples=samples
            )
            whole = (drawn / scale).sum(axis=(1, 2))
            limit = 4 * whole.std() / math.sqrt(len(whole)) + 0.003 * expected
            assert abs(whole.mean() - expected) < limit, (name, samples)


@pytest.mark.parametrize("name", ["mis-balance", "mis-power", "mis-compensated"])
def test_one_direction_of_either_kind_spreads_little_more_than_the_better_kind(name, held):
    radiance = estimator_scene.uneven_map().radiance.copy()
    radiance[2, 11] = 1e4  # a sun: directions drawn by what surfaces reflect miss it
    light = estimator_scene.environment(radiance)
    # Each kind draws half: E[(f/p)²] is at most twice that of either one alone.
    mean_squares = [
        (estimates(each, light, held, copies=8 * COPIES, samples=1) ** 2).mean(axis=0)
        for each in (name, "inverse-cdf")
    ]
    lit = mean_squares[1] > 0
    assert (mean_squares[0][lit] < 2.5 * mean_squares[1][lit]).all()


@pytest.mark.parametrize("name", FIXED)
def test_many_fixed_lights_come_near_the_sum_over_the_sky(name, held):
    light = estimator_scene.uneven_map(rows=16)
    known = estimator_scene.brute_force(light, estimator_scene.packet()[0], per_side=8)
    drawn = estimates(name, light, held, copies=1, samples=256)[0]
    matt = np.arange(16) % 3 == 0
    off = np.sqrt(np.mean((drawn - known)[:, matt] ** 2) / np.mean(known[:, matt] ** 2))
    assert off < 0.05


@pytest.mark.parametrize("name", [*sorted(UNBIASED), *FIXED, "irradiance-cache"])
def test_a_black_map_gives_black(name, held):
    assert not estimates(
        name, estimator_scene.environment(np.zeros((4, 8, 3))), held, copies=2
    ).any()


@pytest.mark.parametrize("name", [*sorted(UNBIASED), *FIXED, "irradiance-cache"])
def test_a_map_of_one_pixel_gives_numbers(name, held):
    radiance = np.zeros((32, 64, 3))
    radiance[5, 20] = 1e4
    drawn = estimates(name, estimator_scene.environment(radiance), held, copies=40)
    assert np.isfinite(drawn).all()
    assert (drawn >= 0).all()
    if name in BY_LIGHT:
        known = estimator_scene.brute_force(
            estimator_scene.environment(radiance), estimator_scene.packet()[0], per_side=4
        )
        matt = (np.arange(16) % 3 == 0) & (known[0] > 0)
        if not name.startswith("rejection"):  # which keeps one in hundreds
            np.testing.assert_allclose(drawn.mean(axis=0)[:, matt], known[:, matt], rtol=0.1)


@pytest.mark.parametrize("name", sorted(UNBIASED))
def test_a_furnace_stays_white(name, held):
    surface = estimator_scene.packet()
    surface[0, MATT : MATT + 3] = 1 / np.pi
    surface[0, MATT + 3 : HIT] = 0  # nothing mirrors
    surface[0, HIT - 1] = 1  # α² of nothing
    surface[0, 1] -= 100  # far below the box
    light = estimator_scene.environment(np.ones((8, 16, 3)))
    drawn = estimates(name, light, held, copies=100, surface=surface)[..., :15]
    # The box hides 1e-4 of the sky.
    error = drawn.std() / math.sqrt(drawn[:, 0].size)
    assert drawn.mean() == pytest.approx(1, abs=4 * error + 1e-3)


@pytest.mark.parametrize("name", sorted(UNBIASED))
def test_a_seed_tells_estimates_apart(name, held):
    light = estimator_scene.uneven_map()
    first, again, other = (estimates(name, light, held, copies=3, seed=seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert (first[0] != first[1]).any()
    assert not first[:, :, 15].any()  # no hit


@pytest.mark.slow
def test_a_picture_of_a_plane_under_an_even_map():
    scene = Scene((), Ground(0.0, (0.5, 0.25, 0.75)))
    camera = Camera(np.array([2.0, 2.0, 0.0]), np.zeros(3), 1e-3, (6, 5))
    light = estimator_scene.environment(np.full((8, 16, 3), (1, 2, 3)))
    picture = estimate_picture("cosine", scene, camera, light, error=1)
    # E = π L on a plane that sees half of everything; L_o = ρ E / π.
    np.testing.assert_allclose(picture.radiance, np.tile([0.5, 0.5, 2.25, 1], (5, 6, 1)), rtol=1e-5)
    assert picture.shadow_rays == 0


def test_an_unknown_estimator_is_refused():
    scene = Scene((), Ground(0.0))
    camera = Camera(np.ones(3), np.zeros(3))
    with pytest.raises(InputError, match="no estimator is called 'best'; there are: cosine, brdf"):
        estimate_picture("best", scene, camera, estimator_scene.uneven_map())
