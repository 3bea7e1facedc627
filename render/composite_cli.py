"""`fishlight composite`: objects set into a photograph, under lights that were captured there."""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from calibration.pose.up import zenith_of_edges, zenith_of_horizon
from capture.arguments import Output, tell
from capture.errors import InputError
from capture.output import check_place
from lighting.light_files import read_lights
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.lights.all_lights import all_lights, level_irradiance
from render.output.view import MIDDLE_GREY
from render.plates.composite import composite
from render.plates.matching import Match, gain_of_ground, ground_seen, match_albedo, match_gain
from render.plates.placing import placed
from render.plates.plate import Plate, check_composite_suffix, read_plate, write_composite
from render.plates.plate_camera import (
    directions_of,
    focal_of_view,
    ground_point,
    plate_camera,
    zenith_of_pitch,
)
from render.scenes.casters import gather_casters
from render.scenes.default_scene import GROUND_EXTENT, default_scene
from render.scenes.mesh import load_meshes
from render.scenes.scene import Ground, Mesh, Scene

Array = NDArray[np.float64]
Signed = Annotated[float, Parameter(allow_leading_hyphen=True)]

_LEVEL_ZENITH = np.array([0.0, -1.0, 0.0])
_MARK_SIGMA_PX = 1.0


def composite_command(
    plate: Path,
    /,
    *,
    lights: Path,
    output: Output,
    at: str,
    camera_height_m: float,
    mesh: Path | None = None,
    height_m: float | None = None,
    turn_deg: Signed = 0.0,
    environment: Annotated[Path | None, Parameter(name="--map")] = None,
    fov_deg: float | None = None,
    pitch_deg: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    vertical: Annotated[list[str] | None, Parameter(negative=())] = None,
    horizon: str = "",
    yaw_deg: Signed = 0.0,
    gain_ev: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    albedo: float | None = None,
    force: bool = False,
) -> None:
    """Set objects into a photograph, lit by lights that were captured where it was taken.

    Their shadows fall on the photograph's ground, which sends light up to them; every pixel that
    they do not change stays as it was. The lights' scale becomes the photograph's by the ground
    that both show: in --map, if that is given and saw it, white balance included; else by its
    --albedo. Without either, that of middle grey is supposed.

    Parameters
    ----------
    plate
        JPEG, PNG or TIFF of 8 bits, or a linear .exr or .hdr.
    lights
        lights.json, as `fishlight lights` writes it.
    output
        The picture: .png, or .exr with linear values in the plate's scale.
    at
        The pixel where the objects stand on the ground, as "x,y" from the upper left.
    camera_height_m
        Of the photograph's camera, above the ground that the objects stand on.
    mesh
        OBJ, glTF, GLB or PLY to set down; spheres and a ring without it.
    height_m
        How high the objects become, all together; as they are if not given.
    turn_deg
        Turns them counter-clockwise, seen from above; at 0 their front looks at the camera.
    environment
        Lat-long map that the lights were made from, to be seen in mirrors, and to match by.
    fov_deg
        Angle that the photograph shows from side to side, if its EXIF does not tell.
    pitch_deg
        Angle by which the camera looked up; negative for down.
    vertical
        In place of --pitch-deg: pixels along a vertical edge from its foot to its head, "x,y x,y".
        Give it for each edge, two at least and well apart.
    horizon
        In place of --pitch-deg: pixels on the true horizon, two at least, "x,y x,y".
    yaw_deg
        Where the camera looked in the lights' world: 0 is the middle of the map, 90 its left
        quarter.
    gain_ev
        Stops from the lights' radiance to the plate's linear values, where they are known.
    albedo
        Share of light that the ground sends back, if that is known and not the gain.
    force
        Replace the output if it exists.
    """
    check_composite_suffix(output, plate)
    check_place(output, force=force)
    if gain_ev is not None and albedo is not None:
        raise InputError("--gain-ev and --albedo each say how bright the lights are: give one")
    picture = read_plate(plate)
    focal_px = _focal_px(plate, picture, fov_deg)
    zenith = _zenith(picture.size_px, focal_px, pitch_deg, vertical or [], horizon)
    yaw_rad = math.radians(yaw_deg)
    camera = plate_camera(picture.size_px, focal_px, zenith, yaw_rad, camera_height_m)
    places = _pixels(at, "--at")
    if len(places) > 1:
        raise InputError(f"--at: wanted one pixel, where the objects stand together, got {at!r}")
    point = ground_point(camera, places[0])
    meshes = default_scene()[0].meshes if mesh is None else _loaded(mesh)
    facing_rad = math.atan2(-point[0], -point[2]) + math.radians(turn_deg)
    if mesh is None:
        facing_rad += math.pi  # its front is its back: the camera looks along +Z
    meshes = placed(meshes, point, facing_rad, height_m)
    light_set = read_lights(lights)
    seen_map = None if environment is None else _read_map(environment)
    radius_m = float(gather_casters(meshes).radius_m)
    extent_m = GROUND_EXTENT * (radius_m + float(np.linalg.norm(point)))
    standing = Scene(meshes, Ground(0.0, radius_m=extent_m))
    received = level_irradiance(*all_lights(light_set, standing))
    seen = ground_seen(picture, camera, point, radius_m)
    match, how = _match(seen, received, seen_map, gain_ev, albedo)
    ground = Ground(
        0.0, (match.reflectance[0], match.reflectance[1], match.reflectance[2]), extent_m
    )
    result = composite(picture, camera, Scene(meshes, ground), light_set, match.gain, seen_map)
    write_composite(output, picture, result.picture, force=force)
    ev = math.log2(float(match.gain @ LUMINANCE_WEIGHTS))
    print(
        f"{output}: lights {len(light_set)}, {np.linalg.norm(camera.eye - point):.2f} m away, "
        f"changed {result.changed.mean():.1%} of the plate\n"
        f"  gain {ev:+.2f} EV (red, green, blue ×{_three(match.gain / 2**ev)}), "
        f"albedo of the ground {_three(match.reflectance)}: {how}"
    )


