"""A full pixel that JPEG's ringing brings back below white.

Claim    : it does not hide the light that the shorter exposures saw there.
Setup    : a sun 2,000 times a grey sky, three exposures 4 EV apart stored as JPEG; OpenCV's
           encoder at three qualities. The sun is unclipped in the shortest only.
Expected : the sun's flux within 2 % of that from PNG, at any quality.
Measured : within 0.3 % at qualities 75 to 95, 0.8 % at 60. Without the rule that an exposure which
           the shorter ones contradict is left out, 87 % of the flux is left at quality 95, 62 % at
           85 and 40 % at 75.
"""

import cv2
import numpy as np
import pytest

from capture.frame import Bracket, Exposure, Frame
from capture.merge import merge_bracket
from tests.capture.simulated_bracket import SRGB_8_BIT, record

EXPOSURES = [Exposure(time_s) for time_s in (1 / 2500, 1 / 156, 1 / 9.8)]


def sky_with_sun():
    radiance = np.ones((96, 96, 3))
    rows, columns = np.mgrid[0:96, 0:96]
    distance = np.hypot(rows - 47.3, columns - 50.6)
    radiance += 2000.0 * np.exp(-0.5 * (distance / 1.5) ** 2)[..., None]
    return radiance


def as_jpeg(frame: Frame, quality: int) -> Frame:
    flags = [cv2.IMWRITE_JPEG_QUALITY, quality]
    _, encoded = cv2.imencode(".jpg", np.ascontiguousarray(frame.counts[..., ::-1]), flags)
    decoded = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    return Frame(np.ascontiguousarray(decoded[..., ::-1]), frame.exposure, index=frame.index)


def sun_flux(bracket: Bracket) -> float:
    image = merge_bracket(bracket, SRGB_8_BIT)
    return float(image.radiance[36:60, 38:63, 1].sum())


@pytest.mark.parametrize("quality", [75, 85, 95])
def test_the_sun_keeps_its_flux(quality):
    bracket = record(sky_with_sun(), EXPOSURES, SRGB_8_BIT, np.random.default_rng(3))
    squeezed = Bracket(tuple(as_jpeg(frame, quality) for frame in bracket.frames))
    assert sun_flux(squeezed) == pytest.approx(sun_flux(bracket), rel=0.02)
