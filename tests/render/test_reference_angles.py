"""Fast sines and arc tangents against the library's."""

import math

from hypothesis import example, given, settings
from hypothesis import strategies as st

from render.reference.angles import angle_of, sine_cosine

COORDINATE = st.floats(-1, 1, allow_subnormal=False)


@given(st.floats(-2, 2))
@example(0.125)
@example(0.375)
@settings(max_examples=100, deadline=None)
def test_sines_are_the_library_s(turns):
    sine, cosine = sine_cosine(turns)
    assert abs(sine - math.sin(2 * math.pi * turns)) < 1e-7
    assert abs(cosine - math.cos(2 * math.pi * turns)) < 1e-7


@given(COORDINATE, COORDINATE)
@example(0.0, 0.0)
@example(0.0, -1.0)
@example(-1.0, 0.0)
@settings(max_examples=100, deadline=None)
def test_angles_are_the_library_s(y, x):
    difference = angle_of(y, x) - math.atan2(y + 0.0, x + 0.0)
    assert abs(math.remainder(difference, 2 * math.pi)) < 2e-7
