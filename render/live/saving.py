"""What is saved of a moment when somebody asks: numbered files in one folder.

Input  : what was seen, and a request.    Output : files that never replace one another.
"""

import traceback
from collections.abc import Callable
from pathlib import Path

from capture.errors import FishlightError
from lighting.export.files import write_scene
from lighting.export.rig import light_rig
from lighting.light_files import write_lights
from lighting.maps.environment_files import write_environment
from render.live.desk import Desk, Request, Seen
from render.output.pictures import write_picture

Say = Callable[[str], None]
"""Told what becomes of requests, for the terminal: nobody may be watching."""


def answer(desk: Desk, say: Say, request: str, do: Callable[[], str]) -> None:
    """Tell what `do` returns, or why it could not be done.

    Called on threads whose errors nobody hears, so a defect is told as well.
    """
    try:
        text, is_error = do(), False
    except (FishlightError, OSError) as error:
        text, is_error = f"{request}: {error}", True
    except Exception:
        traceback.print_exc()
        text, is_error = f"{request}: failed by a defect of fishlight; see the terminal", True
    desk.answer(text, is_error=is_error)
    say(text)


def save(folder: Path, request: Request, seen: Seen) -> str:
    """Write a snapshot or an export, and return a line that says where.

    Raises
    ------
    FishlightError, OSError
        If it cannot be written.
    """
    if request == "snapshot":
        return _snapshot(folder, seen)
    path = free_place(folder, "lights", f".{request.removeprefix('export-')}")
    write_scene(path, light_rig(seen.lights, seen.environment))
    return f"Exported {path}"


def free_place(folder: Path, kind: str, suffix: str) -> Path:
    """Return the first of kind-0001, kind-0002, … that is not there; make the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    number = 1
    while any(folder.glob(f"{kind}-{number:04d}*")):
        number += 1
    return folder / f"{kind}-{number:04d}{suffix}"


def _snapshot(folder: Path, seen: Seen) -> str:
    """Write the lights, and the map and picture if there are any."""
    path = free_place(folder, "snapshot", ".json")
    write_lights(path, seen.lights)
    written = [path.name]
    if seen.environment is not None:
        write_environment(path.with_suffix(".exr"), seen.environment)
        written.append(path.with_suffix(".exr").name)
    if seen.picture is not None:
        write_picture(path.with_suffix(".png"), seen.picture, seen.view_ev)
        written.append(path.with_suffix(".png").name)
    return f"Saved {', '.join(written)} in {folder}"
