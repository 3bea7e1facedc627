"""No more lights than the scene needs: the number for an error, against the error that is made.

Of 27 captured scenes at 2, 5 and 10 %, judged on maps of 256 rows by all standard surfaces, margin
and number of probes were chosen on 18: 53 of their 54 cases are met, and 26 of 27 of the nine held
out (captured_maps.py). In 49 of 54 and in 25 of 27 the number is within 1.5 times the smallest that
meets the error; of the others three are numbers of at most 6. On made maps of 64 rows, which
nothing was chosen on, 21 of 24 are met: what is missed has a hard sun, whose disc an edge cuts
elsewhere than the probes' edges do.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from lighting.blocks.block_grid import coarsened
from lighting.blocks.summed_area import block_sums
from lighting.measures.error_measures import (
    Receivers,
    behind_occluders,
    received,
    received_from_map,
    relative_rms,
    standard_receivers,
)
from lighting.methods import adaptive
from lighting.reduce import reduce_to_lights
from lighting.simulation.sequences import SEQUENCES, Sequence, Source, frames
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.captured_maps import DATA, captured_maps, held_out
from tests.environments import constant, environment, outdoors

TOLERANCES = (0.02, 0.05, 0.1)


def occluded_surfaces(step):
    """Return every so many of the standard surfaces behind each kind of occluder."""
    return {
        kind: Receivers(whole.normals[::step], whole.openings[::step], whole.opening_radius_rad)
        for kind, whole in standard_receivers().items()
        if kind != "open"
    }


SURFACES = occluded_surfaces(4)


def in_the_first_frame(sequence, rows=64):
    return next(iter(frames(sequence, rows, 1))).truth


@cache
def made_maps():
    """Return maps of known skies."""
    lamps = tuple(
        Source(0.4, lambda _, d=direction: np.array(d), np.radians(radius))
        for direction, radius in (((1, 0.6, 0), 2.0), ((0, 0.8, 1), 5.0), ((-1, 0.1, -0.4), 1.0))
    )
    named = ("soft sun over the seam", "light switch", "passer-by", "two suns", "cloud front")
    return [
        outdoors(64),
        in_the_first_frame(Sequence(lamps)),
        in_the_first_frame(Sequence(lamps, sky=0.02)),
        *(in_the_first_frame(SEQUENCES[name]) for name in named),
    ]


def true_light(view, surfaces=SURFACES):
    return {kind: received_from_map(of_kind, view) for kind, of_kind in surfaces.items()}


def real_error(lights, true, surfaces=SURFACES):
    """Return the error behind occluders."""
    return behind_occluders(
        {
            kind: relative_rms(received(surfaces[kind], lights), light)
            for kind, light in true.items()
        }
    )


def met(views, surfaces=SURFACES):
    """Return whether the error of each map at each tolerance is met, and was by 2/3 of the lights.

    The second is false where the count is within 1.5 times the smallest that meets the tolerance.
    """
    is_met, was_met = [], []
    for view in views:
        true = true_light(view, surfaces)
        for tolerance in TOLERANCES:
            lights = reduce_to_lights(view, 512, error=tolerance)
            is_met.append(real_error(lights, true, surfaces) <= tolerance)
            fewer = int(np.ceil(len(lights) / 1.5)) - 1
            was_met.append(
                fewer > 0 and real_error(reduce_to_lights(view, fewer), true, surfaces) <= tolerance
            )
    return np.array(is_met), np.array(was_met)


@pytest.mark.slow
def test_errors_are_met_on_made_maps():
    is_met, was_met = met(made_maps())
    assert is_met.mean() >= 0.85
    assert was_met.mean() <= 0.3


def test_an_overcast_sky_needs_a_fill_and_few_lights():
    # The standard overcast sky, (1 + 2 sin h)/3, over ground of a fifth of the sky's mean.
    up = cell_directions(128)[..., 1]
    sky = environment(np.where(up > 0, (1 + 2 * up) / 3, 0.15))
    lights = reduce_to_lights(sky, 512, error=0.1)
    assert lights.fill.any()
    assert len(lights) <= 4
    assert real_error(lights, true_light(sky)) <= 0.1


def test_a_clear_sky_needs_one_key_light_and_few_more():
    sky = in_the_first_frame(SEQUENCES["cloud front"], 128)
    lights = reduce_to_lights(sky, 512, error=0.1)
    assert lights.is_key.sum() == 1
    assert lights.fill.any()
    assert len(lights) <= 8


def test_a_constant_map_needs_no_light():
    for tolerance in TOLERANCES:
        lights = reduce_to_lights(constant(32), 512, error=tolerance)
        assert len(lights) == 0
        assert lights.predicted_error < 1e-3


@pytest.mark.data
@pytest.mark.slow
def test_errors_are_met_on_captured_maps_held_out():
    maps = captured_maps()
    if not maps:
        pytest.skip(f"no captured maps under {DATA}")
    views = []
    for name in held_out(list(maps)):
        blocks = coarsened(block_sums(maps[name].radiance), 256)
        views.append(environment(blocks[..., 4:] / solid_angles(256)[:, None, None]))
    is_met, was_met = met(views, occluded_surfaces(1))
    assert is_met.mean() >= 0.95
    assert was_met.mean() <= 0.1


def test_lights_are_given_up_only_when_far_fewer_would_do():
    errors = 1 / np.arange(1, 41)
    memory = SimpleNamespace(tree=SimpleNamespace(leaves=lambda: np.arange(20)))
    # n lights err by 1/(n + 1); 16 are more than 3/4 of the 20 that there were, 15 are not.
    assert adaptive._fewest(errors, 1 / 16.5, None) == 16
    assert adaptive._fewest(errors, 1 / 16.5, memory) == 20
    assert adaptive._fewest(errors, 1 / 15.5, memory) == 15
    # Nor are as many kept as no longer do.
    assert adaptive._fewest(errors, 1 / 30.5, memory) == 30
