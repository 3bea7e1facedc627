"""Video files: frames in R, G, B with their times.

Input  : any file that FFmpeg decodes.    Output : VideoFrame, in order of presentation.
Fails  : a video is coded for viewing. Its range is short, its exposure may wander, and colour is
         subsampled; radiance made from it is as good as the assumed sRGB response.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.video.reformatter import Colorspace, ColorTrc
from numpy.typing import NDArray

from capture.errors import InputError, UnreadableFrame
from capture.files import check_file, check_size

VIDEO_SUFFIXES = frozenset(
    (".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".gif", ".y4m")
)

MAX_FRAMES = 100_000
"""Longest video that is read: 55 minutes at 30 frames a second."""

_HD_HEIGHT_PX = 720
_MATRIX_UNSPECIFIED = 2  # AVCOL_SPC_UNSPECIFIED, which PyAV's enumeration lacks
_HDR_TRANSFERS: dict[int, str] = {ColorTrc.SMPTE2084: "PQ", ColorTrc.ARIB_STD_B67: "HLG"}


@dataclass(frozen=True)
class VideoFrame:
    """One decoded frame.

    Attributes
    ----------
    counts : (H, W, 3) uint8
    timestamp_s : float
        Presentation time from the first frame on.
    index : int
        Number among all frames, so that one that could not be decoded leaves a gap.
    """

    counts: NDArray[np.uint8]
    timestamp_s: float
    index: int


def read_video(path: Path) -> Iterator[VideoFrame]:
    """Yield the frames of a video's first picture stream.

    A frame that is damaged is left out, and its number with it. Where the file does not name its
    colour matrix it is BT.709 from 720 rows on and BT.601 below, as players take it.

    Raises
    ------
    UnreadableFrame
        If the file is not a video, or none of its frames can be decoded.
    InputError
        If it does not exist, is longer than MAX_FRAMES, changes its size, or is coded for HDR
        displays (PQ, HLG).
    """
    check_file(path)
    try:
        # Playlists name further files and addresses: without a protocol only this file is read.
        with (
            path.open("rb") as file,
            av.open(file, "r", options={"protocol_whitelist": "none"}) as container,
        ):
            if not container.streams.video:
                raise UnreadableFrame(f"{path}: holds no picture stream")
            yield from _frames(path, container)
    except av.error.FFmpegError as error:
        raise UnreadableFrame(f"{path}: not a readable video ({error.strerror})") from None


def _frames(path: Path, container: av.container.InputContainer) -> Iterator[VideoFrame]:
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    width_px, height_px = stream.codec_context.width, stream.codec_context.height
    check_size(path, width_px, height_px)
    step_s = float(1 / stream.average_rate) if stream.average_rate else 0.0
    index, start_s, timestamp_s = 0, None, -step_s
    decoded_count = 0
    for packet in container.demux(stream):
        try:
            frames = packet.decode()
        except av.error.InvalidDataError:
            index += 1
            continue
        for frame in frames:
            if index >= MAX_FRAMES:
                raise InputError(f"{path}: more than {MAX_FRAMES} frames; cut the video")
            index += 1
            timestamp_s = timestamp_s + step_s if frame.time is None else frame.time
            start_s = timestamp_s if start_s is None else start_s
            if frame.is_corrupt:
                continue
            if (frame.width, frame.height) != (width_px, height_px):
                raise InputError(
                    f"{path}: frame {index - 1} has {frame.width}×{frame.height} px, the "
                    f"first {width_px}×{height_px}; cut the video there"
                )
            decoded_count += 1
            yield VideoFrame(_counts(path, frame), timestamp_s - start_s, index - 1)
    if not decoded_count:
        raise UnreadableFrame(f"{path}: none of its frames can be decoded")


def _counts(path: Path, frame: av.VideoFrame) -> NDArray[np.uint8]:
    if frame.color_trc in _HDR_TRANSFERS:
        raise InputError(
            f"{path}: coded for HDR displays ({_HDR_TRANSFERS[frame.color_trc]}), which is not "
            "supported; convert it to BT.709 first"
        )
    unnamed = frame.colorspace == _MATRIX_UNSPECIFIED and frame.height >= _HD_HEIGHT_PX
    matrix = Colorspace.ITU709 if unnamed else None
    return frame.to_ndarray(format="rgb24", src_colorspace=matrix).astype(np.uint8, copy=False)
