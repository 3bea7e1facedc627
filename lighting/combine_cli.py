"""`fishlight combine`: one environment map of several pictures of a place."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from calibration.files import read_calibration
from capture.arguments import Output, WholeNumber
from capture.errors import InputError
from capture.output import check_place
from capture.radiance_files import read_radiance
from lighting.blocks.fill import Fill, fill_unseen
from lighting.maps.combine import View, align_views, combine_views
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from lighting.remap_cli import check_map_height


def combine(
    radiance: list[Path],
    *,
    calibration: Annotated[list[Path], Parameter(consume_multiple=True)],
    output: Output,
    height: WholeNumber = 512,
    hide_deg: float = 0.0,
    fill: Fill = "black",
    confidence: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Combine pictures of one place, such as two of a mirror ball 90° apart, to one map.

    How the pictures are turned against the first is found from what they show; the calibrations'
    pitch and roll have to be right to about 15°, their yaw need not be. Each direction then comes
    from the picture that saw it most finely.

    Parameters
    ----------
    radiance
        Linear radiance of each picture, EXR or Radiance .hdr, in the same unit.
    calibration
        The calibration of each picture, in the same order; one serves for all.
    output
        The map, EXR or Radiance .hdr.
    height
        Rows of the map; it has twice as many columns.
    hide_deg
        Angle from each picture's middle within which it shows the camera or who holds it, and is
        not used.
    fill
        What unseen directions hold: black, mean (of the seen) or mirror (at the horizon).
    confidence
        A second map, EXR: how well each direction was seen, from 0 in the blind cone of a ball,
        where nothing was, over its stretched rim to 1, where pixels were no wider than cells.
    force
        Replace the output if it exists.
    """
    check_place(output, force=force)
    if confidence is not None:
        check_place(confidence, force=force)
    check_map_height(height)
    if len(calibration) not in (1, len(radiance)):
        raise InputError(
            f"{len(radiance)} pictures and {len(calibration)} calibrations: give one calibration, "
            "or one for each picture in the same order"
        )
    if not 0 <= hide_deg <= 90:
        raise InputError(f"--hide-deg must be 0 to 90, got {hide_deg:g}")
    cameras = [read_calibration(path) for path in calibration]
    cameras *= len(radiance) // len(cameras)
    views = []
    for path, camera in zip(radiance, cameras, strict=True):
        image, cleaned = read_radiance(path)
        camera.check_size(image.size_px, str(path))
        views.append(View(image, camera))
        for remark in cleaned.remarks:
            print(f"  {path}: {remark}")
    hidden_rad = float(np.radians(hide_deg))
    views, turns = align_views(views, hidden_rad)
    for path, turn in zip(radiance[1:], turns, strict=True):
        cosine = (np.trace(turn.R_first_second) - 1) / 2
        print(
            f"  {path}: turned by {np.degrees(np.arccos(np.clip(cosine, -1, 1))):.2f}° to fit "
            f"{radiance[0]}, correlation {turn.correlation:.3f}"
        )
    environment, seen_share = combine_views(views, height, hidden_rad)
    if not environment.valid.any():
        raise InputError("no picture sees anything; check the calibrations and --hide-deg")
    write_environment(output, fill_unseen(environment, fill), force=force)
    if confidence is not None:
        shares = np.repeat(seen_share.astype(np.float32)[..., None], 3, axis=-1)
        nothing = np.zeros_like(environment.valid)
        write_environment(
            confidence, EnvironmentMap(shares, environment.valid, nothing), force=force
        )
    print(
        f"{output}: {2 * height}×{height} of {len(views)} pictures, "
        f"{environment.seen_share:.1%} of all directions seen"
    )
