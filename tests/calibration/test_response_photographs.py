"""The response of a real camera: its exposures agree with it, and do not with the assumed sRGB."""

from pathlib import Path

import numpy as np
import pytest

from calibration.response import estimate_response, sensor_with
from capture.exposure_check import exposure_disagreement_ev
from capture.importing import read_photo_bracket

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
FOLDER = DATA / "brackets-frobisher/frobisher_001"


@pytest.mark.data
@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"{FOLDER} is not here")
def test_neighbouring_exposures_agree_with_the_estimated_response():
    bracket, assumed, _ = read_photo_bracket([FOLDER])
    response = estimate_response([bracket])
    before = np.abs(exposure_disagreement_ev(bracket, assumed))
    after = np.abs(exposure_disagreement_ev(bracket, sensor_with(assumed, response)))
    assert before.max() > 0.8
    assert after.max() < 0.03
    assert response.held_out_ev < 0.03
