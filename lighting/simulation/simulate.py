"""A simulated camera: environment maps seen through a lens, exposed, and recorded with their truth.

Input  : moments of a scenario, and a calibration.    Output : a recording, with a folder truth/.
Per pixel: the mean of the map over the pixel, the discs' flux shared out over the pixels that they
touch, vignetting; then shot noise, read noise, clipping, response and quantisation. The same seed
gives the same counts.
Cost   : about 0.3 s for each megapixel and frame, most of it noise and encoding.
Fails  : what a lens does beyond geometry and vignetting is left out: glare, blur, colour fringes;
also motion within a bracket, whose frames all see the same moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.files import read_calibration
from capture.errors import InputError
from capture.frame import Exposure
from capture.recording_writer import create_recording
from capture.sensor import Sensor, assumed_sensor
from lighting.maps.environment import luminance
from lighting.simulation.scenario import Disc, Moment
from lighting.simulation.truth import write_truth
from lighting.sphere.latlong import direction_to_grid

FrameFormat = Literal["jpeg", "png", "png16"]

_JPEG_QUALITY = 95
_JPEG_SATURATION = 0.75
"""Beside an edge the JPEG encoder rings: at quality 95 a clipped pixel was read back as 232, linear
0.81, in the worst of 100,000 next to a sun. Taken for unclipped it would hide the sun."""
_SAMPLES_PER_CELL = 4
"""Samples on the side of a pixel, over the pixel's extent in cells of the map."""
_MAX_SAMPLES = 8
_POINTS_PER_PIXEL = 1024
"""Points of a disc for each pixel that it covers."""
_PEAK = 0.8
"""Share of the linear value of saturation that the brightest light may reach in the shortest
exposure: noise and JPEG add some."""
_MEDIAN = 0.15
"""Linear value of the median pixel in the longest exposure."""
_STEP = 64.0
"""Largest ratio of neighbouring exposures: the lowest counts of an sRGB curve are coarse."""


@dataclass(frozen=True)
class View:
    """A camera's pixels on the grid of a map, before the map turns.

    Attributes
    ----------
    calibration : Calibration
    height : int
        Rows of the map.
    seen : (H, W) bool
        Pixels whose centre the camera sees; P of them.
    solid_angle : (H, W) float64
        In sr; 0 where the pixel is unseen.
    illumination : (P, 1) or (P, 3) float64
        Relative illumination, times what a mirror ball reflects of each channel.
    rows, columns : (S, P) int16 and float32
        Grid coordinates of S samples spread over each seen pixel.
    """

    calibration: Calibration
    height: int
    seen: NDArray[np.bool_]
    solid_angle: NDArray[np.float64]
    illumination: NDArray[np.float64]
    rows: NDArray[np.int16]
    columns: NDArray[np.float32]


def build_view(calibration: Calibration, height: int) -> View:
    """Return where a camera's pixels lie on a map of `height` rows."""
    width_px, height_px = calibration.image_size_px
    centres = _pixel_grid(width_px, height_px)
    directions, seen = calibration.unproject(centres)
    solid_angle = _solid_angles(calibration)
    seen = seen & np.isfinite(solid_angle)
    if not seen.any():
        raise InputError("the calibration leaves no pixel of the picture that sees anything")
    solid_angle = np.where(seen, solid_angle, 0.0)
    extent_cells = np.sqrt(np.percentile(solid_angle[seen], 99)) * height / np.pi
    side = int(np.clip(np.ceil(_SAMPLES_PER_CELL * extent_cells), 1, _MAX_SAMPLES))
    rows = np.empty((side * side, int(seen.sum())), np.int16)
    columns = np.empty(rows.shape, np.float32)
    offsets = (np.arange(side) + 0.5) / side - 0.5
    for index, (dy, dx) in enumerate((dy, dx) for dy in offsets for dx in offsets):
        sampled, _ = calibration.unproject(centres[seen] + (dx, dy))
        # Past the limit of a model a pixel has no direction; its centre stands in.
        sampled = np.where(np.isfinite(sampled), sampled, directions[seen])
        coordinates = direction_to_grid(sampled, height)
        columns[index] = coordinates[..., 0]
        rows[index] = np.clip(np.rint(coordinates[..., 1]), 0, height - 1)
    illumination = calibration.illumination(directions[seen])[:, None]
    if calibration.reflectance:
        illumination = illumination * calibration.reflected_share(directions[seen])
    return View(calibration, height, seen, solid_angle, illumination, rows, columns)


