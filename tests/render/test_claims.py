"""What claims are tested by: closed forms, invariants, and that a claim can fail."""

import math

import numpy as np
import pytest

from lighting.light_set import LightSet
from lighting.measures.error_measures import received, received_from_map
from lighting.simulation.outdoors import outdoors
from render.claims import combined_techniques, estimated, light_counts, occlusion, point_light
from render.claims.combined_techniques import (
    Drawn,
    combined,
    errors_of,
    floor_beside_light,
    glossy_under_sphere,
    single,
)
from render.claims.contract import CONFIRMED, NOT_CONFIRMED, Claim, Finding, found, over, verdict
from tests.environments import constant


def findings(*held):
    return [Finding(str(k), {}, each) for k, each in enumerate(held)]


def test_verdicts():
    assert verdict(findings(True, None, True)) == CONFIRMED
    assert verdict(findings(False, False)) == NOT_CONFIRMED
    assert verdict(findings(None, None)) == verdict([]) == "undecided"
    assert verdict(findings(True, False, None)) == "confirmed in part, 1 of 2 settings"


def test_what_was_found_is_the_range_of_what_decides():
    claim = Claim("it", "so", "1999", "a test", lambda _maps: [], "ratio")
    told = [Finding("a", {"ratio": value}, True) for value in (0.5, 4.0, 1.0)]
    told += [Finding("open", {"ratio": 2.0}, None), Finding("all", {"largest": 9.0}, True)]
    assert found(claim, told) == "ratio 0.5 to 4, median 1.5"
    assert (over(1.0, 2.0), over(0.0, 0.0), over(1.0, 0.0)) == (0.5, 1.0, math.inf)


def test_the_boundary_of_a_constant_sky_is_the_cosine_rule():
    boundaries = light_counts.shadow_boundaries()
    seen = received_from_map(boundaries, constant(32))
    # A floor that sees a sky from an angle a off the ground on: E = π L (1 + cos a) / 2.
    elevation = np.arccos(boundaries.openings[:, 0, 0, 1])
    np.testing.assert_allclose(seen[:, 0], np.pi * (1 + np.cos(elevation)) / 2, atol=0.01)
    steps = light_counts.largest_step(seen)
    count = light_counts._ELEVATIONS
    assert steps == pytest.approx(np.sin(np.pi / 2) * np.pi / (count + 1) / 2, rel=0.1)


def test_one_light_makes_one_step_of_all_there_is():
    light = LightSet(np.array([[0.0, 1.0, 0.0]]), np.ones((1, 3)), np.zeros(1))
    boundaries = light_counts.shadow_boundaries()
    seen = received(boundaries, light, as_points=True)
    assert light_counts.largest_step(seen) == pytest.approx(1)
    assert light_counts.boundary_error(seen, seen) == 0
    assert light_counts.boundary_error(2 * seen, seen) > 0.9


def test_structured_lights_are_compared_with_random_ones(monkeypatch):
    monkeypatch.setattr(light_counts, "FEW", 8)
    for many_lights, holds in ((8, True), (800, False)):
        monkeypatch.setattr(light_counts, "MANY", many_lights)
        [row] = light_counts.STRUCTURED.measure({"made": outdoors(16)})
        structured, *_, many, over_many = row.figures.values()
        assert over_many == structured / many
        assert row.holds == (structured <= many) == holds


@pytest.mark.parametrize(("structured", "holds"), [(0.8, True), (0.99, None), (1.2, False)])
def test_chance_decides_nothing_between_structured_and_random(monkeypatch, structured, holds):
    errors_of_draws = iter([structured, *np.ones(32), *np.tile([0.9, 1.1], 16)])
    monkeypatch.setattr(light_counts, "behind_occluders", lambda _errors: next(errors_of_draws))
    monkeypatch.setattr(light_counts, "errors", lambda *_lights, **_as_points: None)
    [row] = light_counts.STRUCTURED.measure({"made": outdoors(8)})
    assert row.holds is holds
    assert "over 3000 random" in found(light_counts.STRUCTURED, [row])


@pytest.mark.parametrize("distance", [0.1, 0.5, 2.0])
def test_either_technique_and_both_estimate_the_form_factor(distance):
    light, floor = floor_beside_light(distance)
    # From a point of the floor to an upright rectangle b wide on each side and 1 high:
    # F = (atan(b/d) − d/√(d² + 1) atan(b/√(d² + 1))) / π.
    away = math.hypot(distance, 1)
    half = combined_techniques._HALF_WIDTH
    factor = (math.atan(half / distance) - distance / away * math.atan(half / away)) / math.pi
    for mean, variance in (single(light), single(floor), combined(light, floor, 1.0)):
        assert abs(mean - factor) < 4 * math.sqrt(variance / len(light.value))


