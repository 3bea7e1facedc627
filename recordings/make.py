"""Remakes the bundled recordings, byte for byte: `python -m recordings.make`.

Input  : two HDR maps of the npm package @pmndrs/assets, fetched by `npm pack` or given by --maps.
Output : recordings/outdoor and recordings/indoor, with their truth.
Fails  : to give the same bytes with other versions of OpenCV or OpenEXR than those of
         requirements.lock: JPEG and EXR encoders differ, the scenes do not.
"""

import argparse
import base64
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibration.camera import LEVEL, UP, Calibration
from calibration.files import write_calibration
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from capture.errors import InputError
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from lighting.simulation.scenario import scenario
from lighting.simulation.simulate import simulate_recording

PACKAGE = "@pmndrs/assets@1.7.0"
BRACKETS = 24
RATE_HZ = 2.0
SIDE_PX = 448
CENTRE_PX = ((SIDE_PX - 1) / 2, (SIDE_PX - 1) / 2)
CIRCLE_PX = SIDE_PX / 2 - 4

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Bundled:
    """One of the recordings: its map, camera, and what moves."""

    map_name: str
    camera: Calibration
    yaw_rad_per_s: float = 0.0
    lamp: bool = False
    cloud: bool = False


def sky_camera() -> Calibration:
    """Return a 186° equisolid fisheye with some vignetting that looks at the zenith."""
    rim_rad = np.radians(93.0)
    focal_px = CIRCLE_PX / (2 * np.sin(rim_rad / 2))
    size = (SIDE_PX, SIDE_PX)
    return Calibration(Equisolid(CENTRE_PX, focal_px), size, rim_rad, UP, vignetting=(-0.08,))


def room_camera() -> Calibration:
    """Return a 220° Kannala-Brandt fisheye, held level."""
    rim_rad = np.radians(110.0)
    terms = (-0.02, 0.003, -0.0005, 0.00002)
    at_rim = KannalaBrandt((0.0, 0.0), 1.0, *terms).project(
        np.array([np.sin(rim_rad), 0.0, np.cos(rim_rad)])
    )[0][0]
    model = KannalaBrandt(CENTRE_PX, CIRCLE_PX / at_rim, *terms)
    return Calibration(model, (SIDE_PX, SIDE_PX), rim_rad, LEVEL)


RECORDINGS = {
    "outdoor": Bundled("sky", sky_camera(), yaw_rad_per_s=np.radians(2.0), cloud=True),
    "indoor": Bundled("lobby", room_camera(), lamp=True),
}


def make(name: str, maps: Path, folder: Path) -> None:
    """Write one recording into a folder; `maps` holds the package's maps as .exr."""
    bundled = RECORDINGS[name]
    environment, _ = read_environment(maps / f"{bundled.map_name}.exr")
    moments = scenario(
        [without_ringing(environment)],
        bracket_count=BRACKETS,
        rate_hz=RATE_HZ,
        yaw_rad_per_s=bundled.yaw_rad_per_s,
        lamp=bundled.lamp,
        cloud=bundled.cloud,
    )
    with tempfile.TemporaryDirectory() as temporary:
        calibration_path = Path(temporary) / "calibration.json"
        write_calibration(calibration_path, bundled.camera)
        simulate_recording(
            folder,
            moments,
            calibration_path,
            source=(
                f"simulated from hdri/{bundled.map_name}.exr of {PACKAGE} (Poly Haven); "
                "remade by: python -m recordings.make"
            ),
            licence="CC0-1.0",
            force=True,
        )


def without_ringing(environment: EnvironmentMap) -> EnvironmentMap:
    """Return a map without the dark rims that resampling left around its lamps.

    A cell darker than half the median of the 7 × 7 cells around it, one of which exceeds that
    median tenfold, takes the median. The sum of the light rises by half a percent at most.
    """
    radiance = environment.radiance
    padded = np.pad(radiance, ((3, 3), (0, 0), (0, 0)), mode="edge")
    padded = np.pad(padded, ((0, 0), (3, 3), (0, 0)), mode="wrap")
    around = np.lib.stride_tricks.sliding_window_view(padded, (7, 7), axis=(0, 1))
    median = np.median(around, axis=(-2, -1))
    rim = (radiance < 0.5 * median) & (around.max(axis=(-2, -1)) > 10 * median)
    return replace(environment, radiance=np.where(rim.any(-1, keepdims=True), median, radiance))


def fetch_maps(folder: Path) -> None:
    """Fetch the package with npm and write the maps that are needed as .exr into `folder`."""
    command = ["npm", "pack", "--silent", "--pack-destination", str(folder), PACKAGE]
    try:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(
            f"npm cannot fetch {PACKAGE} ({error}); give its maps as .exr with --maps"
        ) from None
    (archive,) = folder.glob("*.tgz")
    with tarfile.open(archive) as package:
        for bundled in RECORDINGS.values():
            member = package.extractfile(f"package/hdri/{bundled.map_name}.exr.js")
            assert member is not None
            # export default 'data:application/exr;base64,…'
            encoded = member.read().split(b"base64,")[1].split(b"'")[0]
            (folder / f"{bundled.map_name}.exr").write_bytes(base64.b64decode(encoded))


def main() -> None:
    """Parse the command line and make every recording."""
    parser = argparse.ArgumentParser(prog="python -m recordings.make", description=__doc__)
    names = " and ".join(f"{bundled.map_name}.exr" for bundled in RECORDINGS.values())
    parser.add_argument("--maps", type=Path, help=f"folder that holds {names} of {PACKAGE}")
    parser.add_argument("--output", type=Path, default=HERE, help="where to write; here by default")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        maps = arguments.maps
        if maps is None:
            maps = Path(temporary)
            fetch_maps(maps)
        for name in RECORDINGS:
            make(name, maps, arguments.output / name)
            size = sum(each.stat().st_size for each in (arguments.output / name).rglob("*"))
            print(f"{arguments.output / name}: {BRACKETS} brackets, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