def see(view: View, moment: Moment) -> NDArray[np.float64]:
    """Return the light that reaches each pixel, (H, W, 3): radiance × relative illumination."""
    height = moment.environment.height
    if height != view.height:
        raise InputError(
            f"a map of {height} rows among maps of {view.height}: give maps of one size"
        )
    cells = moment.environment.radiance
    turn = np.float32(moment.yaw_rad * height / np.pi)
    total = np.zeros((view.rows.shape[1], 3))
    for rows, columns in zip(view.rows, view.columns, strict=True):
        total += cells[rows, np.rint(columns + turn).astype(np.int32) % (2 * height)]
    radiance = np.zeros((*view.seen.shape, 3))
    radiance[view.seen] = total * (moment.brightness / len(view.rows))
    for disc in moment.discs:
        _add_disc(radiance, view, disc)
    radiance[view.seen] *= view.illumination
    return radiance


def expose(
    light: NDArray[np.float64], exposure: Exposure, sensor: Sensor, rng: np.random.Generator
) -> NDArray[Any]:
    """Return the counts (H, W, 3) that a sensor makes of the light (H, W, 3).

    Photons are Poisson distributed, the read-out adds normal noise, and what exceeds a full pixel
    is clipped.
    """
    electrons_at_1 = sensor.full_well_e / exposure.gain
    # Twice a full pixel is clipped whatever the noise; more would overflow the generator.
    linear = np.minimum(light * exposure.signal, 2.0)
    electrons = rng.poisson(linear * electrons_at_1).astype(np.float64)
    electrons += sensor.read_noise_e * rng.standard_normal(electrons.shape)
    return _encode(electrons / electrons_at_1, sensor)


def fitting_exposures(moments: Sequence[Moment], view: View, sensor: Sensor) -> tuple[float, ...]:
    """Return exposure times in s, rising: nothing clips in the first, the last shows the shade.

    The first bracket is looked at, and the discs of all.
    """
    light = see(view, replace(moments[0], discs=()))
    maps = (moment.brightness * moment.environment.radiance.max() for moment in moments)
    discs = (disc.radiance.max() for moment in moments for disc in moment.discs)
    peak = max(maps) + max(discs, default=0.0)
    median = float(np.median(luminance(light[view.seen])))
    if peak <= 0 or median <= 0:
        raise InputError("the maps are dark: give --exposures")
    shortest = _PEAK * sensor.saturation / peak
    longest = max(_MEDIAN / median, shortest)
    count = 1 + int(np.ceil(np.log(longest / shortest) / np.log(_STEP)))
    return tuple(float(f"{time_s:.3g}") for time_s in np.geomspace(shortest, longest, count))


def simulated_sensor(frame_format: FrameFormat) -> Sensor:
    """Return the sensor behind a format: sRGB-coded in 8 bits, linear above a pedestal in 16."""
    if frame_format == "png16":
        return Sensor(1024.0, 65535.0, source="simulated, linear")
    srgb = replace(assumed_sensor(np.uint8), source="simulated, sRGB")
    return replace(srgb, saturation=_JPEG_SATURATION) if frame_format == "jpeg" else srgb


