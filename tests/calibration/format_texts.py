"""Texts in the formats of other programs, read as the files that they would be."""

from pathlib import Path

from calibration.formats import read_camera
from calibration.formats.foreign import ForeignCamera


def read_text(tmp_path: Path, text: str, camera: str = "") -> tuple[str, ForeignCamera]:
    path = tmp_path / "camera.txt"
    path.write_text(text)
    return read_camera(path, camera)
