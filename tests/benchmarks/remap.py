"""Remap against OpenCV: milliseconds, and what becomes of a light of half a pixel.

Peers: cv2.remap, bilinear, with its maps made beforehand; and the same at 4 × 4 samples a cell,
then INTER_AREA. Accuracy: error of the flux of a Gaussian spot, σ = ½ pixel, at random places
(median and 95th percentile, in %), how far its centroid moves (largest, in cells; infinite where
the spot is lost), and the rms error of a smooth pattern of range 0 to 1.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.camera import UP, Calibration
from calibration.models.equidistant import Equidistant
from capture.radiance import RadianceImage
from lighting.maps.remap import apply_remap, build_remap
from lighting.sphere.latlong import cell_directions, grid_to_direction, solid_angles

SIZE = 1024
TILT = np.array([[1, 0, 0], [0, 0.96, -0.28], [0, 0.28, 0.96]])
CAMERA = Calibration(
    Equidistant(((SIZE - 1) / 2,) * 2, SIZE / np.pi), (SIZE, SIZE), np.pi / 2, TILT @ UP
)
SPOTS = 60
SPOT_ANGLE_RAD = np.radians(80)

Array = NDArray[np.float32]


def grey(picture: NDArray[np.floating]) -> RadianceImage:
    """Return the picture (H, W) as grey radiance without marks."""
    radiance = np.repeat(picture[..., None], 3, axis=2).astype(np.float32)
    seen = np.ones(radiance.shape[:2], bool)
    return RadianceImage(radiance, np.zeros_like(radiance), seen, ~seen)


def ours(height: int) -> Callable[[RadianceImage], Array]:
    """Return fishlight's remap to `height` rows."""
    operator = build_remap(CAMERA, height)
    return lambda image: apply_remap(operator, image).radiance


def opencv(height: int, samples: int) -> Callable[[RadianceImage], Array]:
    """Return cv2.remap with samples² points a cell; unseen cells are black."""
    fine = samples * height
    columns, rows = np.meshgrid(np.arange(2 * fine), np.arange(fine))
    at = (np.stack([columns, rows], axis=-1) + 0.5) / samples - 0.5
    pixels, seen = CAMERA.project(grid_to_direction(at, height))
    pixels[~seen] = -10
    x, y = np.moveaxis(pixels.astype(np.float32), -1, 0).copy()

    def remap(image: RadianceImage) -> Array:
        result = cv2.remap(image.radiance, x, y, cv2.INTER_LINEAR)
        if samples > 1:
            result = cv2.resize(result, (2 * height, height), interpolation=cv2.INTER_AREA)
        return result

    return remap


def accuracy(remap: Callable[[RadianceImage], Array], height: int) -> dict[str, float]:
    """Return what the module's docstring lists."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(np.float64)
    directions = np.nan_to_num(CAMERA.unproject(np.stack([x, y], axis=-1))[0])
    pixel_sr = np.sinc(CAMERA.axis_angle(directions) / np.pi) * (np.pi / SIZE) ** 2
    cells, cell_sr = cell_directions(height), solid_angles(height)[:, None]

    rng = np.random.default_rng(0)
    flux_error, shift = [], []
    while len(shift) < SPOTS:
        u, v = rng.uniform(0, SIZE, 2)
        if np.hypot(u - SIZE / 2, v - SIZE / 2) * np.pi / SIZE > SPOT_ANGLE_RAD:
            continue
        spot = 1e4 * np.exp(-2 * ((x - u) ** 2 + (y - v) ** 2))
        spot[spot < 1e-4] = 0
        light = remap(grey(spot))[..., 0] * cell_sr
        lit = spot > 0
        flux = (spot[lit] * pixel_sr[lit]).sum()
        flux_error.append(abs(light.sum() / flux - 1))
        on = light > 0
        if on.any():
            placed = light[on] @ cells[on]
            true = (spot[lit] * pixel_sr[lit]) @ directions[lit]
            sine = np.linalg.norm(np.cross(placed, true))
            shift.append(np.arctan2(sine, placed @ true) * height / np.pi)
        else:
            shift.append(np.inf)

    def smooth(d: NDArray[np.float64]) -> NDArray[np.float64]:
        return (
            0.5
            + 0.2 * d[..., 0] * d[..., 1]
            + 0.15 * np.sin(5 * d[..., 2])
            + 0.1 * np.cos(7 * d[..., 0])
        )

    inside = CAMERA.axis_angle(cells) < SPOT_ANGLE_RAD
    residual = (remap(grey(smooth(directions)))[..., 0] - smooth(cells))[inside]
    return {
        "flux error median %": 100 * float(np.median(flux_error)),
        "flux error p95 %": 100 * float(np.percentile(flux_error, 95)),
        "centroid shift cells": float(max(shift)),
        "smooth rms": float(np.sqrt(np.mean(residual**2))),
    }


def run(repeats: int) -> list[dict[str, Any]]:
    """Time all systems in turns, and return the rows that bench.py writes."""
    picture = grey(np.random.default_rng(1).random((SIZE, SIZE)))
    rows = []
    for height in (1024, 512, 256, 128):
        systems = {
            "fishlight": ours(height),
            "cv2.remap": opencv(height, 1),
            "cv2.remap 4×4 + INTER_AREA": opencv(height, 4),
        }
        times: dict[str, list[float]] = {name: [] for name in systems}
        for repeat in range(repeats + 1):
            for name, remap in systems.items():
                start = time.perf_counter()
                remap(picture)
                if repeat > 0:  # the first call warms up
                    times[name].append(1e3 * (time.perf_counter() - start))
        medians = {name: statistics.median(values) for name, values in times.items()}
        for name, remap in systems.items():
            rows.append(
                {
                    "stage": "remap",
                    "case": f"fisheye {SIZE}² → {2 * height}×{height}",
                    "system": name,
                    "ms": medians[name],
                    "ratio": medians[name] / medians["fishlight"] if name != "fishlight" else None,
                    "accuracy": accuracy(remap, height),
                }
            )
    return rows


if __name__ == "__main__":
    for row in run(15):
        print(row)
