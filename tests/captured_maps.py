"""Captured maps in ../shared/data, a third of which is held out of tuning.

The third is told by file names alone: of the scenes in the order of their files, every third is
held out. Seven files show a scene that another shows too, smaller or packed otherwise; they are
left out, or what is tuned on one copy would be judged on the other. The margin and the probes of
an asked error (adaptive.SAFETY, prediction.PROBES_TO_MEASURE) are chosen without the held-out
third; constants whose docstrings name 33 or 34 maps are older, and were chosen with all in view.
"""

from pathlib import Path

from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment

DATA = Path(__file__).resolve().parents[1].parent / "shared/data"
_COPIES = (
    "env-pmndrs/lobby.exr",
    "env-pmndrs/night.exr",
    "env-pmndrs/park.exr",
    "env-pmndrs/studio.exr",
    "env-pmndrs/sunrise.exr",
    "env-pmndrs/warehouse.exr",
    "env-polyhaven-drei/venice_sunset_1k.hdr",
)
_LEAST_ROWS = 256


def captured_maps() -> dict[str, EnvironmentMap]:
    """Return the map of each scene by its file's name, in the order of these; none if absent."""
    maps = {}
    for path in sorted(DATA.glob("env-*/*")):
        name = f"{path.parent.name}/{path.name}"
        if path.suffix not in (".exr", ".hdr") or name in _COPIES:
            continue
        try:
            environment, _ = read_environment(path)
        except InputError:
            continue  # a cube, or a picture of something else
        if environment.height >= _LEAST_ROWS:
            maps[name] = environment
    return maps


def held_out(names: list[str]) -> list[str]:
    """Return every third of the names of `captured_maps`."""
    return names[2::3]
