"""Estimated responses as files, and in the recordings that they were estimated from.

Output : JSON with the sensor as a recording's manifest holds it, and how well it was found; or the
         recording's manifest with that sensor.
"""

from pathlib import Path

import msgspec

from calibration.response import Response, sensor_with
from capture.manifest import SensorRecord, read_manifest, sensor_record, write_manifest
from capture.output import write_json
from capture.sensor import Sensor
from capture.sensor_files import SCHEMA


class _ResponseRecord(msgspec.Struct, frozen=True):
    schema: str
    source: str
    method: str
    held_out_ev: float
    assumed_ev: float
    patch_count: int
    exposure_correction_ev: list[float]
    sensor: SensorRecord


def write_response(
    path: Path, response: Response, sensor: Sensor, source: str, *, force: bool = False
) -> None:
    """Write a response, the sensor that has it, and what it was estimated from."""
    record = _ResponseRecord(
        schema=SCHEMA,
        source=source,
        method=response.method,
        held_out_ev=response.held_out_ev,
        assumed_ev=response.assumed_ev,
        patch_count=response.patch_count,
        exposure_correction_ev=response.curve.correction_ev.tolist(),
        sensor=sensor_record(sensor_with(sensor, response)),
    )
    write_json(path, record, force=force)


def apply_response(folder: Path, response: Response, sensor: Sensor) -> None:
    """Give the recording in `folder` the sensor with this response; its frames stay as they are."""
    manifest = read_manifest(folder)
    record = sensor_record(sensor_with(sensor, response))
    write_manifest(folder, msgspec.structs.replace(manifest, sensor=record))
