"""The pictures of a board that a camera took, each looked at once.

Input  : JPEG, PNG or TIFF files of one camera, all of one size.
Output : for each a View or a Rejected, in their order.
Pixels are taken as they are stored, whatever the EXIF orientation says: a lens is fixed to its
sensor.
Cost   : 0.1 s a picture of one megapixel, on as many cores as there are.
"""

import os
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.board import Board
from calibration.detection import detect_board
from calibration.observations import Rejected, View
from capture.errors import InputError, UnreadableFrame
from capture.pictures import picture_size, read_picture
from capture.progress import progress

_LISTED = 6

_WHITE_QUANTILE = 0.999


def detect_views(paths: Sequence[Path], board: Board) -> list[View | Rejected]:
    """Return what each picture shows of the board.

    Raises
    ------
    InputError
        If the pictures are not all of one size, or more of them show a checkerboard of another
        size than one of the wanted.
    """
    _check_sizes(paths)

    def detect(path: Path) -> View | Rejected:
        try:
            return detect_board(read_grey(path), board, path.name)
        except UnreadableFrame as error:
            return Rejected(path.name, str(error))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(progress(pool.map(detect, paths), "looking for the board", len(paths)))
    _check_board(found, board)
    return found


def read_grey(path: Path) -> NDArray[np.uint8]:
    """Return the luma (H, W) of a picture; 16-bit counts are stretched to their brightest ones.

    Raises as `capture.pictures.read_picture` does.
    """
    grey = cv2.cvtColor(read_picture(path), cv2.COLOR_RGB2GRAY)
    if grey.dtype == np.uint8:
        return np.asarray(grey, np.uint8)
    white = max(float(np.quantile(grey, _WHITE_QUANTILE)), 1.0)
    return np.asarray(np.clip(np.rint(grey * (255.0 / white)), 0, 255), np.uint8)


def _check_sizes(paths: Sequence[Path]) -> None:
    sizes: dict[Path, tuple[int, int]] = {}
    for path in paths:
        try:
            sizes[path] = picture_size(path)
        except UnreadableFrame:  # told of when it is read
            continue
    if len(set(sizes.values())) < 2:
        return
    (width, height), count = Counter(sizes.values()).most_common(1)[0]
    odd = [(path, size) for path, size in sizes.items() if size != (width, height)]
    listed = ", ".join(f"{path.name} ({size[0]}×{size[1]})" for path, size in odd[:_LISTED])
    more = f" and {len(odd) - _LISTED} more" if len(odd) > _LISTED else ""
    turned = any(size == (height, width) for _, size in odd)
    advice = (
        "use them as the camera stored them, not turned"
        if turned
        else "calibrate each camera and picture size by itself"
    )
    raise InputError(
        f"{count} of {len(sizes)} pictures are {width}×{height} px, but not {listed}{more}: "
        f"leave these out, or {advice}"
    )


def _check_board(found: Sequence[View | Rejected], board: Board) -> None:
    rejected = [each for each in found if isinstance(each, Rejected)]
    others = Counter(each.seen_grid for each in rejected if each.seen_grid is not None)
    if not others:
        return
    (columns, rows), count = others.most_common(1)[0]
    if count > len(found) - len(rejected):
        raise InputError(
            f"{count} of {len(found)} pictures show a board of {columns}×{rows} inner corners, "
            f"not {board.columns}×{board.rows}: if that is the board, give --board {columns}x{rows}"
        )
