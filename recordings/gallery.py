"""Make the README's pictures from the bundled recordings: python -m recordings.gallery.

Each shows one bracket: an exposure, the map with its lights as rings, and what they light.
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.files import read_calibration
from capture.merge import merge_bracket
from capture.pictures import write_png
from capture.recording import open_recording
from lighting.maps.remap import apply_remap, build_remap
from lighting.reduce import reduce_to_lights
from render.baked.renderer import BakedRenderer
from render.output.preview import preview
from render.output.view import auto_exposure_ev, to_display
from render.scenes.default_scene import default_scene

HERE = Path(__file__).parent
HEIGHT_PX = 360
CAPTION_PX = 34
GAP_PX = 8
LIGHTS = 64
SHOWN_BRACKET = {"outdoor": 2, "indoor": 8}


def strip(recording_folder: Path, position: int) -> NDArray[np.uint8]:
    """Return one exposure, the map with its lights and the rendered picture side by side."""
    recording = open_recording(recording_folder)
    assert recording.calibration_path is not None
    calibration = read_calibration(recording.calibration_path)
    bracket = recording.read_bracket(position)
    image = merge_bracket(bracket, recording.sensor)
    environment = apply_remap(build_remap(calibration, 512), image)
    lights = reduce_to_lights(environment, LIGHTS)
    scene, camera = default_scene()
    with BakedRenderer(scene, camera, 2) as renderer:
        radiance = renderer.render(lights, environment, through_ground=True)
    exposure_ev = auto_exposure_ev(radiance)
    longest = max(bracket.frames, key=lambda frame: frame.exposure.signal)
    parts = (
        (longest.counts, f"1 of {len(bracket.frames)} exposures"),
        (
            preview(environment, lights, exposure_ev, width_px=2 * HEIGHT_PX),
            f"merged and remapped, with {LIGHTS} lights",
        ),
        (to_display(radiance, exposure_ev), "what they light"),
    )
    captioned = [_captioned(picture, caption) for picture, caption in parts]
    gap = np.full((HEIGHT_PX + CAPTION_PX, GAP_PX, 3), 255, np.uint8)
    return np.concatenate([captioned[0], gap, captioned[1], gap, captioned[2]], axis=1)


def _captioned(picture: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    """Return the picture scaled to HEIGHT_PX rows, above a line of text."""
    width_px = round(picture.shape[1] * HEIGHT_PX / picture.shape[0])
    scaled = cv2.resize(picture, (width_px, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    line = np.full((CAPTION_PX, width_px, 3), 255, np.uint8)
    cv2.putText(
        line, caption, (2, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.62, (40, 40, 40), 1, cv2.LINE_AA
    )
    return np.concatenate([scaled, line])


def main() -> None:
    """Write pictures/NAME.png for every bundled recording."""
    for name, position in SHOWN_BRACKET.items():
        path = HERE / "pictures" / f"{name}.png"
        write_png(path, strip(HERE / name, position))
        print(path.relative_to(HERE.parent))


if __name__ == "__main__":
    main()
