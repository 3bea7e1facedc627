"""Key lights: discs that are found where they are, with their light and their radius."""

import numpy as np
import pytest

from lighting.adaptive.key_lights import MOST_KEY_LIGHTS, take_key_lights
from lighting.blocks.block_grid import block_grid
from lighting.blocks.summed_area import block_sums
from lighting.simulation.scenario import Disc
from lighting.simulation.sequences import Sequence, Source, frames
from lighting.sphere.latlong import solid_angles
from tests.environments import bright_poles, constant, environment, one_hot, outdoors, sun_in_sky

ROWS = 128
BLOCK_RAD = np.pi / ROWS
NONE = np.empty((0, 3))


def sky_with(*sources, rows=ROWS):
    """Return blocks of the sequences' sky with discs (direction, radius, flux), and the discs."""
    made = tuple(
        Source(flux, lambda _, d=direction: np.array(d, float), radius)
        for direction, radius, flux in sources
    )
    timed = next(iter(frames(Sequence(made), rows, 1)))
    return block_sums(timed.environment.radiance), timed.sources


def keys_of(blocks, least_share=0.01, most=MOST_KEY_LIGHTS, before=NONE):
    return take_key_lights(blocks, block_grid(len(blocks)), least_share, most, before)


def turn_rad(directions, other):
    return 2 * np.arcsin(np.linalg.norm(directions - other, axis=-1) / 2)


def toward(azimuth, elevation):
    level = np.cos(elevation)
    return level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)


PLACES = {
    "between blocks": toward(0.5, 0.7),
    "within a block": toward(0.5 + 0.3 * BLOCK_RAD, 0.7 + 0.4 * BLOCK_RAD),
    "on the seam": toward(np.pi, 0.6),
    "beside the seam": toward(np.pi - 0.4 * BLOCK_RAD, 0.6),
    "at the upper pole": (0.0, 1.0, 0.0),
    "near the upper pole": toward(2.0, np.pi / 2 - 0.02),
    "at the lower pole": (0.0, -1.0, 0.0),
    "at the horizon": toward(-1.0, 0.0),
}


@pytest.mark.parametrize("radius_deg", [0.27, 1.5])
@pytest.mark.parametrize("direction", PLACES.values(), ids=PLACES)
def test_a_disc_is_found_with_its_light(direction, radius_deg):
    blocks, (disc,) = sky_with((direction, np.radians(radius_deg), 2.0))
    keys = keys_of(blocks)
    assert len(keys.directions) == 1
    # The sky under the cap varies about the ring's median, and so does what is taken for the disc.
    assert turn_rad(keys.directions[0], disc.direction) < np.radians(0.03)
    np.testing.assert_allclose(keys.irradiance[0], disc.irradiance, rtol=0.02)


@pytest.mark.parametrize("radius_deg", [1.0, 1.5, 1.9])
def test_the_radius_is_that_of_a_disc_that_blocks_can_tell(radius_deg):
    blocks, _ = sky_with((toward(0.5, 0.7), np.radians(radius_deg), 4.0), rows=256)
    radius = keys_of(blocks).angular_radius_rad[0]
    assert np.degrees(radius) == pytest.approx(radius_deg, rel=0.15)


def test_a_sun_within_its_blocks_has_no_radius_of_its_own():
    # Blocks cannot tell how small it is. Put among four, it is as wide as they are at most.
    blocks, _ = sky_with((toward(0.5, 0.7), np.radians(0.1), 4.0))
    assert keys_of(blocks).angular_radius_rad[0] < 1.5 * BLOCK_RAD


def test_two_suns_are_two_key_lights():
    blocks, discs = sky_with((toward(0.5, 0.7), 0.005, 2.0), (toward(2.5, 0.4), 0.005, 1.0))
    keys = keys_of(blocks)
    assert len(keys.directions) == 2
    for direction, light, disc in zip(keys.directions, keys.irradiance, discs, strict=True):
        assert turn_rad(direction, disc.direction) < np.radians(0.03)
        np.testing.assert_allclose(light, disc.irradiance, rtol=0.02)


def test_the_order_stays_when_powers_swap():
    # As many blocks apart as makes them alike but for their powers.
    places = toward(0.5, 0.7), toward(0.5 + 80 * BLOCK_RAD, 0.7)
    before, first = NONE, None
    for frame in range(6):
        swing = 0.02 * (-1) ** frame
        blocks, _ = sky_with((places[0], 0.005, 1 + swing), (places[1], 0.005, 1 - swing))
        keys = keys_of(blocks, before=before)
        first = keys.directions if first is None else first
        assert turn_rad(keys.directions, first).max() < np.radians(0.05)
        before = keys.directions
    # Without memory the stronger one comes first, so this would notice a memory that does nothing.
    assert turn_rad(keys_of(blocks).directions, first).max() > 1


def test_a_key_light_stays_below_the_share_that_makes_one():
    blocks, discs = sky_with((toward(0.5, 0.7), 0.005, 0.1))
    share = 0.1 / 1.1
    assert len(keys_of(blocks, 1.3 * share).directions) == 0
    before = np.array([discs[0].direction])
    assert len(keys_of(blocks, 1.3 * share, before=before).directions) == 1
    assert len(keys_of(blocks, 2.0 * share, before=before).directions) == 0


@pytest.mark.parametrize("radius_deg", [6.0, 12.0])
def test_a_window_is_no_key_light(radius_deg):
    blocks, _ = sky_with((toward(0.5, 0.3), np.radians(radius_deg), 2.0))
    keys = keys_of(blocks)
    assert len(keys.directions) == 0
    np.testing.assert_array_equal(keys.rest, blocks)


MAPS = {
    "constant": constant(),
    "outdoors": outdoors(64),
    "one cell": one_hot(),
    "bright poles": bright_poles(),
    "sun": sun_in_sky(64),
    "dark": environment(np.zeros((16, 32))),
    "smallest": constant(2),
}


@pytest.mark.parametrize("view", MAPS.values(), ids=MAPS)
def test_rest_and_key_lights_are_the_map(view):
    blocks = block_sums(view.radiance)
    kept = blocks.copy()
    keys = keys_of(blocks)
    np.testing.assert_array_equal(blocks, kept)  # the caller's own are left alone
    assert (keys.rest[..., [0, 4, 5, 6]] >= 0).all()
    total = keys.rest[..., 4:].sum(axis=(0, 1)) + keys.irradiance.sum(axis=0)
    np.testing.assert_allclose(total, blocks[..., 4:].sum(axis=(0, 1)), rtol=1e-9, atol=1e-30)


def test_no_more_than_asked_and_the_brightest_first():
    lamps = [(toward(azimuth, 0.5), 0.005, 1 + azimuth) for azimuth in (-2.0, -0.5, 1.0, 2.5)]
    blocks, discs = sky_with(*((d, r, f + 2) for d, r, f in lamps))
    for most in range(5):
        found = keys_of(blocks, most=most).directions
        assert len(found) == most
        for direction, disc in zip(found, discs[::-1], strict=False):
            assert turn_rad(direction, disc.direction) < np.radians(0.05)


def test_what_a_key_light_leaves_is_the_sky_around_it():
    with_sun, discs = sky_with((toward(0.5, 0.7), 0.005, 4.0))
    without, _ = sky_with()
    rest = keys_of(with_sun).rest
    assert isinstance(discs[0], Disc)
    solid_angle = solid_angles(ROWS)[:, None]
    changed = np.abs(rest[..., 0] - without[..., 0]) / solid_angle
    assert changed.max() < 0.15  # of a sky of about 0.6, under a sun of thousands