def _loaded(path: Path) -> tuple[Mesh, ...]:
    model = load_meshes(path)
    tell(model.notes)
    return model.meshes


def _read_map(path: Path) -> EnvironmentMap:
    environment, cleaned = read_environment(path)
    tell([f"{path}: {remark}" for remark in cleaned.remarks])
    return environment


def _match(
    seen: Array,
    received: Array,
    environment: EnvironmentMap | None,
    gain_ev: float | None,
    albedo: float | None,
) -> tuple[Match, str]:
    if gain_ev is not None:
        return match_gain(seen, received, np.full(3, 2.0**gain_ev)), "by --gain-ev"
    if albedo is not None:
        return match_albedo(seen, received, albedo), "by --albedo"
    gain = None if environment is None else gain_of_ground(seen, environment)
    if gain is not None:
        return match_gain(seen, received, gain), "by the ground in the map"
    return match_albedo(seen, received, MIDDLE_GREY), "unknown, middle grey supposed"


def _focal_px(path: Path, plate: Plate, fov_deg: float | None) -> float:
    if fov_deg is not None:
        return focal_of_view(plate.size_px[0], math.radians(fov_deg))
    if plate.focal_px is None:
        raise InputError(
            f"{path}: tells no FocalLengthIn35mmFilm; give its field of view, --fov-deg"
        )
    return plate.focal_px


def _zenith(
    size_px: tuple[int, int],
    focal_px: float,
    pitch_deg: float | None,
    vertical: list[str],
    horizon: str,
) -> Array:
    """Return the zenith in the camera's frame, of the one way by which it is given."""
    if (pitch_deg is not None) + bool(vertical) + bool(horizon) != 1:
        raise InputError(
            "one of --pitch-deg, --vertical and --horizon says how the plate's camera was tilted"
        )
    if pitch_deg is not None:
        return zenith_of_pitch(math.radians(pitch_deg))

    def marked(text: str, flag: str) -> Array:
        return directions_of(_pixels(text, flag), size_px, focal_px)

    sigma_rad = _MARK_SIGMA_PX / focal_px
    if vertical:
        edges = [marked(text, "--vertical") for text in vertical]
        return zenith_of_edges(edges, sigma_rad).direction
    return zenith_of_horizon(marked(horizon, "--horizon"), _LEVEL_ZENITH, sigma_rad).direction


def _pixels(text: str, flag: str) -> Array:
    try:
        pixels = np.array([[float(n) for n in pair.split(",")] for pair in text.split()])
    except ValueError:
        pixels = np.zeros((0, 0))
    if pixels.ndim != 2 or pixels.shape[1:] != (2,) or not np.isfinite(pixels).all():
        raise InputError(f"{flag}: wanted pixels as x,y, got {text!r}")
    return pixels


def _three(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)
