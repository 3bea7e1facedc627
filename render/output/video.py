"""Video files for people: H.264 in MP4, as every browser and player shows it.

Input  : 8-bit sRGB pictures of one size.    Output : a file that appears when it is complete.
Fails  : colour is kept at half resolution (4:2:0); use the pictures to measure anything.
"""

from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc
from numpy.typing import NDArray

from capture.errors import InputError
from capture.output import replacing

_CONSTANT_RATE_FACTOR = 18  # no loss that one sees
_THREADS = 1  # with more, x264 does not promise the same bits twice


class VideoWriter:
    """Writes pictures to a video; a context manager, so that a failure leaves nothing behind.

    Parameters
    ----------
    path : Path
        Where the video appears, .mp4; an older one stays until then.
    size_px : (int, int)
        (width, height). H.264 counts in pairs, so an odd last column or row is repeated.
    rate_hz : float
        Pictures per second.
    """

    def __init__(self, path: Path, size_px: tuple[int, int], rate_hz: float) -> None:
        if not 0 < rate_hz < float("inf"):
            raise InputError(f"a video needs a positive frame rate, got {rate_hz}")
        self._path = path
        self._size_px = size_px
        self._rate = Fraction(rate_hz).limit_denominator(1001)
        self._open = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            partial = stack.enter_context(replacing(self._path))
            self._container = stack.enter_context(
                av.open(str(partial), "w", format="mp4", options={"movflags": "+faststart"})
            )
            self._stream = self._add_stream()
            self._open = stack.pop_all()
        self._started = False
        return self

    def _add_stream(self) -> av.VideoStream:
        stream = self._container.add_stream(
            "libx264",
            rate=self._rate,
            options={"crf": str(_CONSTANT_RATE_FACTOR), "threads": str(_THREADS)},
        )
        stream.width, stream.height = (length + length % 2 for length in self._size_px)
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.colorspace = Colorspace.ITU709
        context.color_range = ColorRange.MPEG
        context.color_primaries = ColorPrimaries.BT709
        context.color_trc = ColorTrc.IEC61966_2_1
        return stream

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture, (H, W, 3) uint8 R, G, B."""
        width, height = self._size_px
        if picture.shape != (height, width, 3):
            raise ValueError(f"the video takes ({height}, {width}, 3), got {picture.shape}")
        even = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        frame = av.VideoFrame.from_ndarray(even, format="rgb24")
        frame = frame.reformat(
            format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
        )
        self._container.mux(self._stream.encode(frame))
        self._started = True

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            self._open.__exit__(kind, error, traceback)
            return
        with self._open:
            if not self._started:
                raise InputError(f"{self._path}: a video needs at least one picture")
            self._container.mux(self._stream.encode())
