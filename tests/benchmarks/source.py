"""From a fisheye picture to block sums: straight from the source, and through a map.

Peers are this project's own: the remap to a map, and its block sums. Accuracy, in %, with every
block as a light: relative rms error of irradiance under a sky with a sun of 0.53°, and error of the
flux of the sun alone; the largest of four places: seam, pole, 1° above the edge, elsewhere.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.camera import UP, Calibration
from calibration.models.equidistant import Equidistant
from capture.radiance import RadianceImage
from lighting.blocks.source_blocks import apply_source_blocks, build_source_blocks
from lighting.blocks.summed_area import block_sums
from lighting.maps.remap import apply_remap, build_remap
from lighting.simulation.scenario import Disc, Moment
from lighting.simulation.simulate import build_view, see
from lighting.sphere.caps import SUN_RADIUS_RAD
from lighting.sphere.latlong import cell_directions, solid_angles
from tests.environments import environment, irradiance, normals, outdoors

SIZE = 1024
CAMERA = Calibration(Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi), (SIZE,) * 2, np.pi / 2, UP)
SKY = outdoors(512)
SUN = np.array([200.0, 190.0, 170.0])
PLACES = ((0.0, 0.6, -0.8), (0.0, 1.0, 0.0), (np.cos(0.0175), np.sin(0.0175), 0.0), (0.5, 0.6, 0.3))

Array = NDArray[np.float64]
Path = Callable[[RadianceImage], Array]


def paths() -> dict[str, Path]:
    """Return the ways from a picture to sums over blocks (256, 512, 7)."""
    source = build_source_blocks(CAMERA)

    def through_map(height: int) -> Path:
        remap = build_remap(CAMERA, height)
        return lambda image: block_sums(apply_remap(remap, image).radiance)

    return {
        "fishlight, at the source": lambda image: apply_source_blocks(source, image).sums,
        "fishlight, map 1024×512": through_map(512),
        "fishlight, map 512×256": through_map(256),
    }


def picture(radiance: NDArray[np.floating]) -> RadianceImage:
    """Return radiance (H, W, 3) as a picture without marks."""
    linear = radiance.astype(np.float32)
    seen = np.ones(linear.shape[:2], bool)
    return RadianceImage(linear, np.zeros_like(linear), seen, ~seen)


def lit_by(sums: Array) -> Array:
    """Return the irradiance (n, 3) of all blocks as lights."""
    lit = sums[sums[..., 0] > 0]
    directions = lit[:, 1:4] / np.linalg.norm(lit[:, 1:4], axis=1)[:, None]
    return irradiance(normals(), directions, lit[:, 4:])


def accuracy(systems: dict[str, Path]) -> dict[str, dict[str, float]]:
    """Return what the module's docstring lists, for each system."""
    view = build_view(CAMERA, SKY.height)
    dark = environment(np.zeros((SKY.height, 2 * SKY.height)))
    is_above = cell_directions(SKY.height)[..., 1] > 0
    light = (SKY.radiance * solid_angles(SKY.height)[:, None, None])[is_above]
    sky = irradiance(normals(), cell_directions(SKY.height)[is_above], light)
    found = {name: {"irradiance error %": 0.0, "sun's flux error %": 0.0} for name in systems}
    for place in PLACES:
        direction = np.array(place) / np.linalg.norm(place)
        sun = Disc("sun", direction, SUN_RADIUS_RAD, SUN)
        truth = sky + irradiance(normals(), direction[None], SUN[None])
        both, alone = (picture(see(view, Moment(0.0, w, discs=(sun,)))) for w in (SKY, dark))
        for name, path in systems.items():
            residual = lit_by(path(both)) - truth
            errors = {
                "irradiance error %": np.sqrt(np.mean(residual**2) / np.mean(truth**2)),
                "sun's flux error %": abs(path(alone)[..., 4].sum() / SUN[0] - 1),
            }
            for key, error in errors.items():
                found[name][key] = max(found[name][key], 100 * float(error))
    return found


def run(repeats: int) -> list[dict[str, Any]]:
    """Time all systems in turns, and return the rows that bench.py writes."""
    systems = paths()
    image = picture(np.random.default_rng(1).random((SIZE, SIZE, 3)))
    times: dict[str, list[float]] = {name: [] for name in systems}
    for repeat in range(repeats + 1):
        for name, path in systems.items():
            start = time.perf_counter()
            path(image)
            if repeat > 0:  # the first call warms up
                times[name].append(1e3 * (time.perf_counter() - start))
    medians = {name: statistics.median(values) for name, values in times.items()}
    ours = medians["fishlight, at the source"]
    measured = accuracy(systems)
    return [
        {
            "stage": "source",
            "case": f"fisheye {SIZE}² → 512×256 blocks",
            "system": name,
            "ms": medians[name],
            "ratio": medians[name] / ours if "source" not in name else None,
            "accuracy": measured[name],
        }
        for name in systems
    ]


if __name__ == "__main__":
    for row in run(15):
        print(row)
