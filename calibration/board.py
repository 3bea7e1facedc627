"""The flat pattern that a lens is calibrated with, and where its points lie.

Domain : metres in the board's own frame: the first point at the origin, +x along a row, +y down the
columns, +z into the board, away from who looks at its printed side.
"""

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError

Pattern = Literal["checkerboard", "charuco", "apriltag"]

_GRAMMAR = re.compile(
    r"(?:(?P<pattern>charuco|apriltag):)?(?P<columns>\d{1,3})[x×](?P<rows>\d{1,3})"
    r"(?::(?P<dictionary>\w+_\w+))?(?::(?P<ratio>\d*\.?\d+))?",
    re.IGNORECASE,
)

_WANTED = (
    "wanted inner corners along and down a checkerboard, such as 9x6, or "
    "charuco:SQUARESxSQUARES:DICTIONARY:MARKER/SQUARE, such as charuco:8x5:5X5_100:0.75, or "
    "apriltag:TAGSxTAGS:GAP/TAG, such as apriltag:6x6:0.3"
)


@dataclass(frozen=True)
class Board:
    """A board by its counts and lengths.

    Attributes
    ----------
    pattern : str
        "checkerboard", "charuco" or "apriltag" (Kalibr's aprilgrid of the family 36h11).
    columns, rows : int
        Inner corners of a checkerboard, squares of a ChArUco board, tags of a grid.
    square_m : float
        Side of a square; of a tag, black border included, in a grid.
    marker_ratio : float
        ChArUco alone: side of a marker over that of a square.
    gap_ratio : float
        Tag grid alone: width of the gap over the side of a tag, Kalibr's tagSpacing.
    dictionary : str
        ChArUco alone: name of the markers' dictionary without its "DICT_", such as "5X5_100".
    """

    pattern: Pattern
    columns: int
    rows: int
    square_m: float
    marker_ratio: float = 0.0
    gap_ratio: float = 0.0
    dictionary: str = ""

    def __post_init__(self) -> None:
        least = 1 if self.pattern == "apriltag" else 3
        if min(self.columns, self.rows) < least:
            raise InputError(
                f"a {self.pattern} board needs {least} or more columns and rows, "
                f"got {self.columns}x{self.rows}"
            )
        if not 0 < self.square_m < np.inf:
            raise InputError(f"the side of a square must be positive, got {self.square_m} m")
        if self.pattern == "charuco" and not 0 < self.marker_ratio < 1:
            raise InputError(f"marker over square must be in (0, 1), got {self.marker_ratio}")
        if self.pattern == "apriltag" and not 0 < self.gap_ratio < np.inf:
            raise InputError(f"gap over tag must be positive, got {self.gap_ratio}")

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points: two of each a tag."""
        extra = {"checkerboard": 0, "charuco": -1}
        if self.pattern == "apriltag":
            return 2 * self.columns, 2 * self.rows
        return self.columns + extra[self.pattern], self.rows + extra[self.pattern]

    def points_m(self) -> NDArray[np.float64]:
        """Return the board's points (N, 3), z = 0; a point's id is its place in this array.

        They run along the rows, the upper one first. In a grid of tags the corners of all tags
        share rows: the upper two of each of the upper tags, then their lower two, and so on. (Tag
        0 is the lower left one, as Kalibr prints it.)
        """
        columns, rows = self.grid
        along, down = np.arange(columns, dtype=np.float64), np.arange(rows, dtype=np.float64)
        if self.pattern == "apriltag":
            along, down = (i // 2 * (1 + self.gap_ratio) + i % 2 for i in (along, down))
        y, x = np.meshgrid(down, along, indexing="ij")
        return self.square_m * np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)


def parse_board(text: str, square_m: float) -> Board:
    """Return the board that a word such as 9x6, charuco:8x5:5X5_100:0.75 or apriltag:6x6:0.3 means.

    Raises
    ------
    InputError
        If the word is another, or its numbers make no board.
    """
    match = _GRAMMAR.fullmatch(text.strip())
    if match is None:
        raise InputError(f"board {text!r}: {_WANTED}")
    columns, rows = int(match["columns"]), int(match["rows"])
    dictionary, ratio = match["dictionary"], match["ratio"]
    pattern = (match["pattern"] or "checkerboard").lower()
    wants = {"checkerboard": (False, False), "charuco": (True, True), "apriltag": (False, True)}
    if (dictionary is not None, ratio is not None) != wants[pattern]:
        raise InputError(f"board {text!r}: {_WANTED}")
    try:
        if pattern == "charuco":
            name = dictionary.upper().removeprefix("DICT_")
            return Board("charuco", columns, rows, square_m, float(ratio), dictionary=name)
        if pattern == "apriltag":
            return Board("apriltag", columns, rows, square_m, gap_ratio=float(ratio))
        return Board("checkerboard", columns, rows, square_m)
    except InputError as error:
        raise InputError(f"board {text!r}: {error}") from None