def simulate_recording(
    folder: Path,
    moments: Sequence[Moment],
    calibration_path: Path,
    *,
    exposures_s: Sequence[float] | None = None,
    frame_format: FrameFormat = "jpeg",
    seed: int = 0,
    source: str,
    licence: str = "",
    force: bool = False,
) -> tuple[float, ...]:
    """Write the recording of a camera that lives through `moments`; return its exposure times in s.

    Parameters
    ----------
    folder : Path
        Of the recording; truth/ inside it holds what was simulated (lighting.simulation.truth).
    moments : sequence of Moment
        One for each bracket.
    calibration_path : Path
        The camera; copied into the recording.
    exposures_s : sequence of float or None
        Exposure times of a bracket; None chooses them to fit the light.
    frame_format : "jpeg", "png" or "png16"
    seed : int
        Of the noise. A frame's noise depends on the seed and the frame's place alone.
    source, licence : str
        For the manifest.
    force : bool
        Replace an older recording.
    """
    calibration = read_calibration(calibration_path)
    sensor = simulated_sensor(frame_format)
    view = build_view(calibration, moments[0].environment.height)
    times_s = tuple(exposures_s) if exposures_s else fitting_exposures(moments, view, sensor)
    exposures = [Exposure(time_s) for time_s in times_s]
    spacing_s = moments[1].timestamp_s - moments[0].timestamp_s if len(moments) > 1 else 1.0
    writer = create_recording(
        folder,
        "fishlight simulated camera",
        sensor,
        calibration=calibration_path,
        source=source,
        licence=licence,
        force=force,
    )
    with writer:
        write_truth(writer.folder / "truth", moments, sensor)
        for bracket, moment in enumerate(moments):
            light = see(view, moment)
            for index, exposure in enumerate(exposures):
                counts = expose(
                    light, exposure, sensor, np.random.default_rng([seed, bracket, index])
                )
                writer.write_frame(
                    counts,
                    exposure,
                    moment.timestamp_s + spacing_s * index / len(exposures),
                    bracket,
                    jpeg_quality=_JPEG_QUALITY if frame_format == "jpeg" else None,
                )
    return times_s


def _add_disc(radiance: NDArray[np.float64], view: View, disc: Disc) -> None:
    """Share a disc's flux out over the pixels it touches, in proportion to its area in each.

    Only the part that falls on seen pixels is added; what they get sums to its flux exactly.
    """
    pixel_sr = float(np.median(view.solid_angle[view.seen]))
    count = _POINTS_PER_PIXEL * int(np.ceil(disc.solid_angle_sr / pixel_sr) + 3)
    pixels, _ = view.calibration.project(disc.points(count))
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    columns, rows = np.rint(pixels).astype(np.int64).T
    height_px, width_px = view.seen.shape
    inside = (columns >= 0) & (columns < width_px) & (rows >= 0) & (rows < height_px)
    columns, rows = columns[inside], rows[inside]
    touched, points = np.unique(rows * width_px + columns, return_counts=True)
    touched, points = (each[view.seen.ravel()[touched]] for each in (touched, points))
    share_per_sr = points / count / view.solid_angle.ravel()[touched]
    radiance.reshape(-1, 3)[touched] += share_per_sr[:, None] * disc.irradiance


def _encode(linear: NDArray[np.float64], sensor: Sensor) -> NDArray[Any]:
    """Return the counts whose linear values are nearest to `linear` (H, W, 3)."""
    dtype = np.uint8 if sensor.white_dn <= 255 else np.uint16
    if sensor.response is None:
        exact = sensor.black_dn + linear * (sensor.white_dn - sensor.black_dn)
        return np.clip(np.rint(exact), 0, sensor.white_dn).astype(dtype)
    between = (sensor.response[:-1] + sensor.response[1:]) / 2
    counts = [np.searchsorted(between[:, i], linear[..., i]) for i in range(3)]
    return np.stack(counts, axis=-1).astype(dtype)


def _solid_angles(calibration: Calibration) -> NDArray[np.float64]:
    """Solid angle of every pixel in sr, (H, W), from its corners; NaN where one has no direction.

    Two spherical triangles each: A. van Oosterom and J. Strackee, "The solid angle of a plane
    triangle", IEEE Transactions on Biomedical Engineering, 1983. Nothing is shared with the remap,
    which this camera serves to test.
    """
    width_px, height_px = calibration.image_size_px
    corners, _ = calibration.unproject(_pixel_grid(width_px + 1, height_px + 1) - 0.5)
    a, b, c, d = corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]
    return _triangle_solid_angles(a, b, c) + _triangle_solid_angles(a, c, d)


def _pixel_grid(width_px: int, height_px: int) -> NDArray[np.float64]:
    """Pixel coordinates (height_px, width_px, 2)."""
    x, y = np.meshgrid(np.arange(width_px, dtype=float), np.arange(height_px, dtype=float))
    return np.stack([x, y], axis=-1)


def _triangle_solid_angles(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    triple = np.sum(a * np.cross(b, c), axis=-1)
    dots = np.sum(a * b, axis=-1) + np.sum(b * c, axis=-1) + np.sum(c * a, axis=-1)
    return np.abs(2 * np.arctan2(triple, 1 + dots))
