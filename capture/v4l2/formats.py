"""What pictures a camera sends: pixel format, size and rate, listed and chosen.

Input  : VideoNode, and what is asked for.    Output : PictureFormat and frame interval, as the
driver gave them.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import TypeVar

from capture.errors import InputError
from capture.v4l2 import kernel
from capture.v4l2.node import VideoNode

_Query = TypeVar("_Query", kernel.FormatDescription, kernel.FrameSize, kernel.FrameInterval)

_RATE_TOLERANCE = 0.01  # drivers round intervals to 100 ns, users write 30 for 29.97


@dataclass(frozen=True)
class PictureFormat:
    """The format of every picture of a stream.

    Attributes
    ----------
    fourcc : str
        Four-character code of the pixel format.
    size_px : (int, int)
        (width, height).
    bytes_per_line : int
        From the start of a row to that of the next, padding included; 0 for compressed pictures.
    colorspace, ycbcr_enc, quantization, xfer_func : int
        The driver's numbers (V4L2_COLORSPACE_…, …); 0 leaves them to the colour space's default.
    """

    fourcc: str
    size_px: tuple[int, int]
    bytes_per_line: int
    colorspace: int = 0
    ycbcr_enc: int = 0
    quantization: int = 0
    xfer_func: int = 0


def list_pixel_formats(node: VideoNode) -> list[str]:
    """Return the four-character codes that a camera offers, in its own order."""
    answers = _enumerate(
        node, kernel.ENUMERATE_FORMATS, kernel.FormatDescription(type=kernel.VIDEO_CAPTURE)
    )
    return [kernel.fourcc_name(answer.pixelformat) for answer in answers]


def list_sizes(node: VideoNode, fourcc: str) -> list[str]:
    """Return the sizes that a camera offers in a format, for people: "640×480", or a range."""
    query = kernel.FrameSize(pixel_format=kernel.fourcc(fourcc))
    texts = []
    for answer in _enumerate(node, kernel.ENUMERATE_SIZES, query):
        values = answer.values
        if answer.type == kernel.DISCRETE:
            texts.append(f"{values[0]}×{values[1]}")
        else:
            texts.append(f"{values[0]}×{values[3]} to {values[1]}×{values[4]}")
            break
    return texts


def list_intervals(node: VideoNode, picture: PictureFormat) -> list[Fraction]:
    """Return the frame intervals in seconds that a camera offers; of a range, its shortest."""
    width, height = picture.size_px
    query = kernel.FrameInterval(
        pixel_format=kernel.fourcc(picture.fourcc), width=width, height=height
    )
    intervals = []
    for answer in _enumerate(node, kernel.ENUMERATE_INTERVALS, query):
        numerator, denominator = answer.values[0], answer.values[1]
        if numerator and denominator:
            intervals.append(Fraction(numerator, denominator))
        if answer.type != kernel.DISCRETE:
            break
    return intervals


def choose_format(
    node: VideoNode,
    fourcc: str | None,
    size_px: tuple[int, int] | None,
    supported: Collection[str],
) -> PictureFormat:
    """Set the format asked for and return what the driver gave.

    What is not asked for stays as the camera has it; if that is none of `supported`, the first of
    them that it offers is taken.

    Raises
    ------
    InputError
        If the camera does not offer what is asked for; what it does offer is listed.
    """
    offered = list_pixel_formats(node)
    current = _read_format(node)
    usable = [code for code in offered if code in supported]
    if fourcc is None:
        present = kernel.fourcc_name(current.pixelformat)
        fourcc = present if present in usable else next(iter(usable), None)
    if fourcc not in usable:
        wanted = f"pixel format {fourcc}" if fourcc else "a pixel format that is supported"
        raise InputError(
            f"{node.path} ({node.card}): wanted {wanted}; the camera offers {_join(offered)}, "
            f"of which {_join(usable)} can be used"
        )
    width, height = size_px or (current.width, current.height)
    current.pixelformat = kernel.fourcc(fourcc)
    current.width, current.height = width, height
    current.field = current.bytesperline = current.sizeimage = 0
    current.priv = current.flags = 0
    # Zero asks for the driver's own colours: it says which, and does not convert.
    current.colorspace = current.ycbcr_enc = current.quantization = current.xfer_func = 0
    try:
        node.call(kernel.SET_FORMAT, current, f"set {fourcc} {width}×{height}")
    except OSError as error:
        raise InputError(str(error.strerror)) from None
    given = PictureFormat(
        fourcc=kernel.fourcc_name(current.pixelformat),
        size_px=(current.width, current.height),
        bytes_per_line=current.bytesperline,
        colorspace=current.colorspace,
        ycbcr_enc=current.ycbcr_enc,
        quantization=current.quantization,
        xfer_func=current.xfer_func,
    )
    if given.fourcc != fourcc or (size_px is not None and given.size_px != size_px):
        raise InputError(
            f"{node.path} ({node.card}): wanted {fourcc} {width}×{height}, the driver gave "
            f"{given.fourcc} {current.width}×{current.height}; {fourcc} comes in "
            f"{_join(list_sizes(node, fourcc))}"
        )
    if given.bytes_per_line and (current.width % 2 or current.height % 2):
        raise InputError(
            f"{node.path} ({node.card}): {fourcc} {current.width}×{current.height} has an odd "
            "side, in which colours that pixels share do not come out even"
        )
    if current.field != kernel.FIELD_NONE:
        raise InputError(f"{node.path} ({node.card}): sends interlaced half pictures")
    return given


def choose_interval(node: VideoNode, picture: PictureFormat, rate_hz: float | None) -> float:
    """Set the frame rate asked for, or the highest there is, and return the interval in seconds.

    Raises
    ------
    InputError
        If the camera does not run at that rate; those it offers are listed.
    """
    if rate_hz is not None and not 0 < rate_hz < inf:
        raise InputError(f"a frame rate must be above 0, got {rate_hz}")
    offered = list_intervals(node, picture)
    parameters = kernel.StreamParameters(type=kernel.VIDEO_CAPTURE)
    purpose = "set its frame rate"
    try:
        node.call(kernel.GET_PARAMETERS, parameters, purpose)
        if rate_hz is not None:
            wanted = Fraction(1 / rate_hz).limit_denominator(10_000_000)
        else:
            wanted = min(offered, default=Fraction(0))
        if wanted and parameters.capability & kernel.HAS_FRAME_INTERVAL:
            parameters.numerator, parameters.denominator = wanted.as_integer_ratio()
            node.call(kernel.SET_PARAMETERS, parameters, purpose)
    except OSError as error:
        raise InputError(str(error.strerror)) from None
    if not (parameters.numerator and parameters.denominator):
        raise InputError(f"{node.path} ({node.card}): does not tell its frame rate")
    interval_s = parameters.numerator / parameters.denominator
    if rate_hz is not None and abs(interval_s * rate_hz - 1) > _RATE_TOLERANCE:
        rates = _join([f"{float(1 / interval):.4g}" for interval in offered])
        raise InputError(
            f"{node.path} ({node.card}): wanted {rate_hz:g} frames a second, the driver gave "
            f"{1 / interval_s:.4g}; {picture.fourcc} at this size comes at {rates}"
        )
    return interval_s


def _read_format(node: VideoNode) -> kernel.Format:
    answer = kernel.Format(type=kernel.VIDEO_CAPTURE)
    try:
        node.call(kernel.GET_FORMAT, answer, "read its format")
    except OSError as error:
        raise InputError(str(error.strerror)) from None
    return answer


def _enumerate(node: VideoNode, request: int, query: _Query) -> Iterator[_Query]:
    """Yield the driver's answers to a query; its index counts up until the driver has no more."""
    index = 0
    while True:
        answer = type(query).from_buffer_copy(query)
        answer.index = index
        try:
            node.call(request, answer, "list what it offers")
        except OSError:
            return
        yield answer
        index += 1


def _join(texts: Collection[str]) -> str:
    return ", ".join(texts) if texts else "nothing"
