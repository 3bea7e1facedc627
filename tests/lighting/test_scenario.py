"""What a simulated camera stands in: sun, cloud, lamp, and the map as it turns."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.simulation.scenario import Disc, Moment, scenario, split_sun
from lighting.sphere.latlong import cell_directions, direction_to_grid, solid_angles

HEIGHT = 64


def environment(radiance: np.ndarray) -> EnvironmentMap:
    seen = np.ones(radiance.shape[:2], np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def sunny_map(direction: np.ndarray, peak: float = 5000.0) -> EnvironmentMap:
    radiance = 0.5 + np.random.default_rng(2).random((HEIGHT, 2 * HEIGHT, 3))
    column, row = np.rint(direction_to_grid(direction, HEIGHT)).astype(int)
    radiance[row, column % (2 * HEIGHT)] = peak * np.array([1.0, 0.9, 0.7])
    return environment(radiance)


SUN = np.array([-0.4, 0.7, 0.59]) / np.linalg.norm([-0.4, 0.7, 0.59])


def test_the_points_of_a_disc_stand_for_equal_parts_of_it() -> None:
    disc = Disc("lamp", SUN, 0.3, np.ones(3))
    points = disc.points(20_000)
    cosine = points @ SUN
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, atol=1e-12)
    assert cosine.min() >= np.cos(0.3)
    # Equal solid angles are equal steps of the cosine, and no side is preferred.
    shares, _ = np.histogram(cosine, bins=20, range=(np.cos(0.3), 1.0))
    np.testing.assert_allclose(shares, 1000, atol=1)
    # The mean of a uniform cap lies on its axis at (1 + cos ρ) / 2.
    np.testing.assert_allclose(points.mean(axis=0), SUN * (1 + np.cos(0.3)) / 2, atol=1e-4)


def test_a_disc_gives_the_irradiance_of_its_radiance() -> None:
    disc = Disc("sun", SUN, 0.004651, np.array([6.0, 5.0, 4.0]))
    assert disc.solid_angle_sr == pytest.approx(np.pi * 0.004651**2, rel=1e-5)
    np.testing.assert_allclose(disc.radiance * disc.solid_angle_sr, disc.irradiance)


def test_splitting_the_sun_off_moves_light_and_loses_none() -> None:
    whole = sunny_map(SUN)
    rest, sun = split_sun(whole)
    np.testing.assert_allclose(rest.integral() + sun.irradiance, whole.integral(), rtol=1e-6)
    assert rest.radiance.max() < 2.0
    cell = np.pi / HEIGHT
    assert np.arccos(sun.direction @ SUN) < cell  # the cell's centre, not SUN, is the truth


def test_a_map_without_sun_has_none_to_split_off() -> None:
    with pytest.raises(InputError, match="sun"):
        split_sun(environment(np.ones((HEIGHT, 2 * HEIGHT, 3))))
    with pytest.raises(InputError, match="sun"):
        split_sun(environment(np.zeros((HEIGHT, 2 * HEIGHT, 3))))


def test_the_cloud_takes_the_sun_and_gives_it_back() -> None:
    moments = scenario([sunny_map(SUN)], bracket_count=25, rate_hz=2.0, cloud=True)
    sun = np.array([luminance(moment.discs[0].irradiance) for moment in moments])
    assert sun[0] == sun[-1] == sun.max()
    assert sun[12] == pytest.approx(0.02 * sun[0])
    assert np.all(np.diff(sun[:13]) <= 0)
    assert np.all(np.diff(sun[12:]) >= 0)
    assert np.abs(np.diff(sun)).max() < 0.4 * sun[0]  # smooth: no bracket loses it at once
    assert moments[0].brightness == 1.0
    assert moments[12].brightness == pytest.approx(1.1)


def test_the_lamp_moves_on_a_great_circle_from_plus_x_to_minus_x() -> None:
    moments = scenario([sunny_map(SUN)], bracket_count=24, rate_hz=1.0, lamp=True)
    path = np.array([moment.discs[0].direction for moment in moments])
    np.testing.assert_allclose(np.linalg.norm(path, axis=1), 1.0)
    normal = np.cross(path[0], path[-1])
    np.testing.assert_allclose(path @ normal, 0.0, atol=1e-12)
    assert path[0, 0] > 0 > path[-1, 0]
    assert path[:, 1].min() > 0
    steps = np.arccos(np.sum(path[1:] * path[:-1], axis=1))
    np.testing.assert_allclose(steps, steps[0])


def test_timestamps_follow_the_rate_and_yaw_follows_the_time() -> None:
    moments = scenario(
        [sunny_map(SUN)], bracket_count=5, rate_hz=4.0, yaw_rad_per_s=0.2, cloud=True
    )
    assert [moment.timestamp_s for moment in moments] == [0, 0.25, 0.5, 0.75, 1]
    assert moments[-1].yaw_rad == pytest.approx(0.2)
    first, last = moments[0].discs[0].direction, moments[-1].discs[0].direction
    longitude = np.arctan2([first[0], last[0]], [first[2], last[2]])
    assert longitude[1] - longitude[0] == pytest.approx(0.2)
    assert first[1] == last[1]


def test_after_many_turns_the_yaw_is_still_a_turn() -> None:
    moments = scenario([sunny_map(SUN)], bracket_count=3, rate_hz=1e-12, yaw_rad_per_s=-3.0)
    assert all(-2 * np.pi < moment.yaw_rad <= 0 for moment in moments)
    assert np.sin(moments[2].yaw_rad) == pytest.approx(np.sin(-6e12), abs=1e-3)


def test_one_map_for_each_bracket() -> None:
    maps = [environment(np.full((4, 8, 3), value)) for value in (1.0, 2.0, 3.0)]
    moments = scenario(maps, bracket_count=3, rate_hz=1.0)
    assert [moment.environment for moment in moments] == maps


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bracket_count": 0}, "bracket"),
        ({"rate_hz": 0.0}, "rate"),
        ({"rate_hz": np.nan}, "rate"),
        ({"rate_hz": 1e-320}, "leave time"),
        ({"yaw_rad_per_s": np.inf}, "yaw"),
        ({"rate_hz": 1e-200, "yaw_rad_per_s": 1e200}, "and turn finite"),
        ({"bracket_count": 5}, "2 maps for 5 brackets"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused(changes, told) -> None:
    wanted = {"bracket_count": 2, "rate_hz": 1.0, **changes}
    with pytest.raises(InputError, match=told):
        scenario([sunny_map(SUN)] * 2, **wanted)


@settings(max_examples=20, deadline=None)
@given(yaw_rad=st.floats(-7.0, 7.0), brightness=st.floats(0.5, 2.0))
def test_the_true_map_holds_all_the_light(yaw_rad: float, brightness: float) -> None:
    whole = sunny_map(SUN)
    disc = Disc("lamp", np.array([0.0, 1.0, 0.0]), 0.1, np.array([3.0, 2.0, 1.0]))
    moment = Moment(0.0, whole, brightness, yaw_rad, (disc,))
    expected = brightness * whole.integral() + disc.irradiance
    np.testing.assert_allclose(moment.true_map().integral(), expected, rtol=1e-5)


def test_the_true_map_turns_from_plus_z_toward_plus_x() -> None:
    radiance = np.zeros((HEIGHT, 2 * HEIGHT, 3))
    radiance[HEIGHT // 2, HEIGHT] = 1.0  # the cell right of +Z
    moment = Moment(0.0, environment(radiance))
    for cells in (0.0, 3.0, 7.25):
        turned = replace(moment, yaw_rad=cells * np.pi / HEIGHT).true_map()
        weights = luminance(turned.radiance) * solid_angles(HEIGHT)[:, None]
        mean = np.tensordot(weights, cell_directions(HEIGHT), axes=2)
        longitude = np.arctan2(mean[0], mean[2])
        assert longitude == pytest.approx((cells - 0.5) * np.pi / HEIGHT, abs=1e-4)


def test_the_marks_of_the_true_map_turn_with_it() -> None:
    world = environment(np.ones((4, 8, 3)))
    valid, clipped = np.ones((4, 8), bool), np.zeros((4, 8), bool)
    valid[1, 6], clipped[2, 4] = False, True
    moment = Moment(0.0, replace(world, valid=valid, clipped=clipped))
    for cells, touched in ((3.0, [0]), (3.25, [-1, 0])):  # toward +X: to smaller columns
        turned = replace(moment, yaw_rad=cells * np.pi / 4).true_map()
        np.testing.assert_array_equal(np.argwhere(~turned.valid), [[1, 3 + c] for c in touched])
        np.testing.assert_array_equal(
            np.argwhere(turned.clipped), [[2, (1 + c) % 8] for c in touched]
        )


def test_a_disc_lies_on_the_cells_of_the_true_map_that_it_covers() -> None:
    dark = environment(np.zeros((HEIGHT, 2 * HEIGHT, 3)))
    disc = Disc("lamp", SUN, 0.25, np.array([1.0, 1.0, 1.0]))
    radiance = Moment(0.0, dark, discs=(disc,)).true_map().radiance[..., 0]
    angle = np.arccos(cell_directions(HEIGHT) @ SUN)
    cell = np.pi / HEIGHT
    np.testing.assert_allclose(radiance[angle < 0.25 - cell], disc.radiance[0], rtol=0.1)
    assert not radiance[angle > 0.25 + cell].any()
