"""How truly lights stand for a map: irradiance in the open and behind occluders, against the map.

192 surfaces face everywhere. Each is seen four times: in the open, behind the edge of a wall that
hides half of all directions, behind a sphere of 40° radius, and behind a comb of eight slats; what
each hides is exact, of a light as a point (wholly or not at all) and as a uniform disc of its
angular radius (its share). An error is the root mean square over surfaces and channels of measured
minus true irradiance, over that of the true one.

Reference : all cells of the map, in double precision, each as the disc of its solid angle.
Cost      : 5 to 150 ms for 16 to 1024 lights, 2 s for the truth of a map of 256 rows, 7 of 512, on
            one core; nearly half of it behind the comb.
Fails     : occluders are at infinity and their edges sharp; a fill is summed over a grid of 64
            rows, which is within 1e-3 (rms) of the irradiance behind the comb, 3e-4 elsewhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import caps, harmonics
from lighting.sphere.latlong import cell_directions, solid_angles

Array = NDArray[np.float64]

SURFACES = 192
SPHERE_RADIUS_RAD = np.radians(40)
SLATS = 8
"""Slats of the comb, each as wide as the gap beside it."""
OPEN = "open"
_FILL_ROWS = 64


@dataclass(frozen=True, eq=False)
class Receivers:
    """Surfaces with what hides light from them.

    Attributes
    ----------
    normals : (n, 3) float64
        Unit vectors in the world frame.
    openings : (n, m, k, 3) float64
        Each sees through m regions that do not overlap, each where k caps around these overlap.
    opening_radius_rad : float
        Radius of the caps.
    """

    normals: Array
    openings: Array
    opening_radius_rad: float = np.pi / 2


@cache
def standard_receivers() -> Mapping[str, Receivers]:
    """Return the 192 surfaces "open", and behind a "wall", a "sphere" and a "comb"."""
    normals = spread_directions(SURFACES)
    random = np.random.default_rng(0)
    towards_sphere = _random_directions(random, SURFACES)
    below = (towards_sphere * normals).sum(axis=1) < 0
    towards_sphere[below] *= -1
    return {
        OPEN: Receivers(normals, np.empty((SURFACES, 1, 0, 3))),
        "wall": Receivers(normals, _random_directions(random, SURFACES)[:, None, None]),
        "sphere": behind_spheres(normals, towards_sphere, SPHERE_RADIUS_RAD),
        "comb": behind_combs(
            normals,
            _random_directions(random, SURFACES),
            random.uniform(0, np.pi / SLATS, SURFACES),
            SLATS,
        ),
    }


def behind_spheres(normals: Array, directions: Array, radius_rad: float) -> Receivers:
    """Return surfaces that see all but a cone around each of `directions` (n, 3)."""
    return Receivers(normals, -directions[:, None, None], np.pi - radius_rad)


def behind_combs(normals: Array, axes: Array, azimuth_rad: Array, slats: int) -> Receivers:
    """Return surfaces behind evenly spaced slats whose edges run from pole to pole of `axes`.

    The first gap begins at `azimuth_rad` (n,), and gaps are as wide as slats.
    """
    across = np.cross(axes, np.where(np.abs(axes[:, 1:2]) < 0.9, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(axes, across)
    begin = azimuth_rad[:, None] + 2 * np.pi * np.arange(slats) / slats
    openings = []
    for angle in (begin + np.pi / 2, begin + np.pi / slats - np.pi / 2):
        cosine, sine = np.cos(angle)[..., None], np.sin(angle)[..., None]
        openings.append(cosine * across[:, None] + sine * along[:, None])
    return Receivers(normals, np.stack(openings, axis=2))


def received(receivers: Receivers, lights: LightSet, *, as_points: bool = False) -> Array:
    """Return the irradiance (n, 3) from lights and fill, lights as points or with their extent."""
    radius = np.zeros(len(lights)) if as_points else lights.angular_radius_rad
    from_lights = _received(receivers, lights.directions, lights.irradiance, radius)
    if not lights.fill.any():
        return from_lights
    return from_lights + _fill_response(receivers) @ lights.fill


def received_from_map(receivers: Receivers, environment: EnvironmentMap) -> Array:
    """Return the irradiance (n, 3) from every cell of a map."""
    radiance = environment.radiance.reshape(-1, 3)
    lit = radiance.any(axis=-1)
    directions, solid_angle, radius = _cells(environment.height)
    irradiance = radiance[lit] * solid_angle[lit, None]
    return _received(receivers, directions[lit], irradiance, radius[lit])


def truth(environment: EnvironmentMap) -> dict[str, Array]:
    """Return what each kind of the standard receivers gets from a map, for `errors`."""
    return {
        name: received_from_map(receivers, environment)
        for name, receivers in standard_receivers().items()
    }


def errors(
    lights: LightSet, true: Mapping[str, Array], *, as_points: bool = False
) -> dict[str, float]:
    """Return the relative error of lights for each kind of receivers in `true`.

    Infinite where the map is dark and the lights are not; 0 where both are.
    """
    kinds = standard_receivers()
    return {
        name: relative_rms(received(kinds[name], lights, as_points=as_points), irradiance)
        for name, irradiance in true.items()
    }


def behind_occluders(errors_by_kind: Mapping[str, float]) -> float:
    """Return the root mean square of the errors of all kinds but those in the open."""
    occluded = [error for name, error in errors_by_kind.items() if name != OPEN]
    return float(np.sqrt(np.mean(np.square(occluded))))


def relative_rms(measured: Array, true: Array) -> float:
    """Return the root mean square of measured − true over that of true."""
    difference = float(np.sqrt(np.mean((measured - true) ** 2)))
    size = float(np.sqrt(np.mean(true**2)))
    if size == 0:
        return 0.0 if difference == 0 else np.inf
    return difference / size


def spread_directions(count: int) -> Array:
    """Return unit vectors spread over the sphere, (count, 3): a golden spiral."""
    index = np.arange(count) + 0.5
    y = 1 - 2 * index / count
    longitude = index * np.pi * (3 - np.sqrt(5))
    level = np.sqrt(1 - y * y)
    return np.stack([level * np.sin(longitude), y, level * np.cos(longitude)], axis=-1)


def _received(receivers: Receivers, directions: Array, irradiance: Array, radius: Array) -> Array:
    return caps.received(
        receivers.normals,
        receivers.openings,
        receivers.opening_radius_rad,
        directions,
        irradiance,
        radius,
    )


@cache
def _fill_response(receivers: Receivers) -> Array:
    """Return what each surface gets from each basis function, (n, 9)."""
    directions, solid_angle, radius = _cells(_FILL_ROWS)
    functions = harmonics.basis(directions) * solid_angle[:, None]
    return _received(receivers, directions, functions, radius)


@cache
def _cells(height: int) -> tuple[Array, Array, Array]:
    """Return directions (2N², 3), solid angles (2N²,) and the radii of discs that have them."""
    solid_angle = np.repeat(solid_angles(height), 2 * height)
    radius = 2 * np.arcsin(np.sqrt(solid_angle / (4 * np.pi)))
    return cell_directions(height).reshape(-1, 3), solid_angle, radius


def _random_directions(random: np.random.Generator, count: int) -> Array:
    vectors = random.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
