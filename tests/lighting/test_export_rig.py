"""Which lights and which dome are exported."""

from dataclasses import replace

import numpy as np
import pytest

from capture.errors import InputError
from lighting.export.discs import about, facing_irradiance, light_names, strength_and_colour
from lighting.export.rig import light_rig
from lighting.light_set import LightSet
from lighting.sphere import harmonics
from tests.environments import irradiance, normals, true_irradiance
from tests.lighting.room import lamps, room


def with_fill(lights: LightSet) -> LightSet:
    fill = np.zeros((9, 3))
    fill[0], fill[2], fill[6] = 1.0, (0.3, 0.2, 0.1), (0.0, 0.1, 0.2)
    return replace(lights, fill=fill)


def test_with_a_map_key_lights_and_the_rest_of_the_map_are_written():
    rig = light_rig(with_fill(lamps()), room())
    assert rig.lights.is_key.tolist() == [True, True]
    assert not rig.lights.fill.any()
    assert rig.dome is not None
    together = rig.lights.integral() + rig.dome.integral()
    np.testing.assert_allclose(together, room().integral(), rtol=1e-6)
    np.testing.assert_allclose(rig.missing, 0, atol=1e-6)


def test_lights_and_dome_light_every_side_as_the_map_does():
    rig = light_rig(lamps(), room())
    towards = normals()
    from_lights = irradiance(towards, rig.lights.directions, facing_irradiance(rig.lights))
    together = from_lights + true_irradiance(towards, rig.dome)
    expected = true_irradiance(towards, room())
    # Discs that the horizon cuts are the only difference.
    assert np.sqrt(np.mean((together - expected) ** 2)) < 0.005 * np.sqrt(np.mean(expected**2))


def test_what_the_map_lacks_is_told():
    lights = lamps()
    rig = light_rig(replace(lights, irradiance=lights.irradiance * [1, 1, 2]), room())
    together = rig.lights.integral() + rig.dome.integral()
    np.testing.assert_allclose(together - rig.missing, room().integral(), rtol=1e-6)
    assert rig.missing[2] > 0.5
    np.testing.assert_allclose(rig.missing[:2], 0, atol=1e-6)


@pytest.mark.parametrize("environment", [None, room(16)])
def test_without_key_lights_all_are_written_and_the_map_is_not(environment):
    lights = replace(lamps(), is_key=np.zeros(3, bool))
    rig = light_rig(lights, environment)
    assert len(rig.lights) == 3
    assert rig.dome is None


def test_without_a_map_all_lights_are_written_and_their_fill_is_the_dome():
    lights = with_fill(lamps())
    rig = light_rig(lights)
    assert len(rig.lights) == 3
    np.testing.assert_allclose(rig.dome.integral(), harmonics.integral(lights.fill), rtol=2e-4)
    towards = normals()
    expected = harmonics.irradiance(lights.fill, towards)
    np.testing.assert_allclose(true_irradiance(towards, rig.dome), expected, rtol=5e-4)


def test_a_fill_that_is_rounded_below_zero_is_a_dome_that_is_not():
    fill = np.zeros((9, 3))
    fill[0] = 1.0, 0.0, -1e-10
    rig = light_rig(replace(lamps(), fill=fill))
    np.testing.assert_array_equal(rig.dome.radiance[..., 1:], 0)


@pytest.mark.parametrize("environment", [None, room(16)])
def test_lights_that_have_gone_out_are_not_written(environment):
    # temporal.py leaves lights without irradiance behind, key lights among them.
    keys_out = replace(lamps(), irradiance=lamps().irradiance * [[0], [0], [1]])
    rig = light_rig(keys_out, environment)
    assert len(rig.lights) == 1
    np.testing.assert_array_equal(rig.lights.irradiance, np.ones((1, 3)))
    assert rig.dome is None
    one_out = replace(lamps(), irradiance=lamps().irradiance * [[1], [0], [1]])
    assert len(light_rig(one_out, environment).lights) == (2 if environment is None else 1)


def test_a_map_of_another_scale_is_refused():
    with pytest.raises(InputError, match=r"scale is 'cd/m²'.*lights' is 'relative'"):
        light_rig(lamps(), replace(room(16), scale="cd/m²"))


@pytest.mark.parametrize("radius", [0.0, 0.01, 0.3, 1.0, np.pi / 2])
def test_facing_irradiance_is_the_integral_over_the_disc(radius):
    lights = LightSet(np.array([[0, 0, 1.0]]), np.array([[2.0, 1.0, 0.0]]), np.array([radius]))
    cosine = np.linspace(np.cos(radius), 1, 1000)  # equal steps of solid angle
    expected = lights.irradiance * np.trapezoid(cosine, dx=1 / 999)
    np.testing.assert_allclose(facing_irradiance(lights), expected, rtol=1e-6)


def test_a_disc_is_at_most_a_hemisphere():
    whole = LightSet(np.array([[0, 0, 1.0]]), np.ones((1, 3)), np.array([np.pi]))
    np.testing.assert_allclose(facing_irradiance(whole), 0.5)


def test_colours_are_at_most_1_and_give_the_light_back():
    rgb = np.array([[4.0, 2.0, 1.0], [0.0, 0.0, 0.0]])
    strength, colour = strength_and_colour(rgb)
    np.testing.assert_array_equal(strength[:, None] * colour, rgb)
    assert colour[0].max() == 1


def test_what_is_said_about_lights_is_a_line_that_can_be_printed():
    odd = replace(lamps(), scale="cd/m²\n!echo", source="Ł\0\x1b[31m\u2028 room ")
    assert about(odd) == "lights by fishlight, radiance cd/m² !echo: Ł [31m room"


def test_names_are_unique():
    assert light_names(lamps()) == ["key_0", "key_1", "light_2"]
