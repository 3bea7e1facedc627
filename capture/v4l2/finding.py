"""Finds a camera by its path, its id, its name or its number.

Input  : what a user calls the camera.    Output : the path of its device node.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from capture.errors import FishlightError, InputError
from capture.v4l2.node import VideoNode

_DEVICES = Path("/dev")
_CARD_BYTES = 31  # of a name that the kernel keeps, without the zero that ends it


@dataclass(frozen=True)
class FoundCamera:
    """A device that captures pictures; `id_path`, where udev gives one, outlives unplugging."""

    path: Path
    card: str
    id_path: Path | None = None

    def __str__(self) -> str:
        also = f", {self.id_path}" if self.id_path else ""
        return f"{self.path} ({self.card}{also})"


def find_camera(device: str, devices: Path = _DEVICES) -> Path:
    """Return the device node that `device` means.

    In this order: a path, a number N for /dev/videoN, a link's name in /dev/v4l/by-id or by-path,
    a camera's own name, a part of it in either case. The kernel cuts names at 31 bytes, so what a
    longer one has beyond them is not compared.

    Raises
    ------
    InputError
        If it means none, or several; the cameras found are listed.
    """
    if not device:
        raise InputError(f"which camera? {_listing(devices)}")
    numbered = devices / f"video{device}"
    is_number = re.fullmatch("[0-9]+", device) is not None
    candidates = [numbered] if is_number else [Path(device), devices / device]
    candidates += [devices / "v4l" / folder / device for folder in ("by-id", "by-path")]
    for candidate in candidates:
        if candidate.is_char_device():
            return candidate
    cameras = list_cameras(devices)
    kept = device.encode()[:_CARD_BYTES].decode(errors="ignore")
    named = [camera for camera in cameras if camera.card == kept]
    if not named and not is_number:  # the 7 of /dev/video7 is no part of "HD 720p"
        named = [camera for camera in cameras if kept.casefold() in camera.card.casefold()]
    if len(named) == 1:
        return named[0].path
    if named:
        listed = "; ".join(map(str, named))
        raise InputError(f"several cameras are called {device!r}; name a path: {listed}")
    raise InputError(f"no camera {device}; {_listing(devices)}")


def list_cameras(devices: Path = _DEVICES) -> list[FoundCamera]:
    """Return the devices that capture pictures and may be opened, in order of their number."""
    nodes = [path for path in devices.glob("video*") if re.fullmatch("video[0-9]+", path.name)]
    ids = {link.resolve(): link for link in sorted((devices / "v4l" / "by-id").glob("*"))}
    found = []
    for path in sorted(nodes, key=lambda path: int(path.name.removeprefix("video"))):
        try:
            with VideoNode(path) as node:
                found.append(FoundCamera(path, node.card, ids.get(path.resolve())))
        except FishlightError:
            continue
    return found


def _listing(devices: Path) -> str:
    cameras = list_cameras(devices)
    if cameras:
        return "cameras found: " + "; ".join(map(str, cameras))
    if any(devices.glob("video[0-9]*")):
        return (
            f"none of {devices}/video* is a camera that may be opened (cameras belong to the "
            "group video)"
        )
    return f"there is no {devices}/video*: no camera is plugged in, or its driver is not loaded"
