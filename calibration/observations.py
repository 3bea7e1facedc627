"""What was seen of a board in one picture: its points by number, in pixels, and how surely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.arrays import read_only


@dataclass(frozen=True, eq=False)
class View:
    """The points of a board that were found in one picture, n of them.

    Attributes
    ----------
    name : str
        Of the picture, for people.
    size_px : (int, int)
        Its width and height.
    point_ids : (n,) int64
        Which of `Board.points_m()`, each at most once, rising.
    corners_px : (n, 2) float64
        Where they are, (x, y), integers at pixel centres.
    corner_sigma_px : (n,) float64
        Standard deviation of either coordinate, as estimated from the picture around the corner.
    """

    name: str
    size_px: tuple[int, int]
    point_ids: NDArray[np.int64]
    corners_px: NDArray[np.float64]
    corner_sigma_px: NDArray[np.float64]

    def __post_init__(self) -> None:
        count = len(self.point_ids)
        shapes: dict[str, tuple[type, tuple[int, ...]]] = {
            "point_ids": (np.int64, (count,)),
            "corners_px": (np.float64, (count, 2)),
            "corner_sigma_px": (np.float64, (count,)),
        }
        for name, (dtype, shape) in shapes.items():
            object.__setattr__(self, name, read_only(name, getattr(self, name), dtype, shape))
        if np.any(np.diff(self.point_ids) <= 0):
            raise ValueError(f"{self.name}: point_ids must rise")
        if not np.all(np.isfinite(self.corners_px)) or not np.all(self.corner_sigma_px > 0):
            raise ValueError(f"{self.name}: corners must be finite and their sigma positive")

    def __len__(self) -> int:
        return len(self.point_ids)


@dataclass(frozen=True)
class Rejected:
    """A picture that gives no view, and why, in words that name what to do about it.

    `seen_grid` tells how many columns and rows of corners a checkerboard of another size has.
    """

    name: str
    reason: str
    seen_grid: tuple[int, int] | None = None
