"""Arrays inside frozen dataclasses: checked for shape, converted once, then read-only."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


def read_only(
    name: str, values: ArrayLike, dtype: DTypeLike, shape: tuple[int | None, ...]
) -> NDArray[Any]:
    """Return `values` as a read-only array of `dtype` whose shape matches `shape`.

    Parameters
    ----------
    name : str
        What the array is called in the error message.
    values : array_like
        Not copied when it has the right type already; the caller's own array stays writable.
    dtype : dtype_like
        Element type of the result.
    shape : tuple of (int or None)
        Wanted shape; None stands for any length.

    Raises
    ------
    ValueError
        If the shape does not match.
    """
    array = np.asarray(values, dtype=dtype).view()
    matches = array.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=False)
    )
    if not matches:
        wanted_text = ", ".join("any" if length is None else str(length) for length in shape)
        raise ValueError(f"{name} must have shape ({wanted_text}), got {array.shape}")
    array.flags.writeable = False
    return array
