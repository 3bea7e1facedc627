"""True changes, followed: what the temporal stage costs where nothing flickers.

Claim    : the stage takes what wavers for noise. A change that starts, or that is small beside what
           else goes on, is late by a frame or some; a change that has the scene to itself is not.
Setup    : suns that cross the seam and the pole, a lamp that dims as another brightens, a cloud
           front, a light switch, a passer-by. Maps of 16 rows, 32 lights, 24 frames; irradiance of
           surfaces behind a wall.
Expected : error, and change of the error per frame, above those without the stage by no more than
           0.1 %, for a passer-by 0.2 % of the light.
Measured : none with the lights of cells or adaptive but cloud (0.01 %) and passer-by (0.06 and
           0.03 % a frame); with the inverse CDF no sequence is worse by more than 0.01 % and most
           are better, a soft sun over the seam most: 4.0 → 1.2 % a frame.
"""

import pytest

from tests.steady_sequences import figures

CHANGES = (
    "hard sun over the seam",
    "soft sun over the seam",
    "hard sun over the pole",
    "soft sun over the pole",
    "one lamp for another",
    "cloud front",
    "light switch",
    "passer-by",
)


@pytest.mark.parametrize("method", ["cells", "inverse-cdf", "adaptive"])
@pytest.mark.parametrize("name", CHANGES)
def test_what_changes_is_followed(name, method):
    plain, steady = figures(name, method)
    late = 0.002 if name == "passer-by" else 0.001
    assert steady.error < plain.error + late
    assert steady.error_change < plain.error_change + late
    assert steady.excess_change < plain.excess_change + late


def test_a_sun_that_shakes_fixed_points_is_calmed():
    plain, steady = figures("soft sun over the seam", "inverse-cdf")
    assert steady.error_change < 0.4 * plain.error_change
    assert steady.largest_turn_deg < 30 < plain.largest_turn_deg


def test_a_passer_by_is_late():
    # The weakness itself, so that its cure is noticed.
    plain, steady = figures("passer-by", "cells")
    assert steady.error_change > plain.error_change + 0.0002