@pytest.mark.parametrize("roughness", [0.2, 0.6])
def test_directions_of_light_and_of_the_lobe_have_one_mean(roughness):
    light, lobe = glossy_under_sphere(roughness, 0.2)
    means = [(single(each)) for each in (light, lobe)] + [combined(light, lobe, 2.0)]
    for mean, variance in means[1:]:
        error = math.sqrt((variance + means[0][1]) / len(light.value))
        assert abs(mean - means[0][0]) < 4 * error


def test_two_techniques_that_are_one_err_as_one_with_as_many_directions():
    rng = np.random.default_rng(0)
    value, density = rng.random((2, 4000)) + 0.5
    same = Drawn(value, density, density)
    for power in (1.0, 2.0):
        mean, variance = combined(same, same, power)
        assert mean == pytest.approx(single(same)[0])
        assert variance == pytest.approx(single(same)[1] / 2)
    errors = errors_of(same, same)
    assert len({round(error, 12) for error in errors.values()}) == 1


def test_combined_techniques_never_fail_as_single_ones_do():
    *_, together = combined_techniques.BESIDE.measure({})
    largest = {name.split()[-1]: error for name, error in together.figures.items()}
    assert largest["light"] > 5
    assert largest["surface"] > 2
    assert largest["balance"] < 1.5
    assert together.holds


def test_occlusion_is_confirmed_where_it_grows_with_reach_and_cone(monkeypatch):
    monkeypatch.setattr(occlusion, "SIZE_PX", (48, 36))
    grid = occlusion.OCCLUSION.measure({})
    closed = np.reshape([row.figures["mean occlusion"] for row in grid], (3, 3))
    holds = np.reshape([row.holds for row in grid], (3, 3))
    assert np.all(np.diff(closed, axis=1) > 0)  # reach
    assert holds[0].tolist() == [None, True, True]
    np.testing.assert_array_equal(holds[1:], np.diff(closed, axis=0) >= 0)  # cone


def test_spheres_that_are_the_same_do_not_differ():
    width, height = point_light.SIZE_PX
    picture = np.ones((height, width, 4), np.float32)
    assert point_light.differences(picture) == [0.0] * 3
    picture[:, : width // 4, :3] *= np.e  # a share of 1.01 of the mean is added to both
    first, *others = point_light.differences(picture)
    assert first == pytest.approx(1, abs=0.02)
    assert others == [0.0, 0.0]


@pytest.mark.slow
def test_spreads_are_of_the_same_surfaces_and_fall_with_samples(monkeypatch):
    monkeypatch.setattr(estimated, "SIZE_PX", (16, 8))
    sky = outdoors(8)
    few, many, other = estimated.spreads(sky, [("brdf", 4), ("brdf", 256), ("inverse-cdf", 256)])
    assert few.candidates * 64 == many.candidates
    assert 0 < many.rays <= many.candidates
    assert many.error < few.error / 4
    # Means of six estimates each, against the spread of both.
    off = np.sqrt(np.mean((many.mean - other.mean) ** 2))
    assert off < 2 * math.hypot(many.error, other.error) / math.sqrt(6)
    assert other.size == pytest.approx(many.size, rel=0.2)


def test_resampling_holds_where_it_throws_away_and_is_worth_it(monkeypatch):
    def made(_environment, wanted):
        spread = {
            "inverse-cdf": (1.0, 64.0),
            "rejection-light": (3.0, 16.0),  # 3 · √(16/64) > 1
            "rejection-brdf": (0.5, 48.0),  # keeps most
            "resampling-light": (1.5, 16.0),
            "resampling-brdf": (2.5, 16.0),
        }
        assert {name for name, _ in wanted} == set(spread)
        return [
            estimated.Spread(np.ones((1, 3, 16)), *spread[name], 64.0, 1.0) for name, _ in wanted
        ]

    monkeypatch.setattr(estimated, "spreads", made)
    rows = estimated.RESAMPLING.measure({"m": outdoors(8)})
    held = {row.setting.split()[-1]: row.holds for row in rows}
    assert held == {
        "rejection-light": False,
        "rejection-brdf": False,
        "resampling-light": True,
        "resampling-brdf": False,
    }


@pytest.mark.parametrize(("rays", "holds"), [(0.5, None), (2.0, True)])
def test_a_ray_for_every_second_surface_decides_nothing_of_resampling(rays, holds):
    plain = estimated.Spread(np.ones((1, 3, 16)), 1.0, 64.0, 64.0, 1.0)
    few = estimated.Spread(np.ones((1, 3, 16)), 0.1, rays, 64.0, 1.0)
    assert estimated._is_worth(few, plain) is holds
