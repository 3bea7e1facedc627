"""The views with their boards redrawn, and the picture without the lens's bending.

Input  : Evidence and the pictures that are still there.    Output : SVG elements and JPEG data.
"""

import base64
import html
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from calibration.detection_files import read_grey
from calibration.lens.record import ViewRecord
from calibration.report.evidence import Evidence
from capture.errors import InputError, UnreadableFrame

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_THUMBNAIL_PX = 640

_JPEG_QUALITY = 72

_PREVIEW_PX = 420

_PREVIEW_HALF_FIELD_RAD = np.deg2rad(40.0)

_UNSEEN_GREY = 110


def read_of_size(path: Path, size_px: tuple[int, int]) -> Grey | None:
    """Return a picture's luma (H, W), or None if it is not there, not whole or of another size."""
    try:
        grey = read_grey(path)
    except (InputError, UnreadableFrame):
        return None
    return grey if grey.shape == size_px[::-1] else None


def view_svg(evidence: Evidence, view: int, grey: Grey | None) -> str:
    """Return a view's picture under the board as projected, its corners as found over both."""
    width, height = evidence.calibration.image_size_px
    record = evidence.record.views[view]
    radius = _radius_px(evidence, view)
    if grey is None:
        ground = f'<rect width="{width}" height="{height}" fill="#484f58"/>'
    else:
        ground = f'<image width="{width}" height="{height}" href="{_jpeg_uri(_shrunk(grey))}"/>'
    label = html.escape(f"{record.name}: the board as found and as the lens projects it")
    # A pixel's centre has whole numbers, its left edge half a pixel less.
    return (
        f'<svg role="img" aria-label="{label}" viewBox="0 0 {width} {height}" '
        f'class="view">{ground}<g transform="translate(.5 .5)">'
        f'<path class="board" d="{_board_path(evidence, view)}"/>'
        f'<path class="projected" d="{_crosses(evidence, view, radius)}"/>'
        f'<path class="found" d="{_circles(record, radius, kept=True)}"/>'
        f'<path class="wrong" d="{_circles(record, 1.6 * radius, kept=False)}"/></g></svg>'
    )


def _radius_px(evidence: Evidence, view: int) -> float:
    """Return the radius of a mark: to be seen in a small picture, and clear of its neighbours."""
    columns, rows = evidence.record.board.grid
    along = np.diff(evidence.boards_px[view].reshape(rows, columns, 2), axis=1)
    steps = np.hypot(along[..., 0], along[..., 1])
    steps = steps[np.isfinite(steps)]
    widest = evidence.calibration.image_size_px[0] / 110
    return float(min(widest, np.median(steps) / 3)) if len(steps) else widest


def _board_path(evidence: Evidence, view: int) -> str:
    """Return the rows and columns of a view's board as the lens sees them."""
    columns, rows = evidence.record.board.grid
    points = evidence.boards_px[view].reshape(rows, columns, 2)
    lines = [*points, *points.swapaxes(0, 1)]
    whole = [line for line in lines if np.isfinite(line).all()]
    return " ".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in line) for line in whole)


def _crosses(evidence: Evidence, view: int, radius: float) -> str:
    part = evidence.corners.of_view(view)
    projected = evidence.corners.pixels[part] + evidence.residuals_px[part]
    return " ".join(
        f"M{x - radius:.1f} {y:.2f}h{2 * radius:.1f}M{x:.2f} {y - radius:.1f}v{2 * radius:.1f}"
        for x, y in projected[np.isfinite(projected).all(axis=-1)]
    )


def _circles(record: ViewRecord, radius: float, *, kept: bool) -> str:
    arc = f"a{radius:.1f} {radius:.1f} 0 1 0"
    return " ".join(
        f"M{x - radius:.2f} {y:.2f}{arc} {2 * radius:.1f} 0{arc} {-2 * radius:.1f} 0"
        for (x, y), each in zip(record.corners_px, record.kept, strict=True)
        if each == kept
    )


def thumbnail_uri(grey: Grey) -> str:
    """Return a small picture as a data URI."""
    return _jpeg_uri(_shrunk(grey))


def preview_uris(grey: Grey, calibration: Calibration) -> Mapping[str, str]:
    """Return straight views, 80° wide, to the left, ahead and to the right, as data URIs.

    As a lens without distortion would show them: what is straight must look straight. Grey is what
    the calibration does not see. A lens that does not see far to the side shows ahead alone.
    """
    side = calibration.valid_angle_rad - _PREVIEW_HALF_FIELD_RAD
    half = min(_PREVIEW_HALF_FIELD_RAD, calibration.valid_angle_rad)
    turns = {"to the left": -side, "ahead": 0.0, "to the right": side}
    if side < _PREVIEW_HALF_FIELD_RAD / 2:
        turns = {"ahead": 0.0}
    return {
        name: _jpeg_uri(_straight(grey, calibration, turn, half)) for name, turn in turns.items()
    }


def _straight(grey: Grey, calibration: Calibration, turn_rad: float, half_rad: float) -> Grey:
    """Return a perspective view (S, S) turned about the camera's y axis, to the right above 0."""
    steps = np.tan(half_rad) * np.linspace(-1.0, 1.0, _PREVIEW_PX)
    x, y = np.meshgrid(steps, steps)
    sine, cosine = np.sin(turn_rad), np.cos(turn_rad)
    rays = np.stack([cosine * x + sine, y, cosine - sine * x], axis=-1)
    pixels, seen = calibration.project(rays @ calibration.R_world_camera.T)
    at = np.where(seen[..., None], pixels, -2.0).astype(np.float32)
    straight = cv2.remap(grey, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    return np.where(seen, straight, np.uint8(_UNSEEN_GREY)).astype(np.uint8)


def _shrunk(grey: Grey) -> Grey:
    scale = min(_THUMBNAIL_PX / grey.shape[1], 1.0)
    size = (max(round(grey.shape[1] * scale), 1), max(round(grey.shape[0] * scale), 1))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)


def _jpeg_uri(grey: Grey) -> str:
    _, encoded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode()
