"""A table of lights over time: one row for each frame, in SQLite, for this program and any other.

Input  : FrameRow, or a table that was written before.    Output : rows, in order of time.
The table is called `frames`; pandas (`read_sql`), DuckDB (`sqlite_scan`) and the sqlite3 command
read it as it is. A frame that is written again replaces its row.
Cost   : 10 µs a row, written run by run in one transaction each.
Fails  : SQLite's locks do not work on every network disk; one process writes, and only it.
"""

import sqlite3
from collections.abc import Iterable
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import luminance

SCHEMA_VERSION = 1
"""In the file's user_version."""


class FrameRow(msgspec.Struct, frozen=True, kw_only=True):
    """What one frame came to. None is what was not asked for, or is not there.

    Attributes
    ----------
    recording : str
        Name of the recording's results.
    bracket : int
        Number of the frame in its recording.
    time_s : float
        When it began, by the recording's clock.
    exposure_count : int
    shortest_s, longest_s : float
        Exposure times.
    clipped_share : float or None
        Part of the pixels that were full in every exposure.
    total_irradiance : float or None
        Luminance of ∫ L dω over all directions, of lights and fill.
    sun_x, sun_y, sun_z : float or None
        Unit vector toward the strongest key light, in the world frame; None without a key light.
    sun_power : float or None
        Luminance of its irradiance.
    light_count : int or None
    predicted_error : float or None
        As in LightSet.
    scale : str or None
        Scale of the radiance.
    radiance_file, map_file, lights_file, preview_file : str or None
        Relative to the table's folder.
    failure : str or None
        Why there is nothing else.
    """

    recording: str
    bracket: int
    time_s: float
    exposure_count: int
    shortest_s: float
    longest_s: float
    clipped_share: float | None = None
    total_irradiance: float | None = None
    sun_x: float | None = None
    sun_y: float | None = None
    sun_z: float | None = None
    sun_power: float | None = None
    light_count: int | None = None
    predicted_error: float | None = None
    scale: str | None = None
    radiance_file: str | None = None
    map_file: str | None = None
    lights_file: str | None = None
    preview_file: str | None = None
    failure: str | None = None


_SQL_TYPES = {str: "TEXT", int: "INTEGER", float: "REAL"}
_COLUMNS = {
    field.name: _SQL_TYPES[getattr(field.type, "__args__", (field.type,))[0]]
    for field in msgspec.structs.fields(FrameRow)
}


def light_columns(lights: LightSet) -> dict[str, Any]:
    """Return the columns of a row that tell of its lights."""
    columns = {
        "total_irradiance": float(luminance(lights.integral())),
        "light_count": int(np.count_nonzero(lights.irradiance.any(axis=1))),
        "predicted_error": lights.predicted_error,
        "scale": lights.scale,
    }
    power = np.where(lights.is_key, luminance(lights.irradiance), 0.0)
    if power.any():
        sun = int(power.argmax())
        columns |= dict(
            zip(("sun_x", "sun_y", "sun_z"), lights.directions[sun].tolist(), strict=True)
        )
        columns["sun_power"] = float(power[sun])
    return columns


class SequenceTable:
    """A table that is open for writing; a context manager.

    Raises InputError if the file is something else, or cannot be written (no space, locked).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with _told(path):
            self._connection = sqlite3.connect(path, isolation_level=None)
        try:
            with _told(path):
                _check_version(self._connection, path, new=True)
                columns = ", ".join(f"{name} {kind}" for name, kind in _COLUMNS.items())
                self._connection.execute(
                    f"CREATE TABLE IF NOT EXISTS frames ({columns}, "
                    "PRIMARY KEY (recording, bracket))"
                )
                self._connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        except BaseException:
            self._connection.close()
            raise

    def __enter__(self) -> "SequenceTable":
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def put(self, rows: Iterable[FrameRow]) -> None:
        """Write rows, all or none of them."""
        places = ", ".join("?" * len(_COLUMNS))
        with _told(self._path):
            self._connection.execute("BEGIN")
            try:
                self._connection.executemany(
                    f"INSERT OR REPLACE INTO frames VALUES ({places})",
                    map(msgspec.structs.astuple, rows),
                )
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise


def read_sequence_table(path: Path) -> list[FrameRow]:
    """Return all rows, by recording and within each by time.

    Raises
    ------
    InputError
        If there is no such file, or it is no table of lights.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such table; `fishlight batch` writes one, index.sqlite")
    with (
        _told(path),
        closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection,
    ):
        _check_version(connection, path)
        found = connection.execute(
            f"SELECT {', '.join(_COLUMNS)} FROM frames ORDER BY recording, time_s, bracket"
        )
        try:
            return msgspec.convert(
                [dict(zip(_COLUMNS, row, strict=True)) for row in found], list[FrameRow]
            )
        except msgspec.ValidationError as error:
            raise InputError(f"{path}: {error}") from None


def _check_version(connection: sqlite3.Connection, path: Path, *, new: bool = False) -> None:
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if version != SCHEMA_VERSION and not (new and not version and not tables):
        raise InputError(
            f"{path}: wanted a table of lights of version {SCHEMA_VERSION}, found {version}"
        )


@contextmanager
def _told(path: Path) -> Any:
    """Tell what SQLite has to say as a line about the file."""
    try:
        yield
    except sqlite3.Error as error:
        raise InputError(f"{path}: {error}") from error
