"""What a recording holds, told to people: a list of facts and a sheet of thumbnails.

Input  : Recording.    Output : (name, value) lines, and an 8-bit picture.
Cost   : `examine` reads, checks and decodes every frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from capture.errors import UnreadableFrame
from capture.frame import Exposure, Frame
from capture.manifest import DeviceRecord
from capture.progress import progress
from capture.recording import Recording
from capture.sensor import Sensor, srgb_encode

LISTED_EXPOSURES = 8
LONG_INTERVAL = 1.5
"""Two brackets further apart than this many median intervals have a gap between them."""

MAX_ROWS, MAX_COLUMNS = 12, 16
_SHEET_WIDTH_PX, _SHEET_HEIGHT_PX = 1600, 2400
_MARGIN_PX, _LABEL_PX, _CAPTION_PX, _FONT_PX = 8, 96, 22, 15
_MAX_CELL_PX = 320
_BACKGROUND, _INK, _ALARM = (24, 24, 24), (230, 230, 230), (255, 120, 90)


@dataclass(frozen=True)
class Examination:
    """What came out when every frame was read.

    Attributes
    ----------
    failures : tuple of str
        One line for each bracket that cannot be read.
    clipped_share : float
        Share of pixels with a full channel in the shortest exposures; NaN if none was read.
    black_share : float
        Share of pixels without signal in the longest exposures; NaN if none was read.
    """

    failures: tuple[str, ...]
    clipped_share: float
    black_share: float


def examine(recording: Recording) -> Examination:
    """Read every frame, its digest included, and return what is wrong with them."""
    failures: list[str] = []
    clipped, black = [], []
    for bracket in progress(recording, "reading", len(recording)):
        if isinstance(bracket, UnreadableFrame):
            failures.append(str(bracket))
            continue
        frames = bracket.by_signal()
        clipped.append(clipped_share(frames[0], recording.sensor))
        black.append(black_share(frames[-1].counts, recording.sensor))
    return Examination(tuple(failures), _mean(clipped), _mean(black))


def clipped_share(frame: Frame, sensor: Sensor) -> float:
    """Share of the pixels of a frame that are full in a channel; of float counts, that it marks."""
    if frame.counts.dtype == np.float32:
        return 0.0 if frame.clipped is None else float(frame.clipped.mean())
    table = sensor.linear_table()
    full = [np.searchsorted(table[:, channel], sensor.saturation) for channel in range(3)]
    return float((frame.counts >= np.array(full)).any(axis=2).mean())


def black_share(counts: NDArray[Any], sensor: Sensor) -> float:
    """Share of the pixels of counts (H, W, 3) that are at or below black in every channel."""
    black = 0.0 if counts.dtype == np.float32 else sensor.black_dn
    return float((counts <= black).all(axis=2).mean())


def describe(recording: Recording, examination: Examination) -> list[tuple[str, str]]:
    """Return the facts about a recording as (name, value)."""
    manifest, sensor = recording.manifest, recording.sensor
    frame_count = len(manifest.frames)
    lengths = sorted({len(frames) for frames in recording.brackets})
    times_s = recording.bracket_timestamps_s
    width_px, height_px = recording.size_px
    return [
        ("camera", manifest.camera or "not told"),
        *_device_facts(manifest.device),
        ("sensor", f"black {sensor.black_dn:g}, white {sensor.white_dn:g}; {sensor.source}"),
        ("calibration", manifest.calibration or "none"),
        ("source", manifest.source or "not told"),
        ("licence", manifest.licence or "not told"),
        ("size", f"{width_px}×{height_px} px"),
        ("brackets", f"{len(recording)} of {' or '.join(map(str, lengths))} frames"),
        ("exposures", _exposures_text(recording)),
        ("duration", _duration_text(times_s)),
        ("gaps", _gaps_text(recording)),
        (
            "frames",
            f"{frame_count}, all read, digests right"
            if not examination.failures
            else f"{frame_count}; brackets that cannot be read: {len(examination.failures)}",
        ),
        ("clipped", f"{_share_text(examination.clipped_share)} of the shortest exposures' pixels"),
        ("black", f"{_share_text(examination.black_share)} of the longest exposures' pixels"),
    ]


def _device_facts(device: DeviceRecord | msgspec.UnsetType) -> list[tuple[str, str]]:
    """Return the facts about a live camera; none of a recording that has another source."""
    if isinstance(device, msgspec.UnsetType):
        return []
    driver = f"driver {device.driver}, " if device.driver else ""
    controls = "; ".join(f"{name} {value}" for name, value in device.controls.items())
    rate_hz = 1 / device.frame_interval_s
    return [
        ("device", f"{device.path}, {driver}{device.pixel_format}, {rate_hz:.3g} frames a second"),
        ("controls", controls or "not told"),
    ]


def exposure_text(exposure: Exposure) -> str:
    """Return an exposure as photographers write it, such as 1/250 s f/5.6 gain 4."""
    return " ".join(_exposure_parts(exposure))


def contact_sheet(recording: Recording) -> NDArray[np.uint8]:
    """Return thumbnails, (H, W, 3) R, G, B: a row per bracket, short exposures to the left.

    At most MAX_ROWS brackets and MAX_COLUMNS exposures are shown, evenly chosen, first and last
    among them. A bracket that cannot be read has an empty row that says so.
    """
    positions = _evenly(len(recording), MAX_ROWS)
    columns = min(max(len(recording.brackets[i]) for i in positions), MAX_COLUMNS)
    width_px, height_px = recording.size_px
    free_px = _SHEET_WIDTH_PX - _LABEL_PX - (columns + 1) * _MARGIN_PX
    cell_height = min(_MAX_CELL_PX, _SHEET_HEIGHT_PX // len(positions))
    cell_width = min(free_px // columns, _MAX_CELL_PX, cell_height * width_px // height_px)
    cell = (max(cell_width, 1), max(round(cell_width * height_px / width_px), 1))
    pitch = (cell[0] + _MARGIN_PX, cell[1] + _CAPTION_PX + _MARGIN_PX)
    sheet = Image.new(
        "RGB",
        (_LABEL_PX + columns * pitch[0] + _MARGIN_PX, len(positions) * pitch[1] + _MARGIN_PX),
        _BACKGROUND,
    )
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(_FONT_PX)
    for row, position in enumerate(progress(positions, "thumbnails")):
        top = _MARGIN_PX + row * pitch[1]
        start_s = recording.bracket_timestamps_s[position]
        draw.text((_MARGIN_PX, top), f"#{position}\n{start_s:.2f} s", _INK, font)
        try:
            frames = recording.read_bracket(position).by_signal()
        except UnreadableFrame:
            draw.text((_LABEL_PX + _MARGIN_PX, top), "cannot be read", _ALARM, font)
            continue
        for column, chosen in enumerate(_evenly(len(frames), columns)):
            left = _LABEL_PX + _MARGIN_PX + column * pitch[0]
            thumbnail = _thumbnail(frames[chosen].counts, recording.sensor, cell)
            sheet.paste(Image.fromarray(thumbnail), (left, top))
            caption = _caption(frames[chosen].exposure, cell[0], font)
            draw.text((left, top + cell[1] + 2), caption, _INK, font)
    return np.asarray(sheet)


def _thumbnail(counts: NDArray[Any], sensor: Sensor, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return counts at another size, sRGB-coded; of radiance the brightest percent is white."""
    enlarged = size_px[0] > counts.shape[1]
    method = cv2.INTER_NEAREST if enlarged else cv2.INTER_AREA
    small = cv2.resize(counts, size_px, interpolation=method)
    if counts.dtype == np.float32:
        finite = np.nan_to_num(small, nan=0.0, posinf=0.0, neginf=0.0)
        linear = finite / max(float(np.percentile(finite, 99)), 1e-30)
    else:
        linear = sensor.linear_table()[small, np.arange(3)]
        if sensor.colour_matrix is not None:
            linear = cv2.transform(linear, sensor.colour_matrix)
    return np.rint(255 * srgb_encode(np.clip(linear, 0, 1))).astype(np.uint8)


