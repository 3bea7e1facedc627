"""Turning directions and maps for other programs."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture.errors import InputError
from lighting.export.orientation import in_convention, quaternions, z_up
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions
from tests.environments import constant, normals

Array = NDArray[np.float64]
HEIGHT = 32


def u_of_mitsuba(d: Array) -> Array:
    # d = (sin φ sin θ, cos θ, −cos φ sin θ), φ = 2πu; OpenEXR and USD are turned alike
    return np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) % 1


def u_of_three(d: Array) -> Array:
    return np.arctan2(d[:, 2], d[:, 0]) / (2 * np.pi) + 0.5


def u_of_blender(d: Array) -> Array:
    x, y, _ = z_up(d).T
    return 0.5 - np.arctan2(y, x) / (2 * np.pi)


# Each program's own formula for where it looks, u to the right, for a direction of our world.
LOOK_UP: dict[str, Callable[[Array], Array]] = {
    "exr": u_of_mitsuba,
    "usd": u_of_mitsuba,
    "mitsuba": u_of_mitsuba,
    "three": u_of_three,
    "blender": u_of_blender,
}


def coloured_by_direction() -> EnvironmentMap:
    """A map whose colour tells the direction of each cell, and whose marks are +X and +Z."""
    directions = cell_directions(HEIGHT)
    return EnvironmentMap(
        (directions + 1).astype(np.float32), directions[..., 0] > 0, directions[..., 2] > 0
    )


@pytest.mark.parametrize("convention", LOOK_UP)
def test_each_program_finds_every_direction_where_it_was(convention):
    converted = in_convention(coloured_by_direction(), convention)
    directions = normals(500)
    column = (LOOK_UP[convention](directions) * 2 * HEIGHT).astype(int)
    row = (np.arccos(directions[:, 1]) / np.pi * HEIGHT).astype(int)
    half_diagonal = np.pi / HEIGHT / np.sqrt(2) + 1e-6
    found = converted.radiance[row, column] - 1
    assert np.all(np.linalg.norm(found - directions, axis=1) < half_diagonal)
    np.testing.assert_array_equal(converted.valid, converted.radiance[..., 0] > 1)
    np.testing.assert_array_equal(converted.clipped, converted.radiance[..., 2] > 1)


def test_a_map_of_odd_height_is_turned_by_no_half_cells():
    odd = constant(15)
    assert in_convention(odd, "usd") is odd
    with pytest.raises(InputError, match=r"15 rows.*blender.*even"):
        in_convention(odd, "blender")


def test_z_up_turns_and_does_not_mirror():
    np.testing.assert_array_equal(z_up(np.eye(3)), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert np.linalg.det(z_up(np.eye(3))) == pytest.approx(1)


unit_vectors = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


@given(vector=unit_vectors)
@example(vector=(5e-324, 5e-324, -1.0))
@settings(max_examples=50, deadline=None)
def test_quaternions_turn_plus_z_into_the_direction(vector):
    direction = np.array(vector) / np.linalg.norm(vector)
    turn = quaternions(direction[None])[0]
    rotation = Rotation.from_quat(turn, scalar_first=True)
    np.testing.assert_allclose(rotation.apply([0, 0, 1]), direction, atol=1e-12)
    assert np.linalg.norm(turn) == pytest.approx(1)
    assert rotation.magnitude() == pytest.approx(np.arctan2(np.hypot(*direction[:2]), direction[2]))


@pytest.mark.parametrize("z", [1.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, -0.0, 1e-9, 1e-300])
def test_quaternions_are_exact_beside_the_axis(z, tilt):
    rotation = Rotation.from_quat(quaternions(np.array([[tilt, 0.0, z]]))[0], scalar_first=True)
    np.testing.assert_allclose(rotation.apply([0, 0, 1]), [tilt, 0, z], rtol=1e-6, atol=1e-15)
