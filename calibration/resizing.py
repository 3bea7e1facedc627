"""Lenses for pictures that were resized: what scales with the picture, and what does not."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


def same_shape(size_px: tuple[int, int], other_px: tuple[int, int]) -> bool:
    """Whether one size is the other times a factor, to the rounding of a side to whole pixels."""
    (width, height), (other_width, other_height) = size_px, other_px
    slack = max(width, height, other_width, other_height)
    return 2 * abs(width * other_height - height * other_width) <= slack


def scaled(lens: Any, scale: NDArray[np.float64]) -> Any:
    """Return a frozen dataclass whose fields in pixels hold for a picture scaled in x and y.

    A pixel's centre is half a pixel from its corner, which is what scales: (x + ½) s − ½.
    """
    changes: dict[str, object] = {}
    for name in (each.name for each in fields(lens) if each.name.endswith("_px")):
        value = np.asarray(getattr(lens, name))
        if name in ("centre_px", "principal_px"):
            changes[name] = tuple(((value + 0.5) * scale - 0.5).tolist())
        elif name == "focal_px":
            changes[name] = tuple((value * scale).tolist())
        else:  # a radius: its circle stays one to within the rounding of the picture's sides
            changes[name] = float(value * np.sqrt(scale.prod()))
    return replace(lens, **changes)
