"""Lights find their partners: the closest, within 10° and a factor of four, in any order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.stream.matching import stable_matching

RANDOM_SETS = st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 12), st.integers(0, 12))


def random_lights(random, count, spread=0.3):
    """Return directions within a cone of about `spread`, powers and marks."""
    towards = np.array([0.0, 1.0, 0.0]) + spread * random.standard_normal((count, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    return towards, np.exp(random.standard_normal(count)), random.random(count) < 0.2


def distances(one, other):
    """Return (turn/10°)² + (ln ratio/ln 4)², infinite where two cannot be partners."""
    (directions, power, is_key), (to_directions, to_power, to_is_key) = one, other
    turn = np.arccos(np.clip(directions @ to_directions.T, -1, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(power[:, None] / to_power) / np.log(4)
    chord = np.sin(turn / 2) / np.sin(np.radians(5))
    possible = (turn <= np.radians(10)) & (abs(ratio) <= 1) & (is_key[:, None] == to_is_key)
    possible &= (power[:, None] > 0) & (to_power > 0)
    return np.where(possible, chord**2 + ratio**2, np.inf)


def by_greed(one, other):
    """Return the same matching by always joining the closest two that are left."""
    distance = distances(one, other)
    partner = np.full(len(one[1]), -1)
    while np.isfinite(distance).any():
        i, j = np.unravel_index(distance.argmin(), distance.shape)
        partner[i] = j
        distance[i], distance[:, j] = np.inf, np.inf
    return partner


@settings(deadline=None, max_examples=100)
@given(drawn=RANDOM_SETS)
def test_the_closest_two_are_partners_then_the_closest_of_the_rest(drawn):
    seed, count, to_count = drawn
    random = np.random.default_rng(seed)
    one, other = random_lights(random, count), random_lights(random, to_count)
    np.testing.assert_array_equal(stable_matching(*one, *other), by_greed(one, other))


@settings(deadline=None, max_examples=50)
@given(drawn=RANDOM_SETS)
def test_the_order_of_the_lights_does_not_matter(drawn):
    seed, count, to_count = drawn
    random = np.random.default_rng(seed)
    one, other = random_lights(random, count), random_lights(random, to_count)
    order, to_order = random.permutation(count), random.permutation(to_count)
    plain = stable_matching(*one, *other)
    mixed = stable_matching(*(each[order] for each in one), *(each[to_order] for each in other))
    unmixed = np.where(mixed >= 0, np.append(to_order, -1)[mixed], -1)
    np.testing.assert_array_equal(unmixed, plain[order])


def pair(angle_deg=0.0, ratio=1.0, keys=(False, False)):
    angle = np.radians(angle_deg)
    one = np.array([[0.0, 1.0, 0.0]]), np.array([2.0]), np.array([keys[0]])
    other = (
        np.array([[np.sin(angle), np.cos(angle), 0.0]]),
        np.array([2.0 * ratio]),
        np.array([keys[1]]),
    )
    return stable_matching(*one, *other)[0]


@pytest.mark.parametrize(
    "change",
    [{}, {"angle_deg": 9.99}, {"ratio": 3.99}, {"ratio": 0.251}, {"keys": (True, True)}],
    ids=str,
)
def test_near_and_alike_are_partners(change):
    assert pair(**change) == 0


@pytest.mark.parametrize(
    "change",
    [
        {"angle_deg": 10.01},
        {"angle_deg": 180},
        {"ratio": 4.01},
        {"ratio": 0.249},
        {"ratio": 0},
        {"keys": (True, False)},
        {"keys": (False, True)},
    ],
    ids=str,
)
def test_far_or_unlike_are_not(change):
    assert pair(**change) == -1
