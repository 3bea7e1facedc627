"""The emulated camera's pictures, computed on the host: in the guest arithmetic is slow.

Input  : what scene_pictures.py wrote.    Output : bytes, without numpy.
"""

import json
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class PictureKey:
    """Which picture. `exposure` in units of 100 µs; `gain` doubles the signal with each step."""

    pixel_format: str
    exposure: int
    gain: int


class PictureBook:
    """The pictures of a folder, read in the guest without numpy."""

    def __init__(self, folder: Path) -> None:
        index = json.loads((folder / "pictures.json").read_text())
        self.size_px: tuple[int, int] = tuple(index["size_px"])
        self.formats: tuple[str, ...] = tuple(index["formats"])
        self.exposures: tuple[int, ...] = tuple(index["exposures"])
        self.gain_count: int = index["gain_count"]
        self.auto_exposure: int = index["auto_exposure"]
        self._places = {
            PictureKey(*key): [tuple(place) for place in places] for *key, places in index["places"]
        }
        self._data = (folder / "pictures.bin").read_bytes()

    def picture(self, key: PictureKey, number: int) -> bytearray:
        """Return frame `number`: the noise repeats only after a few frames."""
        places = self._places[key]
        start, length = places[number % len(places)]
        return bytearray(self._data[start : start + length])
