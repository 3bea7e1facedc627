"""Make the README's pictures from the bundled recordings: python -m recordings.gallery.

Each shows brackets: an exposure, the map with its lights as rings, and what they light. One is a
moving picture.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from calibration.files import read_calibration
from capture.merge import merge_bracket
from capture.pictures import write_png
from capture.recording import open_recording
from lighting.maps.remap import apply_remap, build_remap
from lighting.stream.light_stream import LightPlan, StreamMemory, next_lights
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
MOVING, MOVING_SIDE = "indoor", 0.65
MOVING_RATE_HZ = 4.0
"""Twice the recording's own."""
PALETTE_COLOURS = 256


def strips(recording_folder: Path, positions: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
    """Yield one exposure, the map with its lights and the rendered picture side by side.

    All are shown at the exposure that is right for the first.
    """
    recording = open_recording(recording_folder)
    assert recording.calibration_path is not None
    remap = build_remap(read_calibration(recording.calibration_path), 512)
    exposure_ev: float | None = None
    memory: StreamMemory | None = None
    scene, camera = default_scene()
    with BakedRenderer(scene, camera, 2) as renderer:
        for position in positions:
            bracket = recording.read_bracket(position)
            environment = apply_remap(remap, merge_bracket(bracket, recording.sensor))
            lights, memory = next_lights(
                environment, LightPlan(LIGHTS), memory, timestamp_s=bracket.timestamp_s
            )
            radiance = renderer.render(lights, environment, through_ground=True)
            if exposure_ev is None:
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
            yield np.concatenate([captioned[0], gap, captioned[1], gap, captioned[2]], axis=1)


def _captioned(picture: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    """Return the picture scaled to HEIGHT_PX rows, above a line of text."""
    width_px = round(picture.shape[1] * HEIGHT_PX / picture.shape[0])
    scaled = cv2.resize(picture, (width_px, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    line = np.full((CAPTION_PX, width_px, 3), 255, np.uint8)
    cv2.putText(
        line, caption, (2, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.62, (40, 40, 40), 1, cv2.LINE_AA
    )
    return np.concatenate([scaled, line])


def write_gif(path: Path, pictures: Sequence[NDArray[np.uint8]], rate_hz: float) -> None:
    """Write pictures that repeat for ever, in colours that all of them share."""
    scaled = [
        Image.fromarray(
            cv2.resize(each, None, fx=MOVING_SIDE, fy=MOVING_SIDE, interpolation=cv2.INTER_AREA)
        )
        for each in pictures
    ]
    few = scaled[:: max(len(scaled) // 4, 1)]
    together = Image.fromarray(np.concatenate([np.asarray(each) for each in few]))
    palette = together.quantize(PALETTE_COLOURS, Image.Quantize.MEDIANCUT)
    # Dithered, nothing would stand still, and the file be three times as large.
    first, *rest = (each.quantize(palette=palette, dither=Image.Dither.NONE) for each in scaled)
    first.save(
        path,
        save_all=True,
        append_images=rest,
        duration=round(1e3 / rate_hz),
        loop=0,
        optimize=True,
    )


def main() -> None:
    """Write pictures/NAME.png for every bundled recording, and the moving one's GIF."""
    for name, position in SHOWN_BRACKET.items():
        path = HERE / "pictures" / f"{name}.png"
        write_png(path, next(strips(HERE / name, [position])))
        print(path.relative_to(HERE.parent))
    count = len(open_recording(HERE / MOVING))
    path = HERE / "pictures" / f"{MOVING}.gif"
    write_gif(path, list(strips(HERE / MOVING, range(count))), MOVING_RATE_HZ)
    print(path.relative_to(HERE.parent))


if __name__ == "__main__":
    main()
