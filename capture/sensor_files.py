"""A camera's sensor in a file of its own, as `fishlight calibrate response` writes it.

Input  : JSON of schema "fishlight-response/1", whose `sensor` is as in a recording's manifest.
Output : Sensor. What else the file says of how the response was found is for people.
"""

from pathlib import Path

import msgspec

from capture.errors import InputError
from capture.files import read_bytes
from capture.manifest import SensorRecord, sensor_of
from capture.sensor import Sensor

SCHEMA = "fishlight-response/1"

_MAX_BYTES = 2**24


class _Schema(msgspec.Struct):
    schema: str


class _SensorFile(msgspec.Struct):
    sensor: SensorRecord


def read_sensor(path: Path) -> Sensor:
    """Return the sensor of a response file.

    Raises
    ------
    InputError
        If the file does not exist, is of another schema, or its sensor contradicts itself.
    UnreadableFrame
        If it is empty or larger than 16 MiB.
    """
    data = read_bytes(path, _MAX_BYTES)
    try:
        schema = msgspec.json.decode(data, type=_Schema).schema
        if schema != SCHEMA:
            raise InputError(
                f"schema is {schema!r}, and {SCHEMA!r} is wanted, which `fishlight calibrate "
                "response` writes"
            )
        return sensor_of(msgspec.json.decode(data, type=_SensorFile).sensor)
    except (msgspec.MsgspecError, RecursionError, InputError) as error:
        raise InputError(f"{path}: {error}") from None
