"""An error of the scale becomes a larger one of a recovered sun, when the sky gives most light.

Claim    : What map and meter disagree about is taken for the sun's light.
Setup    : A constant sky of π klx and a sun of 10 klx, 60° high; the scale is 3 % too large.
Expected : The sun lacks 3 % of the sky's illuminance, 3 % · π/(10 sin 60°) or 1.1 % of its own;
           a weak sun of 1 klx lacks 11 %. Never is light lost: what the meter showed is kept.
Measured : 0.9 % and 10.7 %.
"""

from dataclasses import replace

import numpy as np
import pytest

from capture.radiance import CD_M2
from lighting.maps.environment import EnvironmentMap
from lighting.photometry.clipped_source import recover_clipped
from lighting.photometry.illuminance import surface_illuminance
from lighting.sphere.latlong import cell_directions

UPWARD = (0.0, 1.0, 0.0)
SUN = np.array([0.5, np.sqrt(0.75), 0.0])
HEIGHT = 128


@pytest.mark.parametrize("sun_lx", [10_000.0, 1_000.0])
def test_the_sun_lacks_what_the_sky_has_too_much(sun_lx: float) -> None:
    clipped = cell_directions(HEIGHT) @ SUN > np.cos(np.radians(1.5))
    shape = clipped.shape
    sky = EnvironmentMap(np.full((*shape, 3), 1000.0), np.ones(shape, bool), clipped, CD_M2)
    measured_lx = 1000 * np.pi + sun_lx * SUN[1]
    too_bright = replace(sky, radiance=sky.radiance * np.float32(1.03))
    whole = recover_clipped(too_bright, UPWARD, measured_lx)
    assert surface_illuminance(whole, UPWARD).total == pytest.approx(measured_lx, rel=1e-6)
    gained = surface_illuminance(whole, SUN).total - surface_illuminance(too_bright, SUN).total
    expected = 0.03 * 1000 * np.pi / (sun_lx * SUN[1])
    assert 1 - gained / sun_lx == pytest.approx(expected, abs=0.003)
