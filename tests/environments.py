"""Environment maps for tests and benchmarks: degenerate ones, and one that looks like outdoors."""

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.measures.error_measures import spread_directions
from lighting.simulation.outdoors import outdoors as outdoors  # the tests' map too
from lighting.sphere.latlong import cell_directions


def environment(radiance: NDArray[np.floating]) -> EnvironmentMap:
    """Return the map (N, 2N, 3), or grey (N, 2N), with every cell seen and none clipped."""
    if radiance.ndim == 2:
        radiance = np.repeat(radiance[..., None], 3, axis=-1)
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


def constant(height: int = 16) -> EnvironmentMap:
    """Grey everywhere."""
    return environment(np.ones((height, 2 * height)))


def one_hot(height: int = 16, cell: tuple[int, int] = (5, 7)) -> EnvironmentMap:
    """One orange cell in the dark."""
    radiance = np.zeros((height, 2 * height, 3))
    radiance[cell] = (3.0, 2.0, 1.0)
    return environment(radiance)


def two_cells(height: int = 16) -> EnvironmentMap:
    """A bright red and a dim blue cell in the dark, on either side of the seam."""
    radiance = np.zeros((height, 2 * height, 3))
    radiance[4, 0] = (5.0, 0.0, 0.0)
    radiance[11, -1] = (0.0, 0.0, 2.0)
    return environment(radiance)


def bright_poles(height: int = 16) -> EnvironmentMap:
    """Pole rows 1000 times brighter than the rest."""
    radiance = np.ones((height, 2 * height))
    radiance[[0, -1]] = 1000.0
    return environment(radiance)


def sun_in_sky(
    height: int = 16, sun: float = 1e6, cell: tuple[int, int] = (4, 5)
) -> EnvironmentMap:
    """A sun of one cell above a sky of 1."""
    radiance = np.ones((height, 2 * height))
    radiance[cell] = sun
    return environment(radiance)


def turned(environment_map: EnvironmentMap, columns: int) -> EnvironmentMap:
    """Return the map rolled to the right by whole columns: turned about +Y by −2π columns/2N."""
    return environment(np.roll(environment_map.radiance, columns, axis=1))


def normals(count: int = 192) -> NDArray[np.float64]:
    """Return unit vectors spread over the sphere, (count, 3)."""
    return spread_directions(count)


def irradiance(
    towards: NDArray[np.float64], directions: NDArray[np.float64], light: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the irradiance (n, 3) on surfaces of normals `towards` (n, 3) from distant lights."""
    return np.clip(towards @ directions.T, 0, None) @ light


def true_irradiance(
    towards: NDArray[np.float64], environment_map: EnvironmentMap
) -> NDArray[np.float64]:
    """Return the irradiance (n, 3) from every cell of the map."""
    height = environment_map.height
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    solid_angle = np.pi / height * (edges[:-1] - edges[1:])
    light = environment_map.radiance * solid_angle[:, None, None]
    return irradiance(towards, cell_directions(height).reshape(-1, 3), light.reshape(-1, 3))
