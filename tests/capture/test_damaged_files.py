"""One contract for every reader: any bytes end in a picture or in an InputError, soon."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from capture.errors import InputError
from capture.exif import Exif, read_exif
from capture.exr import read_exr
from capture.pictures import picture_size, read_picture
from capture.radiance_files import read_radiance, write_hdr

COLOURS = np.random.default_rng(1).integers(0, 256, (24, 32, 3), dtype=np.uint8)
RGB = (COLOURS / 64).astype(np.float32)
TIFF = cv2.imencode(".tif", COLOURS)[1].tobytes()


@dataclass(frozen=True)
class Damage:
    """What happened to a file: bytes changed, then its end lost or strange bytes added."""

    changes: list[tuple[float, int]]
    kept: float
    tail: bytes

    def apply(self, content: bytes) -> bytes:
        damaged = bytearray(content)
        for where, value in self.changes:
            damaged[int(where * (len(damaged) - 1))] ^= value
        return bytes(damaged[: int(self.kept * len(damaged))]) + self.tail


# Half of the changes fall where formats keep their headers.
places = st.floats(0, 1) | st.floats(0, 0.05)
damages = st.builds(
    Damage,
    changes=st.lists(st.tuples(places, st.integers(1, 255)), max_size=4),
    kept=st.just(1.0) | st.floats(0, 1),
    tail=st.just(b"") | st.binary(max_size=8),
)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("originals")
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({33434: 0.01, 36867: "2024:06:01 12:00:00"})
    Image.fromarray(COLOURS).save(folder / "a.jpg", exif=exif)
    Image.fromarray(COLOURS).save(folder / "a.png")
    (folder / "a.tif").write_bytes(TIFF)
    write_hdr(folder / "a.exr", RGB, valid=RGB[..., 0] > 1)
    write_hdr(folder / "a.hdr", RGB)
    return {path.suffix: path.read_bytes() for path in folder.iterdir()}


def check(
    folder: Path, suffix: str, content: bytes, readers: tuple[Callable[[Path], object], ...]
) -> None:
    path = folder / f"damaged{suffix}"
    path.write_bytes(content)
    for reader in readers:
        try:
            reader(path)
        except InputError as error:
            message = str(error)
        else:
            continue
        assert str(path) in message
        assert len(message.splitlines()) == 1


@pytest.mark.parametrize(
    ("suffix", "readers"),
    [
        (".jpg", (read_picture, picture_size)),
        (".png", (read_picture, picture_size)),
        (".tif", (read_picture, picture_size)),
        (".exr", (read_exr, read_radiance)),
        (".hdr", (read_radiance,)),
    ],
)
def test_damaged_file_is_a_picture_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory,
    originals: dict[str, bytes],
    suffix: str,
    readers: tuple[Callable[[Path], object], ...],
) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    check(folder, suffix, originals[suffix], readers)  # compiles, which is not a reader's time

    @settings(max_examples=150, deadline=5000)
    @given(damage=damages)
    def holds(damage: Damage) -> None:
        check(folder, suffix, damage.apply(originals[suffix]), readers)

    holds()


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".exr"])
def test_damaged_file_has_exif_or_none(
    tmp_path_factory: pytest.TempPathFactory, originals: dict[str, bytes], suffix: str
) -> None:
    path = tmp_path_factory.mktemp("damaged") / f"damaged{suffix}"

    @settings(max_examples=100, deadline=5000)
    @given(damage=damages)
    def holds(damage: Damage) -> None:
        path.write_bytes(damage.apply(originals[suffix]) or b"\0")
        assert isinstance(read_exif(path), Exif)

    holds()
