"""Where the sun stands at a moment and place, in the world of a camera that knows north.

Domain : the years in which PyEphem's time scales hold, 1900 to 2100 at least. World: +Y up,
+X east, −Z north.
Source : PyEphem, which computes with the planetary theory VSOP87. It differs from the U.S. National
Renewable Energy Laboratory's Solar Position Algorithm, as pvlib has it, by 0.7″ at most.
Fails  : below 5° above the horizon the air bends light by more or less than the 1010 hPa and 15 °C
of here explain, by an arc-minute and more.
"""

import ephem
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_UNIX_EPOCH_DAY = 25567.5
"""1970-01-01 in PyEphem's days since 1899-12-31 12:00 UTC."""

SUN_RATE_RAD_PER_S = 2 * np.pi / 86400
"""How fast the sun goes round the pole, in the mean of the year."""


def sun_directions(timestamps_s: Array, latitude_rad: float, longitude_rad: float) -> Array:
    """Return world unit vectors (N, 3) toward the sun's middle as it is seen through the air.

    At timestamps (N,) since 1970-01-01 UTC, at a place whose longitude counts eastward.
    """
    observer = ephem.Observer()
    observer.lat, observer.lon = latitude_rad, longitude_rad
    sun = ephem.Sun()
    directions = np.empty((len(timestamps_s), 3))
    for row, timestamp_s in zip(directions, timestamps_s, strict=True):
        observer.date = timestamp_s / 86400 + _UNIX_EPOCH_DAY
        sun.compute(observer)
        level = np.cos(sun.alt)
        row[:] = level * np.sin(sun.az), np.sin(sun.alt), -level * np.cos(sun.az)
    return directions


def celestial_pole(latitude_rad: float) -> Array:
    """Return the world direction (3,) of the north pole of the sky."""
    return np.array([0.0, np.sin(latitude_rad), -np.cos(latitude_rad)])
