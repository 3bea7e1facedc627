"""What a simulated recording really saw: its folder truth/, with maps, discs and sensor.

truth.json holds, for each bracket, the map (a file in the lat-long grid of CONVENTIONS.md), its
brightness and yaw, and the discs in the world frame; and the sensor with its response.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from capture.files import read_bytes
from capture.manifest import SensorRecord, check_relative, sensor_of, sensor_record
from capture.output import write_json
from capture.sensor import Sensor
from lighting.maps.environment_files import read_environment, write_environment
from lighting.simulation.scenario import Disc, Moment

_SCHEMA = "fishlight-truth/1"
_FILE = "truth.json"
_Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Truth:
    """What was simulated: one moment for each bracket, seen by `sensor`."""

    moments: tuple[Moment, ...]
    sensor: Sensor


class _Disc(msgspec.Struct, frozen=True):
    name: str
    direction: _Triple
    angular_radius_rad: float
    irradiance: _Triple


class _Bracket(msgspec.Struct, frozen=True):
    timestamp_s: float
    map: str
    brightness: float
    yaw_rad: float
    discs: tuple[_Disc, ...]


class _Record(msgspec.Struct, frozen=True):
    schema: str
    sensor: SensorRecord
    brackets: tuple[_Bracket, ...]


def write_truth(folder: Path, moments: Sequence[Moment], sensor: Sensor) -> None:
    """Write the truth of a recording into a new folder; each map once, as float32 EXR."""
    folder.mkdir()
    names: dict[int, str] = {}
    brackets = []
    for moment in moments:
        name = names.get(id(moment.environment))
        if name is None:
            name = names[id(moment.environment)] = f"map-{len(names):04d}.exr"
            write_environment(folder / name, moment.environment)
        discs = tuple(
            _Disc(
                disc.name,
                _triple(disc.direction),
                float(disc.angular_radius_rad),
                _triple(disc.irradiance),
            )
            for disc in moment.discs
        )
        brackets.append(
            _Bracket(
                float(moment.timestamp_s),
                name,
                float(moment.brightness),
                float(moment.yaw_rad),
                discs,
            )
        )
    write_json(folder / _FILE, _Record(_SCHEMA, sensor_record(sensor), tuple(brackets)))


def read_truth(folder: Path) -> Truth:
    """Return what `write_truth` wrote.

    Raises
    ------
    InputError
        If a file is missing, or is not what it should be.
    """
    path = folder / _FILE
    try:
        record = msgspec.json.decode(read_bytes(path), type=_Record)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from None
    if record.schema != _SCHEMA:
        raise InputError(f"{path}: schema is {record.schema!r}, this fishlight reads {_SCHEMA!r}")
    maps = {}
    for name in {bracket.map for bracket in record.brackets}:
        check_relative(name)
        maps[name] = read_environment(folder / name)[0]
    moments = tuple(
        Moment(
            bracket.timestamp_s,
            maps[bracket.map],
            bracket.brightness,
            bracket.yaw_rad,
            tuple(
                Disc(
                    disc.name,
                    np.array(disc.direction),
                    disc.angular_radius_rad,
                    np.array(disc.irradiance),
                )
                for disc in bracket.discs
            ),
        )
        for bracket in record.brackets
    )
    return Truth(moments, sensor_of(record.sensor))


def _triple(values: NDArray[np.float64]) -> _Triple:
    x, y, z = values.tolist()
    return x, y, z
