"""The `render` command."""

from pathlib import Path
from typing import Annotated

import moderngl
import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from capture.arguments import Output, parse_size
from capture.errors import InputError
from capture.output import check_place
from lighting.light_files import read_lights
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from render.moving.renderer import MovingRenderer
from render.occlusion_cli import check_occlusion_flags, check_occlusion_suffix, write_occlusion
from render.opengl.context import GlUnavailable, draw_in_context
from render.opengl.renderer import Renderer
from render.output.pictures import check_picture_suffix, write_picture
from render.output.view import auto_exposure_ev
from render.reference_cli import (
    drop_checkpoint,
    put_in_front,
    read_light,
    remark_on,
    trace_picture,
    write_reference,
)
from render.scenes.default_scene import default_scene, frame_meshes
from render.scenes.mesh import load_meshes
from render.scenes.scene import Camera, Scene

SAMPLES_PER_AXIS = 2


def render(
    *,
    output: Output,
    lights: Path | None = None,
    mesh: Path | None = None,
    size: str = "640x480",
    background: Path | None = None,
    exposure_ev: str = "auto",
    reference: bool = False,
    estimator: str | None = None,
    environment: Annotated[Path | None, Parameter(name="--map")] = None,
    error: float | None = None,
    seconds: float | None = None,
    bounces: int | None = None,
    ao: bool = False,
    cone_deg: float | None = None,
    max_distance_m: float | None = None,
    force: bool = False,
) -> None:
    """Render a scene under the lights of a file, with a shadow map for each.

    With --reference the picture is ray-traced without OpenGL: exact shadows, of a whole map or of
    lights, until it is as good as --error asks for, or --seconds are over. An .exr then has the
    standard error of each pixel as a layer, standard_error. A picture that is interrupted goes on
    where it was when the same command is given again.

    Parameters
    ----------
    lights
        lights.json, as `fishlight lights` writes it.
    output
        The picture: .png to look at, or .exr with linear radiance in the lights' scale. With --ao
        also .ply: the mesh, with the ambient occlusion of its vertices in place of its colours.
    mesh
        OBJ, glTF, GLB or PLY file to stand on the ground; spheres and a ring without it.
    size
        Width and height of the picture in pixels.
    background
        Lat-long map, .exr or .hdr, to be seen behind the scene.
    exposure_ev
        Stops by which a PNG is made brighter; auto puts the scene's log-mean at middle grey.
    reference
        Trace rays.
    estimator
        Draw directions as this estimator does, "brdf" or "mis-balance" for instance, in place of
        the way that was found to be best; a name that is none has all of them listed.
    environment
        Lat-long map, .exr or .hdr, whose light to trace: all of it, in place of --lights.
    error
        Relative error of the picture to trace until, 0.01 unless --seconds are given.
    seconds
        Time to trace for.
    bounces
        How many surfaces light may meet on its way to the eye, 1 for direct light: paths are
        traced, in place of the way that was found to be best for direct light.
    ao
        Draw ambient occlusion alone: how open the sky is over each point. Needs no light.
    cone_deg
        Full opening of the cone about the normal in which it is open or not; 180 if not given.
    max_distance_m
        Farther objects do not count.
    force
        Replace the output if it exists.
    """
    size_px = parse_size(size)
    fixed_ev = parse_exposure(exposure_ev)
    if ao:
        check_occlusion_suffix(output)
    else:
        check_picture_suffix(output)
    check_place(output, force=force)
    of_light = (lights, environment, background, fixed_ev, estimator, error, seconds, bounces)
    has_others = reference or any(each is not None for each in of_light)
    check_occlusion_flags(ao, cone_deg, max_distance_m, has_others=has_others)
    if ao:
        scene, camera = scene_to_render(mesh, size_px)
        about = write_occlusion(output, scene, camera, cone_deg, max_distance_m, force=force)
        print(f"{output}: {about}")
        return
    behind, cleaned = (None, None) if background is None else read_environment(background)
    if reference:
        light, about = read_light(lights, environment)
        scene, camera = scene_to_render(mesh, size_px)
        traced = trace_picture(output, scene, camera, light, estimator, error, seconds, bounces)
        if behind is not None:
            put_in_front(traced, behind, camera)
        ev = auto_exposure_ev(traced.radiance) if fixed_ev is None else fixed_ev
        write_reference(output, traced, ev, force=force)
        drop_checkpoint(output)
        about += f", passes {traced.passes}, error {traced.relative_error:.2%}"
        about += remark_on(estimator)
    elif lights is None or any(
        each is not None for each in (environment, estimator, error, seconds, bounces)
    ):
        raise InputError(
            "give --lights; --map, --estimator, --error, --seconds and --bounces are for "
            "--reference"
        )
    else:
        light_set = read_lights(lights)
        about = f"lights {len(light_set)}"
        scene, camera = scene_to_render(mesh, size_px)
        picture, how = draw(scene, camera, light_set, behind)
        about += how
        ev = auto_exposure_ev(picture) if fixed_ev is None else fixed_ev
        write_picture(output, picture, ev, force=force)
    triangles = sum(len(part.faces) for part in scene.meshes)
    print(f"{output}: {about}, triangles {triangles}, {ev:+.1f} EV")
    for remark in () if cleaned is None else cleaned.remarks:
        print(f"  {background}: {remark}")


def draw(
    scene: Scene, camera: Camera, lights: LightSet, background: EnvironmentMap | None
) -> tuple[NDArray[np.float32], str]:
    """Return the picture, with shadow maps or, where there is no OpenGL, rays; and which if so."""

    def with_maps(context: moderngl.Context) -> NDArray[np.float32]:
        with Renderer(context, scene, camera, SAMPLES_PER_AXIS) as renderer:
            return renderer.render(lights, background)

    try:
        return draw_in_context(with_maps), ""
    except GlUnavailable:
        with MovingRenderer(scene, camera, SAMPLES_PER_AXIS) as renderer:
            return renderer.render(lights, background), ", no OpenGL: drawn with rays"


def scene_to_render(mesh: Path | None, size_px: tuple[int, int]) -> tuple[Scene, Camera]:
    """Return the mesh's scene and a camera that frames it; the default scene without a mesh."""
    if mesh is None:
        return default_scene(size_px)
    model = load_meshes(mesh)
    for note in model.notes:
        print(note)
    return frame_meshes(model.meshes, size_px)


def parse_exposure(text: str) -> float | None:
    """Exposure in stops, None for "auto"; InputError for anything else."""
    if text == "auto":
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= 100:
        raise InputError(f"an exposure is a number of stops or auto, got {text!r}")
    return value