def _exposures_text(recording: Recording) -> str:
    records = {(frame.time_s, frame.gain, frame.f_number) for frame in recording.manifest.frames}
    exposures = sorted((Exposure(*record) for record in records), key=lambda each: each.signal)
    span_ev = math.log2(exposures[-1].signal / exposures[0].signal)
    if len(exposures) > LISTED_EXPOSURES:
        ends = f"{exposure_text(exposures[0])} to {exposure_text(exposures[-1])}"
        return f"{len(exposures)} from {ends} ({span_ev:.1f} EV)"
    return f"{', '.join(map(exposure_text, exposures))} ({span_ev:.1f} EV)"


def _share_text(share: float) -> str:
    return "an unknown share" if math.isnan(share) else f"{share:.3%}"


def _duration_text(times_s: Sequence[float]) -> str:
    duration_s = times_s[-1] - times_s[0]
    if duration_s == 0:
        return "0 s"
    return f"{duration_s:.3f} s, {(len(times_s) - 1) / duration_s:.3g} brackets a second"


def _gaps_text(recording: Recording) -> str:
    indices = [frame.index for frame in recording.manifest.frames]
    lost_count = indices[-1] + 1 - len(indices)
    intervals_s = np.diff(recording.bracket_timestamps_s)
    long_count = 0
    if len(intervals_s):
        long_count = int((intervals_s > LONG_INTERVAL * np.median(intervals_s)).sum())
    return (
        f"{lost_count} frames lost before they were written, {long_count} long intervals, "
        f"{int((intervals_s == 0).sum())} repeated and {recording.raised_timestamp_count} falling "
        "timestamps"
    )


def _evenly(count: int, most: int) -> list[int]:
    """Return at most `most` positions of `count`, evenly spread from the first to the last."""
    chosen = np.linspace(0, count - 1, min(count, most))
    return [int(position) for position in np.rint(chosen)]


def _exposure_parts(exposure: Exposure) -> list[str]:
    time_s = exposure.time_s
    # Four digits, and never an exponent.
    parts = [f"{time_s:.4g} s" if time_s > 0.3 else f"1/{float(f'{1 / time_s:.4g}'):.12g} s"]
    if exposure.f_number is not None:
        parts.append(f"f/{exposure.f_number:.3g}")
    if exposure.gain != 1:
        parts.append(f"gain {exposure.gain:.3g}")
    return parts


def _caption(exposure: Exposure, width_px: int, font: Any) -> str:
    """Return as much of an exposure's text as fits, without half a part."""
    parts = _exposure_parts(exposure)
    while parts and font.getlength(" ".join(parts)) > width_px:
        parts.pop()
    return " ".join(parts)


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan
