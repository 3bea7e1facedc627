"""What this machine has for fishlight, what is missing, and the line that mends it."""

import importlib.metadata
import sys
from dataclasses import dataclass
from pathlib import Path

from render.opengl.context import GlUnavailable, create_context, describe

OPENCV_DISTRIBUTIONS = (
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-python",
)
REINSTALL_OPENCV = (
    "pip uninstall -y "
    + " ".join(OPENCV_DISTRIBUTIONS)
    + " && pip install opencv-contrib-python-headless"
)
GROUP_REMEDY = "sudo usermod -aG video $USER, then log in again"


@dataclass(frozen=True)
class Finding:
    """One thing looked at: whether it is as needed, what was found, what to type otherwise."""

    subject: str
    is_good: bool
    found: str
    remedy: str = ""
    is_required: bool = True


def examine() -> list[Finding]:
    """Return the findings about Python, OpenCV, OpenGL and cameras, in that order."""
    return [_python(), _opencv(), _opengl(), _cameras(Path("/dev"))]


def _python() -> Finding:
    found = f"{sys.version.split()[0]} at {sys.executable}"
    return Finding("Python", sys.version_info >= (3, 11), found, "install Python 3.11 or later")


def _opencv() -> Finding:
    """OpenCV from one wheel, the contrib one.

    A second OpenCV wheel overwrites parts of the first: cv2.omnidir then still exists, empty.
    """
    import cv2

    installed = [name for name in OPENCV_DISTRIBUTIONS if _is_installed(name)]
    is_whole = hasattr(getattr(cv2, "omnidir", None), "calibrate")
    found = f"{cv2.__version__} from {', '.join(installed) or 'outside pip'}"
    found += ", contrib intact" if is_whole else ", contrib broken (cv2.omnidir is empty)"
    return Finding("OpenCV", is_whole and len(installed) <= 1, found, REINSTALL_OPENCV)


def _is_installed(distribution: str) -> bool:
    try:
        importlib.metadata.distribution(distribution)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _opengl() -> Finding:
    """OpenGL, without which `render` draws with rays, as all else does anyway."""
    try:
        context = create_context()
    except GlUnavailable as error:
        return Finding("OpenGL", False, "no context, so no shadow maps", str(error), False)
    try:
        return Finding("OpenGL", True, describe(context))
    finally:
        context.release()


def _cameras(devices: Path) -> Finding:
    """V4L2 video nodes; none is no fault, fishlight also replays recordings."""
    nodes = sorted(devices.glob("video*"))
    locked = [node for node in nodes if not _is_readable(node)]
    if locked:
        names = ", ".join(str(node) for node in locked)
        return Finding("Cameras", False, f"no permission for {names}", GROUP_REMEDY, False)
    return Finding("Cameras", True, ", ".join(map(str, nodes)) or "none", is_required=False)


def _is_readable(node: Path) -> bool:
    try:
        node.open("rb").close()
    except PermissionError:
        return False
    except OSError:
        return True  # busy or gone, but not locked
    return True
