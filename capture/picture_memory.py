"""Memory for picture after picture, so that a stream of them takes no fresh pages.

A fresh page is cleared by the system when it is first written to, which takes as long as much of
the merge itself. Pictures are read-only and may be kept by anyone for as long as they like, so
memory is given out again only once nothing refers to what it was given out as.
"""

import weakref
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_KEPT = 2
"""Pieces of memory kept: one to be written to while the picture before it is still looked at."""


class PictureArrays(NamedTuple):
    """Arrays of a RadianceImage, to be filled."""

    radiance: NDArray[np.float32]
    variance: NDArray[np.float32]
    valid: NDArray[np.bool_]
    clipped: NDArray[np.bool_]


class PictureMemory:
    """Gives out arrays for pictures; not for use by several threads at once."""

    def __init__(self) -> None:
        self._pieces: list[tuple[NDArray[np.uint8], weakref.ref[NDArray[np.uint8]]]] = []

    def arrays(self, size_px: tuple[int, int]) -> PictureArrays:
        """Return arrays of undefined content for a picture of (width, height).

        They are the caller's until it and all it gave them to, views included, have let go of them.
        """
        width, height = size_px
        pixels = width * height
        handle = self._handle(26 * pixels)
        ends = np.array([12, 24, 25, 26]) * pixels
        radiance, variance, valid, clipped, _ = np.split(handle, ends)
        return PictureArrays(
            radiance.view(np.float32).reshape(height, width, 3),
            variance.view(np.float32).reshape(height, width, 3),
            valid.view(np.bool_).reshape(height, width),
            clipped.view(np.bool_).reshape(height, width),
        )

    def _handle(self, size_bytes: int) -> NDArray[np.uint8]:
        """Return an array over memory that is free; its views live on it, and so on this."""
        self._pieces = [piece for piece in self._pieces if len(piece[0]) == size_bytes]
        free = [index for index, (_, handle) in enumerate(self._pieces) if handle() is None]
        memory = self._pieces.pop(free[0])[0] if free else np.empty(size_bytes, np.uint8)
        # Through a memoryview, so that the views' base is this handle and not the memory itself.
        handle = np.frombuffer(memory.data, np.uint8)
        self._pieces = [*self._pieces, (memory, weakref.ref(handle))][-_KEPT:]
        return handle
