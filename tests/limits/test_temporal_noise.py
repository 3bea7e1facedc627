"""Noise and mains ripple, smoothed but not gone.

Claim    : the temporal stage cannot tell a frame's noise from the beginning of a change, and shows
           an eighth of each deviation at 30 frames a second.
Setup    : a still scene with 1 % noise; a small lamp (15 % of the light, 0.4° a frame) in 3 %
           noise; a lamp that swings by 20 %, 10 times a second. Maps of 16 rows, 32 lights, 24
           frames; irradiance of surfaces behind a wall.
Expected : change of the error per frame and motion of the lights within one and a half times what
           was measured, and at most the stated part of what it is without the stage.
Measured : change of the error per frame in %, without and with the stage, and motion in degrees:
           cells, still 0.79 → 0.08, 0.33° → 0.012°; lamp 0.89 → 0.38, 0.93° → 0.30°; mains
           21.5 → 1.5, 0.36° → 0.014°; inverse CDF, still 0.80 → 0.08, 0.074° → 0.007°; lamp
           1.5 → 0.42, 0.71° → 0.24°; mains 22.9 → 1.8, 4.8° → 0.09°; adaptive, still 0.79 → 0.09,
           0°; lamp 0.86 → 0.35, 0.41° → 0.21°; mains 21.5 → 1.5, 0.001° → 0°. On a map of 128
           rows with 64 lights of adaptive the lamp's is 0.28 → 0.23 %.
"""

import pytest

from tests.steady_sequences import figures


@pytest.mark.parametrize(
    ("method", "name", "error_change", "motion_deg", "part"),
    [
        ("cells", "still, 1 % noise", 0.0013, 0.018, 0.15),
        ("cells", "small lamp, 3 % noise", 0.0056, 0.45, 0.5),
        ("cells", "mains alias", 0.022, 0.021, 0.1),
        ("inverse-cdf", "still, 1 % noise", 0.0012, 0.011, 0.15),
        ("inverse-cdf", "small lamp, 3 % noise", 0.0063, 0.36, 0.4),
        ("inverse-cdf", "mains alias", 0.026, 0.13, 0.1),
        ("adaptive", "still, 1 % noise", 0.0013, 0.001, 0.15),
        ("adaptive", "small lamp, 3 % noise", 0.0048, 0.32, 0.6),
        ("adaptive", "mains alias", 0.022, 0.002, 0.1),
    ],
)
def test_noise_is_smoothed_to_within_bounds(method, name, error_change, motion_deg, part):
    plain, steady = figures(name, method)
    assert steady.error_change < min(error_change, part * plain.error_change)
    assert steady.motion_deg < motion_deg
    assert steady.motion_deg <= max(part * plain.motion_deg, 0.001)
    assert steady.error <= 1.01 * plain.error
    # The weakness itself: it is not gone.
    assert steady.error_change > error_change / 10
